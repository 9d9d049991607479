"""One program, many loads.

Class: parametric quadratic program. Mechanics: a friction bound grows. cvxpy compiles the program
once, because it follows the rules of disciplined parametrised programming (DPP).
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, models

program = models.tresca(InterfaceProblem(np.eye(2), [[-1.0, -2.0]], 0.3))
bounds, slip = np.linspace(0, 3, 13), []
for program.parameters["g"].value in bounds[:, None]:
    program.problem.solve(solver="CLARABEL")
    slip.append(program.multipliers["slip"][0, 0])
assert program.problem.is_dpp() and np.allclose(
    slip, -np.maximum(2 - bounds, 0), atol=1e-4
)
plt.plot(bounds, slip, "o-")
plt.gca().set(xlabel="friction bound $g$ [N]", ylabel="slip $u_t$ [mm]")
