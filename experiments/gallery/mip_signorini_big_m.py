"""Contact or not: a binary for each node.

Class: mixed-integer linear program. Mechanics: Signorini's conditions u_n >= 0, r_n >= 0, u_n r_n
= 0. A binary number says whether a node touches.
"""

import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

Q, q, M = np.eye(4) + 0.3, np.array([-2.0, -1, 1, 2]), 10.0
r, touches = cp.Variable(4, nonneg=True), cp.Variable(4, boolean=True)
u = Q @ r + q
cp.Problem(
    cp.Minimize(0), [u >= 0, r <= M * touches, u <= M * (1 - touches)]
).solve("HIGHS")
assert abs(u.value * r.value).max() < 1e-6 and list(touches.value > 0.5) == [
    1,
    1,
    0,
    0,
]
plt.plot(range(4), u.value, "o-", range(4), r.value, "s-")
plt.gca().set(
    xlabel="contact [-]", ylabel="gap [mm] (circles), force [N] (squares)"
)
