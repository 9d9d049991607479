"""Alternating direction method of multipliers over Coulomb's cones, the slip term renewed in every
iteration.

    min  r'Qr/2 + (q + g n)' r   subject to  V'r + s = 0,  r = z,  |z_t| <= mu z_n,

with g_i = mu_i |u_t,i|. r follows from one linear system with Q + rho I and the balance rows, z by
projection, and the scaled multiplier x of r = z from their difference; -rho x is the velocity
u + g n, which renews g. Other laws have other sets and openings (contactopt.problem.laws). rho is
balanced after 10, 20, 40, ... iterations where that is worth a factorisation, so that the errors of
r = z and of the velocity fall together. An LU factorisation is taken, since a Q from a file need
not be quite symmetric.

Sources: Acary, Cadoux, Lemarechal, Malick (2011) for the form with g; Boyd, Parikh, Chu, Peleato,
Eckstein (2011), Distributed Optimization and Statistical Learning via ADMM.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from contactopt.checks import check_number
from contactopt.methods import constants
from contactopt.methods.kernels.sparse_blocks import block_matrix
from contactopt.methods.method import Iterate, Method, at_rest
from contactopt.problem import InterfaceProblem

OVER = 1.6  # over-relaxation, between 1.5 and 1.8 in the literature


@dataclass(frozen=True)
class ADMM(Method):
    """The alternating direction method of multipliers on r = z. `rho` is the first weight of r = z,
    in units of the mean compliance; the iteration balances it later.
    """

    rho: float = 1.0
    sparse: ClassVar[bool] = True  # takes a sparse Q
    unsymmetric: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_number("the weight rho", self.rho, low=0.0)

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        z, multipliers = start or at_rest(problem)
        rho, count, check = self.rho, 0, constants.FIRST_BALANCING
        system = Balanced(problem, rho)
        x = np.zeros_like(z) if start is None else -problem.displacements(z, multipliers) / rho
        law = problem.law
        if start is not None:
            x[:, 0] -= law.opening(x[:, 1:])
        while True:
            # r minimises the quadratic program with the weight rho on |r - z + x|^2, under the
            # balance.
            right = rho * (z - x) - problem.q
            right[:, 0] -= rho * law.opening(x[:, 1:])
            r, multipliers = system.solve(right, problem.s)
            # z is the nearest point of the set of forces; over-relaxation mixes r with the old z.
            relaxed, old = OVER * r + (1 - OVER) * z, z
            z = law.nearest(relaxed + x, (relaxed + x)[:, 0])
            # x sums up the errors of r = z. At the solution -rho x is the velocity u + g n.
            x = x + relaxed - z
            yield z, multipliers
            count += 1
            if count == check:
                check *= 2
                change = _balancing(problem, r, z, old, x, rho)
                if not 1 / constants.LEAST_CHANGE < change < constants.LEAST_CHANGE:
                    rho, x = rho * change, x / change
                    system = Balanced(problem, rho)


def _balancing(
    problem: InterfaceProblem,
    r: np.ndarray,
    z: np.ndarray,
    old: np.ndarray,
    x: np.ndarray,
    rho: float,
) -> float:
    """The factor for rho: a larger rho lets r = z fall faster, a smaller one velocities."""
    primal = float(np.linalg.norm(r - z)) / max(float(np.linalg.norm(z)), 1e-300)
    parts = problem.Q @ z.ravel(), problem.q, rho * x  # the velocity is their difference
    size = max(*(float(np.linalg.norm(part)) for part in parts), 1e-300)
    dual = rho * float(np.linalg.norm(z - old)) / size
    wanted = np.sqrt(max(primal, 1e-300) / max(dual, 1e-300))
    return float(np.clip(wanted, 1 / constants.MOST_CHANGE, constants.MOST_CHANGE))


class Balanced:
    """(Q + rho I) r + V lambda = right, V' r + s = 0, with a matrix that is factorised once."""

    def __init__(self, problem: InterfaceProblem, rho: float):
        (k, d), self.V = problem.q.shape, problem.V
        weight, all_of_them = np.tile(rho * np.eye(d), (k, 1, 1)), np.ones(k * d, dtype=bool)
        inverse = block_matrix(problem.Q, d).factor(None, weight, all_of_them)
        if inverse is None:
            raise np.linalg.LinAlgError("Q + rho I is singular")
        self.inverse = inverse
        self.motions = self.inverse(problem.V) if problem.V.shape[1] else problem.V
        self.schur = problem.V.T @ self.motions

    def solve(self, right: np.ndarray, s: np.ndarray) -> Iterate:
        r = self.inverse(right.ravel())
        if len(s) == 0:
            return r.reshape(right.shape), np.zeros(0)
        multipliers = np.linalg.lstsq(self.schur, self.V.T @ r + s, rcond=None)[0]
        return (r - self.motions @ multipliers).reshape(right.shape), multipliers
