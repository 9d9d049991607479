"""The contact surfaces of a solved scene as a guaranteed bound (contactopt.accuracy.bound) sees
them: flat, facet facing facet, or piece of a facet facing piece of a facet.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine, RefTri

from contactopt.errors import InputError
from contactopt.scenes.scene import Part
from contactopt.solving.solve_scene import Solved

LAWS = "frictionless", "tresca", "coulomb"
NEAR = 1e-6  # vertices and contacts coincide within this fraction of the surface
FLAT = 1e-9  # by how much the normals of a flat contact surface differ
SPLIT = {2: 16, 3: 4}  # parts of an edge of a contact facet for integrals over it


class Points(NamedTuple):
    """Points on S pieces of the facets of a pair, s on each: the facet of each piece on either side
    (2, S), shares of its vertices (2, dim, S, s), and weights (S, s) [length^(dim - 1)].
    """

    facets: np.ndarray
    at: np.ndarray
    weights: np.ndarray


class _Side(NamedTuple):
    """An elastic surface of a pair: the number of its body, 1 for the upper and -1 for the lower
    one, its facets, of these the vertices (dim, f), the nodes of a quadratic displacement (q, f)
    and the contacts at the vertices (dim, f), -1 where there is none.
    """

    body: int
    sign: float
    facets: np.ndarray
    vertices: np.ndarray
    nodes: np.ndarray
    contacts: np.ndarray


class FacingFacets:
    """The facets of a pair of surfaces.

    sides     that which carries the contacts, and the other one if it is elastic;   rigid  number
              and sign of a rigid body
    contacts  (dim, f) at the vertices of the first side's facets;   joined  whether facets differ
    rule      points and weights of integrals;   nodes  those of quadratic displacements, where a
              node that faces nothing has no weight
    """

    def __init__(self, solved: Solved, number: int, cells: Sequence[Any]):
        scene, coupling = solved.reduction.scene, solved.reduction.couplings[number]
        pair, self.gap, self.frame = scene.pairs[number], coupling.gap, coupling.frames[0]
        self.revolved = scene.kind == "axisymmetric"
        name, self.joined = f"contact '{pair.name}'", coupling.kind == "mortar"
        if pair.law not in LAWS:
            raise InputError(f"{name} has the law '{pair.law}'; a bound knows {', '.join(LAWS)}.")
        if self.joined and scene.dim == 3:
            raise InputError(
                f"{name} joins surfaces by mortar; in space a bound needs matching ones."
            )
        if np.ptp(coupling.frames, axis=0).max() > FLAT:
            raise InputError(f"{name} has a curved surface; a bound needs a flat one.")
        names = [part.name for part in scene.parts]
        self.sides: list[_Side] = []
        self.rigid: list[tuple[int, float]] = []
        self.shape: Any = None
        for body, surface, sign in zip(pair.bodies, pair.surfaces, (1.0, -1.0)):
            place = names.index(body)
            part, own = scene.parts[place], cells[place]
            if own is None or not isinstance(part, Part):
                self.rigid.append((place, sign))
                given = getattr(part, "gap", None)
                self.shape = given if callable(given) else None
                continue
            facets = np.asarray(own.mesh.boundaries[surface or part.contact])
            self.sides.append(
                _side(own.mesh, (place, sign), facets, coupling.positions, self.frame)
            )
        if len(self.sides) == 2 and coupling.carrier == "lower":
            self.sides = self.sides[::-1]
        meshes = [cells[side.body].mesh for side in self.sides]
        if len(self.sides) == 2 and not self.joined:
            self.sides[1] = _aligned(self.sides[0], self.sides[1], meshes[1])
        if not self.joined and any(np.any(side.contacts < 0) for side in self.sides):
            raise InputError(f"{name}: a bound needs a contact at every vertex of its surfaces.")
        first = solved.reduction.problem.pairs[number].start
        own = self.sides[0].contacts
        self.contacts = np.where(own < 0, -1, own + first)
        self.points = [mesh.p[:, side.vertices] for mesh, side in zip(meshes, self.sides)]
        (at, weights), nodes = facet_rule(scene.dim), facet_nodes(scene.dim)
        if self.joined:
            self.rule, self.nodes, self.ends = joined_points(self.points, self.frame[1])
        else:
            every = np.arange(own.shape[1])
            self.rule, self.nodes = (
                Points(
                    np.stack([every, every]),
                    np.broadcast_to(x[None, :, None], (2, len(x), len(every), x.shape[1])),
                    measures(self.points[0])[:, None] * w,
                )
                for x, w in ((at, weights), (nodes, np.ones(nodes.shape[1])))
            )

    @property
    def alone(self) -> np.ndarray:
        """(k,) contacts at facets of which a part faces nothing."""
        there = np.bincount(
            self.rule.facets[0], self.rule.weights.sum(axis=1), self.contacts.shape[1]
        )
        short = there < (1 - NEAR) * measures(self.points[0])
        return np.setdiff1d(self.contacts[:, short], [-1])

    def of_contacts(self, values: np.ndarray) -> np.ndarray:
        """Values (k, ...) at the vertices (dim, f, ...) of the facets, zero without a contact."""
        return np.concatenate([values, np.zeros((1, *values.shape[1:]))])[self.contacts]

    def at_points(self, values: np.ndarray, points: Points) -> np.ndarray:
        """Values (k,) between the contacts (S, s)."""
        own = self.of_contacts(values)[:, points.facets[0]]
        return np.einsum("vS,vSs->Ss", own, points.at[0])

    def places(self, number: int, points: Points) -> np.ndarray:
        """Points (dim, S, s) on one of the sides."""
        own = self.points[number][:, :, points.facets[number]]
        return np.einsum("dvS,vSs->dSs", own, points.at[number])

    def jump(self, nodal: Sequence[np.ndarray], points: Points, change: bool = False) -> np.ndarray:
        """Gap and slip (dim, S, s) at points, or what the displacements change of them."""
        total = np.zeros(1)
        for side, facets, at in zip(self.sides, points.facets, points.at):
            own = nodal[side.body][:, side.nodes[:, facets]]
            total = total + side.sign * np.einsum("cqS,qSs->cSs", own, quadratic_shapes(at))
        for body, sign in self.rigid:
            total = total + sign * nodal[body][:, None, None]
        out = np.einsum("lc,cSs->lSs", self.frame, total)
        if change:
            return out
        places = [side.sign * self.places(number, points) for number, side in enumerate(self.sides)]
        if self.shape is not None:
            own = self.sides[0].sign * places[0]
            out[0] += np.reshape(self.shape(own.reshape(len(out), -1)), out[0].shape)
        elif len(places) == 2:
            out[0] += np.einsum("d,dSs->Ss", self.frame[0], places[0] + places[1])
        else:
            own = self.gap[self.sides[0].contacts[:, points.facets[0]]]
            out[0] += np.einsum("vS,vSs->Ss", own, points.at[0])
        return out

    def lift(self, nodal: Sequence[np.ndarray], height: np.ndarray, component: int = 0) -> None:
        """Add to the gap, or to a component of the slip, (f, q) at the nodes of facets, at shared
        nodes the largest.
        """
        side = self.sides[0]
        added = np.full(nodal[side.body].shape[1], -np.inf)
        np.maximum.at(added, side.nodes, height.T)
        added[np.isinf(added)] = 0.0
        nodal[side.body][:] += side.sign * self.frame[component][:, None] * added

    def moments(self, number: int, tractions: np.ndarray) -> np.ndarray:
        """(v, f, dim) of tractions (k, dim) on one of the sides with the hat functions. Next to an
        axis of revolution they are those of the linear traction that is zero there.
        """
        side, points = self.sides[number], self.rule
        t = self.of_contacts(tractions)[:, points.facets[0]] @ self.frame  # (v, S, dim)
        own = np.einsum(
            "Ss,vSs,wSs,vSd->wSd", points.weights, points.at[0], points.at[number], t, optimize=True
        )
        out = np.zeros((len(t), len(side.facets), len(self.frame)))
        np.add.at(out.swapaxes(0, 1), points.facets[number], side.sign * own.swapaxes(0, 1))
        if self.revolved:
            r = self.points[number][0]
            for end in range(2):
                on = r[end] <= FLAT * r.max()
                total = out[:, on].sum(axis=0)
                out[end, on], out[1 - end, on] = total / 3, 2 * total / 3
        return out


def joined_points(points: Sequence[np.ndarray], t: np.ndarray) -> tuple[Points, Points, Points]:
    """Points for integrals over the pieces, between the vertices of both, of facets of two plane
    surfaces (dim, v, f) that face each other along t; the nodes of the first one's facets; and the
    ends of the pieces.
    """
    along = [np.einsum("d,dvf->vf", t, own) for own in points]
    size = np.ptp(along[0])
    ends = np.unique(np.concatenate([own.ravel() for own in along]))
    ends = ends[np.concatenate([[True], np.diff(ends) > NEAR * size])]
    middles = (ends[1:] + ends[:-1]) / 2
    facets = np.stack([_found(own, middles) for own in along])
    there = np.all(facets >= 0, axis=0)
    facets, steps = facets[:, there], np.diff(ends)[there, None]
    lead = facets[0]
    stretch = measures(points[0])[lead] / np.abs(along[0][1] - along[0][0])[lead]

    def pieces(at: np.ndarray, weights: np.ndarray) -> Points:
        x = ends[:-1][there, None] + steps * at[1]
        own = [_shares(ends_of[:, of], x) for ends_of, of in zip(along, facets)]
        return Points(facets, np.stack(own), stretch[:, None] * steps * weights)

    x = np.einsum("vf,vq->fq", along[0], facet_nodes(2))
    every = np.repeat(np.arange(len(x)), x.shape[1])
    other = _found(along[1], x.ravel())
    own = [_shares(own[:, of], x.reshape(-1, 1)) for own, of in zip(along, (every, other))]
    faced = (other >= 0)[:, None].astype(float)
    nodes = Points(np.stack([every, other]), np.stack(own), faced)
    return pieces(*facet_rule(2)), nodes, pieces(np.eye(2), np.ones(2))


def _found(along: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The facet between whose ends (2, f) each place lies, or -1."""
    low, high = along.min(axis=0), along.max(axis=0)
    order = np.argsort(low)
    place = order[np.clip(np.searchsorted(low[order], x, "right") - 1, 0, None)]
    near = NEAR * np.ptp(along)
    inside = (x >= low[place] - near) & (x <= high[place] + near)
    return np.where(inside, place, -1)


def _shares(ends: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Shares (2, S, s) of the ends (2, S) at places (S, s)."""
    second = (x - ends[0][:, None]) / (ends[1] - ends[0])[:, None]
    return np.stack([1 - second, second])


def measures(points: np.ndarray) -> np.ndarray:
    """Lengths or areas (f,) of simplices with vertices (dim, v, f)."""
    edges = points[:, 1:] - points[:, :1]
    gram = np.einsum("dav,dbv->vab", edges, edges)
    return np.asarray(np.sqrt(np.linalg.det(gram)) / (1 if len(points) == 2 else 2))


def _side(
    mesh: Any, body: tuple[int, float], facets: np.ndarray, places: np.ndarray, frame: np.ndarray
) -> _Side:
    """The facets of a body, whose vertices find their contacts along the normal."""
    vertices, plane = mesh.facets[:, facets], frame[1:]
    away, contacts = cKDTree((plane @ places).T).query((plane @ mesh.p[:, vertices.ravel()]).T)
    contacts = np.where(away > NEAR * np.ptp(places, axis=1).max(), -1, contacts)
    return _Side(*body, facets, vertices, _nodes(mesh, vertices), contacts.reshape(vertices.shape))


def _nodes(mesh: Any, vertices: np.ndarray) -> np.ndarray:
    """The nodes (q, f) of a quadratic displacement on facets with these vertices (dim, f)."""
    edges = np.sort(mesh.facets if len(mesh.p) == 2 else mesh.edges, axis=0)
    keys = edges[0] * mesh.nvertices + edges[1]
    order, found = np.argsort(keys), [vertices]
    for two in combinations(range(len(vertices)), 2):
        first, second = np.sort(vertices[list(two)], axis=0)
        own = order[np.searchsorted(keys[order], first * mesh.nvertices + second)]
        found.append(mesh.nvertices + own[None])
    return np.concatenate(found)


def _aligned(lead: _Side, other: _Side, mesh: Any) -> _Side:
    """The facets of the other side in the order of the first one, and their vertices as well."""
    wanted, there = (np.sort(side.contacts, axis=0).T.tolist() for side in (lead, other))
    place = {tuple(own): i for i, own in enumerate(there)}
    if set(place) != {tuple(own) for own in wanted}:
        raise InputError("a bound needs contact surfaces whose facets match.")
    facets = np.array([place[tuple(own)] for own in wanted])
    back = np.argsort(np.argsort(lead.contacts, axis=0), axis=0)
    order = np.take_along_axis(np.argsort(other.contacts[:, facets], axis=0), back, axis=0)
    vertices = np.take_along_axis(other.vertices[:, facets], order, axis=0)
    nodes = _nodes(mesh, vertices)
    return _Side(other.body, other.sign, other.facets[facets], vertices, nodes, lead.contacts)


def quadratic_shapes(at: np.ndarray) -> np.ndarray:
    """The quadratic shape functions (q, s) of a facet, those of its vertices first."""
    both = [4 * at[i] * at[j] for i, j in combinations(range(len(at)), 2)]
    return np.concatenate([at * (2 * at - 1), both])


@cache
def facet_nodes(d: int) -> np.ndarray:
    """Shares (dim, q) of the vertices of a facet at the nodes of a quadratic displacement."""
    middles = [(np.eye(d)[i] + np.eye(d)[j]) / 2 for i, j in combinations(range(d), 2)]
    return np.concatenate([np.eye(d), middles]).T


@cache
def facet_rule(d: int) -> tuple[np.ndarray, np.ndarray]:
    """Shares (dim, s) of the vertices of a facet, and weights (s,) that add up to one."""
    x, w = get_quadrature(RefLine if d == 2 else RefTri, 4)
    local, n = np.concatenate([1 - x.sum(axis=0, keepdims=True), x]), SPLIT[d]
    if d == 2:
        corners = [np.array([[i], [i + 1]]) for i in range(n)]
    else:
        up = [(i, j) for i in range(n) for j in range(n - i)]
        corners = [np.array([(i, j), (i + 1, j), (i, j + 1)]) for i, j in up]
        down = [(i, j) for i, j in up if i + j < n - 1]
        corners += [np.array([(i + 1, j + 1), (i + 1, j), (i, j + 1)]) for i, j in down]
    parts = [np.column_stack([n - own.sum(axis=1), own]) / n for own in corners]
    at = np.concatenate([part.T @ local for part in parts], axis=1)
    return at, np.tile(w / w.sum(), len(parts)) / len(parts)
