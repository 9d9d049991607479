"""Tresca friction at contacts that may open: the friction bound is given."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from contactopt.problem.cones import cylinder_derivative, disc, unit
from contactopt.problem.laws.law import Law, Projected
from contactopt.problem.laws.place import Place


@dataclass(frozen=True, eq=False)
class Tresca(Law):
    """u_n >= 0, r_n >= 0, u_n r_n = 0;  |r_t| <= limit, and where u_t != 0: r_t = -limit u_t /
    |u_t|.

    limit  (k,) friction bounds [force], the same whether a contact is open or closed; in a scene a
           bound of the tangential traction [stress], which is multiplied by the nodal areas
    """

    limit: np.ndarray
    convex = True

    @property
    def rough(self) -> np.ndarray:
        return self.limit > 0

    def bound(self, r_n: np.ndarray) -> np.ndarray:
        return self.limit

    def nearest(self, y: np.ndarray, r_n: np.ndarray) -> np.ndarray:
        return np.concatenate([np.maximum(y[:, :1], 0.0), disc(y[:, 1:], self.limit)], axis=1)

    def nearest_derivative(self, y: np.ndarray, r_n: np.ndarray) -> Projected:
        return cylinder_derivative(y, self.limit)

    def project_by_parameter(self, y: np.ndarray) -> np.ndarray:
        slides = np.linalg.norm(y[:, 1:], axis=1) > self.limit
        return np.concatenate([np.zeros((len(y), 1)), slides[:, None] * unit(y[:, 1:])], axis=1)

    def scaled(self, force: float) -> Tresca:
        return replace(self, limit=self.limit / force)

    def lumped(self, first: np.ndarray, count: int) -> Tresca:
        return replace(self, limit=count * self.limit[first])

    @classmethod
    def of_place(cls, values: np.ndarray, place: Place) -> Law:
        return super().of_place(values * place.areas, place)
