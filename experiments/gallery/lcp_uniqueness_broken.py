"""Uniqueness broken.

Class: linear complementarity problem. Mechanics: one node. Above the threshold mu = Q_nn / |Q_nt|
there are loads with several solutions.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, all_solutions, diagnose

Q = np.linalg.inv([[4.0, -1.5], [-1.5, 1.0]])
threshold = diagnose(InterfaceProblem(Q, [[0.0, 0.0]], 1.0)).guaranteed.unique
mus, pushes = np.linspace(0.1, 1.9, 10) * threshold, np.linspace(0, 3, 61)
count = lambda mu, push: len(
    all_solutions(InterfaceProblem(Q, [Q @ [-1.0, push]], mu))
)
most = np.array([max(count(mu, push) for push in pushes) for mu in mus])
assert abs(threshold - Q[0, 0] / Q[0, 1]) < 1e-9 and np.array_equal(
    most > 1, mus > threshold
)
plt.plot(mus / threshold, most, "o")
plt.gca().set(
    xlabel=r"$\mu$ / threshold [-]", ylabel="most solutions of one load [-]"
)
