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
assert np.allclose(force, [-1.2, -1.6], atol=1e-6) and np.allclose(slip, [1.8, 2.4], atol=1e-6)
plt.quiver([0, 0], [0, 0], *np.array([force, slip]).T, color=["C1", "C0"], scale=8)
plt.gca().set(xlabel="$t_1$ [N], [mm]", ylabel="$t_2$ [N], [mm]")
