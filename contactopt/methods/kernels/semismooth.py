"""Semismooth Newton steps on r = P(r - rho u), u = Q r + V lambda + q, V' r + s = 0, for any
projection P.

With P the projection onto half-lines, intervals or discs this is the primal-dual active set method
of one convex subproblem, and a few steps of it make a backend's approximate answer exact
(`crossover`): an interior-point answer is the square root of its accuracy away from the solution
wherever force and gap vanish together. With P the Coulomb map of contactopt.problem.laws it is
Newton's method for the whole problem (Alart-Curnier; Hueber, Stadler, Wohlmuth 2008).
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from contactopt.errors import BackendError
from contactopt.linear.deadline import check_time
from contactopt.linear.operators import Interface
from contactopt.methods.method import Iterate
from contactopt.methods.notes import note

logger = logging.getLogger(__name__)

# y (k, d) -> P(y) and its generalised derivative (k, d, d); zero where the contact is open
Projection = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]

STEPS = 20  # of a crossover
# added to Q in every Newton system: directions without compliance stay where they are
RIDGE = 1e-10
GOOD = 1e-14  # relative residual below which rounding is all that is left
# relative residuals up to which an answer needs no second try, and above which it is none
EXACT, WRONG = 1e-9, 1e-5


@dataclass(frozen=True, eq=False)
class Equations:
    """The equations r = P(r - rho u), V' r + s = 0 of one dimensionless problem.

    Q        (k d, k d) compliance;   q  (k, d) displacements without forces
    V, s     (k d, p) rigid motions and (p,) resultants
    project  the map P with its generalised derivative
    rho      (k,) or one number
    center   (k, d), and weight: with weight > 0 the equations are those of the proximal subproblem,
             in which u = Q r + V lambda + q + weight (r - center)
    """

    Q: Interface
    q: np.ndarray
    V: np.ndarray
    s: np.ndarray
    project: Projection
    rho: np.ndarray = 1.0  # type: ignore[assignment]
    center: np.ndarray | float = 0.0
    weight: float = 0.0

    def __post_init__(self) -> None:
        rho = np.broadcast_to(np.asarray(self.rho, dtype=float), (len(self.q),))
        object.__setattr__(self, "rho", rho)

    def displacements(self, r: np.ndarray, lam: np.ndarray) -> np.ndarray:
        """u (k, d)."""
        u = (self.Q @ r.ravel() + self.V @ lam).reshape(r.shape) + self.q
        return np.asarray(u + self.weight * (r - self.center) if self.weight else u)

    def evaluate(
        self, r: np.ndarray, lam: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Norm of the residual, P(y) - r (k, d), V'r + s (p,) and the derivative of P at y = r -
        rho u.
        """
        P, D = self.project(r - self.rho[:, None] * self.displacements(r, lam))
        error, balance = P - r, self.V.T @ r.ravel() + self.s
        return float(np.sqrt(np.sum(error**2) + np.sum(balance**2))), error, balance, D

    def step(
        self, error: np.ndarray, balance: np.ndarray, D: np.ndarray, ridge: float = RIDGE
    ) -> Iterate | None:
        """dr (k, d), dlambda (p,) of one Newton step; None if the linear system is singular.

        It solves (I - D (I - rho Q)) dr + D rho V dlambda = error, V' dr = -balance. Open contacts,
        D = 0, are known at once and leave the system. Where D = I, in stick or in contact without
        friction, its rows are those of rho Q.
        """
        k, d = error.shape
        p = self.V.shape[1]
        # Open contacts: dr = error. The unknowns are the other dr and dlambda, in one square
        # matrix.
        closed = np.any(D != 0, axis=(1, 2))
        mask = np.repeat(closed, d)
        rows, gone = np.flatnonzero(mask), np.flatnonzero(~mask)
        dr = error.ravel().copy()
        n = len(rows)
        if n + p == 0:
            return dr.reshape(k, d), np.zeros(p)
        rho = np.repeat(self.rho, d)[rows]
        matrix = np.zeros((n + p, n + p))
        matrix[:n, :n] = self.Q if n == k * d else self.Q[np.ix_(rows, rows)]
        matrix[np.arange(n), np.arange(n)] += self.weight + ridge
        matrix[:n, n:] = self.V[rows]
        matrix[:n] *= rho[:, None]  # now rho (Q dr + V dlambda), the rows of a contact that sticks
        matrix[n:, :n] = self.V[rows].T
        coupling = np.zeros(n)
        if np.any(dr[gone]):
            coupling = rho * (self.Q[np.ix_(rows, gone)] @ dr[gone])
        # Where D is not I the rows become D (rho (Q dr + V dlambda) - dr) + dr.
        D = D[closed]
        bent = np.flatnonzero(np.any(np.eye(d) != D, axis=(1, 2)))  # contacts that slip
        index = (bent[:, None] * d + np.arange(d)).ravel()
        matrix[index, index] -= 1.0
        block = matrix[:n] if len(index) == n else matrix[index]  # all slip: no copy
        matrix[index] = (D[bent] @ block.reshape(len(bent), d, n + p)).reshape(len(index), n + p)
        matrix[index, index] += 1.0
        coupling[index] = (D[bent] @ coupling[index].reshape(len(bent), d, 1)).ravel()
        right = np.concatenate([dr[rows] - coupling, -balance - self.V[gone].T @ dr[gone]])
        try:
            with warnings.catch_warnings():
                # a bad step is seen by its residual
                warnings.simplefilter("ignore", la.LinAlgWarning)
                # The transpose of a C array is what LAPACK factorises in place.
                factors = la.lu_factor(matrix.T, overwrite_a=True, check_finite=False)
                x = la.lu_solve(factors, right, trans=1, check_finite=False)
        except (la.LinAlgError, ValueError):
            return None
        if not np.all(np.isfinite(x)):
            return None
        dr[rows] = x[:n]
        return dr.reshape(k, d), x[n:]


def crossover(
    Q: np.ndarray,
    c: np.ndarray,
    V: np.ndarray,
    s: np.ndarray,
    project: Projection,
    r: np.ndarray,
    multipliers: np.ndarray,
    steps: int = STEPS,
) -> Iterate:
    """Improve an approximate answer r (k, d) of a dimensionless subproblem by at most so many
    Newton steps, and return the best point on the way.

    c are the displacements without forces; the rest is as in Equations, with rho = 1. The residual
    of what comes back is never larger than that of the projection of what came in.
    """
    equations = Equations(Q, c.reshape(r.shape), V, s, project)
    residual, r, multipliers = _improve(equations, r, multipliers, steps)
    if steps == STEPS and residual > EXACT * max(1.0, float(np.linalg.norm(r))):
        note(logger, "Newton steps did not make the answer of a convex subproblem exact")
    return r, multipliers


def certified(
    solvers: Iterable[tuple[str, Callable[[], Iterate]]], equations: Equations
) -> Iterate:
    """Ask backends one after the other until Newton steps make an answer exact.

    A backend may call anything optimal, so that every answer is checked by its residual. The next
    of the pairs (name of a backend, its solve), usually the same backend at tighter settings, is
    asked only if the answer is not exact. The first exact answer is returned, or else the best one;
    BackendError if even its relative residual is above WRONG.
    """
    best, asked = (np.inf, np.zeros(0), np.zeros(0)), ""
    for attempt, (asked, solver) in enumerate(solvers):
        if attempt:
            note(
                logger,
                f"the answer of backend '{asked}' was not exact, so it was asked again at tighter"
                " settings",
            )
        r, multipliers = solver()
        answer = _improve(equations, r.reshape(equations.q.shape), multipliers, STEPS)
        best = min(best, answer, key=lambda a: a[0])
        size = max(1.0, float(np.linalg.norm(best[1])))
        if best[0] <= EXACT * size:
            return best[1:]
    if best[0] > WRONG * size:
        raise BackendError(
            f"backend '{asked}' misses the problem it was given by {best[0] / size:.1e}, asked"
            " twice."
        )
    return best[1:]


def _improve(
    equations: Equations, r: np.ndarray, multipliers: np.ndarray, steps: int
) -> tuple[float, np.ndarray, np.ndarray]:
    """The residual and the point of the best Newton iterate from (r, multipliers)."""
    r = equations.project(r)[0]
    best = (np.inf, r, multipliers)
    for _ in range(steps):
        check_time()
        residual, error, balance, D = equations.evaluate(r, multipliers)
        if residual < best[0]:
            best = (residual, r, multipliers)
        if residual <= GOOD * max(1.0, float(np.linalg.norm(r))) or residual > 1e6 * best[0]:
            break
        change = equations.step(error, balance, D)
        if change is None:
            break
        r, multipliers = r + change[0], multipliers + change[1]
    return best
