"""Contact that may open and carries no friction: Signorini's conditions alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contactopt.problem.laws.law import Law, Projected


@dataclass(frozen=True, eq=False)
class Frictionless(Law):
    """u_n >= 0, r_n >= 0, u_n r_n = 0;  r_t = 0.

    mu  zero, and nothing to choose: it only counts the contacts
    """

    mu: np.ndarray = 0.0  # type: ignore[assignment]
    convex = True
    proportional = True
    frictional = False

    def idle(self, y: np.ndarray) -> np.ndarray:
        return np.asarray(y[:, 0] <= 0)

    def sticking(self, r: np.ndarray) -> np.ndarray:
        return np.zeros(len(r), dtype=bool)

    def bound(self, r_n: np.ndarray) -> np.ndarray:
        return np.zeros(len(r_n))

    def nearest_derivative(self, y: np.ndarray, r_n: np.ndarray) -> Projected:
        D = np.zeros((*y.shape, y.shape[1]))
        D[:, 0, 0] = y[:, 0] > 0
        return self.nearest(y, r_n), D

    def project_by_parameter(self, y: np.ndarray) -> np.ndarray:
        return np.zeros(y.shape)

    def nearest(self, y: np.ndarray, r_n: np.ndarray) -> np.ndarray:
        out = np.zeros(y.shape)
        out[:, 0] = np.maximum(y[:, 0], 0.0)
        return out
