"""The normal and the tangential problem through QP and conic backends
(contactopt.methods.kernels.subproblems: from products alone).

A backend's answer is made exact by active-set steps, or asked for again at tighter settings.
"""

from operator import itemgetter

import numpy as np

from contactopt.methods.backends import attempts
from contactopt.methods.backends.conic import Conic
from contactopt.methods.backends.qp import BoxQP
from contactopt.methods.kernels.semismooth import Equations, certified
from contactopt.methods.method import Iterate
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import disc_derivative, half_line_derivative


class Components:
    """The normal or the tangential components of a dimensionless problem, with the plates that
    belong to them.

    own    mask (p,) of the multipliers that belong to them
    shape  (k, j) of their forces;  Q, V  on them;  coupling  with the other components
    """

    def __init__(self, problem: InterfaceProblem, own: np.ndarray, normal: bool):
        blocks = np.arange(problem.q.size).reshape(problem.q.shape)
        here, there = (blocks[:, :1], blocks[:, 1:]) if normal else (blocks[:, 1:], blocks[:, :1])
        rows, others = here.ravel(), there.ravel()
        self.problem, self.own, self.shape = problem, own, here.shape
        self.q, self.V_all = problem.q.ravel()[rows], problem.V[rows]
        self.V_there = problem.V[others]
        self.Q, self.coupling = problem.Q[np.ix_(rows, rows)], problem.Q[np.ix_(rows, others)]
        self.V = self.V_all[:, own]

    def given(self, fixed: np.ndarray, lam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The linear term and the resultants, given the other components."""
        c = self.q + self.coupling @ fixed.ravel() + self.V_all[:, ~self.own] @ lam[~self.own]
        return c, (self.problem.s + self.V_there.T @ fixed.ravel())[self.own]


class NormalProblem(Components):
    """The bound-constrained QP of the normal forces; the backend is handed Q_nn once."""

    def __init__(self, backend: str, problem: InterfaceProblem, own: np.ndarray):
        super().__init__(problem, own, normal=True)
        self.qp = BoxQP.using(backend, self.Q, self.V.T)

    def solve(self, r: np.ndarray, multipliers: np.ndarray) -> Iterate:
        """r (k, dim) with new r_n, and the multipliers of this problem's balance rows."""
        c, s = self.given(r[:, 1:], multipliers)
        low, high = self.problem.law.lowest, np.full(len(c), np.inf)
        tries = attempts(self.qp, lambda qp: qp.solve(c, -s, low, high, start=r[:, 0]))
        equations = Equations(self.Q, c[:, None], self.V, s, lambda y: half_line_derivative(y, low))
        new, lam = certified(tries, equations)
        return np.concatenate([new, r[:, 1:]], axis=1), lam


class TangentialProblem(Components):
    """The QP (one tangential direction) or SOCP (two) of the tangential forces, built once."""

    def __init__(self, backend: str, problem: InterfaceProblem, own: np.ndarray):
        super().__init__(problem, own, normal=False)
        self.active = bool(np.any(problem.law.rough))
        if self.active:
            self.solver: BoxQP | Conic
            if problem.dim == 2:
                self.solver = BoxQP.using(backend, self.Q, self.V.T)
            else:
                from contactopt.models import tangential

                self.solver = Conic.using(backend, tangential(problem), self.Q)

    def solve(self, r: np.ndarray, multipliers: np.ndarray) -> Iterate:
        """r (k, dim) with new r_t, and the multipliers of this problem's balance rows."""
        r_n, r_t = r[:, :1], r[:, 1:]
        if not self.active:
            return np.concatenate([r_n, np.zeros_like(r_t)], axis=1), np.zeros(0)
        c, s = self.given(r_n, multipliers)
        radius, start = self.problem.law.bound(r[:, 0]), r_t.ravel()
        if isinstance(self.solver, BoxQP):
            tries = attempts(self.solver, lambda qp: qp.solve(c, -s, -radius, radius, start=start))
        else:
            given = {"r_n": r[:, 0], "g": radius}
            if not self.own.all():
                given["approach"] = multipliers[~self.own]
            parts = itemgetter("r_t", "shift")
            tries = attempts(self.solver, lambda conic: parts(conic.solve(**given)))
        discs = Equations(
            self.Q, c.reshape(r_t.shape), self.V, s, lambda y: disc_derivative(y, radius)
        )
        new, lam = certified(tries, discs)
        return np.concatenate([r_n, new], axis=1), lam
