"""Nonsmooth Gauss-Seidel method: one contact after another, each local Coulomb problem solved
exactly.

With the forces of all others fixed, contact i solves u_i = Q_ii r_i + v_i: open if v_n >= 0, else
sticking if -Q_ii^-1 v_i lies in the cone, else slipping, u_t = -l r_t with l > 0. Then, r_n
eliminated and S the Schur complement, (S + l I) r_t = Q_tn v_n / Q_nn - v_t, and |r_t| = mu r_n is
one equation for l with a root in a known interval: linear in 2D (closed form), solved by
safeguarded Newton steps in 3D. Plates enter by the method of multipliers: the sweep works on Q +
tau V V', q + V (lambda + tau s), and lambda grows by tau (V' r + s) after it; tau V' V = 10 mean
compliances.

Source: Jourdan, Alart, Jean (1998), A Gauss-Seidel like algorithm to solve frictional contact
problems.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot, inf
from typing import ClassVar

import numpy as np

from contactopt.checks import check_number
from contactopt.linear.deadline import check_time
from contactopt.linear.operators import Interface, form
from contactopt.methods.kernels.gauss_seidel import Sweeps
from contactopt.methods.method import Iterate, Method, at_rest
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import disc
from contactopt.problem.laws.law import Law

STEPS = 60  # Newton or bisection steps for it


@dataclass(frozen=True)
class NSGS(Method):
    """Nonsmooth Gauss-Seidel: the law at one contact after another. `relaxation` is the fraction of
    each local change that is taken, between 0 and 2.
    """

    relaxation: float = 1.0
    sparse: ClassVar[bool] = True  # takes a sparse Q
    unsymmetric: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_number("the relaxation", self.relaxation, low=0.0, high=2.0)

    def solves(self, law: Law) -> bool:
        return law.proportional and not law.dilatant

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        (k, dim), V, s = problem.q.shape, problem.V, problem.s
        r, lam = start or at_rest(problem)
        r = np.array(r, order="C")
        if Sweeps.can(problem):
            sweeps = Sweeps(problem)
            while True:
                check_time()
                sweeps(r, 1, self.relaxation)
                yield r.copy(), lam
        flat = r.reshape(-1)  # a view: changes with r
        tau = 10.0 / np.maximum(np.sum(V**2, axis=0), 1e-300)  # tau V'V
        motions = V.reshape(k, dim, -1)
        rows = [_coupling(problem.Q, dim, i) for i in range(k)]
        bounds = zip(rows, motions, problem.mu, problem.law.lowest == 0)
        contacts = [
            Local(own + (T * tau) @ T.T, float(mu), not apart)
            for (_, _, own), T, mu, apart in bounds
        ]
        while True:
            check_time()
            w = problem.q + (V @ (lam + tau * s)).reshape(k, dim)
            pushed = V.T @ flat
            for i, (local, (others, Q, _), T) in enumerate(zip(contacts, rows, motions)):
                if i % 100 == 0:  # contacts between two looks at the clock
                    check_time()
                old = r[i].copy()
                moved = Q @ flat[others] + w[i]
                if len(s):
                    moved += T @ (tau * pushed)
                new = local.solve((moved - local.W @ old).tolist())
                if self.relaxation != 1.0:
                    new = local.admissible(old + self.relaxation * (new - old))
                r[i] = new
                if len(s):
                    pushed += T.T @ (r[i] - old)
            lam = lam + tau * (V.T @ flat + s)
            yield r.copy(), lam


def _coupling(Q: Interface, dim: int, i: int) -> tuple[slice | np.ndarray, np.ndarray, np.ndarray]:
    """The components that move contact i, their part (dim, m) of Q, its own block (dim, dim)."""
    own = slice(dim * i, dim * (i + 1))
    if form(Q) != "sparse":
        return slice(None), Q[own], Q[own, own]
    row = Q[own]
    others = np.unique(row.indices)
    return others, row[:, others].toarray(), row[:, own].toarray()


class Local:
    """Coulomb's law at one contact, u = W r + v, by scalar arithmetic: W (dim, dim), mu >= 0."""

    def __init__(self, W: np.ndarray, mu: float, bilateral: bool):
        self.W, self.mu, self.bilateral = W, mu, bilateral
        self.compliance = float(W[0, 0])
        w = W[0, 1:] / self.compliance if self.compliance > 0 else W[0, 1:]
        S = W[1:, 1:] - np.outer(W[1:, 0], w)
        floor = 1e-12 * float(np.trace(np.abs(W)) or 1.0)
        S = np.maximum(S, floor) if len(S) == 1 else S + floor * np.eye(2)
        self.S, self.w, self.tn = S.tolist(), w.tolist(), W[1:, 0].tolist()

    def solve(self, v: list[float]) -> np.ndarray:
        """r (dim,). Where several forces satisfy the law: open, else stick, else slip."""
        out = np.zeros(len(v))
        if (v[0] >= 0 and not self.bilateral) or self.compliance <= 0:
            return out
        press, b = -v[0] / self.compliance, [0.0] * len(self.w)
        if self.mu > 0 and press != 0:
            b = self._tangential([x + w * press for x, w in zip(v[1:], self.tn)], press)
            out[1:] = b
        out[0] = press - sum(w * t for w, t in zip(self.w, b))
        return out

    def _tangential(self, b: list[float], press: float) -> list[float]:
        """r_t: stick, or the root l of |r_t| = mu r_n."""
        mu, sign = self.mu, 1.0 if press > 0 else -1.0
        if len(b) == 1:
            t = -b[0] / self.S[0][0]
            bound = mu * (press - self.w[0] * t)
            if abs(t) <= (abs(bound) if self.bilateral else bound):
                return [t]
            way = 1.0 if t > 0 else -1.0
            return [way * mu * abs(press) / (1 + mu * sign * self.w[0] * way)]
        (b1, b2), ((s11, s12), (s21, s22)), (w1, w2) = b, self.S, self.w
        low, level = 0.0, 0.0
        bound = mu * abs(press)
        high = hypot(b1, b2) * (1 + mu * hypot(w1, w2)) / bound if bound > 0 else inf
        if not high < inf:  # no friction to speak of
            return [0.0, 0.0]
        for _ in range(STEPS):
            det = (s11 + level) * (s22 + level) - s12 * s21
            t1, t2 = (s12 * b2 - (s22 + level) * b1) / det, (s21 * b1 - (s11 + level) * b2) / det
            size, normal = hypot(t1, t2), press - w1 * t1 - w2 * t2
            way = -1.0 if self.bilateral and normal < 0 else 1.0
            excess = size - mu * way * normal
            if (level == 0.0 and excess <= 0) or abs(excess) <= 1e-14 * size:
                break
            low, high = (level, high) if excess > 0 else (low, level)
            # derivatives by level
            d1, d2 = (s12 * t2 - (s22 + level) * t1) / det, (s21 * t1 - (s11 + level) * t2) / det
            slope = (t1 * d1 + t2 * d2) / size + mu * way * (w1 * d1 + w2 * d2)
            level = level - excess / slope if slope < 0 else high
            level = level if low < level < high else (low + high) / 2
        return [t1, t2]

    def admissible(self, r: np.ndarray) -> np.ndarray:
        """An over-relaxed force brought back into the law's bounds."""
        if not self.bilateral:
            r[0] = max(r[0], 0.0)
        r[1:] = disc(r[None, 1:], self.mu * np.abs(r[:1]))[0]
        return r
