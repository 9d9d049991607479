"""When a fixed point runs in a circle.

Class: fixed point. Mechanics: one slipping node with Q_nn = Q_nt. A step multiplies the error by
-mu Q_nt / Q_nn. Beyond minus one the bounds leave the solution and end in a bounded cycle.
"""

import matplotlib.pyplot as plt
import numpy as np

g, steps = np.linspace(0, 2, 50), {}
for mu, style in ((0.5, "-"), (1.5, "--")):
    step = lambda g, mu=mu: mu * np.maximum(1 - g, 0)
    bounds = [0.1]
    for _ in range(30):
        bounds.append(step(bounds[-1]))
    steps[mu], _ = abs(bounds[-1] - bounds[-2]), plt.plot(bounds, style)
assert steps[0.5] < 1e-6 < 0.1 < steps[1.5]
plt.gca().set(
    xlabel=r"step [-] ($\mu$ = 0.5 solid, 1.5 dashed)",
    ylabel="friction bound $g$ [N]",
)
