"""Weak and strong duality.

Class: second-order cone program and its dual. Mechanics: Tresca friction. The gap between the two
values is never negative, and zero at the solution.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, models

problem, g = (
    InterfaceProblem(np.eye(3), [[-1.0, 3.0, 4.0]], 0.3),
    np.linspace(0, 6, 13),
)
values = []
for bound in g[:, None]:
    dual, primal = models.tresca(problem), models.tresca(problem, form="primal")
    dual.parameters["g"].value = primal.parameters["g"].value = bound
    values.append(
        [-dual.problem.solve("CLARABEL"), primal.problem.solve("CLARABEL")]
    )
assert np.allclose(*np.transpose(values), atol=1e-6)
plt.plot(g, values, "o-")
plt.gca().set(
    xlabel="friction bound $g$ [N]",
    ylabel="minus dual, and primal value [N mm]",
)
