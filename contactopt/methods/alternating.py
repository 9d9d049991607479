"""The paper's two-stage iteration (section 5.1): normal and tangential forces in turn.

Normal problem, r_t fixed (eq (21); its optimality conditions are Signorini's, eq (15)): a bound-constrained QP,
    min  r_n' Q_nn r_n / 2 + (q_n + Q_nt r_t)' r_n    subject to  r_n >= 0,  V_n' r_n = -s - V_t' r_t.
Tangential problem, r_n fixed (eq (22)): a box-constrained QP with one tangential direction, an SOCP with two,
    min  r_t' Q_tt r_t / 2 + (q_t + Q_tn r_n + V_t lambda)' r_t    subject to  |r_t| <= mu |r_n|.
The multipliers of the balance rows are the plates' displacements. Plates that move tangentially only belong to the
tangential problem. Each iteration costs one QP and one QP or SOCP. It contracts where friction couples weakly to the
normal force (small mu, similar bodies) and may cycle otherwise; relaxation < 1 then often helps. A backend's answer is
made exact by active-set steps, or asked for again at tighter settings. The backend `pcg`, for both problems, forms no
entry of Q: active sets and conjugate gradients with the preconditioners of contactopt.preconditioners.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt.backends import CONIC, QP, attempts, find
from contactopt.backends.conic import DiscSOCP
from contactopt.backends.qp import BoxQP
from contactopt.cones import disc_derivative, half_line_derivative, split, whole_line_derivative
from contactopt.errors import InputError
from contactopt.krylov import model_of
from contactopt.methods import Iterate
from contactopt.preconditioners import find_preconditioner
from contactopt.problem import InterfaceProblem
from contactopt.scene import check_number
from contactopt.semismooth import Equations, certified
from contactopt.subproblems import KrylovSubproblem

PCG = "pcg"  # the backend that needs no entry of Q


@dataclass(frozen=True)
class Alternating:
    """normal, tangential: names of the backends; tangential None is proxqp for intervals, clarabel for discs.

    relaxation in (0, 1]: the fraction of each new tangential force that is taken; preconditioner: of the backend `pcg`.
    """

    normal: str = "proxqp"
    tangential: str | None = None
    relaxation: float = 1.0
    preconditioner: str | None = None

    def __post_init__(self) -> None:
        check_number("the relaxation", self.relaxation, low=0.0, high=1.0 + 1e-12)
        find_preconditioner(self.preconditioner)

    @property
    def implicit(self) -> bool:
        """Takes an operator for Q."""
        return self.normal == PCG

    def backends(self, dim: int) -> tuple[str, str]:
        if PCG in (self.normal, self.tangential):
            if self.normal != PCG or self.tangential not in (PCG, None):
                raise InputError("the backend 'pcg' solves the normal and the tangential problem; name it for both.")
            return PCG, PCG
        tangential = self.tangential or ("proxqp" if dim == 2 else "clarabel")
        return find(self.normal, QP).name, find(tangential, QP if dim == 2 else CONIC).name

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        pushes = np.any(np.abs(problem.V[:: problem.dim]) > 1e-9, axis=0)  # columns with normal entries
        normal, tangential = self._subproblems(problem, pushes)
        r, multipliers = (np.zeros(problem.q.shape), np.zeros(len(problem.s))) if start is None else start
        multipliers = multipliers.copy()
        while True:
            r, multipliers[pushes] = normal.solve(r, multipliers)
            new, multipliers[~pushes] = tangential.solve(r, multipliers)
            r = new + (1 - self.relaxation) * (r - new)
            yield r, multipliers.copy()

    def _subproblems(self, problem: InterfaceProblem, pushes: np.ndarray) -> tuple[Any, Any]:
        _check_friction(problem, ~pushes)
        normal, tangential = self.backends(problem.dim)
        if normal == PCG:
            P = model_of(problem, self.preconditioner)
            return KrylovSubproblem(problem, P, pushes, True), KrylovSubproblem(problem, P, ~pushes, False)
        return NormalProblem(normal, problem, pushes), TangentialProblem(tangential, problem, ~pushes)


def _check_friction(problem: InterfaceProblem, tangential: np.ndarray) -> None:
    if tangential.any() and not np.any(problem.mu > 0):
        raise InputError("a plate that moves tangentially needs friction to hold it, but mu = 0.")


def _index(k: int, dim: int, normal: bool) -> np.ndarray:
    blocks = np.arange(k * dim).reshape(k, dim)
    return blocks[:, 0] if normal else blocks[:, 1:].ravel()


class NormalProblem:
    """The normal QP of one problem: Q_nn is handed to the backend once."""

    def __init__(self, backend: str, problem: InterfaceProblem, columns: np.ndarray):
        n, t = (_index(problem.contacts, problem.dim, normal) for normal in (True, False))
        self.problem, self.columns = problem, columns
        self.Q, self.Q_nt = problem.Q[np.ix_(n, n)], problem.Q[np.ix_(n, t)]
        self.V, self.V_t, self.V_other = problem.V[n][:, columns], problem.V[t][:, columns], problem.V[n][:, ~columns]
        self.qp = BoxQP.using(backend, self.Q, self.V.T)
        self.low = np.full(problem.contacts, -np.inf if problem.bilateral else 0.0)

    def solve(self, r: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """r (k, dim) with new r_n, and the multipliers of this problem's balance rows."""
        r_n, r_t = split(r)
        c = self.problem.q[:, 0] + self.Q_nt @ r_t.ravel() + self.V_other @ multipliers[~self.columns]
        s = self.problem.s[self.columns] + self.V_t.T @ r_t.ravel()
        project = whole_line_derivative if self.problem.bilateral else half_line_derivative
        tries = attempts(self.qp, lambda qp: qp.solve(c, -s, self.low, np.full(len(c), np.inf), start=r_n))
        new, lam = certified(tries, Equations(self.Q, c[:, None], self.V, s, project))
        return np.concatenate([new, r_t], axis=1), lam


class TangentialProblem:
    """The tangential QP (one direction) or SOCP (two) of one problem, built once."""

    def __init__(self, backend: str, problem: InterfaceProblem, columns: np.ndarray):
        n, t = (_index(problem.contacts, problem.dim, normal) for normal in (True, False))
        self.problem, self.columns = problem, columns
        self.Q, self.Q_tn = problem.Q[np.ix_(t, t)], problem.Q[np.ix_(t, n)]
        self.V, self.V_n, self.V_other = problem.V[t][:, columns], problem.V[n][:, columns], problem.V[t][:, ~columns]
        self.active = bool(np.any(problem.mu > 0))
        if self.active:
            bridge = BoxQP if problem.dim == 2 else DiscSOCP
            self.solver = bridge.using(backend, self.Q, self.V.T)

    def solve(self, r: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """r (k, dim) with new r_t, and the multipliers of this problem's balance rows."""
        r_n, r_t = split(r)
        if not self.active:
            return np.concatenate([r_n[:, None], np.zeros_like(r_t)], axis=1), np.zeros(0)
        c = self.problem.q[:, 1:].ravel() + self.Q_tn @ r_n + self.V_other @ multipliers[~self.columns]
        s = self.problem.s[self.columns] + self.V_n.T @ r_n
        radius = self.problem.mu * np.abs(r_n)
        if isinstance(self.solver, BoxQP):
            tries = attempts(self.solver, lambda qp: qp.solve(c, -s, -radius, radius, start=r_t.ravel()))
        else:
            tries = attempts(self.solver, lambda socp: socp.solve(c, -s, radius))
        discs = Equations(self.Q, c.reshape(r_t.shape), self.V, s, lambda y: disc_derivative(y, radius))
        new, lam = certified(tries, discs)
        return np.concatenate([r_n[:, None], new], axis=1), lam
