"""Semismooth Newton steps on r = P(r - rho u), u = Q r + V lambda + q, V' r + s = 0.

With P the projection onto half-lines, intervals or discs this is the primal-dual active set method
of one convex subproblem, and makes a backend's answer exact (`crossover`): an interior-point answer
is the square root of its accuracy off wherever force and gap vanish together. With P the Coulomb
map it is Newton's method for the whole problem (Alart-Curnier; Hueber, Stadler, Wohlmuth 2008).
"""

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import islice
from math import sqrt
from typing import Protocol

import numpy as np

from contactopt.errors import BackendError
from contactopt.linear.operators import Interface
from contactopt.methods.kernels.newton_loop import Unknowns, newton_iterates
from contactopt.methods.kernels.sparse_blocks import Blocks, block_matrix
from contactopt.methods.method import Iterate
from contactopt.methods.notes import note

logger = logging.getLogger(__name__)

# y (k, d) -> P(y) and its generalised derivative (k, d, d); zero where the contact is open
Projection = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]

STEPS = 20  # of a crossover
# added to Q in every Newton system: directions without compliance stay where they are
RIDGE = 1e-10
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
        if not isinstance(self.rho, np.ndarray):
            object.__setattr__(self, "rho", np.full(len(self.q), float(self.rho)))

    def displacements(self, r: np.ndarray, lam: np.ndarray) -> np.ndarray:
        """u (k, d)."""
        u = (self.Q @ r.ravel()).reshape(r.shape) + self.q
        if len(lam):
            u += (self.V @ lam).reshape(r.shape)
        return np.asarray(u + self.weight * (r - self.center) if self.weight else u)

    def evaluate(
        self, r: np.ndarray, lam: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Residual, P(y) - r (k, d), V'r + s (p,), derivative of P at y = r - rho u."""
        P, D = self.project(r - self.rho[:, None] * self.displacements(r, lam))
        error, balance = P - r, self.V.T @ r.ravel() + self.s
        return sqrt(np.vdot(error, error) + balance @ balance), error, balance, D


@dataclass(frozen=True, eq=False)
class Evaluated:
    """Equations at a point: the residual, P(y) - r (k, d), V'r + s (p,), derivative D (k, d, d)."""

    point: Iterate
    residual: float
    error: np.ndarray
    balance: np.ndarray
    D: np.ndarray


def evaluated(equations: Equations, r: np.ndarray, multipliers: np.ndarray) -> Evaluated:
    """The equations at forces r (k, d) and multipliers (p,)."""
    return Evaluated((r, multipliers), *equations.evaluate(r, multipliers))


class Solve(Protocol):
    """How the linear system of a Newton step is solved, which depends on the form of Q."""

    def __call__(
        self, equations: Equations, at: Evaluated, rtol: float = 0.0, ridge: float = RIDGE
    ) -> Iterate | None:
        """dr (k, d) and dlambda (p,) with (I - D (I - rho Q)) dr + D rho V dlambda = error and V'
        dr = -balance, to a relative accuracy; None if the system is singular. Factors are those of
        Q + ridge.
        """
        ...


@dataclass(frozen=True, eq=False)
class Steps:
    """Newton's method on equations, whose linear systems `solve` solves."""

    equations: Equations
    solve: Solve
    accuracy: Callable[[Evaluated], float] = lambda at: 0.0
    ridge: float = RIDGE

    def evaluate(self, point: Unknowns) -> Evaluated:
        return evaluated(self.equations, *point)

    def change(self, at: Evaluated) -> Iterate | None:
        return self.solve(self.equations, at, self.accuracy(at), self.ridge)


@dataclass(frozen=True, eq=False)
class Factored:
    """Steps by the factors of a block system."""

    matrix: Blocks

    def __call__(
        self, equations: Equations, at: Evaluated, rtol: float = 0.0, ridge: float = RIDGE
    ) -> Iterate | None:
        """As `Solve`; open contacts leave the system, and rows with D = I are those of rho Q."""
        (k, d), V, dr = at.error.shape, equations.V, at.error.ravel().copy()
        kept = np.repeat(at.D.reshape(k, d * d).any(axis=1), d)
        p = len(at.balance)
        if not kept.any():
            return None if p else (dr.reshape(k, d), at.balance)
        rows, gone = np.flatnonzero(kept), np.where(kept, 0.0, dr)
        scaled = equations.rho[:, None, None] * at.D
        added = np.eye(d) - at.D + (equations.weight + ridge) * scaled
        right = dr[rows]
        if gone.any():  # what the open contacts lose moves the others
            right -= (scaled @ (equations.Q @ gone).reshape(k, d, 1)).ravel()[rows]
        left = (scaled @ V.reshape(k, d, p)).reshape(k * d, p)[rows]
        border = V[rows], left, -at.balance - V.T @ gone
        answer = self.matrix.solve(scaled, added, kept, right, border, bool(equations.weight))
        if answer is None:
            return None
        dr[rows] = answer[0]
        return dr.reshape(k, d), answer[1]


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
    """The best point of Newton steps from an answer r (k, d); c is u at r = 0, and rho is 1."""
    equations = Equations(Q, c.reshape(r.shape), V, s, project)
    residual, r, multipliers = _improve(equations, r, multipliers, steps)
    if steps == STEPS and residual > EXACT * max(1.0, float(np.linalg.norm(r))):
        note(logger, "Newton steps did not make the answer of a convex subproblem exact")
    return r, multipliers


def certified(
    solvers: Iterable[tuple[str, Callable[[], Iterate]]], equations: Equations
) -> Iterate:
    """Ask backends (name, solve) in turn, until Newton steps make an answer exact, since a backend
    may call anything optimal. Else the best; BackendError if even its relative residual is above
    WRONG.
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
    system = Steps(equations, Factored(block_matrix(equations.Q, r.shape[1])))
    iterates = newton_iterates(system, system.evaluate((r, multipliers)))
    for at in islice(iterates, steps):
        if at.residual < best[0]:
            best = (at.residual, *at.point)
        size = max(1.0, float(np.linalg.norm(at.point[0])))
        if at.residual <= 1e-14 * size or at.residual > 1e6 * best[0]:  # rounding
            break
    return best
