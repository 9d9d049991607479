"""Contact without separation: the normal force may pull, and friction counts its size."""

from dataclasses import dataclass

import numpy as np

from contactopt.problem.cones import cylinder_derivative, disc, split, unit
from contactopt.problem.laws.law import Law, Projected


@dataclass(frozen=True, eq=False)
class Bilateral(Law):
    """u_n = 0;  |r_t| <= mu |r_n|, and where u_t != 0: r_t = -mu |r_n| u_t / |u_t|.

    mu  (k,) friction coefficients
    """

    mu: np.ndarray
    proportional = True
    opens = False

    def bound(self, r_n: np.ndarray) -> np.ndarray:
        return np.asarray(self.mu * np.abs(r_n))

    def nearest(self, y: np.ndarray, r_n: np.ndarray) -> np.ndarray:
        return np.concatenate([y[:, :1], disc(y[:, 1:], self.bound(r_n))], axis=1)

    def nearest_derivative(self, y: np.ndarray, r_n: np.ndarray) -> Projected:
        return cylinder_derivative(y, self.bound(r_n), -np.inf)

    def slope(self, r_n: np.ndarray) -> np.ndarray:
        return np.asarray(self.mu * np.sign(r_n))

    def project_by_parameter(self, y: np.ndarray) -> np.ndarray:
        n, t = split(y)
        slides = np.linalg.norm(t, axis=1) > self.mu * np.abs(n)
        return np.concatenate(
            [np.zeros((len(y), 1)), (slides * np.abs(n))[:, None] * unit(t)], axis=1
        )
