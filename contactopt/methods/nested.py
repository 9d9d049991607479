"""Newton's method on nested grids, for problems whose Q is a convolution: half-spaces, rough
surfaces.

Coarse grids tell cheaply which contacts close and slip; each solution starts the next finer grid.
The steps are those of `newton`, by PCG or GMRES in single precision to the accuracy that they are
worth, while residuals are computed in double precision. Without friction only the normal components
are computed.

Sources: Polonsky, Keer (1999), A numerical method for solving rough contact problems based on the
multi-level multi-summation and conjugate gradient techniques; Hueber, Stadler, Wohlmuth (2008) for
the active sets; Eisenstat, Walker (1996) for the accuracy of steps.
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import ClassVar

import numpy as np

from contactopt.errors import InputError
from contactopt.linear.operators import form
from contactopt.methods import constants, find_method
from contactopt.methods.kernels.level_steps import GridSteps
from contactopt.methods.kernels.levels import Evaluation, Level, Point
from contactopt.methods.kernels.newton_loop import newton_iterates
from contactopt.methods.method import Iterate, Method
from contactopt.methods.notes import note
from contactopt.problem import InterfaceProblem

logger = logging.getLogger(__name__)

# residual over the size of the forces, from which on iterates of the finest grid are shown to the
# driver
NEAR = 1e-8


@dataclass(frozen=True)
class Nested(Method):
    """A method without settings."""

    implicit: ClassVar[bool] = True

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        for point, _ in self.with_residuals(problem, start):
            yield point

    def with_residuals(
        self, problem: InterfaceProblem, start: Iterate | None = None
    ) -> Iterator[tuple[Iterate, float]]:
        """Iterates on the finest grid with the residual of the equations."""
        if form(problem.Q) != "convolution":
            raise InputError(
                "the method 'nested' needs half-spaces on both sides, or one on a rigid body; use"
                " 'auto'."
            )
        levels = [Level.of_problem(problem)]
        while levels[-1].halves:
            levels.append(levels[-1].coarse())
        given = None if start is None else (start[0].T[list(levels[0].components)].copy(), start[1])
        point = _first_guess(levels, given)
        if len(levels) > 1:
            point = _robust_start(levels[-1], point)
        for coarse, fine in zip(levels[:0:-1], levels[-2::-1]):
            at = _solve_level(coarse, point)
            logger.info("grid %s: residual %.1e", coarse.kernel.grid, at.residual)
            point = fine.refined(at.point, coarse)
        steps, last = GridSteps(levels[0], NEAR, least=1.0), np.inf
        begin = steps.evaluate(point)
        if given is not None:
            other = steps.evaluate(given)
            begin = other if other.residual < constants.CLOSER * begin.residual else begin
        for at in newton_iterates(steps, begin):
            r, multipliers = at.point
            if at.residual <= steps.near(r) or at.residual > 0.5 * last:
                yield (_whole(problem, r + at.error), multipliers), at.residual
            last = at.residual


def _first_guess(levels: list[Level], given: Point | None) -> Point:
    """The given point on the coarsest level, or forces spread evenly that balance the loads."""
    coarsest = levels[-1]
    if given is not None:
        for level in levels[:-1]:
            given = level.restricted(given)
        return given
    r = np.zeros(coarsest.q.shape)
    if len(coarsest.s):
        W = coarsest.V[0]
        r[0] = W @ np.linalg.lstsq(W.T @ W, -coarsest.s, rcond=None)[0]
    moved = coarsest.product(r) + coarsest.q
    lam = np.zeros(len(coarsest.s))
    if len(lam):
        lam = np.linalg.lstsq(coarsest.V.reshape(-1, len(lam)), -moved.ravel(), rcond=None)[0]
    return r, lam


def _robust_start(coarsest: Level, point: Point) -> Point:
    """A solution on the coarsest grid: by Newton's steps, or else by `auto` on an array Q."""
    at = _solve_level(coarsest, point, constants.COARSEST_ENOUGH)
    enough, reached = GridSteps(coarsest, constants.COARSEST_ENOUGH).near, at.point
    if at.residual <= enough(reached[0]) or len(coarsest.components) < coarsest.kernel.dim:
        return reached
    note(
        logger,
        "Newton's method failed on the coarsest grid, so the default method starts there from an"
        " array Q",
    )
    V = np.moveaxis(coarsest.V, 0, 1).reshape(coarsest.q.size, -1)
    small = InterfaceProblem(
        coarsest.kernel.entries(), coarsest.q.T, coarsest.law, V=V, s=coarsest.s
    )
    best = at.residual
    for r, lam, *_ in islice(find_method("auto").iterate(small), constants.COARSE_TRIES):
        candidate = np.ascontiguousarray(r.T), lam
        residual = coarsest.evaluate(*candidate).residual
        if residual < best:
            reached, best = candidate, residual
        if best <= enough(reached[0]):
            break
    return reached


def _solve_level(level: Level, point: Point, enough: float = constants.COARSE_ENOUGH) -> Evaluation:
    """Newton's steps on a coarse grid, until the residual is small against the forces."""
    steps = GridSteps(level, enough)
    at = begin = steps.evaluate(point)
    for at in islice(newton_iterates(steps, begin), constants.COARSE_STEPS):
        if at.residual <= steps.near(at.point[0]):
            break
    return at


def _whole(problem: InterfaceProblem, r: np.ndarray) -> np.ndarray:
    """Reactions (k, dim) from the components (c, k) that were solved for."""
    out = np.zeros(problem.q.shape)
    out[:, : len(r)] = r.T
    return out
