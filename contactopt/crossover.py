"""From a backend's approximate answer to the exact one: a few semismooth Newton steps on one subproblem.

The subproblem is  r in K,  Q r + V lambda + c in -N_K(r),  V' r + s = 0  with K a product of half-lines, intervals or
discs, whose projection P is known. An interior-point answer is the square root of its accuracy away from the solution
wherever force and gap vanish together; from the active set it suggests, Newton's method on r = P(r - (Q r + V lambda
+ c)) ends in one to three steps. The step length 1 is right for a dimensionless problem (mean diagonal of Q is 1).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
import scipy.linalg as la

Projection = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]

STEPS = 20
RIDGE = 1e-10  # added to Q in the Newton systems: directions without compliance stay where they are
GOOD = 1e-14  # dimensionless residual below which rounding is all that is left


def crossover(
    Q: np.ndarray,
    c: np.ndarray,
    V: np.ndarray,
    s: np.ndarray,
    project: Projection,
    r: np.ndarray,
    multipliers: np.ndarray,
    steps: int = STEPS,
) -> tuple[np.ndarray, np.ndarray]:
    """Improve (r (k, d), multipliers (p,)); what comes back is never worse than what came in.

    Q (kd, kd), c (kd,), V (kd, p), s (p,); project maps y (k, d) to P(y) and its derivative (k, d, d).
    """

    def evaluate(r: np.ndarray, lam: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        u = (Q @ r.ravel() + V @ lam + c).reshape(r.shape)
        P, D = project(r - u)
        error, balance = P - r, V.T @ r.ravel() + s
        return float(np.sqrt(np.sum(error**2) + np.sum(balance**2))), error, balance, D

    r = project(r)[0]
    best = (evaluate(r, multipliers)[0], r, multipliers)
    for _ in range(steps):
        residual, error, balance, D = evaluate(r, multipliers)
        if residual < best[0]:
            best = (residual, r, multipliers)
        if residual <= GOOD * max(1.0, float(np.linalg.norm(r))) or residual > 1e6 * best[0]:
            break
        step = _newton_step(Q, V, error, balance, D)
        if step is None:
            break
        r, multipliers = r + step[0], multipliers + step[1]
    return best[1], best[2]


def _newton_step(
    Q: np.ndarray, V: np.ndarray, error: np.ndarray, balance: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Solve (I - D (I - Q)) dr + D V dlambda = error,  V' dr = -balance; None if the system is singular.

    Contacts with D = 0 are known at once (dr = error); only the others enter the linear system.
    """
    k, d = error.shape
    p = V.shape[1]
    active = np.flatnonzero(np.any(D != 0, axis=(1, 2)))
    rows = (active[:, None] * d + np.arange(d)).ravel()
    fixed = np.setdiff1d(np.arange(k * d), rows, assume_unique=True)
    dr = error.ravel().copy()
    n = len(rows)

    def apply(X: np.ndarray) -> np.ndarray:  # D X on the active contacts
        return np.einsum("iab,ibj->iaj", D[active], X.reshape(len(active), d, -1)).reshape(n, -1)

    system = np.zeros((n + p, n + p))
    Q_active = Q[np.ix_(rows, rows)] + RIDGE * np.eye(n)
    system[:n, :n] = np.eye(n) - apply(np.eye(n) - Q_active)
    system[:n, n:] = apply(V[rows])
    system[n:, :n] = V[rows].T
    right = np.zeros(n + p)
    right[:n] = dr[rows] - apply((Q[np.ix_(rows, fixed)] @ dr[fixed])[:, None])[:, 0]
    right[n:] = -balance - V[fixed].T @ dr[fixed]
    if n + p == 0:
        return dr.reshape(k, d), np.zeros(p)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", la.LinAlgWarning)  # a bad step is seen by its residual
            step = la.solve(system, right, check_finite=False)
    except (la.LinAlgError, ValueError):
        return None
    if not np.all(np.isfinite(step)):
        return None
    dr[rows] = step[:n]
    return dr.reshape(k, d), step[n:]
