"""Lagrange multipliers for friction inside the two-stage iteration: Uzawa's iteration (paper, 5.1).

The normal problem (21) is that of `alternating`, a quadratic program for the backend proxqp. The
tangential program (22) is solved by Uzawa's ascent on the multiplier of the bound on the slip rate,

    r_t <- projection of r_t - rho u_t on |r_t| <= mu |r_n|,    u_t = (Q r + V lambda + q)_t,

repeated until it has converged; tangentially moving plates keep their balance within the
projection. rho = 1 / largest eigenvalue of Q_tt, so that the inner iteration always converges.

Sources: Glowinski, Lions, Tremolieres (1981), Numerical Analysis of Variational Inequalities, for
Uzawa's method; Panagiotopoulos (1975) for the alternation.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from contactopt.linear.deadline import check_time
from contactopt.linear.operators import eigenvalue_bound
from contactopt.methods.alternating import TwoStage
from contactopt.methods.backends import QP, find
from contactopt.methods.constants import SHARPER, SHARPEST
from contactopt.methods.kernels.balance import project_balanced
from contactopt.methods.kernels.semismooth import Projection
from contactopt.methods.kernels.splitting import Components, NormalProblem
from contactopt.methods.method import NATIVE, Iterate
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import disc_derivative


@dataclass(frozen=True)
class Lagrangian(TwoStage):
    """Uzawa's iteration on the friction forces inside the two-stage iteration. `relaxation` is the
    fraction of each new tangential force that is taken, above 0 and at most 1.
    """

    relaxation: float = 1.0

    def backends(self, dim: int) -> tuple[str, str]:
        return find("proxqp", QP).name, NATIVE

    def subproblems(self, problem: InterfaceProblem, pushes: np.ndarray) -> tuple[Any, Any]:
        return NormalProblem("proxqp", problem, pushes), Tangential(problem, ~pushes, False)


class Tangential(Components):
    """The tangential program, to a hundredth of what the last solve moved r_t."""

    accuracy = SHARPER

    @cached_property
    def step(self) -> float:
        """Of Uzawa's ascent: one over the largest eigenvalue of Q."""
        return 1 / eigenvalue_bound(self.Q)

    def solve(self, r: np.ndarray, lam: np.ndarray) -> Iterate:
        c, s = self.given(r[:, 0], lam)
        r_t, radius, own = r[:, 1:], self.problem.law.bound(r[:, 0]), lam[self.own]
        project: Projection = lambda y: disc_derivative(y, radius)  # noqa: E731
        for _ in range(5000):  # Uzawa steps in one tangential problem
            check_time()
            y = r_t - self.step * ((self.Q @ r_t.ravel()) + c).reshape(self.shape)
            new, own = project_balanced(project, y, self.V, s, self.step, own)
            move, r_t = _over(new, r_t), new
            if move <= self.accuracy:
                break
        self.accuracy = max(SHARPER * _over(r_t, r[:, 1:]), SHARPEST)
        return np.concatenate([r[:, :1], r_t], axis=1), own


def _over(new: np.ndarray, old: np.ndarray) -> float:
    """How far forces moved, over their size."""
    return float(np.linalg.norm(new - old)) / max(1.0, float(np.linalg.norm(new)))
