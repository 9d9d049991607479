"""A guaranteed bound of the discretisation error in the energy norm, and what makes it up.

Let u be the exact displacement with its stress s(u), and J its potential energy,

    J(v) = a(v, v) / 2 - f(v) + int g |[v_t]|,    a(v, v) = int s(v) : C^-1 : s(v) = |v|^2,

smallest under the condition gap(v) >= 0, where [v] is the displacement of the upper surface minus
that of the lower one, gap(v) the initial gap plus [v_n], and g the friction bound: zero without
friction, given for Tresca's law. Take any displacement v that the supports and the contact allow,
gap(v) >= 0, and any stress s* in equilibrium with the loads, whose traction on the contact surface
is a pressure p* >= 0 and a shear |t*| <= g. Then all terms on both sides of

    |u - v|^2 + |s(u) - s*|^2 + 2 C(u, s(u), v, s*)  =  |s* - s(v)|^2
        + 2 int p* gap(v) + 2 int (g |[v_t]| + t* [v_t])                                   (*)

are at least zero; C holds the works of p* in gap(u), of p in gap(v), and likewise of friction. The
right side is the primal-dual gap, 2 (J(v) + J*(s*)): it needs v and s* alone, and bounds |u - v|^2.
It is also the error in the constitutive relations (Ladeveze). Its terms are reported apart: what s*
and s(v) differ by is the mesh's, the second term that of contact, the third that of friction.

s* comes from contactopt.accuracy.equilibrated. Its pressure is the piecewise linear one that has
the values r_i / A_i at the contacts, for the forces r and nodal areas A of the solution. That is not
what loads the finite elements, so the body is solved once more, with factors that are there, under
this pressure, and s* is made from that displacement. Plates and free motions stay in balance: the
pressures are scaled by what is missing, which also makes the bound hold for a solver that stopped
early. v is the solution, plus quadratic bubbles on the contact surface where it penetrates between
contacts. The bound of the solution is that of v plus the norm of what was added.

Coulomb's law is treated as Tresca's with g = mu p*. What follows is that the error of p* changes g:
the left side of (*) loses 2 int mu (p* - p) (|[u_t]| - |[v_t]|). If this is at most
kappa (|u - v|^2 + |s(u) - s*|^2) with kappa < 1, small friction, the bound grows by
1 / (1 - kappa)^1/2. kappa is proportional to mu.

The bound is of the problem whose boundary is that of the mesh. It does not cover straight edges in
place of a curve. Integrals over contact facets are taken at SPLIT parts of each; there also
penetration is looked for.

Sources: Prager, Synge (1947); Ladeveze, Leguillon (1983); Coorevits, Hild, Pelle (2000), A
posteriori error estimation for unilateral contact with matching and non-matching meshes, Comput.
Methods Appl. Mech. Eng. 186; Weiss, Wohlmuth (2009), A posteriori error estimator and error control
for contact problems, Math. Comp. 78.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine, RefTri

from contactopt.accuracy.equilibrated import Simplices
from contactopt.bodies.elastic import ElasticBody
from contactopt.bodies.rigid import RigidBody
from contactopt.coupling.reduction import Reduction
from contactopt.errors import InputError
from contactopt.meshes.cells import is_curved
from contactopt.scenes.scene import Part, Plate, Traction
from contactopt.solving.solve_scene import Solved

LAWS = "frictionless", "tresca", "coulomb"
NEAR = 1e-6  # vertices and contacts coincide within this fraction of the surface
FLAT = 1e-9  # by how much the normals of a flat contact surface differ
SPLIT = 16  # parts of an edge of a contact facet (in space: 4, of 16 parts) for integrals
UNBALANCED = 1e-6  # of the force of an element: so much a vertex may be out of balance


@dataclass(frozen=True, eq=False)
class Bound:
    """The terms of a guaranteed bound, all norms of energy [(force length)^1/2].

    mesh      |s* - s(v)|;   contact, friction  root of twice the work of p* in the gap, and of
              friction
    solver    the part of contact and friction that would be left on this mesh if only the contacts
              mattered: the solver's own error
    moved     norm of the bubbles that take penetration away
    norm      |u_h| of the solution
    elements  for each body (e,) the squares of what its elements add to `mesh`
    """

    mesh: float
    contact: float
    friction: float
    solver: float
    moved: float
    norm: float
    elements: tuple[np.ndarray, ...]

    @property
    def error(self) -> float:
        """The bound of |u - u_h|."""
        return float(np.sqrt(self.mesh**2 + self.contact**2 + self.friction**2) + self.moved)


@dataclass(frozen=True, eq=False)
class _Side:
    """A surface of a pair: the number of its body, 1 for the upper and -1 for the lower one, its
    facets, of these the vertices (dim, f), the nodes of a quadratic displacement (q, f), and the
    contacts at the vertices (dim, f).
    """

    body: int
    sign: float
    facets: np.ndarray
    vertices: np.ndarray
    nodes: np.ndarray
    contacts: np.ndarray


class _Pair:
    """The facets of a pair of surfaces, those of both sides in the same order with the same
    vertices.
    """

    def __init__(self, reduction: Reduction, number: int, cells: Sequence[Simplices | None]):
        scene, coupling = reduction.scene, reduction.couplings[number]
        pair, self.contacts = scene.pairs[number], reduction.problem.pairs[number].contacts
        self.gap, self.frame = coupling.gap, coupling.frames[0]
        name = f"the contact '{pair.name}'" if len(scene.pairs) > 1 else "the contact"
        if pair.law not in LAWS:
            raise InputError(f"{name} has the law '{pair.law}'; a bound knows {', '.join(LAWS)}.")
        if coupling.kind != "matching":
            raise InputError(f"{name} joins surfaces by mortar; a bound needs matching nodes.")
        if np.ptp(coupling.frames, axis=0).max() > FLAT:
            raise InputError(f"{name} has a curved surface; a bound needs a flat one.")
        names, parts = [part.name for part in scene.parts], scene.parts
        self.sides = []
        self.rigid: list[tuple[int, float]] = []
        self.shape = None  # the gap as a function of places
        for body, surface, sign in zip(pair.bodies, pair.surfaces, (1.0, -1.0)):
            place = names.index(body)
            part, own = parts[place], cells[place]
            if own is None:
                self.rigid.append((place, sign))
                given = getattr(part, "gap", None)
                self.shape = given if callable(given) else None
                continue
            facets = np.asarray(own.mesh.boundaries[surface or part.contact])
            self.sides.append(_side(own, place, sign, facets, coupling.positions, self.frame[0]))
        if len(self.sides) == 2:
            self.sides = self.sides[::-1]  # contacts, frames and areas are those of the lower one
            own = cells[self.sides[1].body]
            assert own is not None
            self.sides[1] = _aligned(*self.sides, own)
        self.lead = self.sides[0]
        own = cells[self.lead.body]
        assert own is not None
        self.points = own.mesh.p[:, self.lead.vertices]
        edges = self.points[:, 1:] - self.points[:, :1]
        gram = np.einsum("dav,dbv->vab", edges, edges)
        self.areas = np.sqrt(np.linalg.det(gram)) / (1 if len(edges) == 2 else 2)

    def jump(self, nodal: Sequence[np.ndarray], at: np.ndarray) -> np.ndarray:
        """Gap and slip (dim, f, s) at shares (dim, s) of the vertices of every facet."""
        N, total = _quadratic(at), 0.0
        for side in self.sides:
            own = nodal[side.body][:, side.nodes]
            total = total + side.sign * np.einsum("cqf,qs->cfs", own, N)
        for body, sign in self.rigid:
            total = total + sign * nodal[body][:, None, None]
        out = np.einsum("lc,cfs->lfs", self.frame, total)
        if self.shape is None:
            return out + np.eye(len(out))[0][:, None, None] * (self.gap[self.lead.contacts].T @ at)
        places = np.einsum("dvf,vs->dfs", self.points, at)
        out[0] += np.reshape(self.shape(places.reshape(len(out), -1)), out[0].shape)
        return out


def _side(
    cells: Simplices, body: int, sign: float, facets: np.ndarray, places: np.ndarray, n: np.ndarray
) -> _Side:
    """The facets of a body, whose vertices find their contacts along the normal n."""
    mesh = cells.mesh
    vertices = mesh.facets[:, facets]
    plane = np.eye(cells.dim) - np.outer(n, n)
    away, contacts = cKDTree((plane @ places).T).query((plane @ mesh.p[:, vertices.ravel()]).T)
    if away.max(initial=0.0) > NEAR * np.ptp(places, axis=1).max():
        raise InputError("a bound needs a contact at every vertex of the contact surfaces.")
    nodes = _nodes(cells, vertices)
    return _Side(body, sign, facets, vertices, nodes, contacts.reshape(vertices.shape))


def _nodes(cells: Simplices, vertices: np.ndarray) -> np.ndarray:
    """The nodes (q, f) of a quadratic displacement on facets with these vertices (dim, f)."""
    mesh = cells.mesh
    edges = np.sort(mesh.facets if cells.dim == 2 else mesh.edges, axis=0)
    keys = edges[0] * mesh.nvertices + edges[1]
    order = np.argsort(keys)
    found = []
    for two in combinations(range(len(vertices)), 2):
        first, second = np.sort(vertices[list(two)], axis=0)
        found.append(order[np.searchsorted(keys[order], first * mesh.nvertices + second)])
    return np.concatenate([vertices, mesh.nvertices + np.array(found)])


def _aligned(one: _Side, other: _Side, cells: Simplices) -> _Side:
    """The facets of the other side in the order of the first one, and their vertices as well."""
    wanted, there = (np.sort(side.contacts, axis=0) for side in (one, other))
    place = {tuple(own): i for i, own in enumerate(there.T)}
    if set(place) != {tuple(own) for own in wanted.T}:
        raise InputError("a bound needs contact surfaces whose facets match.")
    facets = np.array([place[tuple(own)] for own in wanted.T])
    order = np.argsort(other.contacts[:, facets], axis=0)
    back = np.argsort(np.argsort(one.contacts, axis=0), axis=0)
    order = np.take_along_axis(order, back, axis=0)
    vertices = np.take_along_axis(other.vertices[:, facets], order, axis=0)
    nodes = _nodes(cells, vertices)
    return _Side(other.body, other.sign, other.facets[facets], vertices, nodes, one.contacts)


def _quadratic(at: np.ndarray) -> np.ndarray:
    """The quadratic shape functions (q, s) of a facet, those of its vertices first."""
    both = [4 * at[i] * at[j] for i, j in combinations(range(len(at)), 2)]
    return np.concatenate([at * (2 * at - 1), both])


@cache
def _rule(d: int) -> tuple[np.ndarray, np.ndarray]:
    """Shares (dim, s) of the vertices of a facet, and weights (s,) that add up to one."""
    x, w = get_quadrature(RefLine if d == 2 else RefTri, 4)
    local = np.concatenate([1 - x.sum(axis=0, keepdims=True), x])
    n = SPLIT if d == 2 else SPLIT // 4
    if d == 2:
        parts = [np.array([[n - i, i], [n - i - 1, i + 1]]) for i in range(n)]
    else:
        up = [(i, j) for i in range(n) for j in range(n - i)]
        parts = [np.array([(i, j), (i + 1, j), (i, j + 1)]) for i, j in up]
        parts += [
            np.array([(i + 1, j + 1), (i + 1, j), (i, j + 1)]) for i, j in up if i + j < n - 1
        ]
        parts = [np.column_stack([n - own.sum(axis=1), own]) for own in parts]
    at = np.concatenate([(part / n).T @ local for part in parts], axis=1)
    return at, np.tile(w / w.sum(), len(parts)) / len(parts)


class _Scene:
    """A solved scene as a bound sees it: bodies of simplices, pairs of facets, contact tractions.

    Raises InputError for what a bound does not know.
    """

    def __init__(self, solved: Solved):
        reduction, solution = solved.reduction, solved.solution
        self.reduction, self.solution, scene = reduction, solution, reduction.scene
        self.problem = reduction.problem
        if scene.kind == "axisymmetric":
            raise InputError(
                "a bound needs plane strain or space: near the axis of revolution no stress of"
                " composite elements has a finite energy."
            )
        if solved.path is not None or reduction.on_ground:
            raise InputError("a bound is of one state of bodies that need no ground to hold them.")
        self.cells = [_cells(body) for body in reduction.bodies]
        self.factor = (
            scene.thickness * scene.copies if scene.kind == "plane-strain" else scene.copies
        )
        count = range(len(scene.pairs))
        self.pairs = [_Pair(reduction, number, self.cells) for number in count]
        self.loads = self._loads()
        self.tractions = self._tractions()

    def nodal(self, displaced: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Displacements (dim, vertices and edges) of every body; (dim,) of a rigid one."""
        out = []
        for body, own, U in zip(self.reduction.bodies, self.cells, displaced):
            flat = own is None
            out.append(U[: self.problem.dim] if flat else own.quadratic(U[body.body.unknowns]))
        return out

    def _loads(self) -> list[sp.csr_matrix]:
        """For each body the matrix (n, k dim) from tractions at the contacts, linear between them,
        to its nodal forces.
        """
        d, k = self.problem.dim, self.problem.contacts
        at, weights = _rule(d)
        found: list[list[Any]] = [[] for _ in self.cells]
        for pair in self.pairs:
            column = (pair.lead.contacts + pair.contacts.start) * d

            def add(body, sign, rows, N, pair=pair, column=column):  # type: ignore[no-untyped-def]
                share = sign * self.factor * np.einsum("s,vs,qs->vq", weights, at, N)
                for (v, q), value in np.ndenumerate(share):
                    for i in range(d):
                        for c in range(d):
                            data = value * pair.areas * pair.frame[c, i]
                            found[body].append((data, rows[i][q], column[v] + c))

            for body, sign in pair.rigid:
                rows = [np.full((1, len(pair.areas)), i) for i in range(d)]
                add(body, sign, rows, np.ones((1, len(weights))))
            for side in pair.sides:
                assembly = self.reduction.bodies[side.body].body
                N, nodes = _quadratic(at), side.nodes
                if assembly.degree == 1:
                    N, nodes = at, side.vertices
                add(side.body, side.sign, assembly.unknowns[:, nodes], N)
        shapes = [(len(body.at_rest), k * d) for body in self.reduction.bodies]
        return [
            sp.csr_matrix((np.concatenate(v), (np.concatenate(i), np.concatenate(j))), shape)
            if own
            else sp.csr_matrix(shape)
            for own, shape in zip(found, shapes)
            for v, i, j in [zip(*own) if own else ((), (), ())]
        ]

    def _tractions(self) -> np.ndarray:
        """(k, dim) tractions at the contacts that the law allows and that balance the motions."""
        problem, law = self.problem, self.problem.law
        areas = problem.areas[:, None]
        t = np.where(areas > 0, self.solution.reactions / np.where(areas > 0, areas, 1.0), 0.0)
        t[:, 0] = np.maximum(t[:, 0], 0.0)
        bound = law.bound(t[:, 0] * areas[:, 0]) / np.where(areas > 0, areas, 1.0)[:, 0]
        size = np.linalg.norm(t[:, 1:], axis=1)
        t[:, 1:] *= np.where(size > bound, bound / np.where(size > 0, size, 1.0), 1.0)[:, None]
        bodies = list(zip(self.reduction.bodies, self.loads))
        work = np.concatenate([load.T @ body.motions for body, load in bodies], axis=1)
        if not work.shape[1]:
            return t
        works = (work.reshape(*t.shape, -1) * t[..., None]).sum(axis=1)  # (k, p)
        missing = -np.concatenate([body.resultants for body, _ in bodies]) - works.sum(axis=0)
        weight = np.abs(works).sum(axis=1)
        scaled = works / np.where(weight > 0, weight, 1.0)[:, None]
        change = scaled @ np.linalg.lstsq(works.T @ scaled, missing, rcond=1e-12)[0]
        if np.any(change < -1):
            raise InputError("the contact forces do not balance the bodies; solve more accurately.")
        return t * (1 + change)[:, None]


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


def guaranteed_bound(solved: Solved) -> Bound:
    """Bound the error of a solution in the energy norm, as in the head of this module.

    InputError, one sentence, for a scene or a mesh for which there is no bound.
    """
    found = _Scene(solved)
    reduction, problem, factor = found.reduction, found.problem, found.factor
    displaced = reduction.displaced(found.solution)
    multipliers = reduction.own_multipliers(found.solution.multipliers)
    before = found.nodal(displaced)
    after = _admissible(found, before)
    elements, moved, norm, unbalanced = [], 0.0, 0.0, 0.0
    pressed = found.tractions.ravel()
    for i, (body, cells, load) in enumerate(zip(reduction.bodies, found.cells, found.loads)):
        if cells is None or not isinstance(body, ElasticBody):
            elements.append(np.zeros(0))
            continue
        material = body.body.material
        loaded = body.displacement(load @ pressed, multipliers[i])
        stress = cells.stress(material, cells.quadratic(loaded[body.body.unknowns]))
        made, worst = cells.equilibrated(material, stress, *_boundary(found, i, cells))
        unbalanced = max(unbalanced, worst)
        own, new = (cells.data_of(cells.stress(material, nodal[i])) for nodal in (before, after))
        energies = [cells.energies(material, data) for data in (made - new, new - own, own)]
        elements.append(factor * energies[0])
        moved += factor * float(energies[1].sum())
        norm += factor * float(energies[2].sum())
    if unbalanced > UNBALANCED:
        raise InputError(
            f"the displacements are {unbalanced:.0e} out of balance, too much for a bound: take a"
            " direct solver of the bodies."
        )
    works = _works(found, after)
    u, r = reduction.seen(displaced), found.tractions * problem.areas[:, None]
    slip = problem.law.bound(r[:, 0]) * np.linalg.norm(u[:, 1:], axis=1)
    left = r[:, 0] * np.maximum(u[:, 0], 0.0) + slip + np.sum(r[:, 1:] * u[:, 1:], axis=1)
    solver = 2 * float(np.maximum(left, 0.0).sum())
    mesh = sum(float(own.sum()) for own in elements)
    contact, friction = (2 * max(own, 0.0) for own in works)
    terms = np.sqrt([mesh, contact, friction, solver, moved, norm])
    return Bound(*(float(term) for term in terms), tuple(elements))


def _admissible(found: _Scene, nodal: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The displacements with hat functions at vertices and bubbles between them that keep the gap
    from being negative, and close it where there is pressure.
    """
    at = _rule(found.problem.dim)[0]
    d, ends = len(at), list(combinations(range(len(at)), 2))
    bubble = np.sum([4 * at[i] * at[j] for i, j in ends], axis=0)
    out = [own.copy() for own in nodal]
    for pair in found.pairs:
        side, n, count = pair.lead, pair.frame[0], len(pair.areas)
        pressed = found.tractions[side.contacts + pair.contacts.start, 0] > 0  # (v, f)
        missing = -pair.jump(out, np.eye(d))[0].T
        lift = np.zeros(out[side.body].shape[1])
        lift[side.vertices] = np.where(pressed, missing, np.maximum(missing, 0.0))
        rest = -pair.jump(out, at)[0] - lift[side.vertices].T @ at
        height = np.max(rest / bubble, axis=1)
        height[~pressed.all(axis=0)] = np.maximum(height[~pressed.all(axis=0)], 0.0)
        own = np.full(len(lift), -np.inf)
        np.maximum.at(own, side.nodes[d:], np.broadcast_to(height, (len(ends), count)))
        middle = np.stack([lift[side.vertices[list(two)]].mean(axis=0) for two in ends])
        lift[side.nodes[d:]] = middle + own[side.nodes[d:]]
        out[side.body] += side.sign * n[:, None] * lift
    return out


def _works(found: _Scene, nodal: Sequence[np.ndarray]) -> tuple[float, float]:
    """The works int p* gap and int (g |slip| + t* slip) over all contact surfaces."""
    at, weights = _rule(found.problem.dim)
    bounds = found.problem.law.bound(found.tractions[:, 0] * found.problem.areas)
    limit = bounds / np.where(found.problem.areas > 0, found.problem.areas, 1.0)
    gaps, slips = 0.0, 0.0
    for pair in found.pairs:
        u = pair.jump(nodal, at)
        contacts = pair.lead.contacts + pair.contacts.start
        t = np.einsum("vfc,vs->cfs", found.tractions[contacts], at)
        g = np.einsum("vf,vs->fs", limit[contacts], at)
        measure = found.factor * pair.areas[:, None] * weights
        gaps += float(np.sum(measure * t[0] * u[0]))
        slip = g * np.linalg.norm(u[1:], axis=0) + np.sum(t[1:] * u[1:], axis=0)
        slips += float(np.sum(measure * slip))
    return gaps, slips


def _boundary(
    found: _Scene, number: int, cells: Simplices
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Body force (dim,), held components (facets, dim) and moments of tractions (facets, dim, dim)
    of a body, as Simplices.equilibrated() takes them.
    """
    scene, d, mesh = found.reduction.scene, cells.dim, cells.mesh
    part = scene.parts[number]
    assert isinstance(part, Part)
    force, components = np.zeros(d), scene.components
    held = np.zeros((mesh.facets.shape[1], d), dtype=bool)
    moments = np.zeros((*held.shape, d))
    edges = np.moveaxis(mesh.p[:, mesh.facets[1:]] - mesh.p[:, mesh.facets[:1]], 2, 0)
    gram = np.swapaxes(edges, 1, 2) @ edges
    areas = np.sqrt(np.linalg.det(gram)) / (1 if d == 2 else 2)
    holding = [
        (s.boundary, components if s.displacement is None else s.displacement)
        for s in part.supports
    ]
    for load in part.loads:
        if isinstance(load, Plate):
            holding.append((load.boundary, components if load.glued else load.force))
        elif isinstance(load, Traction):
            own = np.asarray(mesh.boundaries[load.boundary])
            moments[own] += areas[own, None, None] / d * np.asarray(load.value, dtype=float)
        else:
            force += np.asarray(load.value, dtype=float)
    for boundary, names in holding:
        for name in names:
            held[np.asarray(mesh.boundaries[boundary]), components.index(name)] = True
    for pair in found.pairs:
        for side in pair.sides:
            if side.body != number:
                continue
            t = found.tractions[side.contacts + pair.contacts.start] @ pair.frame  # (v, f, dim)
            own = side.sign * pair.areas[:, None] * (t + t.sum(axis=0)) / (d * (d + 1))
            slot = np.argsort(np.argsort(side.vertices, axis=0), axis=0)
            np.add.at(moments, (side.facets, slot), own)
    return force, held, moments
