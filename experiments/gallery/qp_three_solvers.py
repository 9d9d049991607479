"""OSQP, Clarabel and SCS: how accurate are they?

Class: quadratic program. Mechanics: Tresca friction. All three run with their own settings. The
measure is the distance from the primal value.
"""

import matplotlib.pyplot as plt

from contactopt import InterfaceProblem, models

problem = InterfaceProblem([[2.0, 0.5], [0.5, 1.0]], [[-1.0, -2.0]], 0.3)
gaps = {}
for solver in ("OSQP", "CLARABEL", "SCS"):
    dual, primal = models.tresca(problem), models.tresca(problem, form="primal")
    dual.parameters["g"].value = primal.parameters["g"].value = [0.2]
    gaps[solver] = abs(
        dual.problem.solve(solver) + primal.problem.solve(solver="CLARABEL")
    )
assert max(gaps.values()) < 1e-2
plt.bar(list(gaps), [max(gap, 1e-16) for gap in gaps.values()], log=True)
plt.gca().set(xlabel="solver", ylabel="duality gap [N mm]")
