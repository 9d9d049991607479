"""Newton steps on r = P(r - rho u), u = Q r + V lambda + q + weight (r - center), V' r + s = 0, with a sparse Q.

One step solves J dr + D rho V dlambda = P - r, V' dr = -(V' r + s) with J = I - D + D rho (Q + weight I), D the
generalised derivative of P, block diagonal. Contacts where D = 0 (open) are known at once and leave the system. The
pattern of Q's blocks, the order of elimination and the places of its entries in compressed columns are found once; a
step then costs a few array operations and one sparse LU factorisation (SuperLU). Memory is linear in the non-zeros.
"""

from __future__ import annotations

import warnings

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.solving.kernels.semismooth import Projection

PIVOT = 0.01  # a diagonal entry this much smaller than the largest of its column is still a pivot
SMALL = 60  # unknowns up to which LAPACK on an array is faster than a sparse factorisation
FULL = 0.5  # share of entries from which on it is faster at any size

Iterate = tuple[np.ndarray, np.ndarray]  # reactions (k, d), multipliers (p,)


class BlockMatrix:
    """Q (n, n) by its d x d blocks, with the places of their entries in the columns of an LU factorisation.

    rows, columns  (b,) contacts that each block couples, ordered by rows; every diagonal block is there
    blocks         (b, d, d)
    home           (k,) index of each contact's diagonal block
    """

    def __init__(self, Q: sp.csr_array, d: int):
        n = Q.shape[0]
        k = n // d
        entries = sp.coo_array(Q)
        i, j = (index.astype(np.int64) for index in entries.coords)
        own = np.arange(k)
        keys, where = np.unique(np.concatenate([(i // d) * k + j // d, own * k + own]), return_inverse=True)
        self.rows, self.columns = keys // max(k, 1), keys % max(k, 1)
        self.blocks = np.zeros((len(keys), d, d))
        self.blocks[where[: len(i)], i % d, j % d] = entries.data
        self.home = where[len(i) :]
        self.Q, self.d, self.k = Q, d, k
        self.array = Q.toarray() if n <= SMALL or Q.nnz > FULL * n * n else None
        if self.array is None:
            self._arrange()

    def _arrange(self) -> None:
        """The order of elimination, of least degree, and each entry's place in compressed columns of that order."""
        d, n = self.d, self.d * self.k
        size = float(np.abs(self.Q.data).max(initial=0.0)) or 1.0
        safe = sp.csc_array(abs(self.Q) + sp.diags_array(np.full(n, 2 * size * self.k)))  # pivots are on the diagonal
        place = splu(safe, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).perm_c
        local = np.arange(d)
        row = place[np.broadcast_to((self.rows[:, None] * d + local)[:, :, None], self.blocks.shape)].ravel()
        column = place[np.broadcast_to((self.columns[:, None] * d + local)[:, None, :], self.blocks.shape)].ravel()
        self.order = np.lexsort((row, column))
        self.row, self.column = row[self.order], column[self.order]
        self.position = place  # unknown -> where it is eliminated
        self.unknown = np.argsort(place)

    def solve(self, blocks: np.ndarray, kept: np.ndarray, right: np.ndarray) -> np.ndarray | None:
        """x (m, j) with A x = right, A the rows and columns `kept` (n,) of the matrix of these blocks; None if singular."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", la.LinAlgWarning)  # a bad step is seen by its residual
                x = self._dense(blocks, kept, right) if self.array is not None else self._sparse(blocks, kept, right)
        except (RuntimeError, la.LinAlgError, ValueError):
            return None
        return x if np.all(np.isfinite(x)) else None

    def _dense(self, blocks: np.ndarray, kept: np.ndarray, right: np.ndarray) -> np.ndarray:
        k, d = self.k, self.d
        A = np.zeros((k, d, k, d))
        A[self.rows, :, self.columns, :] = blocks
        A = A.reshape(k * d, k * d)
        return np.asarray(la.solve(A if kept.all() else A[np.ix_(kept, kept)], right, check_finite=False))

    def _sparse(self, blocks: np.ndarray, kept: np.ndarray, right: np.ndarray) -> np.ndarray:
        stays = kept[self.unknown]  # in the order of elimination
        m = int(stays.sum())
        values, row, column = blocks.ravel()[self.order], self.row, self.column
        if m < len(stays):
            inside = stays[row] & stays[column]
            new = np.cumsum(stays) - 1
            values, row, column = values[inside], new[row[inside]], new[column[inside]]
        ends = np.concatenate([[0], np.cumsum(np.bincount(column, minlength=m))])
        matrix = sp.csc_array((values, row.astype(np.int32), ends.astype(np.int32)), shape=(m, m))
        factors = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=PIVOT, options={"SymmetricMode": True})
        there = np.cumsum(kept) - 1  # unknown -> its place in `right`
        index = there[self.unknown[stays]]
        x = np.empty_like(right)
        x[index] = factors.solve(np.ascontiguousarray(right[index]))
        return x


class SparseEquations:
    """The equations of one dimensionless problem: q (k, d), V (k d, p), s (p,), rho (k,); as kernels.semismooth.Equations.

    center, weight: those of the proximal subproblem; they and rho may be changed between steps.
    """

    def __init__(self, Q: BlockMatrix, q: np.ndarray, V: np.ndarray, s: np.ndarray, project: Projection, rho: np.ndarray):
        self.matrix, self.q, self.V, self.s, self.project, self.rho = Q, q, V, s, project, rho
        self.center, self.weight = np.zeros_like(q), 0.0
        self.Q = Q.array if Q.array is not None else Q.Q

    def evaluate(self, r: np.ndarray, lam: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Norm of the residual, P(y) - r (k, d), V'r + s (p,) and the derivative of P at y = r - rho u."""
        u = (self.Q @ r.ravel() + self.V @ lam).reshape(r.shape) + self.q
        if self.weight:
            u += self.weight * (r - self.center)
        P, D = self.project(r - self.rho[:, None] * u)
        error, balance = P - r, self.V.T @ r.ravel() + self.s
        return float(np.sqrt(np.sum(error**2) + np.sum(balance**2))), error, balance, D

    def step(self, error: np.ndarray, balance: np.ndarray, D: np.ndarray) -> Iterate | None:
        """dr (k, d), dlambda (p,) of one Newton step; None if the linear system is singular."""
        A, (k, d) = self.matrix, error.shape
        scaled = self.rho[:, None, None] * D
        blocks = scaled[A.rows] @ A.blocks
        blocks[A.home] += np.eye(d) - D + self.weight * scaled
        closed = np.any(D != 0, axis=(1, 2))
        kept = np.repeat(closed, d)
        dr = error.ravel().copy()
        right = dr[kept]
        gone = np.where(kept, 0.0, dr)
        if np.any(gone):  # what the open contacts lose moves the others
            right -= (scaled @ (self.Q @ gone).reshape(k, d, 1)).ravel()[kept]
        p = len(self.s)
        if p:
            border = (scaled @ self.V.reshape(k, d, p)).reshape(k * d, p)[kept]
            right = np.column_stack([right, border])
        x = A.solve(blocks, kept, right.reshape(len(right), -1)) if len(right) else right.reshape(0, p + 1)
        if x is None:
            return None
        dlam = np.zeros(p)
        if p:
            V = self.V[kept]
            rest = -balance - self.V.T @ gone - V.T @ x[:, 0]
            dlam = -np.linalg.lstsq(V.T @ x[:, 1:], rest, rcond=1e-14)[0]
        dr[kept] = x[:, 0] - x[:, 1:] @ dlam
        return (dr.reshape(k, d), dlam) if np.all(np.isfinite(dlam)) else None
