"""Penalty method: penetration and, if asked, sticking slip allowed against a stiffness, minimised
exactly.

The paper's sub-solver for the normal problem (section 5.1). With kappa the penalty factor it
replaces r_n >= 0, u_n >= 0, r_n u_n = 0 by the law r_n = kappa max(-u_n, 0) of the remaining gap
u_n = (Q r + V lambda + q)_n. Read backwards the law is r_n >= 0, u_n + r_n / kappa >= 0,
r_n (u_n + r_n / kappa) = 0: Signorini's conditions with the compliance Q_nn + I / kappa. So the
dual of the penalised program,
    min  r_n'(Q_nn + I / kappa) r_n / 2 + (q_n + Q_nt r_t)' r_n   subject to  r_n >= 0, the balance,
is the same normal QP and needs no iteration of its own. Likewise Q_tt + I / kappa_t is friction
regularised by a slip |r_t| / kappa_t before the bound is reached. The regularised problem is solved
by `auto`; penetration, error and certificate of the true problem are proportional to 1 / kappa.

Sources: Kikuchi, Oden (1988), Contact Problems in Elasticity, chapter 6; Wriggers (2006),
Computational Contact Mechanics.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from contactopt.checks import check_number
from contactopt.linear.operators import shifted
from contactopt.methods.auto import Auto
from contactopt.methods.method import Iterate, Method
from contactopt.problem import InterfaceProblem, natural_map_residual

# certificate of the regularised problem, relative to the error 1 / factor that the penalty makes
EXACT = 1e-3


@dataclass(frozen=True)
class Penalty(Method):
    """The penalty method. `factor` is the stiffness of the penalty of each node, over the mean
    compliance, `tangential_factor` that along the surface; None: friction is exact.
    """

    factor: float = 1e6
    tangential_factor: float | None = None
    implicit: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_number("the penalty factor", self.factor, low=0.0)
        if self.tangential_factor is not None:
            check_number("the tangential penalty factor", self.tangential_factor, low=0.0)

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        softened = self.regularised(problem)
        loosest = max(self.factor, self.tangential_factor or 0.0)
        for r, multipliers, *_ in Auto().iterate(softened, start):
            yield r, multipliers
            if natural_map_residual(softened, r, multipliers) <= max(EXACT / loosest, 1e-13):
                return

    def regularised(self, problem: InterfaceProblem) -> InterfaceProblem:
        """The dimensionless problem with the compliances 1 / factor added to the diagonal of Q."""
        added = np.zeros(problem.q.shape)
        added[:, 0] = 1 / self.factor
        if self.tangential_factor is not None:
            added[:, 1:] = 1 / self.tangential_factor
        return replace(problem, Q=shifted(problem.Q, added.ravel()))
