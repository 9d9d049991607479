"""A small certificate, a large error.

Class: nearly singular complementarity problem. Mechanics: one node whose friction is as strong as
its springs are coupled. The certificate bounds the laws, and not the error of the forces.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, natural_map_residual

problem = InterfaceProblem([[1, -1], [-1, 2]], [[-1e-9, -5]], 1 - 1e-9)
r_n = np.linspace(0.5, 1.5, 41)
certificate = [
    natural_map_residual(problem, np.array([[r, problem.mu[0] * r]]))
    for r in r_n
]
assert max(certificate) < 1e-8
plt.plot(r_n, certificate, "o-", [1], [0], "k*")
plt.gca().set(
    xlabel="normal force $r_n$ [N] (star: exact)", ylabel="certificate [-]"
)
