"""Coulomb friction at contacts that may open, eqs (15) to (17) of the paper."""

from dataclasses import dataclass

import numpy as np

from contactopt.problem.cones import (
    coulomb_cone,
    coulomb_cone_derivative,
    disc,
    disc_of_height,
    lengths,
    split,
    unit,
)
from contactopt.problem.laws.law import Law, Projected


@dataclass(frozen=True, eq=False)
class Coulomb(Law):
    """u_n >= 0, r_n >= 0, u_n r_n = 0;  |r_t| <= mu r_n, and where u_t != 0: r_t = -mu r_n u_t /
    |u_t|.

    mu  (k,) friction coefficients
    """

    mu: np.ndarray
    proportional = True

    def idle(self, y: np.ndarray) -> np.ndarray:
        return np.asarray(y[:, 0] <= 0)

    def bound(self, r_n: np.ndarray) -> np.ndarray:
        return np.asarray(self.mu * np.maximum(r_n, 0.0))

    def nearest(self, y: np.ndarray, r_n: np.ndarray) -> np.ndarray:
        return coulomb_cone(y, self.mu)

    def nearest_derivative(self, y: np.ndarray, r_n: np.ndarray) -> Projected:
        return coulomb_cone_derivative(y, self.mu)

    def project(self, y: np.ndarray) -> Projected:
        """max(y_n, 0), and y_t projected on the disc of radius mu max(y_n, 0) (Alart, Curnier)."""
        n, t = split(y)
        closed = n > 0
        P, D = disc_of_height(np.maximum(n, 0.0), t, self.mu, closed.astype(float))
        D[~closed] = 0.0
        return P, D

    def mapped(self, y: np.ndarray) -> np.ndarray:
        P = np.empty_like(y)
        np.maximum(y[:, 0], 0.0, out=P[:, 0])
        P[:, 1:] = disc(y[:, 1:], self.mu * P[:, 0])
        return P

    def project_by_parameter(self, y: np.ndarray) -> np.ndarray:
        n, t = split(y)
        slides = (n > 0) & (lengths(t) > self.mu * n)
        return np.concatenate([np.zeros((len(y), 1)), (slides * n)[:, None] * unit(t)], axis=1)

    def opening(self, u_t: np.ndarray) -> np.ndarray:
        return np.asarray(self.mu * lengths(u_t))
