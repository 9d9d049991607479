"""The contact surfaces of a solved scene as a guaranteed bound (contactopt.accuracy.bound) sees
them: flat, facet facing facet, with tractions that the law allows and that balance the bodies.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine, RefTri

from contactopt.accuracy.equilibrated import Simplices
from contactopt.bodies.elastic import ElasticBody
from contactopt.bodies.rigid import RigidBody
from contactopt.errors import InputError
from contactopt.meshes.cells import is_curved
from contactopt.scenes.scene import Part, Plate, Traction
from contactopt.solving.solve_scene import Solved

LAWS = "frictionless", "tresca", "coulomb"
NEAR = 1e-6  # vertices and contacts coincide within this fraction of the surface
FLAT = 1e-9  # by how much the normals of a flat contact surface differ
CLEAR = 1.5  # of the bubbles that a facet beside the pressure needs, so that it stays open
SPLIT = {2: 16, 3: 4}  # parts of an edge of a contact facet for integrals over it


class _Side(NamedTuple):
    """An elastic surface of a pair: the number of its body, 1 for the upper and -1 for the lower
    one, its facets, of these the vertices (dim, f), the nodes of a quadratic displacement (q, f)
    and the contacts at the vertices (dim, f).
    """

    body: int
    sign: float
    facets: np.ndarray
    vertices: np.ndarray
    nodes: np.ndarray
    contacts: np.ndarray


class FacingFacets:
    """The facets of a pair of surfaces, those of both sides in the same order with the same
    vertices.

    lead      the side that carries the contacts;   rigid  numbers and signs of rigid bodies
    contacts  (dim, f) at the vertices;   areas  (f,) of the facets [length^(dim - 1)]
    """

    def __init__(self, solved: Solved, number: int, cells: Sequence[Any]):
        scene, coupling = solved.reduction.scene, solved.reduction.couplings[number]
        pair, self.gap, self.frame = scene.pairs[number], coupling.gap, coupling.frames[0]
        name = f"contact '{pair.name}'"
        if pair.law not in LAWS:
            raise InputError(f"{name} has the law '{pair.law}'; a bound knows {', '.join(LAWS)}.")
        if coupling.kind != "matching":
            raise InputError(f"{name} joins surfaces by mortar; a bound needs matching nodes.")
        if np.ptp(coupling.frames, axis=0).max() > FLAT:
            raise InputError(f"{name} has a curved surface; a bound needs a flat one.")
        names = [part.name for part in scene.parts]
        sides: list[_Side] = []
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
            sides.append(_side(own, (place, sign), facets, coupling.positions, self.frame[0]))
        self.lead, mesh = sides[-1], cells[sides[-1].body].mesh  # contacts are those of the lower
        self.sides = [self.lead]
        for side in sides[:-1]:
            self.sides.append(_aligned(self.lead, side, cells[side.body].mesh))
        self.contacts = self.lead.contacts + solved.reduction.problem.pairs[number].start
        self.points = mesh.p[:, self.lead.vertices]
        self.areas = measures(self.points)

    def jump(self, nodal: Sequence[np.ndarray], at: np.ndarray, change: bool = False) -> np.ndarray:
        """Gap and slip (dim, f, s) at shares (dim, s) of the vertices of every facet, or what the
        displacements change of them.
        """
        N, total = quadratic_shapes(at), np.zeros(1)
        for side in self.sides:
            own = nodal[side.body][:, side.nodes]
            total = total + side.sign * np.einsum("cqf,qs->cfs", own, N)
        for body, sign in self.rigid:
            total = total + sign * nodal[body][:, None, None]
        out = np.einsum("lc,cfs->lfs", self.frame, total)
        if not change and self.shape is None:
            out[0] += self.gap[self.lead.contacts].T @ at
        elif not change:
            places = np.einsum("dvf,vs->dfs", self.points, at)
            out[0] += np.reshape(self.shape(places.reshape(len(out), -1)), out[0].shape)
        return out

    def lift(self, nodal: Sequence[np.ndarray], height: np.ndarray) -> None:
        """Add to the gap (f, q) at the nodes of facets, at shared nodes the largest."""
        added = np.full(nodal[self.lead.body].shape[1], -np.inf)
        np.maximum.at(added, self.lead.nodes, height.T)
        added[np.isinf(added)] = 0.0
        nodal[self.lead.body][:] += self.lead.sign * self.frame[0][:, None] * added

    def moments(self, side: _Side, tractions: np.ndarray) -> np.ndarray:
        """(v, f, dim) of tractions (k, dim) on a side with the hat functions."""
        t = tractions[self.contacts] @ self.frame
        d = len(self.frame)
        return side.sign * self.areas[:, None] * (t + t.sum(axis=0)) / (d * (d + 1))


def measures(points: np.ndarray) -> np.ndarray:
    """Lengths or areas (f,) of simplices with vertices (dim, v, f)."""
    edges = points[:, 1:] - points[:, :1]
    gram = np.einsum("dav,dbv->vab", edges, edges)
    return np.asarray(np.sqrt(np.linalg.det(gram)) / (1 if len(points) == 2 else 2))


def _side(
    cells: Simplices,
    body: tuple[int, float],
    facets: np.ndarray,
    places: np.ndarray,
    n: np.ndarray,
) -> _Side:
    """The facets of a body, whose vertices find their contacts along the normal n."""
    mesh, plane = cells.mesh, np.eye(len(n)) - np.outer(n, n)
    vertices = mesh.facets[:, facets]
    away, contacts = cKDTree((plane @ places).T).query((plane @ mesh.p[:, vertices.ravel()]).T)
    if away.max(initial=0.0) > NEAR * np.ptp(places, axis=1).max():
        raise InputError("a bound needs a contact at every vertex of the contact surfaces.")
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


class PressedScene:
    """A solved scene of bodies of simplices with flat contact surfaces.

    cells       the elements of every body, None for a rigid one
    pairs       of facets;   factor  of all integrals (thickness, mirror images)
    loads       for each body the matrix (n, k dim) from tractions at the contacts, linear between
                them, to its nodal forces
    tractions   (k, dim) at the contacts, in their frames, that the law allows and that balance all
                free motions;   limit  (k,) the friction bound [stress]
    Raises InputError for what a bound does not know.
    """

    def __init__(self, solved: Solved):
        self.reduction, self.solution = solved.reduction, solved.solution
        self.problem, scene = solved.reduction.problem, solved.reduction.scene
        if scene.kind == "axisymmetric":
            raise InputError(
                "a bound needs plane strain or space: near the axis of revolution no stress of"
                " composite elements has a finite energy."
            )
        if solved.path is not None or self.reduction.on_ground:
            raise InputError("a bound is of one state of bodies that need no ground to hold them.")
        self.bodies: list[Any] = list(self.reduction.bodies)
        self.cells: list[Any] = [_cells(body) for body in self.bodies]
        plane = scene.kind == "plane-strain"
        self.factor = scene.copies * (scene.thickness if plane else 1.0)
        count = range(len(scene.pairs))
        self.pairs = [FacingFacets(solved, number, self.cells) for number in count]
        self.loads = [self._load(number, body) for number, body in enumerate(self.bodies)]
        areas = self.problem.areas
        self.share = np.divide(1.0, areas, out=np.zeros(len(areas)), where=areas > 0)
        t = self.share[:, None] * self.solution.reactions
        t[:, 0] = np.maximum(t[:, 0], 0.0)
        bound, size = self.limit_of(t), np.linalg.norm(t[:, 1:], axis=1)
        over = size > bound
        t[over, 1:] *= (bound[over] / size[over])[:, None]
        given = [body.resultants for body in self.bodies]
        self.tractions = self.balanced(t, np.concatenate(given))
        self.limit = self.limit_of(self.tractions)

    def limit_of(self, t: np.ndarray) -> np.ndarray:
        """The friction bound (k,) under tractions."""
        bound = self.problem.law.bound(t[:, 0] * self.problem.areas)
        return np.asarray(self.share * np.broadcast_to(bound, len(t)))

    def nodal(self, displaced: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Displacements (dim, vertices and edges) of every body; (dim, 1) of a rigid one."""
        bodies = zip(self.bodies, self.cells, displaced)
        return [
            own.quadratic(U[body.body.unknowns]) if own else U[: self.problem.dim]
            for body, own, U in bodies
        ]

    def _load(self, number: int, body: Any) -> sp.csr_matrix:
        d = self.problem.dim
        at, weights = facet_rule(d)
        entries: list[Any] = []
        for pair in self.pairs:
            places: list[Any] = [(sign, None) for place, sign in pair.rigid if place == number]
            places += [(side.sign, side) for side in pair.sides if side.body == number]
            for sign, side in places:
                if side is None:
                    N, rows = np.ones((1, at.shape[1])), np.zeros((d, 1, len(pair.areas)), int)
                    rows += np.arange(d)[:, None, None]
                elif body.body.degree == 1:
                    N, rows = at, body.body.unknowns[:, side.vertices]
                else:
                    N, rows = quadratic_shapes(at), body.body.unknowns[:, side.nodes]
                share = sign * self.factor * np.einsum("s,vs,qs->vq", weights, at, N)
                value = np.einsum("vq,f,ci->vciqf", share, pair.areas, pair.frame)
                columns = pair.contacts[:, None] * d + np.arange(d)[:, None]  # (v, c, f)
                row = np.broadcast_to(rows[None, None], value.shape)
                column = np.broadcast_to(columns[:, :, None, None], value.shape)
                entries.append([part.ravel() for part in (value, row, column)])
        shape = (len(body.at_rest), self.problem.q.size)
        if not entries:
            return sp.csr_matrix(shape)
        value, row, column = (np.concatenate(parts) for parts in zip(*entries))
        return sp.csr_matrix((value, (row, column)), shape)

    def balanced(self, t: np.ndarray, resultants: np.ndarray) -> np.ndarray:
        """Tractions (k, dim) that balance resultants (p,) in the free motions, each scaled by what
        it does there.
        """
        bodies = zip(self.bodies, self.loads)
        work = np.concatenate([load.T @ body.motions for body, load in bodies], axis=1)
        if not work.shape[1]:
            return t
        works = (work.reshape(*t.shape, -1) * t[..., None]).sum(axis=1)  # (k, p)
        weight = np.abs(works).sum(axis=1, keepdims=True)
        scaled = np.divide(works, weight, out=np.zeros(works.shape), where=weight > 0)
        missing = -resultants - works.sum(axis=0)
        change = scaled @ np.linalg.lstsq(works.T @ scaled, missing, rcond=1e-12)[0]
        if np.any(change < -1):
            raise InputError("the contact forces do not balance the bodies; solve more accurately.")
        return t * (1 + change)[:, None]

    def admissible(self, nodal: Sequence[np.ndarray]) -> list[np.ndarray]:
        """The displacements with what keeps the gap from being negative, and closes it where there
        is pressure: hat functions at vertices and bubbles between them.
        """
        d = self.problem.dim
        at, nodes = facet_rule(d)[0], facet_nodes(d)
        bubble = quadratic_shapes(at)[d:].sum(axis=0)
        out = [own.copy() for own in nodal]
        for pair in self.pairs:
            missing = -pair.jump(out, nodes)[0]
            closed = (self.tractions[pair.contacts, 0] > 0).T @ nodes > 1 - NEAR
            least = np.maximum(missing[:, :d], 0.0) @ nodes
            pair.lift(out, np.where(closed, missing, np.maximum(missing, least)))
            more = np.maximum(np.max(-pair.jump(out, at)[0] / bubble, axis=1), 0.0)
            more[~closed.all(axis=1)] *= CLEAR
            pair.lift(out, more[:, None] * (np.arange(nodes.shape[1]) >= d))
        return out

    def works(self, nodal: Sequence[np.ndarray]) -> tuple[float, float]:
        """The works int p* gap and int (g |slip| + t* slip) over all contact surfaces."""
        at, weights = facet_rule(self.problem.dim)
        slips = 0.0
        for pair in self.pairs:
            u = pair.jump(nodal, at)[1:]
            t = np.einsum("vfc,vs->cfs", self.tractions[pair.contacts, 1:], at)
            g = self.limit[pair.contacts].T @ at
            measure = self.factor * pair.areas[:, None] * weights
            slip = g * np.linalg.norm(u, axis=0) + np.sum(t * u, axis=0)
            slips += float(np.sum(measure * slip))
        return self.work(self.tractions[:, 0], nodal), slips

    def work(
        self, pressure: np.ndarray, nodal: Sequence[np.ndarray], change: bool = False
    ) -> float:
        """The work of a pressure (k,) in the gap, or in what displacements change of it."""
        at, weights = facet_rule(self.problem.dim)
        total = 0.0
        for pair in self.pairs:
            own = (pressure[pair.contacts].T @ at) * pair.jump(nodal, at, change)[0]
            total += float(np.sum(self.factor * pair.areas[:, None] * weights * own))
        return total

    def boundary(
        self, number: int, tractions: np.ndarray, loaded: bool = True
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Body force (dim,), held components (facets, dim) and moments of tractions (facets, dim,
        dim) of a body, as Simplices.equilibrated() takes them; not `loaded`: of the contact alone.
        """
        scene, mesh, d = self.reduction.scene, self.cells[number].mesh, self.problem.dim
        part: Any = scene.parts[number]
        force, components = np.zeros(d), scene.components
        held = np.zeros((mesh.facets.shape[1], d), dtype=bool)
        moments = np.zeros((*held.shape, d))
        areas = measures(mesh.p[:, mesh.facets])
        holding = [(own.boundary, own.displacement) for own in part.supports]
        for load in part.loads:
            if isinstance(load, Plate):
                holding.append((load.boundary, None if load.glued else load.force))
            elif isinstance(load, Traction) and loaded:
                own = np.asarray(mesh.boundaries[load.boundary])
                moments[own] += areas[own, None, None] / d * np.asarray(load.value, dtype=float)
            elif loaded:
                force += np.asarray(load.value, dtype=float)
        for boundary, names in holding:
            for name in components if names is None else names:
                held[np.asarray(mesh.boundaries[boundary]), components.index(name)] = True
        for pair in self.pairs:
            for side in (own for own in pair.sides if own.body == number):
                slot = np.argsort(np.argsort(side.vertices, axis=0), axis=0)
                np.add.at(moments, (side.facets, slot), pair.moments(side, tractions))
        return force, held, moments


def _cells(body: Any) -> Simplices | None:
    """The elements of an elastic body, None for a rigid one."""
    if isinstance(body, RigidBody):
        return None
    if not isinstance(body, ElasticBody):
        raise InputError(f"body '{body.name}' has no elements here; a bound needs them.")
    mesh = body.body.basis.mesh
    if mesh.refdom.__name__ not in ("RefTri", "RefTet") or is_curved(mesh):
        raise InputError(f"body '{body.name}': a bound needs triangles or tetrahedra, not curved.")
    return Simplices(mesh)
