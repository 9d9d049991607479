"""Uniqueness broken.

Class: linear complementarity problem. Mechanics: one node. Above the threshold mu = Q_nn / |Q_nt|
there are loads with several solutions.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, all_solutions, diagnose

Q = np.linalg.inv([[4.0, -1.5], [-1.5, 1.0]])
threshold = diagnose(InterfaceProblem(Q, [[0.0, 0.0]], 1.0)).guaranteed.unique
mus = np.linspace(0.1, 1.9, 10) * threshold
counts = [len(all_solutions(InterfaceProblem(Q, [Q @ [-1.0, 1.6]], mu))) for mu in mus]
assert abs(threshold - Q[0, 0] / Q[0, 1]) < 1e-9 and set(np.array(counts)[mus < threshold]) == {1}
plt.plot(mus / threshold, counts, "o")
plt.gca().set(xlabel=r"$\mu$ / threshold [-]", ylabel="number of solutions [-]")
