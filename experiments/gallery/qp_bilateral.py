"""Contacts that open, and contacts that pull.

Class: quadratic program. Mechanics: the same load with contacts that may open and with contacts
that may pull.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, models

problem = InterfaceProblem(
    np.eye(8) + 0.4, np.outer([-2, -1, 1, 2], [1.0, 0]), 0.0
)
for name in ("normal", "bilateral"):
    program = getattr(models, name)(problem)
    program.problem.solve(solver="CLARABEL")
    plt.plot(range(4), program.variables["r_n"].value, "o-", label=name)
assert program.variables["r_n"].value.min() < -0.1
plt.legend(frameon=False)
plt.gca().set(xlabel="contact [-]", ylabel="normal force $r_n$ [N]")
