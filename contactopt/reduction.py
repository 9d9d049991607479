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
from scipy.sparse.linalg import LinearOperator, SuperLU, splu

from contactopt.body import Body, build_body
from contactopt.dissection import nested_dissection
from contactopt.interface import match_bodies, positions
from contactopt.problem import InterfaceProblem
from contactopt.scene import Part, Scene

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

    def elastic(self, force: np.ndarray) -> np.ndarray:
        """Displacement (n,) under nodal forces (n,) with the free plates at rest; prescribed unknowns do not move."""
        return np.asarray(self.solve(force) + self.soft @ (self.soft.T @ force))

    def displacement(self, force: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """Displacement of all unknowns under nodal contact forces (n,) and plate displacements (p,), eq (13)."""
        return np.asarray(self.at_rest + self.elastic(force) + self.motions @ multipliers)


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
    def operator(self) -> LinearOperator:
        """Q as products by body solves, (k dim, k dim): one forward and one backward substitution per body."""
        size = self.problem.q.size
        pairs = [(b, n) for b, n in zip(self.bodies, self.nodes) if b is not None]
        maps = [(b, _local_map(b.body.basis.nodal_dofs[:, n].T, self.frames, len(b.at_rest))) for b, n in pairs]

        def product(r: np.ndarray) -> np.ndarray:
            return np.sum([T @ body.elastic(T.T @ r.ravel()) for body, T in maps], axis=0)

        return LinearOperator((size, size), matvec=product, rmatvec=product, dtype=float)

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
    nodes, frames, gap, areas = match_bodies(scene, *bodies)
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
        positions(bodies, nodes),
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
