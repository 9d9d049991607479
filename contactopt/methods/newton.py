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

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from contactopt.errors import InputError
from contactopt.linear.operators import form, has_entries, loosened
from contactopt.methods import constants
from contactopt.methods.kernels.alart_curnier import (
    admissible,
    cold_start,
    coulomb_equations,
    solver_of,
)
from contactopt.methods.kernels.balance import settled
from contactopt.methods.kernels.coupled_newton import CoupledSteps
from contactopt.methods.kernels.krylov import Krylov, model_of
from contactopt.methods.kernels.newton_loop import Forcing, Unknowns, newton_iterates
from contactopt.methods.kernels.semismooth import Evaluated, Solve, evaluated
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

    `linear` is 'dense', 'krylov' (products with Q only) or 'coupled' (iterates on the bodies at
    once). None: dense for an array Q, coupled where bodies are solved by iteration, else krylov.
    `preconditioner` of the last two is a name, 'none', or None for the best that fits.
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
        linear = self.linear or LINEAR[form(problem.Q)]
        if linear == "coupled" and form(problem.Q) != "bodies":
            raise InputError(
                "linear='coupled' needs bodies that are solved by iteration; take the solver"
                " 'multigrid'."
            )
        if linear == "dense" and not has_entries(problem.Q):
            problem = problem.explicit()
        system = SYSTEMS[linear](problem, self.preconditioner)
        point = system.begin(start)
        if point is not None:
            for at in newton_iterates(system, system.evaluate(point)):
                yield system.shown(at), at.residual
        note(logger, UNSOLVED)


class Contacts:
    """Newton's method on the contacts' equations, by factors of Q or by products with Q."""

    def __init__(self, problem: InterfaceProblem, preconditioner: str | None, by_products: bool):
        self.problem, self.equations = problem, coulomb_equations(problem)
        self.by_products = by_products
        self.solve: Solve
        if not by_products:
            self.solve = solver_of(problem)
        else:
            P = model_of(problem, preconditioner)
            if len(problem.pairs) > 1:
                self.equations = coulomb_equations(problem, stiffer=P.factors[:: problem.dim])
            self.solve = Krylov(P)
        loosest = constants.KRYLOV_LOOSEST
        self.accuracy = Forcing(loosest, loosest, constants.TIGHTEST)

    def begin(self, start: Iterate | None) -> Iterate:
        """The first point."""
        return start or cold_start(self.problem, self.solve, constants.KRYLOV_LOOSEST)

    def evaluate(self, point: Unknowns) -> Evaluated:
        """Where products cost iterations, they are no more accurate than the step aimed at."""
        (r, multipliers), equations = point, self.equations
        aim = self.accuracy.accuracy * min(self.accuracy.last, 1.0)
        Q = loosened(self.problem.Q, SHARP * aim / max(1.0, float(np.linalg.norm(r))))
        if Q is not self.problem.Q:
            equations = replace(equations, Q=Q)
        at = evaluated(equations, r, multipliers)
        displacements = partial(equations.displacements, r, multipliers)
        change = settled(equations, self.problem.law, r, at.D, displacements)
        if change is not None:
            multipliers = multipliers + change
            at = evaluated(equations, r, multipliers)
        self.sharp = equations
        return at

    def change(self, at: Evaluated) -> Unknowns | None:
        return self.solve(self.sharp, at, self.accuracy(at.residual))

    def shown(self, at: Evaluated) -> Iterate:
        """What the driver judges."""
        r, multipliers = at.point
        shown = admissible(self.problem, r, at.error) if self.by_products else r + at.error
        return shown, multipliers


# linear -> the system of a problem, with the preconditioner of this name
SYSTEMS: dict[str, Callable[..., Any]] = {
    "dense": partial(Contacts, by_products=False),
    "krylov": partial(Contacts, by_products=True),
    "coupled": CoupledSteps,
}
# form of Q -> how its steps are solved by default
LINEAR = {
    "array": "dense",
    "sparse": "dense",
    "products": "krylov",
    "convolution": "krylov",
    "bodies": "coupled",
}
