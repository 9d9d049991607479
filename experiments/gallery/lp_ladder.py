"""Does a ladder slide?

Class: linear program, a question of feasibility. Mechanics: statics of a rigid body with friction
at two ends, a climber at the height x on a ladder at 60 degrees.
"""

import cvxpy as cp
import matplotlib.pyplot as plt

floor_n, floor_t, wall_n, wall_t, x = (cp.Variable() for _ in range(5))
mu, cot = 0.3, 3**-0.5
cones = [
    cp.abs(floor_t) <= mu * floor_n,
    cp.abs(wall_t) <= mu * wall_n,
    x >= 0,
    x <= 1,
]
balance = [
    floor_t == wall_n,
    floor_n + wall_t == 1,
    wall_n + wall_t * cot == x * cot,
]
highest = cp.Problem(cp.Maximize(x), cones + balance).solve(solver="CLARABEL")
assert abs(highest - mu * (3**0.5 + mu) / (1 + mu**2)) < 1e-6
plt.plot(
    [0.5, 0], [0, 0.866], "k", [0.5 * (1 - highest)], [0.866 * highest], "o"
)
plt.gca().set(
    xlabel="x [length of the ladder]",
    ylabel="y [length of the ladder]",
    aspect="equal",
)
