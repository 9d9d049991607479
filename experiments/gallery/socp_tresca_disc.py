"""Tresca friction in three dimensions.

Class: second-order cone program. Mechanics: friction bounds are discs, and friction opposes the
slip.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, models

problem = InterfaceProblem(np.eye(3), [[-1.0, 3.0, 4.0]], 0.3)
program = models.tresca(problem)
program.parameters["g"].value = [2.0]
program.problem.solve(solver="CLARABEL")
force, slip = program.variables["r"].value[1:], program.multipliers["slip"][0]
assert np.allclose(force, [-1.2, -1.6], atol=1e-6) and np.allclose(
    slip, [1.8, 2.4], atol=1e-6
)
plt.plot([0, force[0]], [0, force[1]], "o-", [0, slip[0]], [0, slip[1]], "s-")
plt.gca().set(
    xlabel="$t_1$: force [N] (circles), slip [mm] (squares)",
    ylabel="$t_2$ [N], [mm]",
)
