"""The contact surfaces of a solved scene as a guaranteed bound (contactopt.bounds.bound) sees
them: flat, facet facing facet, or piece of a facet facing piece of a facet. The pieces are
intervals in the plane. In space they are triangles, of which polygons are made up that
contactopt.coupling.segments cuts.
"""

from collections.abc import Callable, Sequence
from functools import cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from skfem import Mesh
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine, RefTri

from contactopt.coupling.facing import Facets, facing_pairs
from contactopt.coupling.segments import areas, clip
from contactopt.defaults import CLOSE, EQUAL
from contactopt.errors import InputError
from contactopt.meshes.cells import measures
from contactopt.problem.laws import find_law
from contactopt.scenes.scene import Part
from contactopt.solving.solve_scene import Solved

SPLIT = {2: 16, 3: 4}  # parts of an edge of a contact facet for integrals over it
PARTS = {2: 16, 3: 2}  # and of an edge of a piece of one


class Points(NamedTuple):
    """Points of integration on S pieces of the facets of a pair, s on each piece: the facet of each
    piece on either side (2, S), the shares of its vertices (2, dim, S, s), and the weights (S, s)
    [length^(dim - 1)].
    """

    facets: np.ndarray
    at: np.ndarray
    weights: np.ndarray


class _Side(NamedTuple):
    """An elastic surface of a pair: number of its body, 1 (upper) or -1, facets, their vertices
    (dim, f), nodes of quadratic displacements (q, f), and contacts (dim, f), -1 where there is
    none.
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
              node that faces nothing has no weight;   ends  the nodes of pieces, corners first
    """

    def __init__(self, solved: Solved, number: int, cells: Sequence[Any]):
        scene, coupling = solved.reduction.scene, solved.reduction.couplings[number]
        pair, self.gap, self.frame = scene.pairs[number], coupling.gap, coupling.frames[0]
        self.revolved = scene.analysis.revolved
        name, self.joined = f"contact '{pair.name}'", coupling.kind == "mortar"
        law = find_law(pair.law)
        if not (law.convex or law.plain_coulomb()) or law.dilatant or not law.opens:
            raise InputError(
                f"{name} has the law '{pair.law}'; there are bounds for contact that may open, with"
                " Coulomb's friction, with a given bound of friction, or without friction."
            )
        if np.ptp(coupling.frames, axis=0).max() > EQUAL:
            raise InputError(f"{name} has a curved surface; a bound needs a flat one.")
        names = [part.name for part in scene.parts]
        self.sides: list[_Side] = []
        self.rigid: list[tuple[int, float]] = []
        self.shape: Callable[[np.ndarray], np.ndarray] | None = None
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
        (at, weights), nodes = facet_rule(scene.dim, SPLIT[scene.dim]), facet_nodes(scene.dim)
        if self.joined:
            self.rule, self.nodes, self.ends = joined_points(self.points, self.frame)
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
        short = there < (1 - CLOSE) * measures(self.points[0])
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
        """Add `height` (f, q) at nodes to a component of gap or slip. Where facets share a node,
        the largest counts.
        """
        side = self.sides[0]
        added = np.full(nodal[side.body].shape[1], -np.inf)
        np.maximum.at(added, side.nodes, height.T)
        added[np.isinf(added)] = 0.0
        nodal[side.body][:] += side.sign * self.frame[component][:, None] * added

    def moments(self, number: int, tractions: np.ndarray) -> np.ndarray:
        """The moments (v, f, dim) of tractions (k, dim) with the hat functions of a side, zero on
        an axis.
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
                on = r[end] <= EQUAL * r.max()
                total = out[:, on].sum(axis=0)
                out[end, on], out[1 - end, on] = total / 3, 2 * total / 3
        return out


def joined_points(points: Sequence[np.ndarray], frame: np.ndarray) -> tuple[Points, Points, Points]:
    """Points for integrals over the pieces, intervals or triangles, common to facets of two plane
    surfaces (dim, v, f) that face each other along frame[0]; the nodes of the first one's facets;
    and those of the pieces.
    """
    d = len(frame)
    own, other = (np.einsum("ad,dvf->fva", frame[1:], x) for x in points)
    first, second = _meeting(own, other)
    corners, number = _common(own[first], other[second])
    size, whole = _sizes(corners), _sizes(own)
    there = size > CLOSE ** (d - 1) * whole[first[number]]
    corners, facets = corners[there], np.stack([first, second])[:, number[there]]
    area = size[there] * (measures(points[0]) / whole)[facets[0]]

    def pieces(at: np.ndarray, weights: np.ndarray) -> Points:
        x = np.einsum("Sva,vs->Ssa", corners, at)
        shares = [_shares(side[of], x) for side, of in zip((own, other), facets)]
        return Points(facets, np.stack(shares), area[:, None] * weights)

    x = np.einsum("fva,vq->fqa", own, facet_nodes(d))
    inside = _shares(other[second], x[first]).min(axis=0)  # (j, q)
    order, each = np.argsort(inside, axis=0), np.arange(x.shape[1])
    found, best = np.zeros(x.shape[:2], dtype=int), np.full(x.shape[:2], -np.inf)
    found[first[order], each] = second[order]  # the last of several counts: the innermost
    np.maximum.at(best, first, inside)
    every, x = np.repeat(np.arange(len(x)), x.shape[1]), x.reshape(-1, 1, d - 1)
    shares = [_shares(own[every], x), _shares(other[found.ravel()], x)]
    faced = (best.reshape(-1, 1) >= -CLOSE).astype(float)
    nodes = Points(np.stack([every, found.ravel()]), np.stack(shares), faced)
    return (
        pieces(*facet_rule(d, PARTS[d])),
        nodes,
        pieces(facet_nodes(d), np.ones(d * (d + 1) // 2)),
    )


def _sizes(corners: np.ndarray) -> np.ndarray:
    """Lengths or areas (S,) of facets (S, v, dim - 1) in their plane."""
    edges = corners[:, 1:] - corners[:, :1]
    return np.asarray(np.abs(np.linalg.det(edges)) / edges.shape[2])  # of one or two factorial


def _meeting(own: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All pairs (j,) of facets (f, v, dim - 1) of two sides that may have a common part."""
    balls = []
    for plane, up in ((own, 1.0), (other, -1.0)):
        centre = plane.mean(axis=1)
        radius = np.linalg.norm(plane - centre[:, None], axis=2).max(axis=1)
        axis = np.zeros((centre.shape[1] + 1, len(centre)))
        axis[-1] = up
        balls.append(Facets(np.vstack([centre.T, 0 * radius]), radius, axis, 0 * radius))
    return facing_pairs(balls[0], balls[1], -0.5)  # the cosine of opposite normals


def _common(own: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The common parts (S, v, dim - 1) of pairs of facets, in space fans, and their pair (S,)."""
    if own.shape[2] == 1:
        low = np.maximum(own.min(axis=1), other.min(axis=1))
        high = np.minimum(own.max(axis=1), other.max(axis=1))
        return np.stack([low, np.maximum(low, high)], axis=1), np.arange(len(own))
    area = areas(own)
    window = np.where((area < 0)[:, None, None], own[:, ::-1], own)  # counterclockwise
    polygon = clip(other, window, np.sqrt(np.abs(area)))
    hub = np.repeat(polygon[:, :1], polygon.shape[1] - 2, axis=1)
    triangles = np.stack([hub, polygon[:, 1:-1], polygon[:, 2:]], axis=2)
    return triangles.reshape(-1, 3, 2), np.repeat(np.arange(len(own)), hub.shape[1])


def _shares(corners: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Shares (v, S, s) of the vertices (S, v, dim - 1) of facets at places (S, s, dim - 1)."""
    edges = corners[:, 1:] - corners[:, :1]
    others = np.moveaxis((x - corners[:, :1]) @ np.linalg.inv(edges), 2, 0)
    return np.concatenate([1 - others.sum(axis=0, keepdims=True), others])


def _side(
    mesh: Mesh, body: tuple[int, float], facets: np.ndarray, places: np.ndarray, frame: np.ndarray
) -> _Side:
    """The facets of a body, whose vertices find their contacts along the normal."""
    vertices, plane = mesh.facets[:, facets], frame[1:]
    away, contacts = cKDTree((plane @ places).T).query((plane @ mesh.p[:, vertices.ravel()]).T)
    contacts = np.where(away > CLOSE * np.ptp(places, axis=1).max(), -1, contacts)
    return _Side(*body, facets, vertices, _nodes(mesh, vertices), contacts.reshape(vertices.shape))


def _nodes(mesh: Mesh, vertices: np.ndarray) -> np.ndarray:
    """The nodes (q, f) of a quadratic displacement on facets with these vertices (dim, f)."""
    edges = np.sort(mesh.facets if len(mesh.p) == 2 else mesh.edges, axis=0)
    keys = edges[0] * mesh.nvertices + edges[1]
    order, found = np.argsort(keys), [vertices]
    for two in combinations(range(len(vertices)), 2):
        first, second = np.sort(vertices[list(two)], axis=0)
        own = order[np.searchsorted(keys[order], first * mesh.nvertices + second)]
        found.append(mesh.nvertices + own[None])
    return np.concatenate(found)


def _aligned(lead: _Side, other: _Side, mesh: Mesh) -> _Side:
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


def control_points(values: np.ndarray, d: int) -> np.ndarray:
    """Bernstein's control points (S, q) of quadratic functions with values (S, q) at nodes of
    facets.
    """
    ends = np.array(list(combinations(range(d), 2)))
    between = 2 * values[:, d:] - values[:, ends].mean(axis=2)
    return np.concatenate([values[:, :d], between], axis=1)


@cache
def facet_nodes(d: int) -> np.ndarray:
    """Shares (dim, q) of the vertices of a facet at the nodes of a quadratic displacement."""
    middles = [(np.eye(d)[i] + np.eye(d)[j]) / 2 for i, j in combinations(range(d), 2)]
    return np.concatenate([np.eye(d), middles]).T


@cache
def facet_rule(d: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Shares (dim, s) of a facet's vertices, weights (s,) of sum one; edges in n parts."""
    x, w = get_quadrature(RefLine if d == 2 else RefTri, 4)
    local = np.concatenate([1 - x.sum(axis=0, keepdims=True), x])
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
