"""Acary and Cadoux: a fixed point on cones.

Class: fixed point of second-order cone programs. Mechanics: the gap is shifted by mu s until s =
|u_t|.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, models, natural_map_residual

problem, residuals = InterfaceProblem(np.eye(3), [[-1.0, 2.0, 1.0]], 0.4), []
program = models.acary_cadoux(problem)
for _ in range(12):
    program.problem.solve(solver="CLARABEL")
    residuals.append(
        natural_map_residual(
            problem, program.variables["r"].value.reshape(1, 3)
        )
    )
    program.parameters["s"].value = np.linalg.norm(
        program.multipliers["slip"], axis=1
    )
assert residuals[-1] < 1e-5 < residuals[0]
plt.semilogy(residuals, "o-")
plt.gca().set(xlabel="step [-]", ylabel="certificate [-]")
