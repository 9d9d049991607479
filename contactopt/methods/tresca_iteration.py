"""Tresca iteration: Coulomb friction by successive problems whose friction bounds are given.

Each outer iteration solves ONE convex problem, normal and tangential forces together,
    min  r' Q r / 2 + q' r    subject to  r_n >= 0,  |r_t| <= g,  V' r + s = 0,
a box-constrained QP with one tangential direction, an SOCP with two, and then sets g = mu |r_n|.
Its answer is made exact by Newton steps on r = P(r - u), P the projection on half-lines and discs.
The first bounds are those of the bonded problem if a plate presses the bodies together, else zero:
then the first iterate is contact without friction. A fixed point is exactly a solution of Coulomb's
problem. Bounds too small for a plate that is dragged tangentially leave the convex problem without
an answer.

Sources: Panagiotopoulos (1975); Haslinger, Dostal, Kucera (2002), On a splitting type algorithm for
the numerical realization of contact problems with Coulomb friction.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from contactopt.checks import check_number
from contactopt.methods.backends import CONIC, QP, find
from contactopt.methods.backends.conic import Conic
from contactopt.methods.backends.qp import BoxQP
from contactopt.methods.kernels.alart_curnier import cold_start
from contactopt.methods.kernels.semismooth import Projection, crossover
from contactopt.methods.method import Iterate, Method, at_rest
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import cylinder_derivative
from contactopt.problem.laws.law import Law


@dataclass(frozen=True)
class Tresca(Method):
    """The fixed point of Tresca: convex programs with friction bounds of the solution before.

    `backend` names the QP backend in 2D, the conic one in 3D (None: proxqp, clarabel).
    `relaxation`, in (0, 1], is the fraction of each change of the friction bounds that is taken.
    """

    backend: str | None = None
    relaxation: float = 1.0

    def __post_init__(self) -> None:
        check_number("the relaxation", self.relaxation, low=0.0, high=1.0 + 1e-12)

    def backends(self, dim: int) -> tuple[str, str]:
        name = self.backend or ("proxqp" if dim == 2 else "clarabel")
        return (find(name, QP if dim == 2 else CONIC).name,) * 2

    def solves(self, law: Law) -> bool:
        return law.bounded and not law.dilatant

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        convex = TrescaProblem(self.backends(problem.dim)[0], problem)
        bonded = cold_start if len(problem.s) else at_rest
        r = (start or bonded(problem))[0]
        g = problem.law.bound(r[:, 0])
        while True:
            r, multipliers = convex.solve(g, r)
            g = g + self.relaxation * (problem.law.bound(r[:, 0]) - g)
            yield r, multipliers


class TrescaProblem:
    """The convex problem, handed to its backend once."""

    def __init__(self, backend: str, problem: InterfaceProblem):
        self.problem = problem
        self.low = problem.law.lowest
        self.solver: BoxQP | Conic
        if problem.dim == 2:
            self.solver = BoxQP.using(backend, problem.Q, problem.V.T)
        else:
            from contactopt.models import tresca

            self.solver = Conic.using(backend, tresca(problem), problem.Q)

    def solve(self, g: np.ndarray, start: np.ndarray) -> Iterate:
        """r (k, dim) and the multipliers (p,) for the bounds g (k,)."""
        problem, c = self.problem, self.problem.q.ravel()
        if isinstance(self.solver, BoxQP):
            low = np.stack([self.low, -g], axis=1).ravel()
            high = np.stack([np.full(len(g), np.inf), g], axis=1).ravel()
            r, lam = self.solver.solve(c, -problem.s, low, high, start=start.ravel())
        else:
            answer = self.solver.solve(g=g)
            r, lam = answer["r"], answer["approach"]
        project: Projection = lambda y: cylinder_derivative(y, g, self.low)  # noqa: E731
        return crossover(
            problem.Q, c, problem.V, problem.s, project, r.reshape(problem.q.shape), lam
        )
