"""Friction with an associated flow rule: slip dilates."""

from dataclasses import dataclass

import numpy as np

from contactopt.problem.cones import coulomb_cone, coulomb_cone_derivative, split, unit
from contactopt.problem.laws.law import Kinks, Law, Projected


@dataclass(frozen=True, eq=False)
class Associated(Law):
    """|r_t| <= mu r_n,  u_n >= mu |u_t|,  r' u = 0: where a contact slips its gap opens by mu
    |u_t|.

    This is the optimality condition of min r' Q r / 2 + q' r over Coulomb's cones
    (contactopt.models.associated).

    mu  (k,) friction coefficients
    """

    mu: np.ndarray
    convex = True
    proportional = True
    dilatant = True

    def bound(self, r_n: np.ndarray) -> np.ndarray:
        return np.asarray(self.mu * np.maximum(r_n, 0.0))

    def nearest(self, y: np.ndarray, r_n: np.ndarray) -> np.ndarray:
        return coulomb_cone(y, self.mu)

    def nearest_derivative(self, y: np.ndarray, r_n: np.ndarray) -> Projected:
        return coulomb_cone_derivative(y, self.mu)

    def project_by_parameter(self, y: np.ndarray) -> np.ndarray:
        """Between the cone and its polar P is h (1, mu unit), h = (y_n + mu |y_t|) / (1 + mu^2)."""
        n, t = split(y)
        size, mu = np.linalg.norm(t, axis=1), self.mu
        beside = (mu * size > -n) & (size > mu * n)
        h = (n + mu * size) / (1 + mu**2)
        change = (size - 2 * mu * h) / (1 + mu**2)
        return beside[:, None] * np.concatenate(
            [change[:, None], (h + mu * change)[:, None] * unit(t)], axis=1
        )

    def kinks(self, y: np.ndarray, distance: float) -> Kinks:
        """The edges of the polar cone, where contacts open, and of the cone."""
        n, t = split(y)
        size = np.linalg.norm(t, axis=1)
        normal = np.abs(n + self.mu * size) <= distance
        return Kinks(normal, (np.abs(size - self.mu * n) <= distance) & self.rough)

    def on_kinks(self, y: np.ndarray, kinks: Kinks) -> np.ndarray:
        out, size = y.copy(), np.linalg.norm(y[:, 1:], axis=1)
        out[:, 0] = np.where(kinks.normal, -self.mu * size, y[:, 0])
        edge = unit(y[:, 1:]) * (self.mu * np.maximum(y[:, 0], 0.0))[:, None]
        out[:, 1:] = np.where((kinks.tangential & ~kinks.normal)[:, None], edge, y[:, 1:])
        out[kinks.tangential & kinks.normal] = 0.0
        return out
