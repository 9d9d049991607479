"""Lagrange multiplier method for friction inside the two-stage iteration: Uzawa's iteration (paper,
section 5.1).

Normal problem, r_t fixed: the QP (21), solved by conjugate gradients with bounds
(contactopt.methods.kernels.mprgp) and made exact by active set steps. Tangential problem, r_n
fixed: the friction force is the Lagrange multiplier of the bound on the slip rate; Uzawa's ascent
on it,
    r_t <- projection of r_t - rho u_t on the discs |r_t| <= mu |r_n|,    u_t = (Q r + V lambda + q)_t,
is repeated until it has converged. It minimises the convex program (22) of `alternating`;
tangentially moving plates keep their balance within the projection. rho = 1 / largest eigenvalue of
Q_tt, so that the inner iteration always converges, linearly at a rate 1 - 1 / condition number of
Q_tt: cheap iterations, one product with Q_tt each, but many. The outer loop contracts or cycles
exactly as `alternating` does (moderate mu, weak coupling); relaxation < 1 helps there. Sources:
Uzawa's method in Glowinski, Lions, Tremolieres (1981), Numerical Analysis of Variational
Inequalities; Panagiotopoulos (1975) for the alternation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from contactopt.checks import check_number
from contactopt.linear.deadline import check_time
from contactopt.methods.constants import ROUGH_NORMAL, SHARPER, SHARPEST
from contactopt.methods.kernels.balance import project_balanced
from contactopt.methods.kernels.mprgp import eigenvalue_bound, smalbe
from contactopt.methods.kernels.semismooth import Projection, crossover
from contactopt.methods.kernels.splitting import Components
from contactopt.methods.method import NATIVE, Iterate
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import disc_derivative, half_line_derivative
from contactopt.problem.laws.law import Law

INNER = 5000  # Uzawa steps in one tangential problem


@dataclass(frozen=True)
class Lagrangian:
    """Uzawa's iteration on the friction forces inside the two-stage iteration.

    Parameters
    ----------
    relaxation : Fraction of each new tangential force that is taken, above 0 and at most 1.
    """

    relaxation: float = 1.0

    def __post_init__(self) -> None:
        check_number("the relaxation", self.relaxation, low=0.0, high=1.0 + 1e-12)

    def backends(self, dim: int) -> tuple[str, str]:
        return NATIVE, NATIVE

    def solves(self, law: Law) -> bool:
        return law.bounded and not law.dilatant

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        r, lam = (np.zeros(problem.q.shape), np.zeros(len(problem.s))) if start is None else start
        r_n, r_t, lam = r[:, 0], r[:, 1:], lam.copy()
        # columns with normal entries
        pushes = np.any(np.abs(problem.V[:: problem.dim]) > 1e-9, axis=0)
        normal, tangential = Part(problem, pushes, True), Part(problem, ~pushes, False)
        change = 1.0
        while True:
            r_n, lam[pushes] = normal.exact(r_n, r_t, lam)
            new, lam[~pushes] = tangential.uzawa(r_t, r_n, lam, max(SHARPER * change, SHARPEST))
            change = float(np.linalg.norm(new - r_t)) / max(1.0, float(np.linalg.norm(new)))
            r_t = new + (1 - self.relaxation) * (r_t - new)
            yield np.concatenate([r_n[:, None], r_t], axis=1), lam.copy()


class Part(Components):
    """Normal or tangential components, and how each of them is solved for."""

    def __init__(self, problem: InterfaceProblem, own: np.ndarray, normal: bool):
        super().__init__(problem, own, normal)
        self.step = 1 / eigenvalue_bound(self.Q)

    def exact(
        self, r_n: np.ndarray, r_t: np.ndarray, lam: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The normal QP."""
        low = self.problem.law.lowest
        c, s = self.given(r_t, lam)
        rough = smalbe(self.Q, c, low, self.V.T, -s, r_n, lam[self.own], ROUGH_NORMAL)
        project: Projection = lambda y: half_line_derivative(y, low)  # noqa: E731
        r, new = crossover(self.Q, c, self.V, s, project, rough.x[:, None], rough.multipliers)
        return r[:, 0], new

    def uzawa(
        self, r_t: np.ndarray, r_n: np.ndarray, lam: np.ndarray, accuracy: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """The tangential program, until a step moves r_t by at most accuracy times the first step."""
        c, s = self.given(r_n, lam)
        radius, own, first = self.problem.law.bound(r_n), lam[self.own], 0.0
        for _ in range(INNER):
            check_time()
            y = r_t - self.step * ((self.Q @ r_t.ravel()) + c).reshape(self.shape)
            new, own = project_balanced(
                lambda y: disc_derivative(y, radius), y, self.V, s, self.step, own
            )
            move = float(np.linalg.norm(new - r_t))
            r_t, first = new, max(first, move)
            if move <= accuracy * max(1.0, float(np.linalg.norm(r_t))):
                break
        return r_t, own
