"""Semismooth Newton method on the Alart-Curnier equations, the primal-dual active set method for Coulomb friction.

Solves r = P(r - rho (Q r + V lambda + q)), V' r + s = 0 with P the Coulomb map (contactopt.cones.coulomb_map): each step
sorts the contacts into open, sticking and slipping and solves one linear system of the closed ones: dense, n^3/3 to
2 n^3/3 operations, or, where Q is an operator, by PCG and GMRES to the accuracy that the step is worth (Eisenstat, Walker
1996), some ten products with Q each (contactopt.krylov). Full steps from the bonded solution; the number of steps hardly depends on the mesh
(reports/newton_steps). Not globally convergent: rank-deficient Q (rigid bodies, redundant contacts) or strong
friction may make it cycle, which is what `proximal` is for.
Sources: Alart, Curnier (1991); Hueber, Stadler, Wohlmuth (2008), A primal-dual active set algorithm for
three-dimensional contact problems with Coulomb friction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.linalg as la

from contactopt.bonded import Bonded
from contactopt.cones import coulomb_map
from contactopt.errors import InputError
from contactopt.krylov import krylov_step, model_of
from contactopt.methods import NATIVE, Iterate
from contactopt.operators import InterfaceOperator, diagonal, loosened
from contactopt.preconditioners import find_preconditioner
from contactopt.problem import InterfaceProblem
from contactopt.semismooth import RIDGE, Equations

FIRST, LOOSEST, TIGHTEST = 1e-2, 0.1, 1e-4  # accuracy of an iterative step: the first, and the bounds of the others
SHARP = 1e-4  # accuracy of a residual, over the residual that the step aimed at
GLUE = 1e-8  # added to Q for the bonded solution, which a Q of deficient rank leaves open
LOOSE = 0.5  # share of contacts that do not stick, up to which the bonded factorisation is cheaper than a new one


@dataclass(frozen=True)
class Newton:
    """linear: 'dense' or 'krylov', which needs products with Q only; None: as Q is an array or an operator.

    preconditioner of krylov: a name (see contactopt.preconditioners) or 'none'; None: the best that fits the contacts.
    """

    linear: str | None = None
    preconditioner: str | None = None
    implicit: ClassVar[bool] = True  # takes an operator for Q

    def __post_init__(self) -> None:
        if self.linear not in (None, "dense", "krylov"):
            raise InputError(f"unknown linear solver {self.linear!r}; choose dense or krylov.")
        find_preconditioner(self.preconditioner)

    def backends(self, dim: int) -> tuple[str, str]:
        return NATIVE, NATIVE

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        for point, _ in self.steps(problem, start):
            yield point

    def steps(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[tuple[Iterate, float]]:
        """Iterates with the residual of the equations that each step began with."""
        implicit = self.linear == "krylov" or (self.linear is None and isinstance(problem.Q, InterfaceOperator))
        if not implicit:
            problem = problem.explicit()
        equations = coulomb_equations(problem)
        step, first = self._krylov(problem) if implicit else _dense(problem)
        r, multipliers = cold_start(problem, first) if start is None else start
        last, rtol = np.inf, FIRST
        while True:
            aim = rtol * min(last, 1.0) / max(1.0, float(np.linalg.norm(r)))
            equations.Q = loosened(problem.Q, SHARP * aim)
            residual, error, balance, D = equations.evaluate(r, multipliers)
            # P(y): at the solution equal to r, and within the bounds to the last digit
            yield (r + error, multipliers), residual
            rtol = forcing(residual, last)
            change = step(equations, error, balance, D, rtol)
            if change is None:
                return
            r, multipliers, last = r + change[0], multipliers + change[1], residual

    def _krylov(self, problem: InterfaceProblem) -> tuple[Step, Step]:
        P = model_of(problem, self.preconditioner)

        def step(equations, error, balance, D, rtol):  # type: ignore[no-untyped-def]
            return krylov_step(equations, P, error, balance, D, rtol)

        return step, step


# equations, error, balance, D, relative accuracy -> dr, dlambda or None
Step = Callable[[Equations, np.ndarray, np.ndarray, np.ndarray, float], Iterate | None]


def forcing(residual: float, last: float) -> float:
    """Relative accuracy of the linear system that is worth its price."""
    return FIRST if last == np.inf else min(LOOSEST, max(TIGHTEST, 0.5 * (residual / last) ** 2))


def coulomb_equations(problem: InterfaceProblem, center: np.ndarray | None = None, weight: float = 0.0) -> Equations:
    """The Alart-Curnier equations of a problem, rho_i = 1 over the mean compliance of contact i."""
    compliance = diagonal(problem.Q).reshape(problem.q.shape).mean(axis=1) + weight
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


def bonded_factor(problem: InterfaceProblem) -> Bonded | None:
    """The factorised bonded system where it pays: elastic bodies pressed together by a plate, Q of full rank."""
    try:
        return Bonded(problem.Q, problem.V) if len(problem.s) else None
    except la.LinAlgError:
        return None


def _dense(problem: InterfaceProblem) -> tuple[Step, Step]:
    """Newton's steps, and those of the bonded solution."""
    factor = bonded_factor(problem)

    def steps(ridge: float) -> Step:
        return lambda equations, error, balance, D, rtol: newton_step(equations, factor, error, balance, D, ridge)

    return steps(RIDGE), steps(GLUE)


def newton_step(
    equations: Equations,
    factor: Bonded | None,
    error: np.ndarray,
    balance: np.ndarray,
    D: np.ndarray,
    ridge: float = RIDGE,
) -> Iterate | None:
    """One dense step, through the bonded system while few contacts are open or slip."""
    loose = np.any(np.eye(D.shape[1]) != D, axis=(1, 2))
    if factor is not None and loose.sum() <= LOOSE * len(loose):
        try:
            return factor.step(equations.rho, error, balance, D)
        except (la.LinAlgError, np.linalg.LinAlgError):
            pass
    return equations.step(error, balance, D, ridge)


def cold_start(problem: InterfaceProblem, step: Step | None = None) -> Iterate:
    """All contacts glued if a plate presses the bodies together, else no force at all."""
    zero = np.zeros(problem.q.shape), np.zeros(len(problem.s))
    if len(problem.s) == 0:
        return zero
    glue = Equations(
        problem.Q,
        problem.q,
        problem.V,
        problem.s,
        lambda y: (y, np.broadcast_to(np.eye(y.shape[1]), (*y.shape, y.shape[1]))),
    )
    _, error, balance, D = glue.evaluate(*zero)
    return (step or _dense(problem)[1])(glue, error, balance, D, FIRST) or zero
