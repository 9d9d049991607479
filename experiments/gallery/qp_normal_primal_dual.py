"""Contact without friction, in forces and in displacements.

Class: quadratic program and its dual. Mechanics: a block pressed on a foundation. The multipliers
of one program are the unknowns of the other.
"""

import matplotlib.pyplot as plt

from contactopt import models, reduce, scenes

problem = reduce(scenes.flat_punch(elements=8))
dual, primal = models.normal(problem), models.normal(problem, form="primal")
dual.problem.solve(solver="CLARABEL"), primal.problem.solve(solver="CLARABEL")
r_n, reaction = dual.variables["r_n"].value, primal.multipliers["reaction"]
assert abs(reaction - r_n).max() < 1e-4 * r_n.max()
plt.plot(problem.coordinates[0], r_n, "o", label="dual: unknown")
plt.plot(problem.coordinates[0], reaction, "x", label="primal: multiplier")
plt.gca().set(xlabel="x [mm]", ylabel="normal force $r_n$ [N]")
