"""Accelerated projected gradient method with restart, on convex subproblems of a fixed point.

Acary and Cadoux's form of Coulomb friction: with the slip's contribution g_i = mu_i |u_t,i| held
fixed, the forces solve
    min  r'Qr/2 + (q + g n)' r    subject to  |r_t| <= mu r_n,  V'r + s = 0,
a convex program over Coulomb's cones; g is renewed from its answer (the outer iteration that is
yielded). Other laws have other sets and openings (contactopt.problem.laws); for bilateral contact
the bound mu |r_n| is held. An inner iteration costs one product with Q (Nesterov's step 1 / largest
eigenvalue, restarted where the momentum points uphill), an outer one many of them. The inner
iteration always converges, in a number of steps like the square root of Q's condition number, and
for singular Q more slowly; the fixed point has no proof of convergence. Sources: O'Donoghue, Candes
(2015), Adaptive restart; Acary, Cadoux, Lemarechal, Malick (2011), A formulation of the linear
discrete Coulomb friction problem via convex optimization.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import sqrt
from typing import ClassVar

import numpy as np

from contactopt.linear.deadline import check_time
from contactopt.methods.constants import SHARPER, SHARPEST
from contactopt.methods.kernels.balance import project_balanced
from contactopt.methods.kernels.mprgp import eigenvalue_bound
from contactopt.methods.method import NATIVE, Iterate
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import disc
from contactopt.problem.laws.law import Projected

INNER = 2000  # products with Q in one subproblem
ROUNDS = 20  # of disc_qp


@dataclass(frozen=True)
class APG:
    """Accelerated projected gradients.

    There are no settings: the step follows from the largest eigenvalue of Q.
    """

    sparse: ClassVar[bool] = True  # takes a sparse Q

    def backends(self, dim: int) -> tuple[str, str]:
        return NATIVE, NATIVE

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        r, lam = (np.zeros(problem.q.shape), np.zeros(len(problem.s))) if start is None else start
        step = 1 / eigenvalue_bound(problem.Q)
        law, target = problem.law, 1e-3
        while True:
            q, r_n = problem.q.copy(), r[:, 0]
            q[:, 0] += law.opening(problem.displacements(r, lam)[:, 1:])

            def project(y: np.ndarray, r_n: np.ndarray = r_n) -> Projected:
                return law.nearest_derivative(y, r_n)

            prox = lambda y, lam, P=project: project_balanced(P, y, problem.V, problem.s, step, lam)  # noqa: E731
            gradient = lambda y, q=q: (problem.Q @ y.ravel()).reshape(q.shape) + q  # noqa: E731
            new, lam = _accelerate(
                gradient, prox, r, lam, step, target * max(1.0, float(np.linalg.norm(r)))
            )
            change = float(np.linalg.norm(new - r)) / max(1.0, float(np.linalg.norm(new)))
            r, target = new, max(SHARPER * min(change, 1e2 * target), SHARPEST)
            yield r, lam


def _accelerate(
    gradient: Callable[[np.ndarray], np.ndarray],
    prox: Callable[[np.ndarray, np.ndarray], Iterate],
    r: np.ndarray,
    lam: np.ndarray,
    step: float,
    accuracy: float,
    limit: int = INNER,
) -> Iterate:
    """Minimise a quadratic over the convex set of prox, from r (k, d), until a step moves r by at
    most `accuracy`.
    """
    y, momentum = r, 1.0
    for _ in range(limit):
        check_time()
        new, lam = prox(y - step * gradient(y), lam)
        move, along = new - y, new - r
        if np.linalg.norm(move) <= accuracy:
            return new, lam
        following = (1 + sqrt(1 + 4 * momentum**2)) / 2
        if np.sum(move * along) < 0:  # the momentum points uphill: restart
            y, r, momentum = new, new, 1.0
        else:
            y, r, momentum = new + (momentum - 1) / following * along, new, following
    return r, lam


def disc_qp(
    Q: np.ndarray,
    c: np.ndarray,
    radius: np.ndarray,
    start: np.ndarray | None = None,
    tol: float = 1e-10,
) -> tuple[np.ndarray, bool]:
    """Solve min t'Qt/2 + c't subject to |t_i| <= radius_i, the tangential problem (paper, eq (22)),
    natively.

    In rounds: the gradient is taken in double precision at the start of a round and its change in
    single precision, which halves the memory traffic.

    Parameters
    ----------
    Q : (k d, k d) symmetric positive semidefinite array.
    c : (k, d) linear term.
    radius : (k,) bounds, at least 0.
    start : (k, d) point to start from; None: zero.
    tol : Bound of the natural map |t - P(t - step (Q t + c))| over max(|t|, step |c|).

    Returns
    -------
    t (k, d), and whether it meets the tolerance.
    """
    single, none = Q.astype(np.float32), np.zeros(0)
    step = 1 / eigenvalue_bound(single)
    t = disc(np.zeros_like(c) if start is None else start, radius)
    before = np.inf
    for _ in range(ROUNDS):
        u = (Q @ t.ravel()).reshape(t.shape) + c
        # unit of the certificate
        size = max(float(np.linalg.norm(t)), step * float(np.linalg.norm(c)))
        error = float(np.linalg.norm(t - disc(t - step * u, radius)))
        if error <= tol * size:
            return t, True
        # single precision is not enough here: the last rounds in double precision
        if error > 0.5 * before:
            single = Q

        def gradient(
            y: np.ndarray, t: np.ndarray = t, u: np.ndarray = u, unit: float = error
        ) -> np.ndarray:
            change = ((y - t) / unit).astype(single.dtype)  # noqa: B023
            return u + unit * (single @ change.ravel()).reshape(y.shape).astype(float)  # noqa: B023

        before = error
        t, _ = _accelerate(
            gradient,
            lambda y, lam: (disc(y, radius), lam),
            t,
            none,
            step,
            max(1e-4 * error, 0.3 * tol * size),
        )
    return t, False
