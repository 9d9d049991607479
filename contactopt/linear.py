"""The linear system A x = b of one elastic body behind one seam: sparse Cholesky-like factors or multigrid.

A is the stiffness on the free displacement unknowns, symmetric positive definite. Every solver is made by a function
of SOLVERS from

    A          (n, n) sparse [force / length]
    node       (n,) mesh node of each unknown;   component  (n,) its component, 0 .. dim - 1
    points     (dim, nodes) coordinates of the mesh nodes
    last       (m,) unknowns whose block of the inverse is asked for (the contact unknowns), or None
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.dissection import nested_dissection
from contactopt.errors import BackendError, InputError

RTOL = 1e-10  # default accuracy of an iterative solve


class BodySolver(Protocol):
    """Solves A x = b. Different solvers may work in different threads; one solver serves one thread at a time.

    name        its name in SOLVERS
    iterations  conjugate gradient iterations of the last call of `solve`, the most of any column; 0 for factors
    """

    name: str
    iterations: int

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """A^-1 load; load (n,) or (n, j). `rtol` (None: 1e-10) bounds an iterative solver's error, see there."""

    def trailing_inverse(self) -> np.ndarray:
        """The block of A^-1 on the unknowns `last`, in their order, (m, m) symmetric; InputError without `last`."""


def make_solver(
    name: str,
    A: sp.csr_matrix,
    node: np.ndarray,
    component: np.ndarray,
    points: np.ndarray,
    last: np.ndarray | None = None,
) -> BodySolver:
    """The solver `name`, a key of SOLVERS or 'auto'; arguments as in the head of this module.

    Raises InputError for an unknown name or a missing package.
    """
    if name == "auto":
        name = choose(A.shape[0], len(points))
    if name not in SOLVERS:
        raise InputError(f"unknown body solver {name!r}; choose from auto, {', '.join(SOLVERS)}.")
    return SOLVERS[name](A, node, component, points, last)


def choose(n: int, dim: int) -> str:
    """The solver for n unknowns in `dim` dimensions."""
    return "superlu" if dim == 2 or n <= 100_000 else "multigrid"


class SuperLUSolver:
    """Factors of A in an order of nested dissection, `last` eliminated last: their triangles give its Schur complement."""

    name = "superlu"
    iterations = 0

    def __init__(
        self,
        A: sp.csr_matrix,
        node: np.ndarray,
        component: np.ndarray,
        points: np.ndarray,
        last: np.ndarray | None = None,
    ):
        self.last = last
        self.order = elimination_order(A, node, component, points, np.zeros(0, int) if last is None else last)
        ordered = A[self.order][:, self.order].tocsc()
        self.factors = splu(ordered, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        out = np.zeros(load.shape)
        if load.size:
            out[self.order] = self.factors.solve(np.ascontiguousarray(load[self.order]))
        return out

    def trailing_inverse(self) -> np.ndarray:
        factors, m = self.factors, len(_asked(self.last))
        n = factors.shape[0]
        head = n - m
        symmetric = np.array_equal(factors.perm_c, factors.perm_r)
        if not symmetric or not np.array_equal(np.sort(factors.perm_c[head:]), np.arange(head, n)):
            return _inverse_block(self, n)
        L, U = factors.L[head:, head:].toarray(), factors.U[head:, head:].toarray()
        place = factors.perm_c[head:] - head
        # S = L U = L D L' with D > 0 the pivots: S^-1 = X' X, X = D^-1/2 L^-1; NumPy keeps X' X symmetric.
        X = la.solve_triangular(L, np.eye(m), lower=True, unit_diagonal=True) / np.sqrt(np.diag(U))[:, None]
        C = X.T @ X
        return np.asarray(C[np.ix_(place, place)])


def elimination_order(
    A: sp.csr_matrix, node: np.ndarray, component: np.ndarray, points: np.ndarray, last: np.ndarray
) -> np.ndarray:
    """Permutation of the unknowns: nested dissection of the nodes without any of `last`, then the rest, then `last`."""
    present, own = np.unique(node, return_inverse=True)
    inside = np.ones(len(present), dtype=bool)
    inside[own[last]] = False
    gather = sp.csr_matrix((np.ones(len(own), np.int32), (own, np.arange(len(own)))), (len(present), len(own)))
    pattern = sp.csr_matrix((np.ones(A.nnz, np.int32), A.indices, A.indptr), A.shape)
    graph = (gather @ pattern @ gather.T).tocsr()[inside][:, inside]
    graph.data = np.ones(graph.nnz, np.int8)
    rank = np.full(len(present), len(present))
    rank[np.flatnonzero(inside)[nested_dissection(graph, points[:, present[inside]])]] = np.arange(inside.sum())
    order = np.lexsort((component, rank[own]))
    final = np.zeros(len(own), dtype=bool)
    final[last] = True
    return np.concatenate([order[~final[order]], last])


class PardisoSolver:
    """Cholesky factors of Intel's oneMKL PARDISO in its own nested dissection order (pip install pypardiso)."""

    name = "pardiso"
    iterations = 0

    def __init__(
        self,
        A: sp.csr_matrix,
        node: np.ndarray,
        component: np.ndarray,
        points: np.ndarray,
        last: np.ndarray | None = None,
    ):
        try:
            from pypardiso import PyPardisoSolver
        except ImportError as error:
            raise InputError("the body solver 'pardiso' needs the package pypardiso: pip install pypardiso.") from error
        self.last = last
        self.upper = sp.triu(A, format="csr")
        self.factors = PyPardisoSolver(mtype=2)  # real, symmetric positive definite
        self.factors.factorize(self.upper)
        weakref.finalize(self, self.factors.free_memory, everything=True)  # MKL's memory is not Python's

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        if not load.size:
            return np.zeros(load.shape)
        return np.asarray(self.factors.solve(self.upper, np.asfortranarray(load, dtype=float)))

    def trailing_inverse(self) -> np.ndarray:
        return _inverse_block(self, self.upper.shape[0])


class MultigridSolver:
    """Conjugate gradients preconditioned by smoothed aggregation with the rigid motions (pip install pyamg).

    solve() ends where |b - A x| <= rtol |b|; BackendError if it does not get there.
    """

    name = "multigrid"

    def __init__(
        self,
        A: sp.csr_matrix,
        node: np.ndarray,
        component: np.ndarray,
        points: np.ndarray,
        last: np.ndarray | None = None,
    ):
        try:
            import pyamg
        except ImportError as error:
            raise InputError("the body solver 'multigrid' needs the package pyamg: pip install pyamg.") from error
        self.last = last
        self.iterations = 0
        self.A = A
        dim = len(points)
        present, own = np.unique(node, return_inverse=True)
        self.place = own * dim + component
        size = len(present) * dim
        where = sp.csr_matrix((np.ones(len(own)), (self.place, np.arange(len(own)))), (size, len(own)))
        held = np.ones(size)
        held[self.place] = 0.0
        full = (where @ A @ where.T + sp.diags(held * np.median(A.diagonal()))).tobsr((dim, dim))
        modes = rigid_motions(points[:, present])
        modes[held > 0] = 0.0
        self.hierarchy = pyamg.smoothed_aggregation_solver(
            full, modes, improve_candidates=None, max_coarse=300, coarse_solver="pinv"
        )
        self.cycle = self.hierarchy.aspreconditioner()

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        from scipy.sparse.linalg import LinearOperator, cg

        columns = load.reshape(len(load), -1)
        out = np.zeros(columns.shape)
        n = self.A.shape[0]
        counts = [0] * columns.shape[1]

        def apply(r: np.ndarray) -> np.ndarray:
            full = np.zeros(self.cycle.shape[0])
            full[self.place] = r
            return np.asarray((self.cycle @ full)[self.place])

        for j in range(columns.shape[1]):

            def count(_: Any, j: int = j) -> None:
                counts[j] += 1

            out[:, j], info = cg(
                self.A,
                columns[:, j],
                rtol=RTOL if rtol is None else rtol,
                maxiter=500,
                M=LinearOperator((n, n), matvec=apply),
                callback=count,
            )
            if info:
                raise BackendError("multigrid: conjugate gradients did not converge.")
        self.iterations = max(counts, default=0)
        return out.reshape(load.shape)

    def trailing_inverse(self) -> np.ndarray:
        return _inverse_block(self, self.A.shape[0])


def rigid_motions(points: np.ndarray) -> np.ndarray:
    """Translations and rotations at points (dim, k), as columns (k dim, 3 or 6), unknowns of a point in a row."""
    dim, k = points.shape
    x = points - points.mean(axis=1, keepdims=True)
    x = x / (np.abs(x).max(initial=0.0) or 1.0)
    columns = [np.repeat(np.eye(dim)[:, [i]], k, axis=1) for i in range(dim)]
    for i in range(dim):
        for j in range(i):
            turn = np.zeros((dim, k))
            turn[i], turn[j] = x[j], -x[i]
            columns.append(turn)
    return np.stack([c.T.ravel() for c in columns], axis=1)


def _asked(last: np.ndarray | None) -> np.ndarray:
    if last is None:
        raise InputError("no unknowns were named whose block of the inverse is asked for; give `last`.")
    return last


def _inverse_block(solver: Any, n: int, columns: int = 64) -> np.ndarray:
    """The block of the inverse on solver.last by solves with unit loads, some columns at a time."""
    last = _asked(solver.last)
    C = np.empty((len(last), len(last)))
    for start in range(0, len(last), columns):
        chosen = last[start : start + columns]
        unit = np.zeros((n, len(chosen)))
        unit[chosen, np.arange(len(chosen))] = 1.0
        C[:, start : start + columns] = solver.solve(unit)[last]
    return np.asarray((C + C.T) / 2)


SOLVERS: dict[str, Callable[..., BodySolver]] = {
    "superlu": SuperLUSolver,
    "pardiso": PardisoSolver,
    "multigrid": MultigridSolver,
}
