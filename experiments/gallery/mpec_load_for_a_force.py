"""Which load gives this friction force?

Class: mathematical program with equilibrium constraints. Mechanics: an inverse problem with one
unknown. Newton's method uses the derivative of the solution.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, sensitivity, solve

Q, wanted, push, steps = np.array([[2.0, 0.5], [0.5, 1.0]]), -0.25, 0.1, []
at = lambda push: InterfaceProblem(Q, [[-1.0, push]], 0.8)
for _ in range(4):
    answer = solve(at(push), tol=1e-12)
    miss = wanted - answer.reactions[0, 1]
    slope = (
        sensitivity(at(push), answer).forward(q=[[0.0, 1.0]]).reactions[0, 1]
    )
    push, steps = push + miss / slope, [*steps, max(abs(miss), 1e-16)]
assert steps[-1] < 1e-6
plt.semilogy(steps, "o-")
plt.gca().set(xlabel="step [-]", ylabel="error of the friction force [N]")
