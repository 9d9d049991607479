"""A warm start.

Class: sequence of problems. Mechanics: the same block with a little more friction. The previous
solution is a good first guess.
"""

import matplotlib.pyplot as plt

from contactopt import reduce, scenes, solve

first = solve(reduce(scenes.flat_punch(elements=16, mu=0.30)))
problem = reduce(scenes.flat_punch(elements=16, mu=0.31))
steps = {"cold": solve(problem), "warm": solve(problem, start=first)}
assert steps["warm"].iterations <= steps["cold"].iterations
plt.bar(list(steps), [answer.iterations for answer in steps.values()])
plt.gca().set(xlabel="start", ylabel="iterations [-]")
