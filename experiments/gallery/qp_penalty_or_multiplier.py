"""Penalty against multiplier.

Class: quadratic program. Mechanics: springs in place of a constraint. The bodies overlap by the
force over the stiffness.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, models

problem = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.0)
program, stiffness, depth = models.penalised(problem), 10.0 ** np.arange(5), []
for kappa in stiffness:
    program.parameters["compliance"].value = 1 / kappa
    program.problem.solve(solver="CLARABEL")
    depth.append(-program.multipliers["gap"][0])
assert np.allclose(depth, 1 / (1 + stiffness), atol=1e-6)
plt.loglog(stiffness, depth, "o-")
plt.gca().set(
    xlabel=r"penalty stiffness $\kappa$ [N/mm]", ylabel="overlap [mm]"
)
