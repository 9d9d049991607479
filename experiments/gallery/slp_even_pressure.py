"""The design of a punch with an even pressure.

Class: sequential linear programs for a largest value, which has kinks.
Mechanics: a rigid punch is pressed on a half-plane. Its best profile is known.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import linprog

import contactopt
from contactopt import HalfSpace, Material, Rigid, Scene, solve

half, force = 10.0, 100.0  # mm, N
x = half * (2 * np.arange(64) + 1 - 64) / 64
punch = Rigid("punch", normal=(0, 1), force={"y": -force})
scene = Scene("punch", punch, HalfSpace("flat", Material(5.0, 0.3), x), 0.0)
problem = contactopt.reduce(scene, Q="explicit")
even = lambda answer: answer.reactions[:, 0] / problem.areas * 2 * half / force


def pressed(gap):
    """The problem with this gap, its solution, and pressure over mean."""
    q = problem.q + np.column_stack([gap, 0 * gap])
    answer = solve(own := replace(problem, q=q), tol=1e-9)
    return own, answer, even(answer)


def change(own, answer, pressure):
    """The change of the gap within reach that makes the peak least.

    min t over d, t:  pressure + J d <= t at all contacts,  |d| <= reach.
    """
    slopes = contactopt.sensitivity(own, answer).forward
    J = [even(slopes(q=one[:, None] * [1.0, 0.0])) for one in np.eye(len(x))]
    rows = np.column_stack([np.transpose(J), -np.ones(len(x))])
    bounds = [(-reach, reach)] * len(x) + [(None, None)]
    return linprog(np.eye(65)[-1], rows, -pressure, bounds=bounds).x[:-1]


gap, reach, now = 0 * x, 0.3, pressed(0 * x)
first = now[-1]
while reach > 1e-6:
    trial = gap + change(*now)
    if (new := pressed(trial))[-1].max() < now[-1].max() * (1 - 1e-7):
        gap, now = trial, new
    else:
        reach *= 0.3
# the displacement under an even pressure: Johnson (1985), section 2.5
known = (1 + x / half) * np.log((1 + x / half) ** 2)
known = (known + known[::-1]) * force / (2 * np.pi * 5.0) * (1 - 0.3**2)
assert np.ptp(gap - known) < 1e-6 * np.ptp(known)
assert now[-1].max() < 1 + 1e-6 < 4 < first.max()
plt.plot(x, first, x, now[-1], x, known - known.min(), ":")
plt.gca().set(xlabel="place [mm]", ylim=(0, 3))
plt.ylabel("pressure / mean, flat and designed; profile [mm]")
