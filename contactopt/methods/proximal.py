"""Proximal-point loop around the semismooth Newton method: robust where Q has no full rank, on any
form of Q.

Outer iterate r_j solves Coulomb's problem with u = Q r + V lambda + q + alpha (r - r_{j-1}), a
problem whose compliance Q + alpha I has full rank, by Newton steps from r_{j-1} with a line search.
alpha falls by 5 after a success and rises by 8 after a failure, so that the loop ends as Newton's
method where that converges. The fixed points are exactly the solutions of Coulomb's problem. The
multiplier form of the same loop is the augmented Lagrangian method with penalty 1 / alpha.

Sources: Acary, Bremond, Huber (2018), section on proximal-point algorithms; Rockafellar (1976).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from contactopt.checks import check_number
from contactopt.linear.operators import form
from contactopt.methods import constants
from contactopt.methods.kernels.alart_curnier import cold_start, coulomb_equations
from contactopt.methods.kernels.damped import solve_subproblem
from contactopt.methods.kernels.sparse_blocks import Blocks, block_matrix
from contactopt.methods.method import Iterate, Method, at_rest
from contactopt.problem import InterfaceProblem

# of the proximal term; where even the largest fails, the loop ends
LEAST_WEIGHT, LARGEST_WEIGHT = 1e-12, 1e6
Pace = Literal["steady", "gentle", "eager"]


@dataclass(frozen=True)
class Proximal(Method):
    """The proximal point method, whose subproblems are solved by Newton's method. `alpha` is the
    first weight of the proximal term, in units of the mean compliance.
    """

    alpha: float = 1e-3
    sparse: ClassVar[bool] = True  # takes a sparse Q
    unsymmetric: ClassVar[bool] = True  # and one that is not symmetric

    def __post_init__(self) -> None:
        check_number("alpha", self.alpha, low=0.0)

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        matrix = block_matrix(problem.Q, problem.dim)
        bonded = form(problem.Q) == "array"
        point = start or (cold_start(problem) if bonded else at_rest(problem))
        yield from proximal_iterates(problem, matrix, point, self.alpha)


def proximal_iterates(
    problem: InterfaceProblem, matrix: Blocks, point: Iterate, alpha: float, pace: Pace = "steady"
) -> Iterator[Iterate]:
    """The solution of one proximal subproblem after another, or of a failed one the point at which
    Newton's method ended. `alpha` is the first weight of the proximal term. The pace `gentle` is
    for problems on which every smaller alpha soon fails; the pace `eager` ends with the first
    failure.
    """
    steps = constants.SUBPROBLEM_STEPS
    fall, rise, easy, most = {
        "steady": (constants.FALL, constants.RISE, steps, steps),
        "gentle": (constants.GENTLE_FALL, constants.GENTLE_RISE, constants.EASY, steps),
        "eager": (constants.FALL, np.inf, constants.EAGER_STEPS, constants.EAGER_STEPS),
    }[pace]
    while alpha < LARGEST_WEIGHT:
        equations = coulomb_equations(problem, point[0], alpha)
        new, solved, taken = solve_subproblem(equations, matrix, point, most)
        yield new
        point = new if solved else point
        if not solved:
            alpha *= rise
        elif taken <= easy:
            alpha = max(alpha / fall, LEAST_WEIGHT)
