"""The derivative of a solution.

Class: sensitivity of an equilibrium. Mechanics: how the friction force follows the push. One
linear system replaces many solves.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, sensitivity, solve

at = lambda push: InterfaceProblem(
    [[2.0, 0.5], [0.5, 1.0]], [[-1.0, push]], 0.8
)
pushes = np.linspace(-1.0, 1.0, 41)
answers = [solve(at(push), tol=1e-12) for push in pushes]
forces = np.array([answer.reactions[0, 1] for answer in answers])
slope = (
    sensitivity(at(pushes[20]), answers[20])
    .adjoint(reactions=[[0.0, 1.0]])
    .q[0, 1]
)
assert abs(slope - (forces[21] - forces[19]) / (pushes[21] - pushes[19])) < 1e-6
plt.plot(pushes, forces, pushes, forces[20] + slope * pushes, "--")
plt.gca().set(xlabel="push [mm]", ylabel="friction force $r_t$ [N]")
