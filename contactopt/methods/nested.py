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

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import ClassVar

import numpy as np

from contactopt.errors import InputError
from contactopt.linear.convolution import Convolution
from contactopt.methods import constants, find_method
from contactopt.methods.kernels.alart_curnier import forcing
from contactopt.methods.kernels.elimination import eliminated
from contactopt.methods.kernels.level_steps import step
from contactopt.methods.kernels.levels import Evaluation, Level, Point
from contactopt.methods.method import Iterate, Method
from contactopt.methods.notes import note
from contactopt.problem import InterfaceProblem

logger = logging.getLogger(__name__)

# residual over the size of the forces, from which on iterates of the finest grid are shown to the
# driver
NEAR = 1e-8
ENOUGH = 0.5  # of NEAR that a step aims at, for linear systems are not solved in its norm


@dataclass(frozen=True)
class Nested(Method):
    """No settings."""

    implicit: ClassVar[bool] = True

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        for point, _ in self.with_residuals(problem, start):
            yield point

    def with_residuals(
        self, problem: InterfaceProblem, start: Iterate | None = None
    ) -> Iterator[tuple[Iterate, float]]:
        """Iterates on the finest grid with the residual of the equations."""
        if not isinstance(problem.Q, Convolution):
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
            point, at = _solve_level(coarse, point)
            logger.info("grid %s: residual %.1e", coarse.kernel.grid, at.residual)
            point = fine.refined(point, coarse)
        finest, at, last = levels[0], levels[0].evaluate(*point), np.inf
        if given is not None:
            other = finest.evaluate(*given)
            if other.residual < constants.CLOSER * at.residual:
                point, at = given, other
        while True:
            near = NEAR * max(1.0, float(np.linalg.norm(point[0])))
            if at.residual <= near or at.residual > 0.5 * last:
                yield (_whole(problem, point[0] + at.error), point[1]), at.residual
            if at.residual > constants.SLOW * last:
                point, at = eliminated(finest, point, at)
            worth = _worth(at.residual, last)
            if at.residual > near:  # no step need come further than that
                worth = max(worth, min(ENOUGH * near / at.residual, constants.NESTED_LOOSEST))
            change, count = step(finest, at, worth)
            last = at.residual
            point = point[0] + change[0], point[1] + change[1]
            at = finest.evaluate(*point)
            told = finest.kernel.grid, len(at.closed), count, at.residual
            logger.info("grid %s: %d closed, %d iterations, residual %.1e", *told)


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
    reached, at = _solve_level(coarsest, point, constants.COARSEST_ENOUGH)
    if (
        at.residual <= constants.COARSEST_ENOUGH * float(np.linalg.norm(reached[0]))
        or len(coarsest.components) < coarsest.kernel.dim
    ):
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
        if best <= constants.COARSEST_ENOUGH * float(np.linalg.norm(reached[0])):
            break
    return reached


def _solve_level(
    level: Level, point: Point, enough: float = constants.COARSE_ENOUGH
) -> tuple[Point, Evaluation]:
    """Newton's steps on a coarse grid, until the residual is small beside the forces."""
    at, last = level.evaluate(*point), np.inf
    for _ in range(constants.COARSE_STEPS):
        if at.residual <= enough * float(np.linalg.norm(point[0])):
            break
        if at.residual > constants.SLOW * last:
            point, at = eliminated(level, point, at)
        change, _ = step(level, at, _worth(at.residual, last))
        last = at.residual
        point = point[0] + change[0], point[1] + change[1]
        at = level.evaluate(*point)
    return point, at


def _worth(residual: float, last: float) -> float:
    """Accuracy of a step: low while the residual does not fall, because contacts still change."""
    loosest, tightest = constants.NESTED_LOOSEST, constants.NESTED_TIGHTEST
    return forcing(residual, last, loosest, loosest, tightest)


def _whole(problem: InterfaceProblem, r: np.ndarray) -> np.ndarray:
    """Reactions (k, dim) from the components (c, k) that were solved for."""
    out = np.zeros(problem.q.shape)
    out[:, : len(r)] = r.T
    return out
