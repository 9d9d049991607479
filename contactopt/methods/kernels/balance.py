"""Projections that keep the balance of the plates: r = P(y - rho V lambda) with V' r + s = 0.

With P the projection on a convex set, lambda minimises a convex, piecewise smooth function of p
unknowns: a few Newton steps with an exact line search, each O(k). So every first-order method on
forces works with plates, without a penalty. Where the forces are friction alone the slope jumps
from contact to contact, as at a weighted median, and only the exact search finds the one that
sticks.
"""

from collections.abc import Callable

import numpy as np

from contactopt.linear.deadline import check_time
from contactopt.methods.kernels.semismooth import Equations, Projection
from contactopt.problem.cones import disc_derivative
from contactopt.problem.laws.law import Law

LEAST_FELT = 1e-8  # share of a motion that closed, sticking or glued contacts must feel to hold it
SURE = 1e-6  # error of the balance, over all friction bounds, with which a motion counts as found
STEPS = 50  # of Newton's method
# relative to V'V, added to the Newton matrix: nothing need be in contact at the start
CURVATURE = 1e-10


def project_balanced(
    project: Projection,
    y: np.ndarray,
    V: np.ndarray,
    s: np.ndarray,
    step: np.ndarray | float,
    multipliers: np.ndarray,
    steps: int = STEPS,
) -> tuple[np.ndarray, np.ndarray]:
    """Solve r = P(y - rho V lambda), V' r + s = 0 for r (k, d) and lambda (p,), from `multipliers`,
    in at most so many Newton `steps`; P projects on a closed convex set that holds zero, and
    `step` is rho > 0. Without a solution the r of the last lambda comes back.
    """
    lam = multipliers
    if len(s) == 0:
        return project(y)[0], lam
    k, d = y.shape
    rho = np.broadcast_to(np.asarray(step, dtype=float), (k,))[:, None]
    size = np.abs(s) + np.abs(V).sum(axis=0) * 1e-3
    felt = np.sum(rho[:, :, None] * V.reshape(k, d, -1) ** 2, axis=(0, 1))
    ridge = CURVATURE * np.diag(np.where(felt > 0, felt, 1.0))  # no force feels some motions
    z = y - rho * (V @ lam).reshape(k, d)
    for _ in range(steps):
        check_time()
        P, D = project(z)
        error = V.T @ P.ravel() + s
        if np.all(np.abs(error) <= 1e-13 * size):  # of the balance
            break
        # lambda minimises a convex function with the gradient -(V'P + s) and the second derivative
        # V' rho D V.
        DV = np.einsum("kab,kbp->kap", rho[:, :, None] * D, V.reshape(k, d, -1)).reshape(V.shape)
        move = np.linalg.solve(V.T @ DV + ridge, error)
        way = (V @ move).reshape(k, d)

        def slope(
            t: float, z: np.ndarray = z, way: np.ndarray = way, work: float = float(s @ move)
        ) -> float:
            return -float(np.sum(way * project(z - t * rho * way)[0])) - work

        length = _least(slope, -float(error @ move))
        if length == 0.0:
            break
        lam, z = lam + length * move, z - length * rho * way
    return P, lam


def _least(slope: Callable[[float], float], first: float) -> float:
    """The t > 0 where a slope that grows from `first` < 0 vanishes; 0 if not above rounding."""
    low, high, below, above, t = 0.0, np.inf, first, np.inf, 1.0
    for trial in range(200):  # evaluations of one line search
        value = slope(t)
        if abs(value) <= 0.1 * abs(first):
            return t
        if value < 0:
            low, below = t, value
        else:
            high, above = t, value
        if high == np.inf:
            t = 4 * low
        elif low == 0.0:
            t = high / 16
        else:
            # The secant is exact inside a piece without jumps; halving halts at a jump.
            t = low - below * (high - low) / (above - below) if trial % 2 else np.sqrt(low * high)
            if not low < t < high or high - low <= 4 * np.finfo(float).eps * high:
                return high
    return 0.0 if high == np.inf else high


def loose_motions(V: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Orthonormal combinations (p, j) of V that closed and sticking contacts leave free."""
    d = D.shape[1]
    firm = np.repeat(np.all(np.eye(d) == D, axis=(1, 2))[:, None], d, axis=1)
    firm[:, 0] = np.any(D != 0, axis=(1, 2))
    felt = V[firm.ravel()]
    values, motions = np.linalg.eigh(felt.T @ felt)
    return np.asarray(motions[:, values <= LEAST_FELT * max(values.max(initial=0.0), 1.0)])


def settled(
    equations: Equations,
    law: Law,
    r: np.ndarray,
    D: np.ndarray,
    displacements: Callable[[], np.ndarray],
) -> np.ndarray | None:
    """The change (p,) of the multipliers with which friction balances motions that no contact
    holds; None where there are no such motions, or no friction balances the loads.

    Where all contacts slip, their linearised forces do not change with such a motion, and Newton's
    system is singular or its steps jump over the contact that should stick. With the normal forces
    as bounds of the friction, the motion follows from a convex problem. D is the derivative of the
    law's map at the forces r (k, d), and `displacements` gives u (k, d).
    """
    if not len(equations.s):
        return None
    loose = loose_motions(equations.V, D)
    if not loose.size:
        return None
    k, d = r.shape
    y = r - equations.rho[:, None] * displacements()
    normal = np.maximum(y[:, 0], law.lowest)
    bound, W = law.bound(normal), (equations.V @ loose).reshape(k, d, -1)
    s = loose.T @ equations.s + normal @ W[:, 0]
    slide = bound > 0
    if not slide.any():
        return None
    t, bound, rho = y[slide, 1:], bound[slide], equations.rho[slide]
    W = W[slide, 1:].reshape(-1, W.shape[2])

    def balanced(moved: np.ndarray, share: float, steps: int = STEPS) -> tuple[np.ndarray, bool]:
        P, moved = project_balanced(_softened(bound, share), t, W, s, rho, moved, steps)
        return moved, bool(np.linalg.norm(W.T @ P.ravel() + s) <= SURE * bound.sum())

    moved, found = balanced(np.zeros(len(s)), 1.0, 5)  # steps without softened friction
    if not found:  # far away the friction must soften first
        share = float(np.min(bound / np.maximum(np.linalg.norm(t, axis=1), bound), initial=1.0))
        moved = np.zeros(len(s))
        while share < 1.0:
            moved, share = balanced(moved, share)[0], 100.0 * share  # times sharper friction
        moved, found = balanced(moved, 1.0)
    return loose @ moved if found else None


def _softened(bound: np.ndarray, share: float) -> Projection:
    """The projection of share y on discs, for friction that grows with the slip."""

    def project(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        P, D = disc_derivative(share * y, bound)
        return P, share * D

    return project
