"""Tresca against Coulomb: a fixed point.

Class: fixed point of quadratic programs. Mechanics: Coulomb's law is Tresca's with the bound g =
mu r_n.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, models, solve

problem, bounds = (
    InterfaceProblem([[2.0, 0.5], [0.5, 1.0]], [[-1.0, -2.0]], 0.4),
    [np.zeros(1)],
)
program = models.tresca(problem)
for _ in range(12):
    program.parameters["g"].value = bounds[-1]
    program.problem.solve(solver="CLARABEL")
    bounds.append(np.maximum(problem.mu * program.variables["r"].value[0], 0))
assert abs(bounds[-1] - 0.4 * solve(problem).reactions[0, 0]).max() < 1e-5
plt.plot(bounds, "o-")
plt.gca().set(xlabel="step [-]", ylabel="friction bound $g$ [N]")
