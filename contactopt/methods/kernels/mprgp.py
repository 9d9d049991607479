"""Bound-constrained quadratic programs by gradient projections and conjugate gradients, without a
factorisation.

    min  x'Px/2 + c'x    subject to  x >= low,    optionally  A x = b            (the normal
         problem, paper, eq (21))

MPRGP (Dostal): conjugate gradients on the free unknowns; a gradient step that frees bound unknowns
where their part of the projected gradient dominates (proportioning); where a conjugate gradient
step leaves the bounds, its projection if that lowers the objective, else a step to the first bound
and a projected gradient step of fixed length (expansion). Each step costs one product with P, two
in an expansion. Converges for every positive definite P, at a rate that depends on its condition
number only. `box_qp` takes the products in single precision, half the memory traffic that limits
them, and refines; `smalbe` adds equality rows by the augmented Lagrangian method. Sources: Dostal
(2009), Optimal Quadratic Programming Algorithms, chapters 5 and 6; the projected step: Kruzik,
Horak, Cermak, Pospisil, Pecha (2020), Active set expansion strategies in MPRGP algorithm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contactopt.errors import InputError
from contactopt.linear.deadline import check_time
from contactopt.methods.constants import (
    EIGENVALUE_MARGIN,
    FINEST_SHARE,
    ROUND_SHARE,
    ROWS_FALL,
    ROWS_SHARE,
    SINGLE_ACCURACY,
    SINGLE_PROGRESS,
    SINGLE_STEPS,
    STIFFER,
)

# of gradient steps, over 1 / the largest eigenvalue; they converge below 2 (Dostal 2009, chapter 5)
LENGTH = 1.9
# largest penalty, relative to P's largest eigenvalue; beyond it half of the digits are lost
STIFFEST = 1e6


@dataclass(frozen=True, eq=False)
class BoxResult:
    """x (n,), the multipliers (p,) of A x = b, the steps taken, and whether the tolerance was met."""

    x: np.ndarray
    multipliers: np.ndarray
    iterations: int
    met: bool


def largest_eigenvalue(P: np.ndarray, steps: int = 10) -> float:
    """Estimate the largest eigenvalue of a symmetric positive semidefinite matrix from below, by
    power steps.

    Parameters
    ----------
    P : (n, n) an array or sparse.
    steps : Number of products with P.

    Returns
    -------
    The estimate; 0 for an empty or a zero matrix.
    """
    n = P.shape[0]
    v = (1 + 0.1 * np.cos(1.0 + np.arange(n))).astype(P.dtype)
    value = 0.0
    for _ in range(steps if n else 0):
        v /= np.linalg.norm(v)
        image = P @ v
        value, v = float(np.linalg.norm(image)), image
        if value == 0.0:
            break
    return value


def projected_gradient(x: np.ndarray, g: np.ndarray, low: np.ndarray) -> np.ndarray:
    """Compute the projected gradient, which is zero exactly at the solution.

    Parameters
    ----------
    x, g, low : (n,) point, gradient there, and lower bounds.

    Returns
    -------
    (n,) the gradient where x is free, its negative part where x is at its bound.
    """
    return np.where(x > low, g, np.minimum(g, 0))


def mprgp(
    P: np.ndarray,
    c: np.ndarray,
    low: np.ndarray,
    start: np.ndarray | None = None,
    tol: float = 1e-10,
    max_iterations: int = 10_000,
    largest: float | None = None,
) -> BoxResult:
    """Solve min x'Px/2 + c'x, x >= low, until the norm of the projected gradient is at most tol
    |c|.

    The arithmetic is that of P's type.

    Parameters
    ----------
    P : (n, n) symmetric positive semidefinite
    c : (n,)
    low : (n,) bounds, finite or -inf
    start : (n,); None: zero
    tol : bound of the projected gradient over |c|
    max_iterations : steps, each with one or two products with P
    largest : an upper bound of P's largest eigenvalue; estimated if None

    Returns
    -------
    BoxResult

    Raises
    ------
    InputError : on shapes that do not fit
    """
    _check(P, c, low)
    target = tol * float(np.linalg.norm(c))
    x, steps, met = _descend(
        P, c, low, _start(c, low, start), target, max_iterations, largest or _bound(P)
    )
    return BoxResult(x, np.zeros(0), steps, met)


def _bound(P: np.ndarray) -> float:
    return EIGENVALUE_MARGIN * largest_eigenvalue(P) or 1.0


def _check(P: np.ndarray, c: np.ndarray, low: np.ndarray) -> None:
    n = len(c)
    if P.shape != (n, n) or low.shape != (n,):
        raise InputError(
            f"a QP in {n} unknowns needs P ({n}, {n}) and low ({n},); got {P.shape} and"
            f" {low.shape}."
        )


def _start(c: np.ndarray, low: np.ndarray, start: np.ndarray | None) -> np.ndarray:
    return np.maximum(np.zeros_like(c) if start is None else start, low)


def _descend(
    P: np.ndarray,
    c: np.ndarray,
    low: np.ndarray,
    x: np.ndarray,
    target: float,
    limit: int,
    largest: float,
) -> tuple[np.ndarray, int, bool]:
    """MPRGP from the feasible x: the last x, the steps taken, whether |projected gradient| <=
    target.
    """
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


def box_qp(
    P: np.ndarray,
    c: np.ndarray,
    low: np.ndarray,
    start: np.ndarray | None = None,
    tol: float = 1e-10,
    max_iterations: int = 10_000,
) -> BoxResult:
    """Solve the same problem as `mprgp`, in less time where P does not fit the processor's cache.

    Iterative refinement: the correction d of x minimises d'Pd/2 + (P x + c)'d, d >= low - x, in
    single precision to a few digits, scaled so that no digit is lost; its gradient is taken anew in
    double precision. It ends in double precision if P is too ill-conditioned for that.

    Parameters
    ----------
    P : (n, n) symmetric positive semidefinite array of float64.
    c, low, start, tol, max_iterations : As for `mprgp`.

    Returns
    -------
    The solution, without multipliers.

    Raises
    ------
    InputError : On shapes that do not fit.
    """
    _check(P, c, low)
    x, target = _start(c, low, start), tol * float(np.linalg.norm(c))
    single = P.astype(np.float32)
    largest = _bound(single)
    residual, total = np.inf, 0
    while total < max_iterations:
        g = P @ x + c
        size = float(np.linalg.norm(projected_gradient(x, g, low)))
        if size <= target:
            return BoxResult(x, np.zeros(0), total, True)
        if size > SINGLE_PROGRESS * residual:
            break
        residual = size
        bound = (low - x) / size
        d, steps, _ = _descend(
            single,
            (g / size).astype(np.float32),
            bound.astype(np.float32),
            np.zeros(len(c), np.float32),
            max(SINGLE_ACCURACY, ROUND_SHARE * target / size),
            SINGLE_STEPS,
            largest,
        )
        total += steps
        x = np.where(d > bound.astype(np.float32), np.maximum(x + size * d.astype(float), low), low)
    x, steps, met = _descend(P, c, low, x, target, max_iterations - total, largest)
    return BoxResult(x, np.zeros(0), total + steps, met)


def smalbe(
    P: np.ndarray,
    c: np.ndarray,
    low: np.ndarray,
    A: np.ndarray,
    b: np.ndarray,
    start: np.ndarray | None = None,
    multipliers: np.ndarray | None = None,
    tol: float = 1e-10,
    max_iterations: int = 20_000,
) -> BoxResult:
    """min x'Px/2 + c'x, x >= low, A x = b: MPRGP inside the augmented Lagrangian method (SMALBE-M,
    Dostal).

    The rows of A are made orthonormal first. The penalty starts as P's largest eigenvalue and grows
    where the error of the rows falls too slowly. The accuracy of each inner solve is proportional
    to that error. The tolerance is met when the projected gradient of the Lagrangian is at most tol
    |c + A'y| and the error of the orthonormal rows at most tol times their right side.

    Parameters
    ----------
    P, c, low, start, max_iterations : as for mprgp()
    A, b : (p, n) of full rank and (p,), the equality rows
    multipliers : (p,) first guess of y in the gradient P x + c + A'y; None: zero
    tol : as above

    Returns
    -------
    BoxResult

    Raises
    ------
    InputError : on shapes that do not fit
    """
    _check(P, c, low)
    if A.shape != (len(b), len(c)):
        raise InputError(f"A must have shape ({len(b)}, {len(c)}); got {A.shape}.")
    if len(b) == 0:
        return mprgp(P, c, low, start, tol, max_iterations)
    basis, triangle = np.linalg.qr(A.T)  # the same rows, orthonormal
    A, b = basis.T, np.linalg.solve(triangle.T, b)
    penalty = largest = _bound(P)
    augmented = P + penalty * (A.T @ A)
    y = np.zeros(len(b)) if multipliers is None else triangle @ multipliers
    x, total = _start(c, low, start), 0
    error = float(np.linalg.norm(A @ x - b))
    before, enough = np.inf, tol * max(float(np.linalg.norm(b)), 1e-300)
    while total < max_iterations:
        linear = c + A.T @ (y - penalty * b)
        target = tol * float(np.linalg.norm(c + A.T @ y))
        wanted = max(ROWS_SHARE * min(penalty * error, before), FINEST_SHARE * target)
        x, steps, met = _descend(
            augmented, linear, low, x, wanted, max_iterations - total, largest + penalty
        )
        total += max(steps, 1)
        y = y + penalty * (A @ x - b)
        error, last = float(np.linalg.norm(A @ x - b)), error
        if met and wanted <= target and error <= enough:
            return BoxResult(x, np.linalg.solve(triangle, y), total, True)
        before = wanted
        if error > max(ROWS_FALL * last, enough) and penalty < STIFFEST * largest:
            penalty *= STIFFER
            augmented = P + penalty * (A.T @ A)
    return BoxResult(x, np.linalg.solve(triangle, y), total, False)
