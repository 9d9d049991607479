"""Newton steps at the price of one factorisation: most contacts of an elastic interface stick.

If every contact stuck, each Newton step would solve the same bonded system B = [[Q, V], [V', 0]].
With z = Q dr + V dlambda the change of displacement, known where a contact sticks, a step has
unknowns only at the other contacts N:

    dr = G z + h,   G = (B^-1)_rr,   ((I - D) G_NN + D rho) z_N = error_N - (I - D) h_N.

One Cholesky factorisation of Q (n^3/3) serves all steps; a contact that leaves the sticking state
costs `dim` columns of G once, 2 n^2 operations each. The bonded solution, the cold start of
Newton's method, comes with it.
"""

import weakref

import numpy as np
import scipy.linalg as la

from contactopt.linear.operators import asymmetry
from contactopt.problem import InterfaceProblem

# least diagonal entry of the factor, over the largest: below, Q is too near to singular for this
LEAST_PIVOT = 1e-7


class Bonded:
    """The factorised bonded system of a symmetric positive definite Q (n, n) with V (n, p)."""

    def __init__(self, Q: np.ndarray, V: np.ndarray):
        """Raises LinAlgError if Q is not symmetric or not safely positive definite."""
        n = len(Q)
        if asymmetry(Q) > 1e-12:
            raise la.LinAlgError("Q is not symmetric")
        self.factor = la.cho_factor(Q, lower=True, check_finite=False)
        diagonal = np.diag(self.factor[0])
        if diagonal.min() < LEAST_PIVOT * diagonal.max():
            raise la.LinAlgError("Q is nearly singular")
        self.V = V
        self.X = la.cho_solve(self.factor, V, check_finite=False) if V.shape[1] else V
        self.K = V.T @ self.X  # stiffness that the plates feel
        self.columns = np.zeros((n, 0))
        self.place = np.full(n, -1)  # unknown -> its column of G, -1 if not there yet

    def solve(self, z: np.ndarray, balance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """dr, dlambda of Q dr + V dlambda = z (n,) or (n, j), V' dr = -balance (p,) or (p, j)."""
        dr = la.cho_solve(self.factor, z, check_finite=False)
        if self.V.shape[1] == 0:
            return dr, np.zeros_like(balance)
        multipliers = np.linalg.solve(self.K, self.V.T @ dr + balance)
        return dr - self.X @ multipliers, multipliers

    def inverse(self, unknowns: np.ndarray) -> np.ndarray:
        """Columns (n, m) of G, the inverse of Q under the balance, each computed once."""
        new = unknowns[self.place[unknowns] < 0]
        if len(new):
            unit = np.zeros((len(self.V), len(new)))
            unit[new, np.arange(len(new))] = 1.0
            self.place[new] = self.columns.shape[1] + np.arange(len(new))
            solved = self.solve(unit, np.zeros((self.V.shape[1], len(new))))[0]
            self.columns = np.concatenate([self.columns, solved], axis=1)
        return self.columns[:, self.place[unknowns]]

    def step(
        self, rho: np.ndarray, error: np.ndarray, balance: np.ndarray, D: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The Newton step that factors of Q give (`Factored`); LinAlgError if it is singular."""
        k, d = error.shape
        # N are unknowns of contacts that are open or slip; the right side of others is error / rho.
        loose = np.flatnonzero(np.any(np.eye(d) != D, axis=(1, 2)))
        N = (loose[:, None] * d + np.arange(d)).ravel()
        z = (error / rho[:, None]).ravel()
        z[N] = 0.0
        dr, multipliers = self.solve(z, balance)
        # So far every contact sticks. The others correct that by their displacements z_N.
        if len(N):
            # With dr = (bonded dr) + G z_N their rows (I - D) dr + rho D z = error are a small
            # dense system for z_N.
            G = self.inverse(N)
            keep = np.eye(d) - D[loose]

            def blocks(A: np.ndarray, X: np.ndarray) -> np.ndarray:
                return (A @ X.reshape(len(loose), d, -1)).reshape(len(N), -1)

            matrix = blocks(keep, G[N])
            i = np.arange(len(loose))
            matrix.reshape(len(i), d, len(i), d)[i, :, i, :] += rho[loose, None, None] * D[loose]
            right = error[loose].ravel() - blocks(keep, dr[N])[:, 0]
            # not of SciPy, which warns of redundant contacts; the certificate judges the answer
            z_N = np.linalg.solve(matrix, right)
            dr = dr + G @ z_N
            if len(balance):
                multipliers = multipliers + np.linalg.solve(self.K, self.X[N].T @ z_N)
        return dr.reshape(k, d), multipliers


_last: list[tuple[weakref.ref[InterfaceProblem], Bonded]] = []


def bonded(problem: InterfaceProblem) -> Bonded | None:
    """The factors of a dimensionless problem, kept while it lives, or None."""
    try:
        made = Bonded(problem.Q, problem.V)
    except la.LinAlgError:
        return None
    origin = getattr(problem, "origin", problem)
    _last[:] = [(weakref.ref(origin, lambda _: _last.clear()), made)]
    return made


def last_bonded(problem: InterfaceProblem) -> Bonded | None:
    """The factors of a problem made dimensionless, if Newton's method made them last; else None."""
    return next((made for origin, made in tuple(_last) if origin() is problem), None)
