"""The default, without a number to choose: Newton's method, and where it fails cones, then the proximal loop.

0. Where Q is a convolution, as of half-spaces: Newton's method on nested grids, while its residual falls.
1. Unless Q is sparse and singular (rigid bodies): Newton's method from the bonded solution (or no force at all) while its residual
   falls. Elastic bodies end here (reports/newton_steps), each step one dense linear system.
2. The interior-point method (contactopt.solving.kernels.interior), which no cycle and no rank deficiency of Q disturbs,
   and a few steps of the proximal loop for the last digits. They need no symmetric Q and no backend.
   Where these fail, it ends if a proof is found that there is no solution (contactopt.problem.feasibility).
3. The path that turns back where it must (contactopt.solving.kernels.homotopy), at most TURNING linear systems of it.
4. Where Q is a symmetric array: CONE_PROGRAMS iterations of the Acary-Cadoux fixed point, convex programs.
5. Where Q is sparse: interior-point paths drawn at random, PATHS of them, since one that ends early says nothing of the next;
   then the proximal loop from the best of all points, its weight falling slowly: jammed packings need hundreds of steps.
   When SPARSE_ROUND of them have not halved the residual, the same again on other paths, with twice the patience.
6. Else the proximal loop from the best point. When ROUND outer iterations have not halved the residual, twice as many after
   each restart, the loop starts again from contact forces drawn at random (fixed seed, so that runs repeat) and larger than
   those of the point it leaves: strong friction may have solutions that repel the loop and others that attract it.
It ends where the driver's certificate or limits say so. There is no proof that it finds a solution: Coulomb's problem
may have none.
"""

from __future__ import annotations

import logging
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from itertools import count, islice
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from contactopt.errors import BackendError, InputError
from contactopt.problem import InterfaceProblem, infeasibility
from contactopt.problem.convolution import Convolution
from contactopt.problem.operators import InterfaceOperator
from contactopt.solving.constants import (
    CLOSE,
    CONE_PROGRAMS,
    FEW_ENTRIES,
    GENTLE_ALPHA,
    LARGER,
    LEAST_ALPHA,
    NEWTON_STEPS,
    PATHS,
    PATIENCE,
    POLISH,
    PROGRESS,
    ROUND,
    SPARSE_ROUND,
    TURNING,
)
from contactopt.solving.kernels.alart_curnier import cold_start, coulomb_equations, definite
from contactopt.solving.kernels.homotopy import homotopy_iterates
from contactopt.solving.kernels.interior import Path, interior_iterates
from contactopt.solving.kernels.sparse_blocks import Blocks, block_matrix
from contactopt.solving.methods import NATIVE, Iterate, Known
from contactopt.solving.methods.newton import Newton
from contactopt.solving.methods.proximal import Proximal, proximal_equations, proximal_iterates
from contactopt.solving.notes import note
from contactopt.solving.preconditioners import find_preconditioner

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Auto:
    """The default method. It has no number to choose.

    Parameters
    ----------
    preconditioner
        Of Newton's steps where Q is known by its products: a name in contactopt.solving.preconditioners, or 'none'.
        None: the best that fits the contacts.
    """

    preconditioner: str | None = None
    implicit: ClassVar[bool] = True
    sparse: ClassVar[bool] = True
    unsymmetric: ClassVar[bool] = True

    def __post_init__(self) -> None:
        find_preconditioner(self.preconditioner)

    def backends(self, dim: int) -> tuple[str, str]:
        return NATIVE, NATIVE

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate | Known]:
        if sp.issparse(problem.Q) and not (problem.symmetric and definite(problem.Q)):
            reached = start or (np.zeros(problem.q.shape), np.zeros(len(problem.s)))
        else:
            if isinstance(problem.Q, Convolution):
                start = yield from self._nested(problem, start)
                note(logger, "Newton's method on nested grids made no progress; it goes on with the finest grid alone")
            reached = yield from self._newton(problem, start, self.preconditioner)
            if isinstance(problem.Q, InterfaceOperator):
                note(
                    logger,
                    "Newton's method made no progress with products, so all that follows looks at the entries of Q",
                )
                try:
                    problem = problem.explicit()
                except InputError as error:
                    note(logger, f"the default method ends with Newton's steps: {error}")
                    return
                reached = yield from self._newton(problem, None, None)  # its steps are exact now
            note(logger, "Newton's method made no progress, so interior points and the proximal loop take over")
        from contactopt.solving.methods.cone import AcaryCadoux

        matrix = block_matrix(problem.Q, problem.dim)
        if start is not None and sp.issparse(problem.Q):
            reached = yield from self._proximal(problem, matrix, start, POLISH, LEAST_ALPHA)
        interior = AcaryCadoux().solves(problem.law) and not problem.law.dilatant
        if interior:
            for full in (True, False):
                reached = yield from self._interior(
                    problem, matrix, reached, interior_iterates(problem, matrix, Path(full))
                )
        if infeasibility(problem) is not None:  # the driver says so
            return
        if interior:
            turning = homotopy_iterates(problem, matrix, TURNING)
            reached = yield from self._interior(problem, matrix, reached, turning)
            if problem.symmetric and not sp.issparse(problem.Q):
                reached = yield from self._cones(problem, reached)
        if sp.issparse(problem.Q):
            yield from self._jammed(problem, matrix, reached)
            return
        random = np.random.default_rng(0)
        for restarts in count():
            last = yield from self._proximal(problem, matrix, reached, ROUND * 2**restarts, Proximal.alpha)
            r = random.normal(size=problem.q.shape)
            r[:, 0] = np.abs(r[:, 0])
            r *= LARGER * np.sqrt(np.mean(last[0] ** 2)) or 1.0
            reached = problem.law.nearest(r, r[:, 0]), last[1]
            note(logger, "the proximal loop got nowhere and started again from random forces")

    @staticmethod
    def _jammed(problem: InterfaceProblem, matrix: Blocks, reached: Iterate) -> Generator[Iterate, None, None]:
        """Without end: paths drawn at random, and the gentle proximal loop from the best point so far."""
        from contactopt.solving.methods.cone import AcaryCadoux

        random, evaluate = np.random.default_rng(0), proximal_equations(problem, matrix).evaluate
        interior = AcaryCadoux().solves(problem.law) and not problem.law.dilatant
        for restarts in count():
            if interior and restarts:
                turning = homotopy_iterates(problem, matrix, TURNING * 2**restarts, random)
                reached = yield from Auto._interior(problem, matrix, reached, turning)
            for _ in range(PATHS if interior else 0):
                path = Path.random(random, problem.contacts)
                reached = yield from Auto._interior(problem, matrix, reached, interior_iterates(problem, matrix, path))
            patience = SPARSE_ROUND * 2**restarts
            last = yield from Auto._proximal(problem, matrix, reached, patience, GENTLE_ALPHA, gentle=True)
            reached = min(reached, last, key=lambda point: evaluate(*point)[0])
            note(logger, "the proximal loop got nowhere and goes on from the best point, by other paths to begin with")

    @staticmethod
    def _nested(problem: InterfaceProblem, start: Iterate | None) -> Generator[Iterate, None, Iterate | None]:
        """Iterates of the nested method while they change for the better; returns the best."""
        from contactopt.solving.methods.nested import Nested

        best, reached, since = np.inf, start, 0
        for point, residual in Nested().steps(problem, start):
            yield point
            since = 0 if residual < PROGRESS * best else since + 1
            if residual < best:
                best, reached = residual, point
            if since >= PATIENCE:
                break
        return reached

    @staticmethod
    def _newton(
        problem: InterfaceProblem, start: Iterate | None, preconditioner: str | None
    ) -> Generator[Iterate | Known, None, Iterate]:
        """Newton's iterates; returns the best.

        What comes next needs the entries of Q. Where there are many, or bodies are solved by iteration, these are dear, and
        Newton's method goes on until its own products have cost as much.

        A start that leads nowhere is given up for the solution of the bonded problem, from which Newton's method begins
        where it has none.
        """
        best, reached = np.inf, start
        operator = problem.Q if isinstance(problem.Q, InterfaceOperator) else None
        for begin in (start, None) if start is not None else (None,):
            least, since = np.inf, 0
            for steps, (point, residual) in enumerate(Newton(preconditioner=preconditioner).steps(problem, begin)):
                yield point
                since = 0 if residual < PROGRESS * least else since + 1
                least = min(least, residual)
                if residual < best:
                    best, reached = residual, point[:2]
                tired = since >= PATIENCE or steps >= NEWTON_STEPS
                dear = (
                    operator is not None
                    and (operator.coupled is not None or problem.q.size > FEW_ENTRIES)
                    and operator.products < problem.q.size
                )
                if tired and (begin is not None or not dear):
                    break
            if begin is not None:
                note(logger, "Newton's method made no progress from the given start and begins anew without it")
        return reached or cold_start(problem)

    @staticmethod
    def _cones(problem: InterfaceProblem, start: Iterate) -> Generator[Iterate, None, Iterate]:
        """A few cone programs; returns the best point, `start` if there was none better."""
        from contactopt.solving.methods.cone import AcaryCadoux

        if not AcaryCadoux().solves(problem.law):
            return start
        equations = coulomb_equations(problem)
        best, reached = equations.evaluate(*start)[0], start
        try:
            for point in islice(AcaryCadoux().iterate(problem), CONE_PROGRAMS):
                yield point
                residual = equations.evaluate(*point)[0]
                best, reached = min((best, reached), (residual, point), key=lambda pair: pair[0])
        except BackendError as error:  # no answer: the proximal loop needs none
            note(logger, f"the cone programs of the default method gave no answer: {error}")
        return reached

    @staticmethod
    def _interior(
        problem: InterfaceProblem, matrix: Blocks, start: Iterate, points: Iterator[tuple[Iterate, float]]
    ) -> Generator[Iterate, None, Iterate]:
        """Points with their errors and, where they came near to a solution, a few proximal steps for the last digits.

        Returns the last point or a better `start`.
        """
        best, reached = np.inf, start
        for point, error in points:
            yield point
            if error < best:
                best, reached = error, point
        if best < CLOSE:
            alpha = max(LEAST_ALPHA, 100 * best)
            reached = yield from Auto._proximal(problem, matrix, reached, POLISH, alpha)
        evaluate = proximal_equations(problem, matrix).evaluate
        return min(start, reached, key=lambda point: evaluate(*point)[0])

    @staticmethod
    def _proximal(
        problem: InterfaceProblem, matrix: Blocks, start: Iterate, patience: int, alpha: float, gentle: bool = False
    ) -> Generator[Iterate, None, Iterate]:
        """Iterates of the proximal loop while each `patience` of them halve the residual; returns the last."""
        equations = proximal_equations(problem, matrix)
        best, target, point = np.inf, np.inf, start
        for done, point in enumerate(proximal_iterates(equations, start, alpha, gentle), start=1):
            yield point
            best = min(best, equations.evaluate(*point)[0])
            if done % patience == 0:
                if best > target:
                    break
                target = best / 2
        if point is start:  # not a single subproblem could be solved from there
            yield point
        return point
