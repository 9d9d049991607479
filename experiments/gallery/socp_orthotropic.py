"""Friction that depends on the direction.

Class: second-order cone program. Mechanics: associated friction on a grooved surface, 0.2 along
the grooves and 0.6 across. The force limit is an ellipse.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, laws, models

law, forces = laws.Orthotropic([0.2], [0.6]), []
for angle in np.linspace(0, 2 * np.pi, 25):
    q = [[-1.0, 50 * np.cos(angle), 50 * np.sin(angle)]]
    program = models.associated(InterfaceProblem(np.eye(3), q, law))
    program.problem.solve(solver="CLARABEL")
    forces.append(
        program.variables["r"].value / program.variables["r"].value[0]
    )
assert np.allclose(
    (np.array(forces)[:, 1:] / [0.2, 0.6] ** np.ones(2)) ** 2 @ [1, 1],
    1,
    atol=1e-3,
)
plt.plot(*np.array(forces).T[1:], "o-")
plt.gca().set(
    xlabel="$r_1 / r_n$ [-]", ylabel="$r_2 / r_n$ [-]", aspect="equal"
)
