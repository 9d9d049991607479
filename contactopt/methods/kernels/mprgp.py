"""Bound-constrained quadratic programs by gradient projections and conjugate gradients, without a
factorisation.

    min  x'Px/2 + c'x    subject to  x >= low,    optionally  A x = b            (the normal
         problem, paper, eq (21))

MPRGP (Dostal): conjugate gradients on the free unknowns; a gradient step that frees bound unknowns
where their part of the projected gradient dominates (proportioning); where a conjugate gradient
step leaves the bounds, its projection if that lowers the objective, else a step to the first bound
and a projected gradient step of fixed length (expansion). Each step costs one product with P, two
in an expansion. Converges for every positive definite P, at a rate that depends on its condition
number only. `smalbe` adds equality rows by the augmented Lagrangian method. Sources: Dostal (2009),
Optimal Quadratic Programming Algorithms, chapters 5 and 6; the projected step: Kruzik, Horak,
Cermak, Pospisil, Pecha (2020), Active set expansion strategies in MPRGP algorithm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contactopt.errors import InputError
from contactopt.linear.deadline import check_time
from contactopt.methods.constants import (
    EIGENVALUE_MARGIN,
    FINEST_SHARE,
    ROWS_FALL,
    ROWS_SHARE,
    STIFFER,
)

# of gradient steps, over 1 / the largest eigenvalue; they converge below 2 (Dostal 2009, chapter 5)
LENGTH = 1.9
# largest penalty, relative to P's largest eigenvalue; beyond it half of the digits are lost
STIFFEST = 1e6
MOST_STEPS = 20_000  # of a program with equality rows


@dataclass(frozen=True, eq=False)
class BoxResult:
    """x (n,), the multipliers (p,) of A x = b, the steps, and whether the tolerance is met."""

    x: np.ndarray
    multipliers: np.ndarray
    iterations: int
    met: bool


def largest_eigenvalue(P: np.ndarray, steps: int = 10) -> float:
    """The largest eigenvalue of a semidefinite P, estimated from below by power steps."""
    n = P.shape[0]
    v = (1 + 0.1 * np.cos(1.0 + np.arange(n))).astype(P.dtype)
    value = 0.0
    for _ in range(steps if n else 0):
        v /= np.linalg.norm(v)
        v = P @ v
        value = float(np.linalg.norm(v))
        if value == 0.0:
            break
    return value


def eigenvalue_bound(P: np.ndarray) -> float:
    """A number above the largest eigenvalue; 1 for an empty or a zero matrix."""
    return EIGENVALUE_MARGIN * largest_eigenvalue(P) or 1.0


def mprgp(
    P: np.ndarray,
    c: np.ndarray,
    low: np.ndarray,
    start: np.ndarray | None = None,
    tol: float = 1e-10,
    max_iterations: int = 10_000,
) -> BoxResult:
    """Solve min x'Px/2 + c'x, x >= low, until the norm of the projected gradient is at most tol
    |c|, with P (n, n) symmetric positive semidefinite and bounds low (n,) finite or -inf.

    The arithmetic is that of P's type. InputError on shapes that do not fit.
    """
    _check(P, c, low)
    x = np.maximum(np.zeros_like(c) if start is None else start, low)
    target = tol * float(np.linalg.norm(c))
    x, steps, met = descend(P, c, low, x, target, max_iterations, eigenvalue_bound(P))
    return BoxResult(x, np.zeros(0), steps, met)


def _check(P: np.ndarray, c: np.ndarray, low: np.ndarray) -> None:
    n = len(c)
    if P.shape != (n, n) or low.shape != (n,):
        raise InputError(
            f"a QP in {n} unknowns needs P ({n}, {n}) and low ({n},); got {P.shape} and"
            f" {low.shape}."
        )


def descend(
    P: np.ndarray,
    c: np.ndarray,
    low: np.ndarray,
    x: np.ndarray,
    target: float,
    limit: int,
    largest: float,
) -> tuple[np.ndarray, int, bool]:
    """MPRGP from a feasible x: the last x, the steps, whether |projected gradient| <= target."""
    length = LENGTH / largest
    g = P @ x + c
    p = None  # direction of the conjugate gradients; None: start afresh from the free gradient
    for step in range(limit):
        check_time()
        free = x > low
        phi, beta = np.where(free, g, 0), np.where(free, 0, np.minimum(g, 0))
        if float(np.sqrt(phi @ phi + beta @ beta)) <= target:
            return x, step, True
        reduced = np.where(free, np.minimum((x - low) / length, phi), 0)
        if beta @ beta > reduced @ phi:  # not proportional: free what pulls away from its bound
            image = P @ beta
            curvature = beta @ image
            if curvature <= 0:
                return x, step, False
            t = (g @ beta) / curvature
            x, g, p = x - t * beta, g - t * image, None
            continue
        p = phi if p is None else p
        image = P @ p
        curvature = p @ image
        if curvature <= 0:
            return x, step, False
        t = (g @ p) / curvature
        trial = x - t * p
        if np.all(trial >= low):
            x, g = trial, g - t * image
            phi = np.where(x > low, g, 0)
            p = phi - ((phi @ image) / curvature) * p
            continue
        trial = np.maximum(trial, low)
        new = P @ trial + c
        if trial @ (new + c) < x @ (g + c):
            x, g, p = trial, new, None
            continue
        ahead = p > 0  # the projection did not descend: Dostal's expansion
        first = np.min((x[ahead] - low[ahead]) / p[ahead])
        x, g = np.maximum(x - first * p, low), g - first * image
        x = np.maximum(x - length * np.where(x > low, g, 0), low)
        g, p = P @ x + c, None
    return x, limit, False


def smalbe(
    P: np.ndarray,
    c: np.ndarray,
    low: np.ndarray,
    A: np.ndarray,
    b: np.ndarray,
    start: np.ndarray | None = None,
    multipliers: np.ndarray | None = None,
    tol: float = 1e-10,
) -> BoxResult:
    """min x'Px/2 + c'x, x >= low, A x = b: MPRGP inside the augmented Lagrangian method (SMALBE-M,
    Dostal), with A (p, n) of full rank.

    The rows of A are made orthonormal first. The penalty starts as P's largest eigenvalue and grows
    where the error of the rows falls too slowly. The accuracy of each inner solve is proportional
    to that error. The tolerance is met when the projected gradient of the Lagrangian is at most tol
    |c + A'y| and the error of the orthonormal rows at most tol times their right side. `start` (n,)
    and the multipliers y (p,) of the gradient P x + c + A'y are first guesses.
    """
    _check(P, c, low)
    if A.shape != (len(b), len(c)):
        raise InputError(f"A must have shape ({len(b)}, {len(c)}); got {A.shape}.")
    if len(b) == 0:
        return mprgp(P, c, low, start, tol, MOST_STEPS)
    basis, triangle = np.linalg.qr(A.T)  # the same rows, orthonormal
    A, b = basis.T, np.linalg.solve(triangle.T, b)
    penalty = largest = eigenvalue_bound(P)
    augmented = P + penalty * (A.T @ A)
    y = np.zeros(len(b)) if multipliers is None else triangle @ multipliers
    x, total = np.maximum(np.zeros_like(c) if start is None else start, low), 0
    error = float(np.linalg.norm(A @ x - b))
    before, enough = np.inf, tol * max(float(np.linalg.norm(b)), 1e-300)
    done = False
    while total < MOST_STEPS and not done:
        linear, target = c + A.T @ (y - penalty * b), tol * float(np.linalg.norm(c + A.T @ y))
        wanted = max(ROWS_SHARE * min(penalty * error, before), FINEST_SHARE * target)
        bound, left = largest + penalty, MOST_STEPS - total
        x, steps, met = descend(augmented, linear, low, x, wanted, left, bound)
        total += max(steps, 1)
        y = y + penalty * (A @ x - b)
        error, last = float(np.linalg.norm(A @ x - b)), error
        done = met and wanted <= target and error <= enough
        before = wanted
        if error > max(ROWS_FALL * last, enough) and penalty < STIFFEST * largest:
            penalty *= STIFFER
            augmented = P + penalty * (A.T @ A)
    return BoxResult(x, np.linalg.solve(triangle, y), total, done)
