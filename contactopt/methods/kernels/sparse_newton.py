"""Newton steps on r = P(r - rho u), u = Q r + V lambda + q + weight (r - center), V' r + s = 0,
with Q sparse or an array.

One step solves J dr + D rho V dlambda = P - r, V' dr = -(V' r + s) with J = I - D + D rho (Q +
weight I), D the generalised derivative of P, block diagonal. Contacts where D = 0 (open) are known
at once and leave the system.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from contactopt.linear.deadline import check_time
from contactopt.methods.constants import ENOUGH, MEMORY, SHORTEST, SUBPROBLEM_STEPS
from contactopt.methods.kernels.semismooth import Projection
from contactopt.methods.kernels.sparse_blocks import Blocks, bordered

DONE = 1e-13  # residual over the size of the forces at which rounding ends the iteration

Iterate = tuple[np.ndarray, np.ndarray]  # reactions (k, d), multipliers (p,)


@dataclass(frozen=True, eq=False)
class ProximalEquations:
    """The equations of one proximal subproblem of a dimensionless problem; with weight 0 they are
    those of the problem itself.

    matrix        Q, with the factors of Newton's matrices
    q, V, s       (k, d), (k d, p) and (p,) of the problem
    project       the projection of the law with its derivative
    compliance    (k,) of the contacts, of which rho = 1 / (compliance + weight) is made
    center        (k, d) forces from which the proximal term counts; not used while the weight is 0
    weight        of the proximal term
    """

    matrix: Blocks
    q: np.ndarray
    V: np.ndarray
    s: np.ndarray
    project: Projection
    compliance: np.ndarray
    center: np.ndarray | float = 0.0
    weight: float = 0.0

    def at(self, center: np.ndarray, weight: float) -> ProximalEquations:
        """The subproblem of that center and weight."""
        return replace(self, center=center, weight=weight)

    @cached_property
    def rho(self) -> np.ndarray:
        """(k,) steps of the fixed-point equations."""
        return np.asarray(1 / np.maximum(self.compliance + self.weight, 1e-3))

    def evaluate(
        self, r: np.ndarray, lam: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Norm of the residual, P(y) - r (k, d), V'r + s (p,) and the derivative of P at y = r -
        rho u.
        """
        u = (
            (self.matrix.Q @ r.ravel() + self.V @ lam).reshape(r.shape)
            + self.q
            + self.weight * (r - self.center)
        )
        P, D = self.project(r - self.rho[:, None] * u)
        error, balance = P - r, self.V.T @ r.ravel() + self.s
        return float(np.sqrt(np.sum(error**2) + np.sum(balance**2))), error, balance, D

    def step(self, error: np.ndarray, balance: np.ndarray, D: np.ndarray) -> Iterate | None:
        """dr (k, d), dlambda (p,) of one Newton step; None if the linear system is singular."""
        k, d = error.shape
        scaled = self.rho[:, None, None] * D
        kept = np.repeat(np.any(D != 0, axis=(1, 2)), d)
        dr = error.ravel().copy()
        right, gone = dr[kept], np.where(kept, 0.0, dr)
        if np.any(gone):  # what the open contacts lose moves the others
            right -= (scaled @ (self.matrix.Q @ gone).reshape(k, d, 1)).ravel()[kept]
        if len(right) == 0:
            return dr.reshape(k, d), np.zeros(len(balance))
        solve = self.matrix.factor(scaled, np.eye(d) - D + self.weight * scaled, kept)
        if solve is None:
            return None
        left = (scaled @ self.V.reshape(k, d, -1)).reshape(k * d, -1)[kept]
        answer = bordered(solve, right, self.V[kept], left, -balance - self.V.T @ gone)
        if answer is None:
            return None
        dr[kept] = answer[0]
        return dr.reshape(k, d), answer[1]

    def solve(self, r: np.ndarray, lam: np.ndarray) -> tuple[Iterate, bool, int]:
        """The last iterate of Newton's method with a line search, whether it solves the subproblem,
        and the steps.
        """
        residual, error, balance, D = self.evaluate(r, lam)
        recent = [residual]
        for steps in range(1, SUBPROBLEM_STEPS + 1):
            check_time()
            change = self.step(error, balance, D)
            if change is None:
                return (r, lam), False, steps
            length = 1.0
            while True:
                trial = r + length * change[0], lam + length * change[1]
                residual, error, balance, D = self.evaluate(*trial)
                if residual <= max(recent[-MEMORY:]):
                    break
                length /= 2
                if length < SHORTEST:
                    return (r, lam), False, steps
            r, lam = trial
            recent.append(residual)
            moved = self.weight * float(np.linalg.norm(self.rho[:, None] * (r - self.center)))
            if residual <= max(DONE * float(np.linalg.norm(r)), ENOUGH * moved):
                return (r, lam), True, steps
        return (r, lam), False, SUBPROBLEM_STEPS
