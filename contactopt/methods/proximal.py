"""Proximal-point loop around the semismooth Newton method: robust where Q has no full rank, on any
form of Q.

Outer iterate r_j solves Coulomb's problem with u = Q r + V lambda + q + alpha (r - r_{j-1}), a
problem whose compliance Q + alpha I has full rank, by Newton steps from r_{j-1} with a line search.
alpha falls by 5 after a success and rises by 8 after a failure, so that the loop ends as Newton's
method where that converges. The fixed points are exactly the solutions of Coulomb's problem; there
is no proof of convergence for Coulomb friction. Cost: one linear system per Newton step, dense, or
by a sparse factorisation where Q is sparse. Q need not be symmetric. Source: Acary, Bremond, Huber
(2018), section on proximal-point algorithms; Rockafellar (1976). The multiplier form of the same
loop is the augmented Lagrangian method with penalty 1 / alpha.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from contactopt.checks import check_number
from contactopt.methods.constants import (
    EASY,
    FALL,
    GENTLE_FALL,
    GENTLE_RISE,
    RISE,
    SUBPROBLEM_STEPS,
)
from contactopt.methods.kernels.alart_curnier import cold_start, coulomb_equations
from contactopt.methods.kernels.sparse_blocks import Blocks, block_matrix
from contactopt.methods.kernels.sparse_newton import solve_subproblem
from contactopt.methods.method import NATIVE, Iterate
from contactopt.problem import InterfaceProblem

# of the proximal term; where even the largest fails, the loop ends
LEAST_WEIGHT, LARGEST_WEIGHT = 1e-12, 1e6


@dataclass(frozen=True)
class Proximal:
    """The proximal point method, whose subproblems are solved by Newton's method.

    Parameters
    ----------
    alpha : First weight of the proximal term, in units of the mean compliance.
    """

    alpha: float = 1e-3
    sparse: ClassVar[bool] = True  # takes a sparse Q
    unsymmetric: ClassVar[bool] = True  # and one that is not symmetric

    def __post_init__(self) -> None:
        check_number("alpha", self.alpha, low=0.0)

    def backends(self, dim: int) -> tuple[str, str]:
        return NATIVE, NATIVE

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        matrix = block_matrix(problem.Q, problem.dim)
        bonded = isinstance(problem.Q, np.ndarray)
        zero = np.zeros(problem.q.shape), np.zeros(len(problem.s))
        point = start or (cold_start(problem) if bonded else zero)
        yield from proximal_iterates(problem, matrix, point, self.alpha)


def proximal_iterates(
    problem: InterfaceProblem, matrix: Blocks, point: Iterate, alpha: float, gentle: bool = False
) -> Iterator[Iterate]:
    """Solve one proximal subproblem of a dimensionless problem after another, from a point on.

    Parameters
    ----------
    problem : The dimensionless interface problem.
    matrix : Its Q, ready for block systems.
    point : Forces (k, dim) and multipliers (p,) to start from.
    alpha : The first weight of the proximal term.
    gentle : Whether alpha changes slowly, so that few subproblems fail: for problems on which every
        smaller alpha soon fails.

    Yields
    ------
    The solution of each subproblem, or of a failed one the point that Newton's method left it at.
    """
    (fall, rise), easy = (
        ((GENTLE_FALL, GENTLE_RISE), EASY) if gentle else ((FALL, RISE), SUBPROBLEM_STEPS)
    )
    while alpha < LARGEST_WEIGHT:
        equations = coulomb_equations(problem, point[0], alpha)
        new, solved, steps = solve_subproblem(equations, matrix, point)
        yield new
        point = new if solved else point
        if not solved:
            alpha *= rise
        elif steps <= easy:
            alpha = max(alpha / fall, LEAST_WEIGHT)
