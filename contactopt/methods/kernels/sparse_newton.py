"""Newton steps by factors of block systems, and the damped method for proximal subproblems."""

from __future__ import annotations

import numpy as np

from contactopt.linear.deadline import check_time
from contactopt.methods import constants
from contactopt.methods.kernels.semismooth import Equations
from contactopt.methods.kernels.sparse_blocks import Blocks, bordered
from contactopt.methods.method import Iterate

DONE = 1e-13  # residual over the size of the forces at which rounding ends the iteration


def block_step(
    equations: Equations,
    matrix: Blocks,
    error: np.ndarray,
    balance: np.ndarray,
    D: np.ndarray,
    ridge: float = 0.0,
) -> Iterate | None:
    """The same step as `Equations.step`, by the factors of a sparse or dense block system."""
    k, d = error.shape
    scaled = equations.rho[:, None, None] * D
    kept = np.repeat(np.any(D != 0, axis=(1, 2)), d)
    dr = error.ravel().copy()
    right, gone = dr[kept], np.where(kept, 0.0, dr)
    if np.any(gone):  # what the open contacts lose moves the others
        right -= (scaled @ (equations.Q @ gone).reshape(k, d, 1)).ravel()[kept]
    if len(right) == 0:
        return dr.reshape(k, d), np.zeros(len(balance))
    solve = matrix.factor(scaled, np.eye(d) - D + (equations.weight + ridge) * scaled, kept)
    if solve is None:
        return None
    V = equations.V
    left = (scaled @ V.reshape(k, d, -1)).reshape(k * d, -1)[kept]
    answer = bordered(solve, right, V[kept], left, -balance - V.T @ gone)
    if answer is None:
        return None
    dr[kept] = answer[0]
    return dr.reshape(k, d), answer[1]


def solve_subproblem(
    equations: Equations, matrix: Blocks, point: Iterate, most: int | None = None
) -> tuple[Iterate, bool, int]:
    """The last iterate of Newton's method with a line search, whether it solves, and the steps."""
    residual, error, balance, D = equations.evaluate(*point)
    recent, most = [residual], most or constants.SUBPROBLEM_STEPS
    for steps in range(1, most + 1):
        check_time()
        change = block_step(equations, matrix, error, balance, D)
        if change is None:
            return point, False, steps
        length = 1.0
        while True:
            trial = point[0] + length * change[0], point[1] + length * change[1]
            residual, error, balance, D = equations.evaluate(*trial)
            if residual <= max(recent[-constants.MEMORY :]):
                break
            length /= 2
            if length < constants.SHORTEST:
                return point, False, steps
        point = trial
        recent.append(residual)
        moved = equations.rho[:, None] * (point[0] - equations.center)
        goal = constants.ENOUGH * equations.weight * float(np.linalg.norm(moved))
        if residual <= max(DONE * float(np.linalg.norm(point[0])), goal):
            return point, True, steps
    return point, False, most
