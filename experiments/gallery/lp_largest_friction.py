"""The largest friction force that a load allows.

Class: linear program. Mechanics: limit load. Three contacts share the weight; each carries at
most mu r_n sideways.
"""

import cvxpy as cp
import matplotlib.pyplot as plt

mu, weight, r_n, r_t = 0.3, 10.0, cp.Variable(3), cp.Variable(3)
carried = [r_n >= 0, cp.sum(r_n) == weight, cp.abs(r_t) <= mu * r_n]
limit = cp.Problem(cp.Maximize(cp.sum(r_t)), carried).solve(solver="CLARABEL")
assert abs(limit - mu * weight) < 1e-6
plt.bar(["1", "2", "3"], r_t.value)
plt.gca().set(xlabel="contact [-]", ylabel=r"friction force $r_t$ [N]")
