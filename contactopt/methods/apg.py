"""Accelerated projected gradient method with restart, on convex subproblems of a fixed point.

Acary and Cadoux's form of Coulomb friction: with the slip's contribution g_i = mu_i |u_t,i| held
fixed, the forces solve
    min  r'Qr/2 + (q + g n)' r    subject to  |r_t| <= mu r_n,  V'r + s = 0,
a convex program over Coulomb's cones; g is renewed from its answer (the outer iteration that is
yielded). Other laws have other sets and openings (contactopt.problem.laws); for bilateral contact
the bound mu |r_n| is held. The inner iteration takes Nesterov's step 1 / largest eigenvalue and is
restarted where the momentum points uphill.

Sources: O'Donoghue, Candes (2015), Adaptive restart; Acary, Cadoux, Lemarechal, Malick (2011), A
formulation of the linear discrete Coulomb friction problem via convex optimization.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import sqrt
from typing import ClassVar

import numpy as np

from contactopt.linear.deadline import check_time
from contactopt.linear.operators import eigenvalue_bound
from contactopt.methods.constants import SHARPER, SHARPEST
from contactopt.methods.kernels.balance import project_balanced
from contactopt.methods.method import Iterate, Method, at_rest
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.law import Projected


@dataclass(frozen=True)
class APG(Method):
    """Accelerated projected gradients. The step follows from the largest eigenvalue of Q."""

    sparse: ClassVar[bool] = True  # takes a sparse Q

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        r, lam = start or at_rest(problem)
        step = 1 / eigenvalue_bound(problem.Q)
        law, target = problem.law, 1e-3
        while True:
            q, r_n = problem.q.copy(), r[:, 0]
            q[:, 0] += law.opening(problem.displacements(r, lam)[:, 1:])

            def project(y: np.ndarray, r_n: np.ndarray = r_n) -> Projected:
                return law.nearest_derivative(y, r_n)

            prox = lambda y, lam, P=project: project_balanced(P, y, problem.V, problem.s, step, lam)  # noqa: E731
            gradient = lambda y, q=q: (problem.Q @ y.ravel()).reshape(q.shape) + q  # noqa: E731
            accuracy = target * max(1.0, float(np.linalg.norm(r)))
            new, lam = accelerate(gradient, prox, r, lam, step, accuracy)
            change = float(np.linalg.norm(new - r)) / max(1.0, float(np.linalg.norm(new)))
            r, target = new, max(SHARPER * min(change, 1e2 * target), SHARPEST)
            yield r, lam


def accelerate(
    gradient: Callable[[np.ndarray], np.ndarray],
    prox: Callable[[np.ndarray, np.ndarray], Iterate],
    r: np.ndarray,
    lam: np.ndarray,
    step: float,
    accuracy: float,
) -> Iterate:
    """Minimise a quadratic over the set of prox until a step moves r by `accuracy` at most."""
    y, momentum = r, 1.0
    for _ in range(2000):  # products with Q in one subproblem
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
