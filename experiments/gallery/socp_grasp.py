"""How hard must two fingers press?

Class: second-order cone program. Mechanics: statics of a grasp. Two fingers hold a weight between
them by friction.
"""

import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

squeeze, weight, friction = [], 2.0, np.linspace(0.2, 1, 9)
for mu in friction:
    n, t = cp.Variable(), cp.Variable((2, 2))
    law = [
        cp.norm(t[0]) <= mu * n,
        cp.norm(t[1]) <= mu * n,
        t[0] + t[1] == [0, weight],
    ]
    squeeze.append(cp.Problem(cp.Minimize(n), law).solve(solver="CLARABEL"))
assert np.allclose(squeeze, weight / 2 / friction, atol=1e-5)
plt.plot(friction, squeeze, "o-")
plt.gca().set(
    xlabel=r"friction coefficient $\mu$ [-]",
    ylabel="least force of a finger [N]",
)
