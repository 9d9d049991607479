"""A sweep of the friction coefficient.

Class: sequence of complementarity problems. Mechanics: a block on a foundation of the same
material. The edge of the block moves outwards, the surface below it
inwards, and friction resists.
"""

import matplotlib.pyplot as plt
import numpy as np

from contactopt import reduce, scenes, solve

mus = np.linspace(0, 0.6, 7)
answers = [solve(reduce(scenes.flat_punch(elements=8, mu=mu))) for mu in mus]
friction = [abs(answer.reactions[:, 1]).sum() for answer in answers]
assert friction[0] < 1e-6 and np.all(np.diff(friction) > -1e-6)
plt.plot(mus, friction, "o-")
plt.gca().set(
    xlabel=r"friction coefficient $\mu$ [-]", ylabel=r"$\Sigma |r_t|$ [N]"
)
