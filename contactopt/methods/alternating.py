"""The paper's two-stage iteration (section 5.1): normal and tangential forces in turn.

Normal problem, r_t fixed (eq (21); its optimality conditions are Signorini's, eq (15)): a QP,
    min  r_n' Q_nn r_n / 2 + (q_n + Q_nt r_t)' r_n    subject to  r_n >= 0,
         V_n' r_n = -s - V_t' r_t.
Tangential problem, r_n fixed (eq (22)): a QP with one tangential direction, an SOCP with two,
    min  r_t' Q_tt r_t / 2 + (q_t + Q_tn r_n + V_t lambda)' r_t    subject to  |r_t| <= mu |r_n|.
The multipliers of the balance rows are the plates' displacements. Plates that move tangentially
only belong to the tangential problem. A backend's answer is made exact by active-set steps, or
asked for again at tighter settings. The backend `pcg`, for both problems, forms no entry of Q:
active sets and conjugate gradients with the preconditioners of contactopt.methods.preconditioners.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt.checks import check_number
from contactopt.errors import InputError
from contactopt.methods.backends import CONIC, QP, find
from contactopt.methods.kernels.krylov import model_of
from contactopt.methods.kernels.splitting import NormalProblem, TangentialProblem
from contactopt.methods.kernels.subproblems import KrylovSubproblem
from contactopt.methods.method import Iterate, Method, at_rest
from contactopt.methods.preconditioners import find_preconditioner
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.law import Law

PCG = "pcg"  # the backend that needs no entry of Q


class TwoStage(Method):
    """The iteration with any two solvers; `relaxation` is the share of new tangential forces."""

    relaxation: float

    def __post_init__(self) -> None:
        check_number("the relaxation", self.relaxation, low=0.0, high=1.0 + 1e-12)

    def solves(self, law: Law) -> bool:
        """Laws that bound tangential forces and under which slip does not open the gap."""
        return law.bounded and not law.dilatant

    def subproblems(self, problem: InterfaceProblem, pushes: np.ndarray) -> tuple[Any, Any]:
        """Solvers of the normal problem, with the plates of the mask `pushes` (p,), and of the
        tangential one, with all others. `solve(r, multipliers)` returns r (k, dim) with its own
        components renewed, and the multipliers of its own plates.
        """
        raise NotImplementedError

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        # columns with normal entries
        pushes = np.any(np.abs(problem.V[:: problem.dim]) > 1e-9, axis=0)
        normal, tangential = self.subproblems(problem, pushes)
        r, multipliers = start or at_rest(problem)
        multipliers = multipliers.copy()
        while True:
            r, multipliers[pushes] = normal.solve(r, multipliers)
            new, multipliers[~pushes] = tangential.solve(r, multipliers)
            r = new + (1 - self.relaxation) * (r - new)
            yield r, multipliers.copy()


@dataclass(frozen=True)
class Alternating(TwoStage):
    """The alternating iteration of the paper: a normal and a tangential convex program in turn.

    `normal` and `tangential` name the backends; by default the tangential one is proxqp for
    intervals, clarabel for discs. `relaxation`, in (0, 1], is the fraction of a new tangential
    force that is taken. `preconditioner` is that of the backend 'pcg', which needs products with Q
    only.
    """

    normal: str = "proxqp"
    tangential: str | None = None
    relaxation: float = 1.0
    preconditioner: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        find_preconditioner(self.preconditioner)

    @property
    def implicit(self) -> bool:
        """Takes an operator for Q."""
        return self.normal == PCG

    def backends(self, dim: int) -> tuple[str, str]:
        if PCG in (self.normal, self.tangential):
            if self.normal != PCG or self.tangential not in (PCG, None):
                raise InputError(
                    "the backend 'pcg' solves the normal and the tangential problem; name it for"
                    " both."
                )
            return PCG, PCG
        tangential = self.tangential or ("proxqp" if dim == 2 else "clarabel")
        return find(self.normal, QP).name, find(tangential, QP if dim == 2 else CONIC).name

    def subproblems(self, problem: InterfaceProblem, pushes: np.ndarray) -> tuple[Any, Any]:
        if not pushes.all() and not np.any(problem.law.rough):
            raise InputError(
                "a plate that moves tangentially needs friction to hold it, but mu = 0."
            )
        normal, tangential = self.backends(problem.dim)
        if normal == PCG:
            P = model_of(problem, self.preconditioner)
            pressing = KrylovSubproblem(problem, P, pushes, True)
            return pressing, KrylovSubproblem(problem, P, ~pushes, False)
        contact = NormalProblem(normal, problem, pushes)
        return contact, TangentialProblem(tangential, problem, ~pushes)
