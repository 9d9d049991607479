"""Proximal-point loop around the semismooth Newton method: robust where Q has no full rank.

Outer iterate r_j solves Coulomb's problem with u = Q r + V lambda + q + alpha (r - r_{j-1}), a problem whose compliance
Q + alpha I has full rank, by Newton steps from r_{j-1}. alpha falls by 4 after a success and rises
by 8 after a failure, so that the loop ends as Newton's method where that converges. The fixed points are exactly the
solutions of Coulomb's problem; there is no proof of convergence for Coulomb friction. Cost: one dense linear system per
Newton step.
Source: Acary, Bremond, Huber (2018), section on proximal-point algorithms; Rockafellar (1976). The multiplier form of
the same loop is the augmented Lagrangian method with penalty 1 / alpha.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from contactopt.problem import InterfaceProblem
from contactopt.solving.kernels.alart_curnier import cold_start, coulomb_equations
from contactopt.solving.methods import NATIVE, Iterate

INNER = 15  # Newton steps in one proximal subproblem
ENOUGH = 1e-3  # a subproblem counts as solved when its residual fell by this factor
DONE = 1e-14
SMALLEST, LARGEST = 1e-9, 1e6  # weights; where even the largest fails, the loop ends


@dataclass(frozen=True)
class Proximal:
    """alpha: first weight of the proximal term, in units of the mean compliance."""

    alpha: float = 1.0

    def backends(self, dim: int) -> tuple[str, str]:
        return NATIVE, NATIVE

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        r, multipliers = start or cold_start(problem)
        alpha = self.alpha
        while alpha < LARGEST:
            new, solved = proximal_step(problem, r, multipliers, alpha)
            if solved:
                r, multipliers = new
                yield new
            alpha = max(alpha / 4, SMALLEST) if solved else 8 * alpha


def proximal_step(
    problem: InterfaceProblem, r: np.ndarray, multipliers: np.ndarray, alpha: float
) -> tuple[Iterate, bool]:
    """The best iterate of the proximal subproblem at (r, alpha), and whether it is solved."""
    equations = coulomb_equations(problem, r, alpha)
    residual, error, balance, D = equations.evaluate(r, multipliers)
    first, best, point = residual, (residual, (r, multipliers)), (r, multipliers)
    size = max(1.0, float(np.linalg.norm(r)))
    recent = [residual]
    for _ in range(INNER):
        step = equations.step(error, balance, D)
        if step is None:
            break
        length = 1.0
        while True:  # accept what is below the worst of the last residuals
            trial = point[0] + length * step[0], point[1] + length * step[1]
            residual, error, balance, D = equations.evaluate(*trial)
            if residual <= max(recent[-4:]) or length < 1e-2:
                break
            length /= 2
        if length < 1e-2:
            break
        point = trial
        recent.append(residual)
        if residual < best[0]:
            best = (residual, point)
        if residual <= max(DONE * size, 0.1 * ENOUGH * ENOUGH * first):
            break
    return best[1], best[0] <= max(DONE * size, ENOUGH * first)
