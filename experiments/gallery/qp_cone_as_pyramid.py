"""The cone as a pyramid.

Class: quadratic program for a cone program. Mechanics: associated friction at one contact in
three dimensions. The error of a pyramid with m facets falls like 1 / m^2.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, models

problem = InterfaceProblem(np.eye(3), [[-1.0, 2.0, 0.0]], 0.4)
exact = models.associated(problem).problem.solve(solver="CLARABEL")
facets = [4, 8, 16, 32, 64]
value = [
    models.associated(problem, m).problem.solve(solver="CLARABEL")
    for m in facets
]
errors = np.subtract(value, exact)
assert errors.min() > -1e-7 and np.all(errors[1:] < errors[:-1] / 3)
plt.semilogy(facets, errors, "o-")
plt.gca().set(xlabel="facets $m$ [-]", ylabel="excess of the minimum [N mm]")
