"""Projections that keep the balance of the plates: r = P(y - step V lambda) with lambda such that V' r + s = 0.

With P the projection on a convex set this is the projection on the set's part where V' r + s = 0, and lambda minimises
a convex, piecewise smooth function of p unknowns: a few damped Newton steps, each O(k). It makes every first-order
method on forces work with plates, without a penalty: lambda is the multiplier that the step itself determines.
"""

from __future__ import annotations

import numpy as np

from contactopt.solving.deadline import check_time
from contactopt.solving.kernels.semismooth import Projection

STEPS = 50  # of Newton's method
EXACT = 1e-13  # relative error of the balance at which the search ends
CURVATURE = 1e-10  # relative to V'V, added to the Newton matrix: nothing need be in contact at the start


def project_balanced(
    project: Projection, y: np.ndarray, V: np.ndarray, s: np.ndarray, step: float, multipliers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solve r = P(y - step V lambda), V' r + s = 0 for r and lambda.

    If no r in the set keeps the balance, the r of the last lambda comes back.

    Parameters
    ----------
    project : P and its derivative; P is a projection on a closed convex set that holds zero
    y : (k, d) the point that is projected
    V, s : (k d, p) rigid motions and (p,) resultants
    step : greater than 0
    multipliers : (p,) where lambda starts

    Returns
    -------
    r (k, d) and lambda (p,)
    """
    lam = multipliers
    if len(s) == 0:
        return project(y)[0], lam
    k, d = y.shape
    size = np.abs(s) + np.abs(V).sum(axis=0) * 1e-3

    # lambda minimises a convex function with the gradient -(V'P + s): Newton's method on it, with a line search.
    def evaluate(lam: np.ndarray) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
        z = y - step * (V @ lam).reshape(k, d)
        P, D = project(z)
        value = 0.5 * (np.sum(z**2) - np.sum((z - P) ** 2)) / step - s @ lam  # its gradient is -(V'P + s)
        return P, D, float(value), V.T @ P.ravel() + s

    P, D, value, error = evaluate(lam)
    for _ in range(STEPS):
        check_time()
        if np.all(np.abs(error) <= EXACT * size):
            break
        # Its second derivative is step V'D V; a little of V'V keeps it regular where no contact is closed.
        DV = np.einsum("kab,kbp->kap", D, V.reshape(k, d, -1)).reshape(V.shape)
        hessian = step * (V.T @ DV + CURVATURE * np.diag(np.sum(V**2, axis=0)))
        move, length = np.linalg.solve(hessian, error), 1.0
        # Shorten the step until the function falls by a share of what its slope promises (Armijo).
        while length > 1e-18:
            trial = evaluate(lam + length * move)
            slack = 1e-14 * (1 + abs(value))  # rounding of the value
            if trial[2] <= value - 1e-4 * length * (error @ move) + slack:
                break
            length /= 4
        if length <= 1e-18:
            break
        lam = lam + length * move
        if np.array_equal(trial[3], error):
            break
        P, D, value, error = trial
    return P, lam
