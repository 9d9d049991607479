"""Surfaces that are glued to each other: no displacement between them, whatever the force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contactopt.problem.laws.law import Law, Projected


@dataclass(frozen=True, eq=False)
class Tied(Law):
    """u = 0; r is free.

    mu  zero, and nothing to choose: it only counts the contacts
    """

    mu: np.ndarray = 0.0  # type: ignore[assignment]
    convex = True
    bounded = False
    opens = False
    frictional = False

    @property
    def rough(self) -> np.ndarray:
        return np.ones(self.contacts, dtype=bool)

    def bound(self, r_n: np.ndarray) -> np.ndarray:
        return np.full(len(r_n), np.inf)

    def nearest_derivative(self, y: np.ndarray, r_n: np.ndarray) -> Projected:
        return y.copy(), np.broadcast_to(np.eye(y.shape[1]), (*y.shape, y.shape[1])).copy()
