"""The design of a profile.

Class: mathematical program with equilibrium constraints (MPEC). Mechanics: the heights of four
nodes are chosen so that each carries one newton.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize

from contactopt import InterfaceProblem, solve

Q, rough = (
    np.kron(np.eye(4) + 0.3, np.eye(2)),
    np.array([-2.0, -1.0, -0.5, -1.5]),
)
force = lambda h: solve(
    InterfaceProblem(Q, np.column_stack([rough + h, np.zeros(4)]), 0.0)
).reactions[:, 0]
best = minimize(
    lambda h: np.sum((force(h) - 1) ** 2), np.full(4, -2.0), method="BFGS"
).x
assert abs(force(best) - 1).max() < 1e-2 < abs(force(np.zeros(4)) - 1).max()
plt.plot(range(4), force(np.zeros(4)), "o-", range(4), force(best), "s-")
plt.gca().set(
    xlabel="contact [-]", ylabel="normal force, first (circles) and best [N]"
)
