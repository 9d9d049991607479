"""A V-cycle of smoothed aggregation for the stiffness of an elastic body, whose near-kernel are the rigid motions.

Meshes that are graded away from a contact have flat elements, and nodes far along their long sides hardly know of each
other. Only nodes close to each other in the measure of the mesh around them are aggregated, so that such elements are
coarsened along their short sides first. Every level is scaled to a unit diagonal and smoothed by Chebyshev polynomials
of the fourth kind, that is by products with sparse matrices, which leave Python's lock to other threads.

Sources: Vanek, Mandel, Brezina (1996), Algebraic multigrid by smoothed aggregation for second and fourth order elliptic
problems; Lottes (2023), Optimal polynomial smoothers for multigrid V-cycles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh

from contactopt.bodies.solvers.system import (
    Product,
    System,
    asked,
    block_product,
    inverse_block,
)
from contactopt.checks import check_number
from contactopt.errors import BackendError, InputError

MOST = 300  # conjugate gradient iterations
COARSEST = 60  # nodes or aggregates that are not coarsened further
NEAR = 1.5  # neighbours at up to this multiple of the least distance are aggregated
DEGREE = 3  # of the smoothing polynomial
RTOL = 1e-10  # default accuracy of an iterative solve


class MultigridSolver:
    """Conjugate gradients preconditioned by contactopt.bodies.solvers.multigrid (pip install pyamg).

    solve() ends where (r' B r)^1/2, r the residual and B the V-cycle, has fallen by `rtol`: an estimate of the error in
    the energy norm, relative to the solution's. BackendError if it does not get there.
    """

    name = "multigrid"

    def __init__(self, system: System):
        self.last = system.last
        self.iterations = 0
        self.cycle = VCycle(*system[:4])

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        rtol = RTOL if rtol is None else rtol
        check_number("rtol", rtol, low=0.0, high=1.0)
        columns = load.reshape(len(load), -1)
        out = np.zeros(columns.shape)
        self.iterations = 0
        for b, x in zip(columns.T, out.T):
            answer, steps = conjugate_gradients(self.cycle, self.cycle.scale * b, rtol)
            x[:] = self.cycle.scale * answer
            self.iterations = max(self.iterations, steps)
        return out.reshape(load.shape)

    def trailing_inverse(self) -> np.ndarray:
        return inverse_block(self, len(self.cycle.scale))

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        return block_product(self, asked(self.last), len(self.cycle.scale), load, rtol)

    def restricted(self, at: np.ndarray) -> Product:
        return lambda load, rtol: block_product(self, at, len(self.cycle.scale), load, rtol)


@dataclass(frozen=True, eq=False)
class Level:
    """A (n, n) scaled to a unit diagonal, its largest eigenvalue, and the prolongation P (n, coarse n) to it."""

    A: sp.csr_matrix
    largest: float
    P: sp.csr_matrix

    def smooth(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x = p(A) r close to A^-1 r for the upper eigenvalues, p of degree DEGREE - 1; r - A x = r' - A z: x, r', z."""
        z = 4 / (3 * self.largest) * r
        x = z.copy()
        for k in range(2, DEGREE + 1):
            r = r - self.A @ z
            z = (2 * k - 3) / (2 * k + 1) * z + (8 * k - 4) / ((2 * k + 1) * self.largest) * r
            x += z
        return x, r, z


class VCycle:
    """B, symmetric positive definite and spectrally close to the inverse of the scaled matrix.

    scale    (n,) s = diag(A)^-1/2;   A  (n, n) the scaled diag(s) A diag(s)
    levels   finest first;   coarsest  the inverse of the last level's matrix
    Arguments as in contactopt.bodies.solvers.system.System. Raises InputError if the package pyamg is missing.
    """

    def __init__(self, A: sp.csr_matrix, node: np.ndarray, component: np.ndarray, points: np.ndarray):
        self.scale = scale = _inverse_root(A.diagonal())
        self.A = _scaled(A, scale)
        self.levels: list[Level] = []
        blocks, place, present = nodal_blocks(A, node, component, len(points))
        points, modes = points[:, present], rigid_motions(points[:, present])
        modes[np.setdiff1d(np.arange(len(modes)), place)] = 0.0
        level = self.A
        while points.shape[1] > COARSEST:
            P, modes, points = coarsen(blocks, modes, points)
            blocks = P.T @ blocks @ P
            rows = P.tocsr() if self.levels else P.tocsr()[place]
            coarse = _inverse_root(blocks.diagonal())
            inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
            self.levels.append(Level(level, largest_eigenvalue(level), _scaled(rows, inverse, coarse)))
            level, scale = _scaled(blocks.tocsr(), coarse), coarse
        self.coarsest = la.pinvh(level.toarray(), rtol=1e-12)

    def apply(self, r: np.ndarray, depth: int = 0) -> np.ndarray:
        """B r on the levels from `depth` on: smooth, correct on the next level, smooth."""
        if depth == len(self.levels):
            return np.asarray(self.coarsest @ r)
        level = self.levels[depth]
        x, r, z = level.smooth(r)
        r = r - level.A @ z
        correction = level.P @ self.apply(level.P.T @ r, depth + 1)
        return np.asarray(x + correction + level.smooth(r - level.A @ correction)[0])

    @property
    def complexity(self) -> float:
        """Entries of the matrices of all levels over those of the finest."""
        return sum(level.A.nnz for level in self.levels) / self.A.nnz if self.levels else 1.0


def conjugate_gradients(cycle: VCycle, r: np.ndarray, rtol: float) -> tuple[np.ndarray, int]:
    """Solution of the scaled system for the right-hand side r (n,), and the number of iterations.

    Ends where (r' B r)^1/2, r the residual, has fallen by rtol; BackendError if it does not within MOST iterations.
    """
    x, p, size, goal = np.zeros(len(r)), np.zeros(len(r)), 1.0, None
    for step in range(MOST + 1):
        z = cycle.apply(r)
        size, previous = float(r @ z), size
        goal = rtol**2 * size if goal is None else goal
        if size <= goal:
            return x, step
        if not np.isfinite(size):
            break
        p = z + (size / previous) * p
        Ap = cycle.A @ p
        alpha = size / float(p @ Ap)
        x += alpha * p
        r = r - alpha * Ap
    raise BackendError(f"multigrid: the error was not reduced by {rtol:g} within {MOST} iterations.")


def coarsen(A: sp.bsr_matrix, modes: np.ndarray, points: np.ndarray) -> tuple[sp.bsr_matrix, np.ndarray, np.ndarray]:
    """Prolongation from the aggregates of nodes, and the modes and points of the aggregates.

    A (n, n) in blocks of nodes;  modes (n, j) it should represent exactly;  points (dim, nodes)
    """
    try:
        from pyamg.aggregation.aggregate import standard_aggregation
        from pyamg.aggregation.smooth import jacobi_prolongation_smoother
        from pyamg.aggregation.tentative import fit_candidates
    except ImportError as error:
        raise InputError(
            "the body solver 'multigrid' needs the package pyamg: pip install pyamg, or choose another."
        ) from error
    near = near_neighbours(A, points)
    groups = standard_aggregation(near)[0]
    tentative, modes = fit_candidates(groups, modes)
    P = jacobi_prolongation_smoother(A, tentative, near, modes, filter_entries=True, weighting="local")
    return P, modes, np.asarray((points @ groups) / groups.sum(axis=0))


def near_neighbours(A: sp.bsr_matrix, points: np.ndarray) -> sp.csr_matrix:
    """Neighbours in the graph of A at no more than NEAR times the distance of the nearest one, and each node itself.

    The nearest neighbour of either node counts, so that the pattern is symmetric.
    """
    count = points.shape[1]
    row, column = np.repeat(np.arange(count), np.diff(A.indptr)), A.indices
    distance = np.linalg.norm(points[:, row] - points[:, column], axis=0)
    distance[row == column] = np.inf
    least = np.minimum.reduceat(distance, A.indptr[:-1])
    keep = (distance <= NEAR * np.maximum(least[row], least[column])) | (row == column)
    return sp.csr_matrix((np.ones(keep.sum()), (row[keep], column[keep])), (count, count))


def rigid_motions(points: np.ndarray) -> np.ndarray:
    """Translations and rotations at points (dim, k), as columns (k dim, 3 or 6), the unknowns of a point in a row.

    An axisymmetric body keeps the motions of its section: its hoop strain is small across a few elements.
    """
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


def largest_eigenvalue(A: sp.csr_matrix) -> float:
    """A little more than the largest eigenvalue of a symmetric matrix, by Lanczos' method."""
    start = np.random.default_rng(0).standard_normal(A.shape[0])
    return 1.02 * float(eigsh(A, 1, which="LA", v0=start, tol=1e-2, return_eigenvectors=False)[0])


def nodal_blocks(
    A: sp.csr_matrix, node: np.ndarray, component: np.ndarray, dim: int
) -> tuple[sp.bsr_matrix, np.ndarray, np.ndarray]:
    """A in blocks of nodes, the place of each unknown there, the nodes present; held unknowns are rows of their own."""
    present, own = np.unique(node, return_inverse=True)
    place = own * dim + component
    size = len(present) * dim
    spread = sp.csr_matrix((np.ones(len(own)), (place, np.arange(len(own)))), (size, len(own)))
    held = np.full(size, np.median(A.diagonal()))
    held[place] = 0.0
    return (spread @ A @ spread.T + sp.diags(held)).tobsr((dim, dim)), place, present


def _inverse_root(diagonal: np.ndarray) -> np.ndarray:
    """diagonal^-1/2; 0 for the motions that an aggregate of too few nodes does not have."""
    there = diagonal > 1e-10 * diagonal.max()
    return np.divide(1.0, np.sqrt(diagonal, where=there, out=np.ones_like(diagonal)), where=there, out=0 * diagonal)


def _scaled(A: sp.csr_matrix, rows: np.ndarray, columns: np.ndarray | None = None) -> sp.csr_matrix:
    """diag(rows) A diag(columns), columns = rows if None."""
    values = A.data * (rows if columns is None else columns)[A.indices]
    values *= np.repeat(rows, np.diff(A.indptr))
    return sp.csr_matrix((values, A.indices, A.indptr), A.shape)
