"""Linear systems diag(left) Q + diag(added), both block diagonal, with Q an array or sparse.

Newton's and interior-point methods solve many of them. For a sparse Q the pattern of its blocks,
the order of elimination and the places of its entries are found once; a system then costs a few
array operations and one sparse LU factorisation (SuperLU).
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse.linalg import splu

from contactopt.linear.operators import Interface, form
from contactopt.methods.constants import FULL, SMALL

# A diagonal entry this much smaller than the largest of its column is still a pivot: other pivots
# destroy the order of elimination, and the factors fill.
PIVOT = 1e-4


# a factorised block system: right-hand sides (m, j) -> x (m, j)
Solver: TypeAlias = Callable[[np.ndarray], np.ndarray]
# V (m, p), B (m, p) and balance (p,) of a bordered system
Border: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]


def assembled(
    Q: np.ndarray, left: np.ndarray | None, added: np.ndarray, kept: np.ndarray
) -> np.ndarray:
    """Rows and columns `kept` (n,) of diag(left) Q + diag(added) as an array; left None is I."""
    k, d = added.shape[:2]
    used = kept.reshape(k, d).any(axis=1)
    if not used.all():  # only their contacts, then only their components
        rows = np.flatnonzero(np.repeat(used, d))
        Q, added, kept = Q[rows][:, rows], added[used], kept[rows]
        left, k = None if left is None else left[used], len(added)
    n = k * d
    A = Q.copy() if left is None else (left @ Q.reshape(k, d, n)).reshape(n, n)
    own = np.arange(k)
    A.reshape(k, d, k, d)[own, :, own, :] += added
    return A if kept.all() else A[kept][:, kept]


def factorised(A: np.ndarray) -> Solver | None:
    """The solver with an array A (n, n), which is overwritten; None if A is singular."""
    if not len(A):
        return lambda right: right
    lu, swapped, info = dgetrf(np.ascontiguousarray(A).T, overwrite_a=True)
    if info:
        return None
    return lambda right: np.asarray(dgetrs(lu, swapped, right, trans=1)[0])


class Blocks:
    """Q (n, n) in blocks of d."""

    Q: Interface
    d: int

    def factor(self, left: np.ndarray | None, added: np.ndarray, kept: np.ndarray) -> Solver | None:
        """Solver of rows and columns `kept` of diag(left) Q + diag(added); left None is I."""
        raise NotImplementedError

    def solve(
        self,
        left: np.ndarray,
        added: np.ndarray,
        kept: np.ndarray,
        right: np.ndarray,
        border: Border,
        regular: bool,
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """x (m,) and lambda (p,) of A x + B lambda = right, V' x = balance, with A the system of
        `factor` and `border` V, B, balance; None if singular. Where A is `regular` lambda need not
        be unique.
        """
        solver = self.factor(left, added, kept)
        return None if solver is None else bordered(solver, right, *border)


class DenseBlocks(Blocks):
    """Q as an array."""

    def __init__(self, Q: np.ndarray, d: int):
        self.Q, self.d = Q, d

    def factor(self, left: np.ndarray | None, added: np.ndarray, kept: np.ndarray) -> Solver | None:
        return factorised(assembled(self.Q, left, added, kept))

    def solve(
        self,
        left: np.ndarray,
        added: np.ndarray,
        kept: np.ndarray,
        right: np.ndarray,
        border: Border,
        regular: bool,
    ) -> tuple[np.ndarray, np.ndarray] | None:
        V, B, balance = border
        p = len(balance)
        if regular or not p:
            return super().solve(left, added, kept, right, border, regular)
        A = assembled(self.Q, left, added, kept)
        solver = factorised(np.block([[A, B], [V.T, np.zeros((p, p))]]))
        if solver is None:
            return None
        x = solver(np.concatenate([right, balance]))
        return (x[:-p], x[-p:]) if np.isfinite(x).all() else None


def blocks_of(Q: sp.csr_array, d: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns (b,), values (b, d, d) of the blocks of Q, and places (k,) of diagonal ones."""
    filled, own = sp.bsr_array(Q, blocksize=(d, d)), np.arange(Q.shape[0] // d)
    rows = np.repeat(own, np.diff(filled.indptr))
    keys = np.concatenate([rows * len(own) + filled.indices, own * len(own) + own])
    unique, where = np.unique(keys, return_inverse=True)
    blocks = np.zeros((len(unique), d, d))
    blocks[where[: len(rows)]] = filled.data
    return unique // len(own), unique % len(own), blocks, where[len(rows) :]


class SparseBlocks(Blocks):
    """Q (n, n) by its d x d blocks, with the places of their entries in the columns of an LU
    factorisation.

    rows, columns  (b,) contacts that each block couples, ordered by rows; every diagonal block is
                   there
    blocks         (b, d, d)
    home           (k,) index of each contact's diagonal block
    """

    def __init__(self, Q: sp.csr_array, d: int):
        self.Q, self.d, self.k = Q, d, Q.shape[0] // d
        self.rows, self.columns, self.blocks, self.home = blocks_of(Q, d)
        self.unknown, self.entries = self._arranged()

    def _arranged(self) -> tuple[np.ndarray, sp.csc_array]:
        """Unknowns in an order of least degree, and its compressed columns."""
        d, n = self.d, self.d * self.k
        # SuperLU finds the order on a matrix of the same pattern with so large a diagonal that
        # nothing is pivoted.
        size = float(np.abs(self.Q.data).max(initial=0.0)) or 1.0
        # pivots are on the diagonal
        safe = sp.csc_array(abs(self.Q) + sp.diags_array(np.full(n, 2 * size * self.k)))
        place = splu(
            safe, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        ).perm_c
        # Row and column of every entry of every block in that order, sorted as compressed columns
        # want them.
        local = np.arange(d)
        rows = (self.rows[:, None] * d + local)[:, :, None]
        columns = (self.columns[:, None] * d + local)[:, None, :]
        row = place[np.broadcast_to(rows, self.blocks.shape)].ravel()
        column = place[np.broadcast_to(columns, self.blocks.shape)].ravel()
        numbers = np.arange(self.blocks.size)
        return np.argsort(place), sp.csr_array((numbers, (row, column)), shape=(n, n)).tocsc()

    def factor(self, left: np.ndarray | None, added: np.ndarray, kept: np.ndarray) -> Solver | None:
        blocks = self.blocks.copy() if left is None else left[self.rows] @ self.blocks
        blocks[self.home] += added
        # Take the entries by columns, and leave out the unknowns that are not kept.
        places = self.entries
        index = self.unknown  # places in the right-hand side, in the order of elimination
        if not kept.all():
            stays = np.flatnonzero(kept[index])
            places = places[:, stays][stays]
            index = (np.cumsum(kept) - 1)[index[stays]]
        values = blocks.ravel()[places.data]
        matrix = sp.csc_array((values, places.indices, places.indptr), shape=places.shape)
        try:
            factors = splu(
                matrix,
                permc_spec="NATURAL",
                diag_pivot_thresh=PIVOT,
                options={"SymmetricMode": True},
            )
        except (RuntimeError, ValueError):
            return None

        def solve(right: np.ndarray) -> np.ndarray:
            x = np.empty_like(right)
            x[index] = factors.solve(np.ascontiguousarray(right[index]))
            return x

        return solve


def block_matrix(Q: Interface, d: int) -> Blocks:
    """Q in blocks of d components for block systems, sparse where that beats LAPACK on an array."""
    if form(Q) != "sparse":
        return DenseBlocks(Q, d)
    n = Q.shape[0]
    return DenseBlocks(Q.toarray(), d) if n <= SMALL or Q.nnz > FULL * n * n else SparseBlocks(Q, d)


def bordered(
    solve: Solver, right: np.ndarray, V: np.ndarray, left: np.ndarray, balance: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """x, lambda of A x + left lambda = right, V' x = balance, given a solver with A; or None."""
    p = len(balance)
    x = solve(np.column_stack([right, left]) if p else right[:, None])
    if not np.all(np.isfinite(x)):
        return None
    if p == 0:
        return x[:, 0], np.zeros(0)
    try:
        multipliers = np.linalg.lstsq(V.T @ x[:, 1:], V.T @ x[:, 0] - balance, rcond=1e-14)[0]
    except np.linalg.LinAlgError:
        return None
    return x[:, 0] - x[:, 1:] @ multipliers, multipliers
