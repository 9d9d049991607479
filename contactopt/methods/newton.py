"""Semismooth Newton method on the Alart-Curnier equations, the primal-dual active set method for
Coulomb friction.

Each step on r = P(r - rho (Q r + V lambda + q)), V' r + s = 0 sorts the contacts by the map P of
the law and solves one linear system of the closed ones: dense, by sparse factors, or for an
operator Q by PCG and GMRES to the accuracy that the step is worth (Eisenstat, Walker 1996). Where
the bodies themselves are solved by iteration, one iteration sees contacts and bodies at once
(contactopt.methods.kernels.coupled_newton). Motions that friction alone holds follow from a convex
problem before each step (contactopt.methods.kernels.balance).

Sources: Alart, Curnier (1991); Hueber, Stadler, Wohlmuth (2008), A primal-dual active set algorithm
for three-dimensional contact problems with Coulomb friction.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from contactopt.errors import InputError
from contactopt.linear.operators import InterfaceOperator, loosened
from contactopt.methods import constants
from contactopt.methods.kernels.alart_curnier import (
    admissible,
    cold_start,
    coulomb_equations,
    forcing,
    newton_steps,
)
from contactopt.methods.kernels.balance import settled
from contactopt.methods.kernels.coupled_newton import coupled_steps
from contactopt.methods.kernels.krylov import model_of
from contactopt.methods.method import Iterate, Known, Method
from contactopt.methods.notes import note
from contactopt.methods.preconditioners import find_preconditioner
from contactopt.problem import InterfaceProblem

logger = logging.getLogger(__name__)

UNSOLVED = "Newton's method ended because the linear system of a step could not be solved"
SHARP = 1e-4  # accuracy of a residual, over the residual that the step aimed at


@dataclass(frozen=True)
class Newton(Method):
    """Newton's method on the equations of Alart and Curnier.

    `linear` is 'dense', 'krylov', which needs products with Q only, or 'coupled', which iterates on
    the bodies at once. None: dense for an array Q, coupled where the bodies are solved by
    iteration, and krylov for other operators. `preconditioner` of the last two is a name in
    contactopt.methods.preconditioners, or 'none'. None: the best that fits the contacts.
    """

    linear: str | None = None
    preconditioner: str | None = None
    implicit: ClassVar[bool] = True  # takes an operator for Q
    sparse: ClassVar[bool] = True  # and a sparse Q
    unsymmetric: ClassVar[bool] = True  # and one that is not symmetric

    def __post_init__(self) -> None:
        if self.linear not in (None, "dense", "krylov", "coupled"):
            raise InputError(
                f"unknown linear solver {self.linear!r}; choose dense, krylov or coupled."
            )
        find_preconditioner(self.preconditioner)

    def iterate(
        self, problem: InterfaceProblem, start: Iterate | None = None
    ) -> Iterator[Iterate | Known]:
        for point, _ in self.with_residuals(problem, start):
            yield point

    def with_residuals(
        self, problem: InterfaceProblem, start: Iterate | None = None
    ) -> Iterator[tuple[Iterate | Known, float]]:
        """Iterates with the residual before each step; InputError if `linear` does not fit."""
        form = problem.Q.coupled if isinstance(problem.Q, InterfaceOperator) else None
        if self.linear == "coupled" and form is None:
            raise InputError(
                "linear='coupled' needs bodies that are solved by iteration; take the solver"
                " 'multigrid'."
            )
        if form is not None and self.linear in (None, "coupled"):
            yield from coupled_steps(problem, form, self.preconditioner, start)
            note(logger, UNSOLVED)
            return
        implicit = self.linear == "krylov" or (
            self.linear is None and isinstance(problem.Q, InterfaceOperator)
        )
        if self.linear == "dense" or (isinstance(problem.Q, InterfaceOperator) and not implicit):
            problem = problem.explicit()
        equations = coulomb_equations(problem)
        P = model_of(problem, self.preconditioner) if implicit else None
        if P is not None and len(problem.pairs) > 1:
            equations = coulomb_equations(problem, stiffer=P.factors[:: problem.dim])
        step, first = newton_steps(problem, P)
        r, multipliers = start or cold_start(problem, first, constants.KRYLOV_FIRST)
        last, rtol = np.inf, constants.KRYLOV_FIRST
        while True:
            aim = rtol * min(last, 1.0) / max(1.0, float(np.linalg.norm(r)))
            Q = loosened(problem.Q, SHARP * aim)
            sharp = equations if Q is problem.Q else replace(equations, Q=Q)
            residual, error, balance, D = sharp.evaluate(r, multipliers)
            change = settled(sharp, problem.law, r, D, partial(sharp.displacements, r, multipliers))
            if change is not None:
                multipliers = multipliers + change
                residual, error, balance, D = sharp.evaluate(r, multipliers)
            yield (admissible(problem, r, error) if implicit else r + error, multipliers), residual
            rtol = forcing(
                residual,
                last,
                constants.KRYLOV_FIRST,
                constants.KRYLOV_LOOSEST,
                constants.KRYLOV_TIGHTEST,
            )
            moved = step(sharp, error, balance, D, rtol)
            if moved is None:
                note(logger, UNSOLVED)
                return
            r, multipliers, last = r + moved[0], multipliers + moved[1], residual
