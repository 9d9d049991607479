"""All solutions by mixed integers.

Class: mixed-integer program, here enumerated. Mechanics: one node on coupled springs with strong
friction. Stick, slip and separation are all possible under one load.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, all_solutions

Q = np.linalg.inv([[4.0, -1.5], [-1.5, 1.0]])
counts, pushes = [], np.linspace(-2, 4, 25)
for push in pushes:
    counts.append(
        len(all_solutions(InterfaceProblem(Q, [Q @ [-1.0, push]], 3.5)))
    )
assert max(counts) == 3 and min(counts) == 1
plt.step(pushes, counts, where="mid")
plt.gca().set(
    xlabel="push [N]", ylabel="number of solutions [-]", yticks=[0, 1, 2, 3]
)
