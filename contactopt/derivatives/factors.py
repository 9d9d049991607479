"""Factors of M = [[I - D + D rho Q, D rho V], [V', 0]] that serve M and its transpose.

Components whose row of D is zero are known at once, dr = error. Rows of the unit matrix in D mean
that a component sticks, and their rows of M are those of rho Q. With the unknowns in the order
(known, sticking, all other and the multipliers), and rows and columns in the units of Q,

    K = R M C = [[1, 0, 0], [A, [Q_ss, B], [C, E]]],     Q_ss = G G',   X = G^-1 B,   Y = G^-1 C',

Cholesky's factor G and LU of S = E - Y' X solve K x = b and K' x = b. Where few components stick,
or Q is not symmetric and definite, all of them are others.

The same factors are those of an LU factorisation of K', K' = P L U, which `Whole` holds in one
array. Then K x = b is solved by two triangular systems wherever the array is taken.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import scipy.sparse as sp
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dgecon, dgetrf, dgetrs, dlange, dlaswp, dpotrf
from scipy.sparse.linalg import splu

from contactopt.defaults import ROUNDED
from contactopt.derivatives.constants import WHOLE
from contactopt.errors import InputError
from contactopt.linear.operators import asymmetry
from contactopt.methods.kernels.bonded import LEAST_PIVOT

SINGULAR = 1e-13  # reciprocal condition of a matrix below which it counts as singular
UNSEEN = 1e-8  # relative residual up to which a singular system counts as solved
UNIQUE = (
    "the solution has no derivative, because its linear system is singular: forces or motions are"
    " not unique there; remove redundant contacts, or hold the bodies."
)


class Factors(Protocol):
    """What solves M x = b and M' x = b for one right side b (k d + p,); InputError where M is
    singular, but for a right side of M' that does not see what is undetermined.
    """

    def solve(self, right: np.ndarray) -> np.ndarray: ...
    def back(self, right: np.ndarray) -> np.ndarray: ...


class Whole(NamedTuple):
    """LU of K' in one array.

    array     (m, m) whose transpose holds L below the diagonal, which is one, and U
    rows      (m,) the equations of M in the order of K
    unknowns  (m,) the unknowns of M in the order of the rows of L
    scales    (2, m) R and C in the order of M
    unique    whether M is regular; else what it leaves undetermined is held, so that right sides
              that do not see it are served
    """

    array: np.ndarray
    rows: np.ndarray
    unknowns: np.ndarray
    scales: np.ndarray
    unique: bool


class Square:
    """LU of the transpose of S (m, m), overwritten; null vectors make a singular S regular."""

    def __init__(self, S: np.ndarray):
        self.W, self.sigma = np.zeros((len(S), 0)), 0.0
        self.lu, self.swaps = S.T, np.arange(len(S))
        if not len(S):
            return
        self.lu, self.swaps, _ = dgetrf(S.T, overwrite_a=True)
        pivots = np.abs(self.lu.diagonal())
        if pivots.min() > 1e-6 * pivots.max():  # else look at the condition
            return
        S = np.empty(S.shape)
        S[:, self.order] = (np.tril(self.lu, -1) @ np.triu(self.lu) + np.triu(self.lu)).T
        if not dgecon(self.lu, dlange("1", S.T))[0] > SINGULAR:
            left, values, right = np.linalg.svd(S)
            null = values <= UNSEEN * values[0]
            self.W, self.sigma = left[:, null], float(values[0]) or 1.0
            self.lu, self.swaps, _ = dgetrf((S + self.sigma * self.W @ right[null]).T)

    @property
    def unique(self) -> bool:
        return not self.W.shape[1]

    def solve(self, right: np.ndarray) -> np.ndarray:
        """S^-1 right (m,)."""
        if not self.unique:
            # forces have no derivative, whatever one that an adjoint asks for may have
            raise InputError(UNIQUE)
        return self._applied(right, 1)

    def back(self, right: np.ndarray) -> np.ndarray:
        """The transpose of S^-1 times right (m,)."""
        x = self._applied(right, 0)
        if self.sigma * np.linalg.norm(self.W.T @ x) > UNSEEN * np.linalg.norm(right):
            raise InputError(UNIQUE)
        return x

    def _applied(self, right: np.ndarray, trans: int) -> np.ndarray:
        return (
            np.asarray(dgetrs(self.lu, self.swaps, right, trans=trans)[0]) if len(right) else right
        )

    @property
    def order(self) -> np.ndarray:
        """The row of S' that each row of L stands for."""
        numbers = np.arange(float(len(self.lu)))[:, None]
        return dlaswp(numbers, self.swaps)[:, 0].astype(int) if len(self.lu) else self.swaps


@dataclass(frozen=True, eq=False)
class DenseFactors:
    """The factors defined at the top, for an array Q.

    order    (m,) equations and unknowns of M in the order of K;  known  how many are known
    scales   (2, m) diagonals of R and C in the order of M
    A        (m - known, known);  G  (s, s);  X, Y  (s, m - known - s)
    """

    order: np.ndarray
    known: int
    scales: np.ndarray
    A: np.ndarray
    G: np.ndarray
    X: np.ndarray
    Y: np.ndarray
    schur: Square

    def solve(self, right: np.ndarray) -> np.ndarray:
        b = (self.scales[0] * right)[self.order]
        first, rest = b[: self.known], b[self.known :]
        x = self._inner(rest - self.A @ first, self.X, self.Y, self.schur.solve)
        return self._placed(np.concatenate([first, x]), self.scales[1])

    def back(self, right: np.ndarray) -> np.ndarray:
        b = (self.scales[1] * right)[self.order]
        x = self._inner(b[self.known :], self.Y, self.X, self.schur.back)
        first = b[: self.known] - self.A.T @ x
        return self._placed(np.concatenate([first, x]), self.scales[0])

    def _inner(
        self,
        right: np.ndarray,
        X: np.ndarray,
        Y: np.ndarray,
        schur: Callable[[np.ndarray], np.ndarray],
    ) -> np.ndarray:
        """The solution without the known unknowns; X and Y are exchanged for the transpose."""
        s = len(self.G)
        if not s:
            return schur(right)
        y = dtrsm(1.0, self.G, right[:s, None], lower=1)[:, 0]
        z = schur(right[s:] - Y.T @ y)
        x = dtrsm(1.0, self.G, (y - X @ z)[:, None], lower=1, trans_a=1)[:, 0]
        return np.concatenate([x, z])

    def _placed(self, x: np.ndarray, scale: np.ndarray) -> np.ndarray:
        found = np.empty(len(x))
        found[self.order] = x
        return found * scale

    @property
    def whole(self) -> Whole:
        g, s, m, lu = self.known, len(self.G), len(self.order), self.schur.lu
        swapped = self.schur.order
        unknowns = np.concatenate([self.order[: g + s], self.order[g + s :][swapped]])
        array = lu.T
        if g or s:
            array, pivots = np.zeros((m, m)), self.G.diagonal()[:, None]
            np.fill_diagonal(array[:g, :g], 1.0)
            array[g:, :g] = self.A
            if s:
                own = array[g : g + s, g:]
                own[:, :s] = np.tril(self.G * pivots.T) + np.triu(self.G.T / pivots, 1)
                own[:, s:] = self.X[:, swapped] / pivots
                array[g + s :, g : g + s] = self.Y.T * pivots.T
            array[g + s :, g + s :] = lu.T
        return Whole(array, self.order, unknowns, self.scales, self.schur.unique)


def dense_factors(Q: np.ndarray, V: np.ndarray, rho: np.ndarray, D: np.ndarray) -> DenseFactors:
    """The factors for an array Q, motions V (n, p), steps rho (k,), and D (k, d, d)."""
    (k, d), (n, p), unit = D.shape[:2], V.shape, float(rho.mean())
    kept, rest = D.any(axis=2).ravel(), np.eye(d) - D
    stick, G = _sticking(Q, kept, kept & ~rest.any(axis=2).ravel())
    loose = kept & ~stick
    first, second, third = (part.nonzero()[0] for part in (~kept, stick, loose))
    scales = np.ones((2, n + p))
    scales[0, :n] = np.where(loose, 1 / unit, 1.0)
    if len(G):
        scales[0, second] = 1 / np.repeat(rho, d)[second]
    if p:
        size = np.linalg.norm(V, axis=0)
        scales[:, n:] = 1 / (unit * np.where(size > 0, size, 1.0))
        V = V * scales[0, n:]

    # the rows of the third unknowns
    touched = loose.reshape(k, d).any(axis=1).nonzero()[0]
    left, mask = (rho / unit)[:, None, None] * D, loose.reshape(k, d)[touched].ravel()
    left, a = left[touched], len(third)
    rows = left @ (Q.reshape(k, d, n)[touched] if len(touched) < k else Q.reshape(k, d, n))
    rows.reshape(-1, d, k, d)[np.arange(len(rows)), :, touched] += rest[touched] / unit
    rows = rows.reshape(-1, n) if a == len(mask) else rows.reshape(-1, n)[mask]
    S, A = np.zeros((a + p, a + p)), np.concatenate([rows.take(first, axis=1), V[first].T])
    S[:a, :a] = rows if a == n else rows.take(third, axis=1)
    S[:a, a:] = (left @ V.reshape(k, d, p)[touched]).reshape(len(mask), p)[mask]
    S[a:, :a] = V[third].T
    X = Y = G
    if len(G):
        B = np.concatenate([Q.take(third, axis=1)[second], V[second]], axis=1)
        C = np.concatenate([rows.take(second, axis=1), V[second].T])
        A = np.concatenate([Q.take(first, axis=1)[second], A])
        X, Y = (dtrsm(1.0, G, border, lower=1) for border in (B, C.T))
        S -= Y.T @ X
    order = np.concatenate([first, second, third, np.arange(n, n + p)])
    return DenseFactors(order, len(first), scales, A, G, X, Y, Square(S))


def _sticking(Q: np.ndarray, kept: np.ndarray, stick: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The components (n,) that Cholesky's factor serves, and this factor, or none of few ones."""
    none = np.zeros(len(Q), dtype=bool), np.zeros((0, 0))
    if np.count_nonzero(kept) <= WHOLE or not stick.any():
        return none
    own = Q if stick.all() else Q[stick].take(stick.nonzero()[0], axis=1)
    if asymmetry(own) > ROUNDED:
        return none
    G, failed = dpotrf(own.T, lower=True, clean=False, overwrite_a=own is not Q)
    pivots = G.diagonal()
    return none if failed or not pivots.min() > LEAST_PIVOT * pivots.max() else (stick, G)


class SparseFactors:
    """LU of M for a sparse Q, of many bodies of which each touches few others."""

    def __init__(self, Q: sp.csr_array, V: np.ndarray, rho: np.ndarray, D: np.ndarray):
        (k, d), p, unit = D.shape[:2], V.shape[1], float(rho.mean())
        places, size = (np.arange(k), np.arange(k + 1)), np.linalg.norm(V, axis=0)
        motions = 1 / np.where(size > 0, size, 1.0)
        slope = sp.bsr_array((rho[:, None, None] * D, *places)).tocsr()
        rest, V = sp.bsr_array((np.eye(d) - D, *places)).tocsr(), sp.csr_array(V * motions)
        # the multipliers are forces here, like all other unknowns
        border = slope @ V / unit, V.T
        M = [[slope @ Q + rest, border[0]], [border[1], sp.csr_array((p, p))]]
        try:
            self.factors = splu(sp.block_array(M, format="csc"))
        except RuntimeError as error:
            raise InputError(UNIQUE) from error
        pivots = np.abs(self.factors.U.diagonal())
        if not pivots.min(initial=1.0) > SINGULAR * pivots.max(initial=1.0):
            raise InputError(UNIQUE)
        ones = np.ones(k * d)
        self.rows, self.columns = np.append(ones, motions), np.append(ones, motions / unit)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """M^-1 right."""
        return np.asarray(self.columns * self.factors.solve(self.rows * right))

    def back(self, right: np.ndarray) -> np.ndarray:
        """The transpose of M^-1 times right."""
        return np.asarray(self.rows * self.factors.solve(self.columns * right, trans="T"))
