"""A bound on a friction force by optimisation.

Class: second-order cone program. Mechanics: without knowing the compliance, balance and the cones
alone bound the friction force of one contact of three.
"""

import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

mu, pulls, most = 0.4, np.linspace(0, 4, 9), []
for pull in pulls:
    n, t = cp.Variable(3), cp.Variable(3)
    laws = [cp.sum(n) == 10, cp.sum(t) == pull, cp.abs(t) <= mu * n, n <= 6]
    most.append(cp.Problem(cp.Maximize(t[0]), laws).solve(solver="CLARABEL"))
assert np.allclose(most, np.minimum(mu * 6, (pulls + mu * 10) / 2), atol=1e-5)
plt.plot(pulls, most, "o-")
plt.gca().set(
    xlabel="pull on all three [N]", ylabel="most that the first carries [N]"
)
