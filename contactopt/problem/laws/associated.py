"""Friction with an associated flow rule: forces and displacements are normal to each other's cones, so slip dilates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contactopt.problem.cones import coulomb_cone, coulomb_cone_derivative
from contactopt.problem.laws import Law, Projected


@dataclass(frozen=True, eq=False)
class Associated(Law):
    """|r_t| <= mu r_n,  u_n >= mu |u_t|,  r' u = 0: where a contact slips its gap opens by mu |u_t|.

    This is the optimality condition of min r' Q r / 2 + q' r over Coulomb's cones (contactopt.models.associated).

    mu  (k,) friction coefficients
    """

    mu: np.ndarray
    convex = True
    proportional = True
    dilatant = True

    @property
    def coefficient(self) -> np.ndarray:
        return self.mu

    def bound(self, r_n: np.ndarray) -> np.ndarray:
        return np.asarray(self.mu * np.maximum(r_n, 0.0))

    def nearest(self, y: np.ndarray, r_n: np.ndarray) -> np.ndarray:
        return coulomb_cone(y, self.mu)

    def nearest_derivative(self, y: np.ndarray, r_n: np.ndarray) -> Projected:
        return coulomb_cone_derivative(y, self.mu)
