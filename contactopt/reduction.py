"""From two bodies to the interface: u = Q r + V lambda + q by domain decomposition (paper, eqs (13)-(14)).

One sparse factorisation per body, its contact unknowns eliminated last: the trailing triangles of the factors are
then those of the Schur complement S, and C = S^-1 is the body's compliance. With T the map from displacements to
local contact frames (n, t1[, t2]) and sigma = +1 for the upper, -1 for the lower body,

    A U = f + sigma T' r   on the free unknowns,   U = lift + M lambda_plate on the others,
    u = sum sigma T U + gap n   ==>   Q = sum T C T',   q = sum sigma T U(r=0, lambda=0) + gap n.

A plate's motion, extended into the body by A (Z = M - A_ff^-1 A_f: M), meets the balance Z' A Z lambda = thrust +
Z' (f - A lift) + sigma (T Z)' r. Motions that no support resists (kernel of Z' A Z) become the multipliers of the
problem, V = sigma T Z and s = thrust + Z' (f - A lift); the others are condensed into Q and q.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu
from scipy.spatial import KDTree

from contactopt.body import Body, build_body
from contactopt.dissection import nested_dissection
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem
from contactopt.scene import Part, Rigid, Scene

MATCH = 1e-6  # nodes match within this fraction of the shortest distance between contact nodes
KERNEL = 1e-10  # a plate motion resisted by less than this fraction of the body's stiffness is free


@dataclass(frozen=True, eq=False)
class ReducedBody:
    """A factorised Body: U^P, compliance and plate motions; n unknowns, m of them free on the contact boundary.

    interface   (m,) unknowns of C;   compliance  (m, m) C = S^-1 [length / force]
    at_rest     (n,) displacement at r = 0, lambda = 0 [length]
    motions     (n, p) displacement fields Z of the free plate motions
    resultants  (p,) s
    soft        (n, j) plate motions with elastic resistance, scaled so that each adds soft soft' to the compliance
    """

    body: Body
    order: np.ndarray
    factors: SuperLU
    interface: np.ndarray
    compliance: np.ndarray
    at_rest: np.ndarray
    motions: np.ndarray
    resultants: np.ndarray
    soft: np.ndarray

    def solve(self, load: np.ndarray) -> np.ndarray:
        """A_ff^-1 load, zero on the prescribed unknowns; load (n,) or (n, j)."""
        return _solve(self.factors, self.order, load)

    def displacement(self, force: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """Displacement of all unknowns under nodal contact forces (n,) and plate displacements (p,), eq (13)."""
        elastic = self.solve(force) + self.soft @ (self.soft.T @ force)
        return np.asarray(self.at_rest + elastic + self.motions @ multipliers)


@dataclass(frozen=True, eq=False)
class Reduction:
    """An InterfaceProblem with what is needed to go back to the bodies.

    bodies    ReducedBody of the upper and the lower body, None where rigid
    nodes     contact nodes (k,) of each, in the order of the problem
    frames    (k, dim, dim) rows n, t1[, t2] at each contact
    plates    number of multipliers of each body
    seconds   phase -> time
    """

    scene: Scene
    problem: InterfaceProblem
    bodies: tuple[ReducedBody | None, ReducedBody | None]
    nodes: tuple[np.ndarray, np.ndarray]
    frames: np.ndarray
    plates: tuple[int, int]
    seconds: dict[str, float]

    @property
    def dofs(self) -> int:
        """Free displacement unknowns of both bodies."""
        return sum(len(b.body.free) for b in self.bodies if b is not None)


def _solve(factors: SuperLU, order: np.ndarray, load: np.ndarray) -> np.ndarray:
    out = np.zeros(load.shape)
    if load.size:
        out[order] = factors.solve(np.ascontiguousarray(load[order]))
    return out


def reduce(scene: Scene, elements: int | None = None, zone: float | None = None) -> InterfaceProblem:
    """The interface problem of a scene, Q explicit.

    elements  across the contact half-width (default: the scene's);  zone  half-width the meshes resolve [length].
    Raises InputError on input that cannot be modelled: unknown boundaries, a body free to move,
    nodes that do not match.
    """
    return reduce_bodies(scene, elements, zone).problem


def reduce_bodies(scene: Scene, elements: int | None = None, zone: float | None = None) -> Reduction:
    """As reduce(), keeping the factorised bodies for recovery. Both bodies are processed concurrently."""
    elements = scene.elements if elements is None else elements
    zone = scene.zone if zone is None else zone
    seconds: dict[str, float] = {}
    start = time.perf_counter()
    parts = (scene.upper, scene.lower)
    bodies = [build_body(scene, part, elements, zone) if isinstance(part, Part) else None for part in parts]
    nodes, frames, gap, areas = _interface(scene, *bodies)
    seconds["assemble"] = time.perf_counter() - start

    start = time.perf_counter()
    with ThreadPoolExecutor(2) as pool:
        reduced = list(pool.map(lambda body: None if body is None else reduce_body(body), bodies))
    seconds["factorise"] = time.perf_counter() - start

    start = time.perf_counter()
    k, dim = len(gap), scene.dim
    Q, q = np.zeros((k * dim, k * dim)), np.zeros((k, dim))
    q[:, 0] = gap
    columns, resultants, plates = [], [], []
    for part, body, own, sign in zip(parts, reduced, nodes, (1.0, -1.0)):
        if body is not None:
            T = _local_map(body.body.basis.nodal_dofs[:, own].T, frames, len(body.at_rest))
            _add_compliance(Q, T, body)
            q += sign * (T @ body.at_rest).reshape(k, dim)
            V, s = sign * (T @ body.motions), body.resultants
        else:
            V, s = _rigid_motions(part, scene, frames, sign)
        columns.append(V)
        resultants.append(s)
        plates.append(len(s))
    problem = InterfaceProblem(
        Q,
        q,
        np.full(k, float(scene.mu)),
        np.concatenate(columns, axis=1),
        np.concatenate(resultants),
        areas,
        _coordinates(bodies, nodes),
        scene.bilateral,
    )
    seconds["compliance"] = time.perf_counter() - start
    return Reduction(scene, problem, (reduced[0], reduced[1]), nodes, frames, (plates[0], plates[1]), seconds)


def reduce_body(body: Body) -> ReducedBody:
    """Factorise one body and condense it to its contact unknowns."""
    contact = np.intersect1d(body.contact_dofs, body.free)
    order = _elimination_order(body, contact)
    A = body.A[order][:, order].tocsc()
    factors = splu(A, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    compliance = _trailing_inverse(factors, len(contact))

    residual = body.load - body.A @ body.lift
    at_rest = body.lift + _solve(factors, order, residual)
    Z = body.motion - _solve(factors, order, body.A @ body.motion)
    K = Z.T @ (body.A @ Z)
    thrust = body.thrust + Z.T @ residual
    stiffness, modes = np.linalg.eigh((K + K.T) / 2)
    free = stiffness <= KERNEL * np.max(np.sum(body.motion * (body.A @ body.motion), axis=0), initial=0.0)
    soft = Z @ (modes[:, ~free] / np.sqrt(stiffness[~free]))
    at_rest = at_rest + soft @ ((modes[:, ~free] / np.sqrt(stiffness[~free])).T @ thrust)
    basis = np.eye(len(thrust)) if free.all() else modes[:, free]  # keep one multiplier per plate component
    motions = Z @ basis
    return ReducedBody(
        body, order, factors, order[len(order) - len(contact) :], compliance, at_rest, motions, basis.T @ thrust, soft
    )


def _elimination_order(body: Body, contact: np.ndarray) -> np.ndarray:
    """Free unknowns, interior by nested dissection, contact last."""
    dofs = np.asarray(body.basis.nodal_dofs)
    adjacency = body.A[dofs[0]][:, dofs[0]]
    interior = np.ones(dofs.shape[1], dtype=bool)
    interior[body.nodes] = False
    inside = np.flatnonzero(interior)
    pattern = sp.csr_matrix((np.ones(adjacency.nnz, np.int8), adjacency.indices, adjacency.indptr), adjacency.shape)
    nodes = inside[nested_dissection(pattern[inside][:, inside], body.basis.mesh.p[:, inside])]
    is_free = np.zeros(len(body.load), dtype=bool)
    is_free[body.free] = True
    ordered = np.concatenate([dofs[:, nodes].T.ravel(), dofs[:, body.nodes].T.ravel()])
    return np.asarray(ordered[is_free[ordered]])


def _trailing_inverse(factors: SuperLU, m: int) -> np.ndarray:
    """The trailing m x m block of A^-1 from the factors of A: the inverse of the Schur complement S = L U."""
    n = factors.shape[0]
    head = n - m
    symmetric = np.array_equal(factors.perm_c, factors.perm_r)
    if symmetric and np.array_equal(np.sort(factors.perm_c[head:]), np.arange(head, n)):
        L, U = factors.L[head:, head:].toarray(), factors.U[head:, head:].toarray()
        place = factors.perm_c[head:] - head
        # S = L U = L D L' with D the pivots: C = (L^-1)' D^-1 L^-1 keeps C symmetric.
        X = la.solve_triangular(L, np.eye(m), lower=True, unit_diagonal=True)
        C = (X / np.diag(U)[:, None]).T @ X
        return np.asarray(C[np.ix_(place, place)])
    unit = np.zeros((n, m))
    unit[head:] = np.eye(m)
    return np.asarray(factors.solve(unit)[head:])


def _local_map(dofs: np.ndarray, frames: np.ndarray, n: int) -> sp.csr_matrix:
    """T (k dim, n): displacements of a body -> components in the contact frames; dofs (k, dim)."""
    k, dim = dofs.shape
    rows = np.repeat(np.arange(k * dim), dim)
    columns = np.repeat(dofs, dim, axis=0).ravel()
    values = frames.ravel()
    keep = values != 0
    return sp.csr_matrix((values[keep], (rows[keep], columns[keep])), (k * dim, n))


def _add_compliance(Q: np.ndarray, T: sp.csr_matrix, body: ReducedBody) -> None:
    """Q += T (C + soft soft') T'."""
    local = T[:, body.interface]
    half = local @ body.compliance
    product = local @ half.T
    Q += (product + product.T) / 2
    if body.soft.shape[1]:
        soft = T @ body.soft
        Q += soft @ soft.T


def _rigid_motions(rigid: Any, scene: Scene, frames: np.ndarray, sign: float) -> tuple[np.ndarray, np.ndarray]:
    """V (k dim, p) and s (p,) of a rigid body under a total force."""
    force = rigid.force or {}
    k = len(frames)
    columns = [frames[:, :, scene.components.index(name)].reshape(k * scene.dim) for name in force]
    V = sign * np.stack(columns, axis=1) if columns else np.zeros((k * scene.dim, 0))
    return V, np.array(list(force.values()), dtype=float)


def _interface(scene: Scene, upper: Body | None, lower: Body | None) -> tuple[Any, ...]:
    """Matched contact nodes of both bodies, frames, initial gap and areas."""
    if upper is not None and lower is not None:
        own, other = _match(upper, lower)
        nodes = (upper.nodes[own], lower.nodes[other])
        normals = lower.normals[:, other]
        gap = np.sum(normals * (upper.points[:, own] - lower.points[:, other]), axis=0)
        areas = lower.areas[other]
    else:
        body, rigid, sign = (upper, scene.lower, -1.0) if upper is not None else (lower, scene.upper, 1.0)
        assert body is not None and isinstance(rigid, Rigid)
        own = np.lexsort(body.points)
        nodes = (body.nodes[own], body.nodes[own])
        normals = sign * body.normals[:, own]
        if rigid.normal is not None:
            normals = np.tile(np.array(rigid.normal)[:, None] / np.linalg.norm(rigid.normal), len(own))
        areas = body.areas[own]
        gap = np.zeros(len(own)) if rigid.gap is None else np.asarray(rigid.gap(body.points[:, own]), dtype=float)
        if gap.shape != (len(own),) or not np.all(np.isfinite(gap)):
            raise InputError(f"the gap of rigid body '{rigid.name}' must give one finite number per contact node.")
    return nodes, _frames(normals), gap, areas


def _match(upper: Body, lower: Body) -> tuple[np.ndarray, np.ndarray]:
    """Indices into both bodies' contact nodes such that partners lie on one normal; InputError if they do not."""
    mean = lower.normals @ lower.areas
    mean /= np.linalg.norm(mean)
    first, second = (b.points - np.outer(mean, mean @ b.points) for b in (upper, lower))
    order = np.lexsort(upper.points)
    distance, partner = KDTree(second.T).query(first.T[order])
    spacing = KDTree(second.T).query(second.T, k=2)[0][:, 1].min() if second.shape[1] > 1 else 1.0
    if len(order) != second.shape[1]:
        raise InputError(
            f"interface nodes do not match: body '{upper.name}' has {len(order)} contact nodes, "
            f"body '{lower.name}' has {second.shape[1]}; give both meshes the same nodes there."
        )
    if distance.max() > MATCH * max(spacing, 1e-300) or len(np.unique(partner)) < len(partner):
        raise InputError(
            f"interface nodes do not match: a contact node of body '{upper.name}' lies {distance.max():.3g} off "
            f"the normal through the nearest one of body '{lower.name}' (spacing {spacing:.3g}); "
            "give both meshes the same nodes there."
        )
    return order, partner


def _frames(normals: np.ndarray) -> np.ndarray:
    """Rows n, t1[, t2] per node; t1 is the first axis made orthogonal to n (in 2D: n turned clockwise)."""
    dim, k = normals.shape
    frames = np.zeros((k, dim, dim))
    frames[:, 0] = normals.T
    if dim == 2:
        frames[:, 1] = np.stack([normals[1], -normals[0]], axis=1)
        return frames
    steep = np.abs(normals[0]) > 0.9  # the first axis is nearly normal there: use the second
    axis = np.where(steep[:, None], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    t1 = axis - np.sum(axis * normals.T, axis=1)[:, None] * normals.T
    frames[:, 1] = t1 / np.linalg.norm(t1, axis=1)[:, None]
    frames[:, 2] = np.cross(frames[:, 0], frames[:, 1])
    return frames


def _coordinates(bodies: list[Body | None], nodes: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    body, own = (bodies[1], nodes[1]) if bodies[1] is not None else (bodies[0], nodes[0])
    assert body is not None
    return np.asarray(body.basis.mesh.p[:, own])
