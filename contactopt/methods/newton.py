"""Semismooth Newton method on the Alart-Curnier equations, the primal-dual active set method for Coulomb friction.

Solves r = P(r - rho (Q r + V lambda + q)), V' r + s = 0 with P the Coulomb map (contactopt.cones.coulomb_map): each step
sorts the contacts into open, sticking and slipping and solves one linear system of the closed ones, dense, n^3/3 to
2 n^3/3 operations. Full steps from the bonded solution; converges in 2 to 10 steps on elastic bodies, almost
independently of the mesh. Not globally convergent: rank-deficient Q (rigid bodies, redundant contacts) or strong
friction may make it cycle, which is what `proximal` is for.
Sources: Alart, Curnier (1991); Hueber, Stadler, Wohlmuth (2008), A primal-dual active set algorithm for
three-dimensional contact problems with Coulomb friction.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from contactopt.cones import coulomb_map
from contactopt.methods import NATIVE, Iterate
from contactopt.problem import InterfaceProblem
from contactopt.semismooth import Equations


@dataclass(frozen=True)
class Newton:
    """No settings."""

    def backends(self, dim: int) -> tuple[str, str]:
        return NATIVE, NATIVE

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        equations = coulomb_equations(problem)
        r, multipliers = bonded(problem) if start is None else start
        if start is None:
            yield r, multipliers
        while True:
            _, error, balance, D = equations.evaluate(r, multipliers)
            step = equations.step(error, balance, D)
            if step is None:
                return
            r, multipliers = r + step[0], multipliers + step[1]
            yield r, multipliers


def coulomb_equations(problem: InterfaceProblem, center: np.ndarray | None = None, weight: float = 0.0) -> Equations:
    """The Alart-Curnier equations of a problem, rho_i = 1 over the mean compliance of contact i."""
    compliance = np.diag(problem.Q).reshape(problem.q.shape).mean(axis=1) + weight
    return Equations(
        problem.Q,
        problem.q,
        problem.V,
        problem.s,
        lambda y: coulomb_map(y, problem.mu, problem.bilateral),
        1 / np.maximum(compliance, 1e-3),
        center,
        weight,
    )


def bonded(problem: InterfaceProblem) -> Iterate:
    """Cold start: all contacts glued if a plate presses the bodies together, else no force at all."""
    r, multipliers = np.zeros(problem.q.shape), np.zeros(len(problem.s))
    if len(problem.s) == 0:
        return r, multipliers
    k, dim = problem.q.shape
    glue = Equations(problem.Q, problem.q, problem.V, problem.s, lambda y: (y, np.tile(np.eye(dim), (k, 1, 1))))
    _, error, balance, D = glue.evaluate(r, multipliers)
    step = glue.step(error, balance, D, ridge=1e-8)
    return step if step is not None else (r, multipliers)
