"""Calibration from a measured loop.

Class: nonlinear least squares with exact derivatives. Mechanics: two cylinders
are pressed together and pushed to and fro. Their shift determines E and mu.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import least_squares
from scipy.stats import norm

from contactopt import HalfSpace, Material, Scene, follow, gradient

truth, start = (5.0, 0.5), (6.5, 0.7)  # E [MPa], mu
pushes = (0.0, 16.0, 30.0, 42.0, 14.0, -16.0, -42.0, -14.0, 16.0, 42.0)  # N
x = 32.0 * (2 * np.arange(24) + 1 - 24) / 24
arch = -(x**2) / 8000.0


def path(E, mu):
    """The states of the loop: pressed, then pushed load by load."""
    states, one = [], {"material": Material(E, 0.3), "depth": 1000.0}
    for push in pushes:
        load = {"x": push, "y": -100.0}
        upper = HalfSpace("upper", points=x, height=arch, force=load, **one)
        pair = upper, HalfSpace("lower", points=x, **one)
        states.append(Scene("cylinders", *pair, mu, thickness=400.0))
    return follow(states, Q="explicit", tol=1e-12)


def misfit(values):
    """What the model leaves of the data, over the noise."""
    return (path(*values).history["shift"] - data) / noise


def slopes(values):
    """The derivatives of the shift in every state by E and mu."""
    made, names = path(*values), ("E", "mu")
    by = [gradient(made, "shift", names, i).by for i in range(len(pushes))]
    return np.array([[own["E"], own["mu"]] for own in by]) / noise


exact = path(*truth).history["shift"]
noise = 0.01 * abs(exact).max()
data = exact + noise * np.random.default_rng(19).normal(size=len(exact))
held = ([0.1, 0.421], [100.0, 10.0])  # friction of 42 N held 100 N: mu > 0.42
found = least_squares(misfit, start, slopes, held, xtol=1e-9)
covariance = np.linalg.inv(found.jac.T @ found.jac)
half = norm.ppf(0.975) * np.sqrt(np.diag(covariance))
assert np.all(abs(found.x - truth) < half)
plt.plot(pushes, data, "o", pushes, data + noise * found.fun)
words = "push [N]; 95 %: E = {:.2f} ± {:.2f} MPa, $\\mu$ = {:.2f} ± {:.2f}"
plt.xlabel(words.format(*np.stack([found.x, half]).T.ravel()))
plt.ylabel("shift [mm], measured and fitted")
