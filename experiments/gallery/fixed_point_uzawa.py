"""Uzawa's method climbs the dual.

Class: projected gradient on a dual quadratic program. Mechanics: the force of a contact grows
where the bodies overlap.
"""

import matplotlib.pyplot as plt
import numpy as np

Q, q, r, gaps = np.eye(4) + 0.3, np.array([-2.0, -1, 1, 2]), np.zeros(4), []
S, value = np.linalg.inv(Q), 0.0
for _ in range(40):
    r = np.maximum(r - 0.4 * (Q @ r + q), 0)
    u = np.maximum(Q @ r + q, 0)
    gaps.append((u - q) @ S @ (u - q) / 2 + r @ Q @ r / 2 + q @ r)
assert min(gaps) > -1e-12 and gaps[-1] < 1e-6 * gaps[0]
plt.semilogy(np.maximum(gaps, 1e-16), "o-")
plt.gca().set(xlabel="step [-]", ylabel="duality gap [N mm]")
