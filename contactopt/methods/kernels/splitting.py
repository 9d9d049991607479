"""The normal and the tangential problem through QP and conic backends
(contactopt.methods.kernels.subproblems: from products alone).

A backend's answer is made exact by active-set steps, or asked for again at tighter settings.
"""

from __future__ import annotations

import numpy as np

from contactopt.methods.backends import attempts
from contactopt.methods.backends.conic import DiscSOCP
from contactopt.methods.backends.qp import BoxQP
from contactopt.methods.kernels.semismooth import Equations, Projection, certified
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import disc_derivative, half_line_derivative, split


def _index(k: int, dim: int, normal: bool) -> np.ndarray:
    blocks = np.arange(k * dim).reshape(k, dim)
    return blocks[:, 0] if normal else blocks[:, 1:].ravel()


class NormalProblem:
    """The bound-constrained QP of the normal forces; its matrix Q_nn is handed to the backend once.

    backend : name of the QP solver
    problem : dimensionless
    columns : (p,) mask of the multipliers that belong to the normal problem
    """

    def __init__(self, backend: str, problem: InterfaceProblem, columns: np.ndarray):
        n, t = (_index(problem.contacts, problem.dim, normal) for normal in (True, False))
        self.problem, self.columns = problem, columns
        self.Q, self.Q_nt = problem.Q[np.ix_(n, n)], problem.Q[np.ix_(n, t)]
        self.V, self.V_t, self.V_other = (
            problem.V[n][:, columns],
            problem.V[t][:, columns],
            problem.V[n][:, ~columns],
        )
        self.qp = BoxQP.using(backend, self.Q, self.V.T)
        self.low = problem.law.lowest

    def solve(self, r: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """r (k, dim) with new r_n, and the multipliers of this problem's balance rows."""
        r_n, r_t = split(r)
        c = (
            self.problem.q[:, 0]
            + self.Q_nt @ r_t.ravel()
            + self.V_other @ multipliers[~self.columns]
        )
        s = self.problem.s[self.columns] + self.V_t.T @ r_t.ravel()
        project: Projection = lambda y: half_line_derivative(y, self.low)  # noqa: E731
        tries = attempts(
            self.qp, lambda qp: qp.solve(c, -s, self.low, np.full(len(c), np.inf), start=r_n)
        )
        new, lam = certified(tries, Equations(self.Q, c[:, None], self.V, s, project))
        return np.concatenate([new, r_t], axis=1), lam


class TangentialProblem:
    """The QP (one tangential direction) or SOCP (two) of the tangential forces, built once.

    Arguments as for NormalProblem; `columns` are those of the tangential problem.
    """

    def __init__(self, backend: str, problem: InterfaceProblem, columns: np.ndarray):
        n, t = (_index(problem.contacts, problem.dim, normal) for normal in (True, False))
        self.problem, self.columns = problem, columns
        self.Q, self.Q_tn = problem.Q[np.ix_(t, t)], problem.Q[np.ix_(t, n)]
        self.V, self.V_n, self.V_other = (
            problem.V[t][:, columns],
            problem.V[n][:, columns],
            problem.V[t][:, ~columns],
        )
        self.active = bool(np.any(problem.law.rough))
        if self.active:
            bridge = BoxQP if problem.dim == 2 else DiscSOCP
            self.solver = bridge.using(backend, self.Q, self.V.T)

    def solve(self, r: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """r (k, dim) with new r_t, and the multipliers of this problem's balance rows."""
        r_n, r_t = split(r)
        if not self.active:
            return np.concatenate([r_n[:, None], np.zeros_like(r_t)], axis=1), np.zeros(0)
        c = (
            self.problem.q[:, 1:].ravel()
            + self.Q_tn @ r_n
            + self.V_other @ multipliers[~self.columns]
        )
        s = self.problem.s[self.columns] + self.V_n.T @ r_n
        radius = self.problem.law.bound(r_n)
        if isinstance(self.solver, BoxQP):
            tries = attempts(
                self.solver, lambda qp: qp.solve(c, -s, -radius, radius, start=r_t.ravel())
            )
        else:
            tries = attempts(self.solver, lambda socp: socp.solve(c, -s, radius))
        discs = Equations(
            self.Q, c.reshape(r_t.shape), self.V, s, lambda y: disc_derivative(y, radius)
        )
        new, lam = certified(tries, discs)
        return np.concatenate([r_n[:, None], new], axis=1), lam
