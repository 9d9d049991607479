"""Four laws, one load.

Class: complementarity problems. Mechanics: Coulomb, Tresca, associated and no friction at one
contact that is pushed and pressed.
"""

import matplotlib.pyplot as plt

from contactopt import InterfaceProblem, laws, solve

tried = [
    laws.Coulomb([0.4]),
    laws.Tresca([0.2]),
    laws.Associated([0.4]),
    laws.Frictionless([0.0]),
]
forces = {}
for law in tried:
    problem = InterfaceProblem([[2.0, 0.5], [0.5, 1.0]], [[-1.0, -2.0]], law)
    forces[type(law).__name__] = solve(problem).reactions[0]
assert (
    abs(forces["Tresca"][1] - 0.2) < 1e-6
    and abs(forces["Frictionless"][1]) < 1e-6
)
plt.bar(list(forces), [abs(force[1]) for force in forces.values()])
plt.gca().set(xlabel="law", ylabel="friction force $|r_t|$ [N]")
