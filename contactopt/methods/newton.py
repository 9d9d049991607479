"""Semismooth Newton method on the Alart-Curnier equations, the primal-dual active set method for
Coulomb friction.

Solves r = P(r - rho (Q r + V lambda + q)), V' r + s = 0 with P the map of the law
(contactopt.problem.laws): each step sorts the contacts into open, sticking and slipping and solves
one linear system of the closed ones: dense, n^3/3 to 2 n^3/3 operations, by sparse factors where Q
is sparse, or, where Q is an operator, by PCG and GMRES to the accuracy that the step is worth
(Eisenstat, Walker 1996), some ten products with Q each (contactopt.methods.kernels.krylov). Where
the bodies themselves are solved by iteration, one iteration sees contacts and bodies at once
(contactopt.methods.kernels.coupled_newton). Full steps from the bonded solution; the number of
steps hardly depends on the mesh. Motions that friction alone holds, and no
sticking contact, follow from a convex problem before each step
(contactopt.methods.kernels.balance). Not globally convergent: rank-deficient Q (rigid bodies,
redundant contacts) or strong friction may make it cycle, which is what `proximal` is for. Sources:
Alart, Curnier (1991); Hueber, Stadler, Wohlmuth (2008), A primal-dual active set algorithm for
three-dimensional contact problems with Coulomb friction.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from contactopt.errors import InputError
from contactopt.linear.operators import InterfaceOperator, loosened
from contactopt.methods.kernels.alart_curnier import (
    FIRST,
    admissible,
    cold_start,
    coulomb_equations,
    dense,
    forcing,
    krylov,
    sparse,
)
from contactopt.methods.kernels.balance import loose_motions, settled
from contactopt.methods.kernels.coupled_newton import coupled_steps
from contactopt.methods.kernels.krylov import model_of
from contactopt.methods.method import NATIVE, Iterate, Known
from contactopt.methods.notes import note
from contactopt.methods.preconditioners import find_preconditioner
from contactopt.problem import InterfaceProblem

logger = logging.getLogger(__name__)

UNSOLVED = "Newton's method ended because the linear system of a step could not be solved"
SHARP = 1e-4  # accuracy of a residual, over the residual that the step aimed at


@dataclass(frozen=True)
class Newton:
    """Newton's method on the equations of Alart and Curnier.

    Parameters
    ----------
    linear : 'dense', 'krylov', which needs products with Q only, or 'coupled', which iterates on
        the bodies at once. None: dense for an array Q, coupled where the bodies are solved by
        iteration, and krylov for other operators.
    preconditioner : Of 'krylov' and 'coupled': a name in contactopt.methods.preconditioners, or
        'none'. None: the best that fits the contacts.
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

    def backends(self, dim: int) -> tuple[str, str]:
        return NATIVE, NATIVE

    def iterate(
        self, problem: InterfaceProblem, start: Iterate | None = None
    ) -> Iterator[Iterate | Known]:
        for point, _ in self.steps(problem, start):
            yield point

    def steps(
        self, problem: InterfaceProblem, start: Iterate | None = None
    ) -> Iterator[tuple[Iterate | Known, float]]:
        """Iterate as `iterate` does, and tell the residual of the equations.

        Parameters
        ----------
        problem, start : As for `iterate`.

        Yields
        ------
        An iterate, and the residual of the equations that its step began with.

        Raises
        ------
        InputError : If the linear algebra that was asked for does not fit Q.
        """
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
        if implicit:
            P = model_of(problem, self.preconditioner)
            if len(problem.pairs) > 1:
                equations = coulomb_equations(problem, stiffer=P.factors[:: problem.dim])
            step, first = krylov(P)
        else:
            step, first = sparse(problem) if sp.issparse(problem.Q) else dense(problem)
        r, multipliers = cold_start(problem, first) if start is None else start
        last, rtol = np.inf, FIRST
        while True:
            aim = rtol * min(last, 1.0) / max(1.0, float(np.linalg.norm(r)))
            sharp = replace(equations, Q=loosened(problem.Q, SHARP * aim))
            residual, error, balance, D = sharp.evaluate(r, multipliers)
            loose = loose_motions(problem.V, D)
            if loose.size:
                u = (sharp.Q @ r.ravel() + problem.V @ multipliers).reshape(r.shape) + problem.q
                change = settled(sharp, problem.law, r, u, loose)
                if change is not None:
                    multipliers = multipliers + change
                    residual, error, balance, D = sharp.evaluate(r, multipliers)
            yield (admissible(problem, r, error) if implicit else r + error, multipliers), residual
            rtol = forcing(residual, last)
            moved = step(sharp, error, balance, D, rtol)
            if moved is None:
                note(logger, UNSOLVED)
                return
            r, multipliers, last = r + moved[0], multipliers + moved[1], residual
