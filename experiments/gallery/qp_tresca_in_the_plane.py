"""Tresca friction in the plane.

Class: quadratic program. Mechanics: bounds on friction that are given beforehand, here a tenth of
a newton.
"""

import matplotlib.pyplot as plt

from contactopt import models, reduce, scenes

problem = reduce(scenes.flat_punch(elements=8))
program = models.tresca(problem)
program.parameters["g"].value = [0.1] * problem.contacts
program.problem.solve(solver="CLARABEL")
r_t = program.variables["r"].value[1::2]
assert abs(r_t).max() < 0.1 + 1e-6
plt.plot(problem.coordinates[0], r_t, "o-")
plt.gca().set(xlabel="x [mm]", ylabel="friction force $r_t$ [N]")
