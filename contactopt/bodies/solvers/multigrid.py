"""Multigrid by smoothed aggregation for the stiffness of an elastic body, whose near-kernel are the
rigid motions.

Meshes that are graded away from a contact have flat elements, and nodes far along their long sides
hardly know of each other. Only nodes close to each other in the measure of the mesh around them are
aggregated, so that such elements are coarsened along their short sides first. Every level is scaled
to a unit diagonal and smoothed by Chebyshev polynomials of the fourth kind, that is by products
with sparse matrices, which leave Python's lock to other threads.

The V-cycle works in single precision: it only has to come close to the inverse, and its time is the
time to read its matrices. The conjugate gradients around it work in double precision with the
matrix of the body itself.

Sources: Vanek, Mandel, Brezina (1996), Algebraic multigrid by smoothed aggregation for second and
fourth order elliptic problems; Lottes (2023), Optimal polynomial smoothers for multigrid V-cycles.
"""

from dataclasses import dataclass
from threading import Lock
from typing import NamedTuple

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigsh

from contactopt.bodies.motions import rigid_fields
from contactopt.bodies.solvers.constants import (
    COARSEST,
    DEGREE,
    MOST_ITERATIONS,
    NEAR,
    RTOL,
    TELLING,
    USUAL,
)
from contactopt.bodies.solvers.sparse_products import BlockProduct, SparseProduct, galerkin
from contactopt.bodies.solvers.system import INDEFINITE, Act, BodySolver, Submatrix, System
from contactopt.checks import check_number
from contactopt.errors import BackendError, InputError
from contactopt.linear.budget import expect, spend
from contactopt.linear.concurrency import Crew, give_back

SINGLE = np.float32
IMPORTING = Lock()  # of two threads that import pyamg at once one may see half of it


class MultigridSolver(BodySolver):
    """Conjugate gradients preconditioned by a V-cycle, which needs the package pyamg.

    A solve ends as `conjugate_gradients` says; that estimates the error in the energy norm,
    relative to that of the solution. A are products with the (n, n) matrix in double precision,
    cycle is the VCycle.
    """

    name = "multigrid"
    iterative = True
    releases_lock = True

    def __init__(self, system: System):
        super().__init__(system)
        crew = Crew()
        block = isinstance(system.A, Submatrix)
        self.A = BlockProduct(system.A, crew) if block else SparseProduct(system.A, crew)
        self.cycle = VCycle(*system[:4], crew)

    @property
    def iteration(self) -> tuple[Act, Act]:
        return self.A.__matmul__, self.cycle.apply

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        rtol = RTOL if rtol is None else rtol
        check_number("rtol", rtol, low=0.0, high=1.0)
        out = np.zeros(load.shape)
        for b, x in zip(load.reshape(self.n, -1).T, out.reshape(self.n, -1).T):
            x[:], cycles = conjugate_gradients(self.A, self.cycle, b, rtol)
            if rtol <= TELLING:
                expect(slower=cycles / (USUAL * -np.log10(rtol)))
        return out


@dataclass(frozen=True, eq=False)
class Level:
    """One level of the hierarchy, in single precision.

    A        products with the (n, n) matrix, scaled to a unit diagonal
    largest  a little more than the largest eigenvalue of A
    P, R     prolongation (n, coarse n) from the next level, and its transpose
    """

    A: SparseProduct
    largest: np.floating
    P: SparseProduct
    R: SparseProduct

    def smooth(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x = p(A) r, close to A^-1 r for upper eigenvalues, and r', z: r - A x = r' - A z."""
        z = SINGLE(4 / 3) / self.largest * r
        x = z.copy()
        for k in range(2, DEGREE + 1):
            r = r - self.A @ z
            z = (
                SINGLE((2 * k - 3) / (2 * k + 1)) * z
                + SINGLE((8 * k - 4) / (2 * k + 1)) / self.largest * r
            )
            x += z
        return x, r, z


class VCycle:
    """B, symmetric positive definite up to single precision and spectrally close to the inverse of
    A.

    place     (n,) of each unknown among those of all nodes present, nodes one after the other; held
              unknowns have a place too, and a row of their own that nothing else touches
    scale     (n,) diag(A)^-1/2
    levels    finest first;   coarsest  the inverse of the last level's matrix

    Arguments as in contactopt.bodies.solvers.system.System, and the threads that share large
    products.
    """

    def __init__(
        self,
        A: sp.csr_matrix | Submatrix,
        node: np.ndarray,
        component: np.ndarray,
        points: np.ndarray,
        crew: Crew,
    ):
        blocks, self.place, present = nodal_blocks(A, node, component, len(points))
        self.scale = _inverse_root(A.diagonal())
        self.size = blocks.shape[0]
        self.levels: list[Level] = []
        points, modes = points[:, present], rigid_motions(points[:, present])
        modes[np.setdiff1d(np.arange(self.size), self.place)] = 0.0
        scale = _inverse_root(blocks.diagonal())
        while points.shape[1] > COARSEST:
            P, modes, points = _coarsen(blocks, modes, points)
            give_back()
            coarse = galerkin(P, blocks, crew)
            beyond = _inverse_root(coarse.diagonal())
            _scale(blocks, scale, scale)
            level = SparseProduct(blocks, crew)
            _scale(P, np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0), beyond)
            products = SparseProduct(P, crew), SparseProduct(P.T, crew)
            self.levels.append(Level(level, SINGLE(_largest_eigenvalue(level)), *products))
            blocks, scale = coarse, beyond
            give_back()
        dense = blocks.toarray() * scale * scale[:, None]
        self.coarsest = la.pinvh(dense, rtol=1e-12).astype(SINGLE)

    def apply(self, r: np.ndarray) -> np.ndarray:
        """B r for a residual r (n,), scaled to one: single precision has small exponents."""
        size = float(np.abs(r).max(initial=0.0))
        if size == 0.0:
            return np.zeros(len(r))
        spend(len(r))
        full = np.zeros(self.size, dtype=SINGLE)
        full[self.place] = self.scale * r / size
        return self.scale * size * self._correct(full, 0)[self.place]

    def _correct(self, r: np.ndarray, depth: int) -> np.ndarray:
        """Smooth, correct on the next level, smooth, from the level `depth` on."""
        if depth == len(self.levels):
            return np.asarray(self.coarsest @ r)
        level = self.levels[depth]
        x, r, z = level.smooth(r)
        r = r - level.A @ z
        correction = level.P @ self._correct(level.R @ r, depth + 1)
        return np.asarray(x + correction + level.smooth(r - level.A @ correction)[0])

    @property
    def complexity(self) -> float:
        """Entries of the matrices of all levels over those of the finest."""
        entries = [level.A.matrix.nnz for level in self.levels]
        return sum(entries) / entries[0] if entries else 1.0


class Iterated(NamedTuple):
    """Solution x (n,) of a linear system and the number of V-cycles that it took."""

    x: np.ndarray
    cycles: int


def conjugate_gradients(
    A: SparseProduct | BlockProduct, cycle: VCycle, load: np.ndarray, rtol: float
) -> Iterated:
    """Solve A x = load, load (n,) [force], by conjugate gradients with a V-cycle B.

    It ends where (r' B r)^1/2, with the residual r, has fallen by `rtol`; BackendError if it does
    not get there within MOST_ITERATIONS iterations, if r' B r is negative or not a number, or if A
    is found not to be positive definite.
    TooDear instead, where a budget is open.
    """
    r = np.array(load, dtype=float)
    x, p, size, goal = np.zeros(len(r)), np.zeros(len(r)), 1.0, None
    for step in range(MOST_ITERATIONS + 1):
        z = cycle.apply(r)
        size, previous = _dot(r, z), size
        goal = rtol**2 * size if goal is None else goal
        if 0 <= size <= goal:
            return Iterated(x, step)
        if not 0 < size < np.inf:
            expect(slower=np.inf)
            raise BackendError(
                "multigrid: the V-cycle is not positive definite here; take a solver with factors."
            )
        p = z + (size / previous) * p
        Ap = A @ p
        curvature = _dot(p, Ap)
        if curvature <= 0:
            raise BackendError(f"multigrid: {INDEFINITE}.")
        alpha = size / curvature
        x += alpha * p
        r -= alpha * Ap
    expect(slower=np.inf)
    raise BackendError(
        f"multigrid: the error was not reduced by {rtol:g} within {MOST_ITERATIONS} iterations."
    )


def _dot(x: np.ndarray, y: np.ndarray) -> float:
    """x' y without BLAS, whose threads would spin until the next call."""
    return float(np.einsum("i,i", x, y))


def _coarsen(
    A: sp.bsr_matrix, modes: np.ndarray, points: np.ndarray
) -> tuple[sp.bsr_matrix, np.ndarray, np.ndarray]:
    """Prolongation from aggregates of nodes, which represents the modes, and their points."""
    try:
        with IMPORTING:
            from pyamg.aggregation.aggregate import standard_aggregation
            from pyamg.aggregation.tentative import fit_candidates
    except ImportError as error:
        raise InputError(
            "the body solver 'multigrid' needs the package pyamg: pip install pyamg, or choose"
            " another."
        ) from error
    near = _near(A, points)
    groups = standard_aggregation(_pattern(A, near))[0]
    tentative, modes = fit_candidates(groups, modes)
    P = _smoothed(A, near, tentative, modes)
    return P, modes, np.asarray((points @ groups) / groups.sum(axis=0))


def _smoothed(
    A: sp.bsr_matrix, near: np.ndarray, tentative: sp.bsr_matrix, modes: np.ndarray
) -> sp.bsr_matrix:
    """A tentative prolongation T after one step of Jacobi's method: T - U, with U = D^-1 F T made
    orthogonal to the coarse modes row by row, so that it keeps representing them.

    F has the blocks of A that are marked as near only, and D is 3/4 of the sums of its rows' sizes.
    pyamg's jacobi_prolongation_smoother does the same, in several times the memory.
    """
    from pyamg.aggregation.smooth import satisfy_constraints
    from pyamg.util.utils import compute_BtBinv

    indptr, row = _starts(A, near), _rows_of(A)[near]
    values = A.data[near]
    sizes = np.add.reduceat(np.abs(values).sum(axis=2), indptr[:-1])
    values *= np.divide(4 / 3, sizes, out=np.zeros_like(sizes), where=sizes > 0)[row][:, :, None]
    F = sp.bsr_matrix((values, A.indices[near], indptr), A.shape)
    U = (F @ tentative.astype(A.dtype)).astype(float)
    del F, values, row, sizes  # which take more than what follows
    satisfy_constraints(U, modes, compute_BtBinv(modes, U))
    return sp.bsr_matrix(tentative - U).astype(A.dtype)


def _near(A: sp.bsr_matrix, points: np.ndarray) -> np.ndarray:
    """Marks blocks of A of nodes within NEAR times the distance of the nearest one of either."""
    row, column = _rows_of(A), A.indices
    distance = np.zeros(len(row))
    for x in points:
        distance += (x[row] - x[column]) ** 2
    np.sqrt(distance, out=distance)
    distance[row == column] = np.inf
    least = np.minimum.reduceat(distance, A.indptr[:-1])
    return np.asarray((distance <= NEAR * np.maximum(least[row], least[column])) | (row == column))


def _pattern(A: sp.bsr_matrix, chosen: np.ndarray) -> sp.csr_matrix:
    """Ones where A has a block that is chosen, in ascending columns."""
    count, indices = len(A.indptr) - 1, A.indices[chosen]
    ones = np.ones(len(indices), dtype=np.int8)
    pattern = sp.csr_matrix((ones, indices, _starts(A, chosen)), (count, count))
    pattern.sort_indices()
    return pattern


def _rows_of(A: sp.bsr_matrix) -> np.ndarray:
    """Row of each block."""
    return np.repeat(np.arange(len(A.indptr) - 1, dtype=np.int32), np.diff(A.indptr))


def _starts(A: sp.bsr_matrix, chosen: np.ndarray) -> np.ndarray:
    """Where the rows start in a list of the chosen blocks of A."""
    return np.concatenate([[0], np.cumsum(chosen)])[A.indptr].astype(A.indptr.dtype)


def rigid_motions(points: np.ndarray) -> np.ndarray:
    """The translations and rotations of points (dim, k) as columns, (k dim, 3 or 6)."""
    fields = rigid_fields(points)
    return fields.swapaxes(0, 1).reshape(-1, fields.shape[2])


def _largest_eigenvalue(A: SparseProduct) -> float:
    """A little more than the largest eigenvalue of a symmetric matrix, by Lanczos' method."""
    n = A.matrix.shape[0]
    start = np.random.default_rng(0).standard_normal(n).astype(A.matrix.dtype)
    operator = LinearOperator((n, n), matvec=lambda x: A @ x.ravel(), dtype=A.matrix.dtype)
    return 1.02 * float(
        eigsh(operator, 1, which="LA", v0=start, tol=1e-2, return_eigenvectors=False)[0]
    )


def nodal_blocks(
    A: sp.csr_matrix | Submatrix, node: np.ndarray, component: np.ndarray, dim: int
) -> tuple[sp.bsr_matrix, np.ndarray, np.ndarray]:
    """A matrix in single precision and blocks of k nodes, the places (n,) in it, the nodes (k,)."""
    present, own = np.unique(node, return_inverse=True)
    place, size = own * dim + component, len(present) * dim
    held = np.full(size, np.median(A.diagonal()))
    held[place] = 0.0
    if isinstance(A, Submatrix):
        blocks = getattr(A.whole, "blocksize", ()) == (dim, dim)
        if blocks and np.array_equal(A.kept, node * dim + component):
            return _masked(A.whole, present, held), place, present
        A = A.whole[A.kept][:, A.kept]
    entries = sp.coo_matrix(A)
    row, column = place[entries.row], place[entries.col]
    wide = sp.coo_matrix((entries.data, (row, column)), (size, size)) + sp.diags(held)
    return wide.astype(SINGLE).tobsr((dim, dim)), place, present


def _masked(whole: sp.bsr_matrix, present: np.ndarray, held: np.ndarray) -> sp.bsr_matrix:
    """The blocks of the nodes present (k,), where unknowns may have rows of their own."""
    dim = whole.blocksize[0]
    there = np.zeros(whole.shape[0] // dim, dtype=bool)
    there[present] = True
    chosen = there[_rows_of(whole)] & there[whole.indices]
    indptr = _starts(whole, chosen)[np.append(present, len(there))]
    indices = (np.cumsum(there, dtype=np.int32) - 1)[whole.indices[chosen]]
    blocks = sp.bsr_matrix((whole.data.astype(SINGLE)[chosen], indices, indptr), 2 * held.shape)
    _scale(blocks, held == 0, held == 0)
    own, c = np.flatnonzero(_rows_of(blocks) == indices), np.arange(dim)
    blocks.data[own[:, None], c, c] += held.astype(SINGLE).reshape(-1, dim)
    return blocks


def _inverse_root(diagonal: np.ndarray) -> np.ndarray:
    """diagonal^-1/2; 0 for the motions that an aggregate of too few nodes does not have."""
    diagonal = diagonal.astype(float)
    there = diagonal > 1e-10 * diagonal.max()
    root = np.sqrt(diagonal, where=there, out=np.ones_like(diagonal))
    return np.where(there, 1.0 / root, 0.0)


def _scale(A: sp.bsr_matrix, rows: np.ndarray, columns: np.ndarray) -> None:
    """Replace A by diag(rows) A diag(columns), without a copy."""
    height, width = A.blocksize
    A.data *= rows.astype(A.dtype).reshape(-1, height, 1)[_rows_of(A)]
    A.data *= columns.astype(A.dtype).reshape(-1, 1, width)[A.indices]
