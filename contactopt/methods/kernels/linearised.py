"""The linear system of one Newton step with an unsymmetric derivative, and its inverse for a model
of Q.

    (I - D + D rho Q) dr + D rho V dlambda = error,   V' dr = -balance
                                                      (contactopt.methods.kernels.semismooth)

Contacts with D = 0 are open: their dr is known, and they leave the system.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from contactopt.defaults import ROUNDED
from contactopt.linear.flexible_gmres import flexible_gmres
from contactopt.methods.constants import SLIPPING
from contactopt.methods.kernels.semismooth import Equations
from contactopt.methods.preconditioners import Preconditioner

RESTART, CYCLES = 60, 3  # of GMRES

Act = Callable[[np.ndarray], np.ndarray]


class Border:
    """The balance V' x of a bordered system [[A, B], [V', 0]], given an approximate inverse N of A:
    Y = N B, and K is the inverse of V' Y without motions that no contact feels.
    """

    def __init__(self, near: Act, B: np.ndarray, V: np.ndarray, unfelt: float = 1e-15):
        self.near, self.V = near, V
        self.Y = np.stack([near(b) for b in B.T], axis=1) if B.shape[1] else B
        self.K = np.linalg.pinv(V.T @ self.Y, rcond=unfelt)

    def off(self, x: np.ndarray) -> np.ndarray:
        """I - Y K V', onto the x that do not change the balance."""
        return np.asarray(x - self.Y @ (self.K @ (self.V.T @ x)))

    def solve(self, x: np.ndarray) -> np.ndarray:
        """The inverse of the system: without multipliers, then those that restore the balance."""
        n = len(self.V)
        y = self.near(x[:n])
        multipliers = self.K @ (self.V.T @ y - x[n:])
        return np.concatenate([y - self.Y @ multipliers, multipliers])


@dataclass(frozen=True, eq=False)
class Linearised:
    """One Newton step's system: the equations and the derivative D (k, d, d) of the projection."""

    equations: Equations
    D: np.ndarray

    @cached_property
    def closed(self) -> np.ndarray:
        """Unknowns of the contacts that are not open (n,)."""
        return np.flatnonzero(np.repeat(np.any(self.D != 0, axis=(1, 2)), self.D.shape[1]))

    def rows(self, dr: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """dr - D (dr - rho (moved + weight dr)) (k d,): the left sides of all contacts."""
        k, d = self.D.shape[:2]
        shift = moved + self.equations.weight * dr
        inner = dr.reshape(k, d) - self.equations.rho[:, None] * shift.reshape(k, d)
        return (dr.reshape(k, d) - np.einsum("kab,kb->ka", self.D, inner)).ravel()

    def solve(
        self,
        product: Act,
        inverse: LinearOperator,
        error: np.ndarray,
        balance: np.ndarray,
        rtol: float,
    ) -> tuple[np.ndarray, np.ndarray]:
        """dr (k d,) and dlambda (p,) for the right sides error (k d,) and -balance, by flexible
        GMRES: what is left of the rows is at most rtol |(error, balance)|.
        """
        closed, V = self.closed, self.equations.V
        n, known = len(closed), error.copy()
        known[closed] = 0.0
        right = np.concatenate([error[closed], -balance - V.T @ known])
        if np.any(known):
            right[:n] -= self.rows(known, product(known))[closed]
        # `right` also holds what open contacts do to the others, which may be many times the errors
        errors = np.hypot(np.linalg.norm(error), np.linalg.norm(balance))
        goal = rtol * min(1.0, errors / (np.linalg.norm(right) or 1.0))
        A = self.operator(product)
        x = flexible_gmres(A.matvec, inverse.matvec, right, np.ones(len(right)), goal)
        known[closed] = x[:n]
        return known, x[n:]

    def operator(self, product: Act) -> LinearOperator:
        """The left sides (n + p,) of closed contacts and balance, by products."""
        n, V = len(self.closed), self.equations.V

        def act(x: np.ndarray) -> np.ndarray:
            dr = np.zeros(len(V))
            dr[self.closed] = x[:n]
            return np.concatenate([self.rows(dr, product(dr) + V @ x[n:])[self.closed], V.T @ dr])

        size = n + V.shape[1]
        return LinearOperator((size, size), matvec=act, dtype=float)

    def inverse(self, P: Preconditioner, rtol: float) -> LinearOperator:
        """The inverse of the system with the model of P for Q, to rtol; `rough` without a model."""
        rough = self.rough(P)
        if P.model is None:
            return rough
        model = self.operator(P.model.matvec)
        return LinearOperator(
            rough.shape, matvec=lambda x: _gmres(model, x.ravel(), rtol, rough), dtype=float
        )

    def rough(self, P: Preconditioner) -> LinearOperator:
        """P where a component is held, else the identity, bordered by the balance."""
        closed, d = self.closed, self.D.shape[1]
        rho, V = np.repeat(self.equations.rho, d)[closed], self.equations.V[closed]
        n, p = V.shape
        inside = np.diagonal(self.D, axis1=1, axis2=2).ravel()[closed] > SLIPPING
        unknowns = closed[inside]

        def apply(x: np.ndarray) -> np.ndarray:
            y = x.copy()
            full = np.zeros(P.shape[0])
            full[unknowns] = x[inside] / rho[inside]
            y[inside] = (P @ full)[unknowns]
            return y

        shifts = (rho[:, None] * V).reshape(n // d, d, p)
        DrhoV = (self.D[np.any(self.D != 0, axis=(1, 2))] @ shifts).reshape(n, p)
        border = Border(apply, DrhoV, V, ROUNDED)
        return LinearOperator((n + p, n + p), matvec=lambda x: border.solve(x.ravel()), dtype=float)


def _gmres(A: LinearOperator, b: np.ndarray, rtol: float, M: LinearOperator) -> np.ndarray:
    with np.errstate(invalid="ignore", divide="ignore"):
        x = gmres(A, b, rtol=rtol, restart=min(len(b), RESTART), maxiter=CYCLES, M=M)[0]
    # where every contact is open, nothing resists the motions, and GMRES divides by zero
    return np.asarray(x if np.all(np.isfinite(x)) else M @ b)
