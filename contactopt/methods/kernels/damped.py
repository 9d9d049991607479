"""Newton's method with a line search, for proximal subproblems."""

from itertools import islice

import numpy as np

from contactopt.methods import constants
from contactopt.methods.kernels.newton_loop import newton_iterates
from contactopt.methods.kernels.semismooth import Equations, Factored, Steps
from contactopt.methods.kernels.sparse_blocks import Blocks
from contactopt.methods.method import Iterate

DONE = 1e-13  # residual over the size of the forces at which rounding ends the iteration


def solve_subproblem(
    equations: Equations, matrix: Blocks, point: Iterate, most: int = constants.SUBPROBLEM_STEPS
) -> tuple[Iterate, bool, int]:
    """The last iterate of Newton's method with a line search, whether it solves, and the steps."""
    steps, system = 0, Steps(equations, Factored(matrix), ridge=0.0)
    iterates = newton_iterates(system, system.evaluate(point), damped=True)
    for steps, at in enumerate(islice(iterates, most + 1)):
        point = at.point
        moved = equations.rho[:, None] * (point[0] - equations.center)
        goal = constants.ENOUGH * equations.weight * float(np.linalg.norm(moved))
        if steps and at.residual <= max(DONE * float(np.linalg.norm(point[0])), goal):
            return point, True, steps
    return point, False, steps
