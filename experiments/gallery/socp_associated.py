"""Associated friction opens the gap.

Class: second-order cone program. Mechanics: the convex relaxation of Coulomb's law. A contact
that slips opens by mu |u_t|.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, models

gaps, coefficients = [], np.linspace(0, 1, 11)
for mu in coefficients:
    program = models.associated(
        InterfaceProblem(np.eye(3), [[-1.0, 2.0, 0.0]], mu)
    )
    program.problem.solve(solver="CLARABEL")
    gaps.append(
        [
            program.multipliers["gap"][0],
            mu * abs(program.multipliers["slip"]).max(),
        ]
    )
assert np.allclose(*np.transpose(gaps), atol=1e-5)
plt.plot(coefficients, gaps, "o-")
plt.gca().set(
    xlabel=r"friction coefficient $\mu$ [-]", ylabel=r"gap and $\mu |u_t|$ [mm]"
)
