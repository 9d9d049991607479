"""Lemke's method.

Class: linear complementarity problem. Mechanics: Coulomb friction in the plane. A pivoting method
finds the same forces as Newton's method.
"""

import matplotlib.pyplot as plt

from contactopt import reduce, scenes, solve

problem = reduce(scenes.flat_punch(elements=8, mu=0.3))
pivots, newton = solve(problem, "lemke"), solve(problem, "newton")
assert (
    abs(pivots.reactions - newton.reactions).max()
    < 1e-6 * newton.reactions.max()
)
plt.plot(problem.coordinates[0], pivots.reactions[:, 1], "o", label="Lemke")
plt.plot(problem.coordinates[0], newton.reactions[:, 1], "x", label="Newton")
plt.gca().set(xlabel="x [mm]", ylabel="friction force $r_t$ [N]")
