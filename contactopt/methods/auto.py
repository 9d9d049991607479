"""The default, without a number to choose: Newton's method, and where it fails cones, then the
proximal loop.

0. Where the problem has no plates, and the package was installed with a compiler: FIRST_SWEEPS
   sweeps of the nonsmooth Gauss-Seidel method, accelerated after Anderson, if they cost little.
   Where stage 1 fails, the sweeps go on for twice as long. Where Q is a convolution,
   as of half-spaces: Newton's method on nested grids, while its residual falls.
1. Unless Q is sparse and singular (rigid bodies): Newton's method from the bonded solution (or no
   force at all) while its residual falls. Elastic bodies end here. Where its sortings go round in a
   circle near a solution, a few proximal steps break out of it.
2. Where Q is sparse and singular: the sweeps of stage 0 from no force again, each of them
   accelerated, since packings on which one of the two goes round in a circle seldom stop the other.
   Then the proximal loop, as long as its subproblems are easy and each of them halves the residual.
3. The interior-point method (contactopt.methods.kernels.interior), which no cycle and no rank
   deficiency of Q disturbs, and a few steps of the proximal loop for the last digits. Where these
   fail, it ends if a proof is found that there is no solution (contactopt.problem.feasibility).
4. Where Q is a symmetric array: CONE_PROGRAMS iterations of the Acary-Cadoux fixed point. Then a
   tree over the states of the contacts looks for a solution or for a proof that there is none
   (contactopt.methods.kernels.states), with TREE_WORK, and twice as much after each round of stages
   5 and 6.
5. Where Q is sparse and singular: PATHS interior-point paths drawn at random, since one that ends
   early says nothing of the next; then the proximal loop from the best of all points, its weight
   falling slowly: jammed packings need hundreds of steps. When SPARSE_ROUND of them have not halved
   the residual, the same again on other paths, with twice the patience.
6. Else the proximal loop from the best point. When ROUND outer iterations have not halved the
   residual, twice as many after each restart, the loop starts again from contact forces drawn at
   random (fixed seed, so that runs repeat) and larger than those of the point it leaves: strong
   friction may have solutions that repel the loop and others that attract it.
It ends where the driver's certificate or limits say so.
"""

import logging
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import ClassVar

import numpy as np

from contactopt.errors import BackendError, InputError
from contactopt.linear.deadline import check_time
from contactopt.linear.operators import form, has_entries
from contactopt.methods import NoSolution, Repeated, constants
from contactopt.methods.cone import AcaryCadoux
from contactopt.methods.kernels.alart_curnier import cold_start, coulomb_equations, definite
from contactopt.methods.kernels.gauss_seidel import Sweeps
from contactopt.methods.kernels.interior import Path, interior_iterates
from contactopt.methods.kernels.sparse_blocks import block_matrix
from contactopt.methods.kernels.states import Point, StateTree, can
from contactopt.methods.method import Iterate, Known, Method, at_rest
from contactopt.methods.nested import Nested
from contactopt.methods.newton import Newton
from contactopt.methods.notes import note
from contactopt.methods.nsgs import NSGS
from contactopt.methods.preconditioners import find_preconditioner
from contactopt.methods.proximal import Pace, Proximal, proximal_iterates
from contactopt.problem import InterfaceProblem, infeasibility

logger = logging.getLogger(__name__)

SAME = 1e-6  # relative difference of two residuals of a stage that goes round in a circle
NO_PROGRESS = "Newton's method made no progress, so interior points and the proximal loop take over"
NO_PROGRESS_NESTED = (
    "Newton's method on nested grids made no progress; it goes on with the finest grid alone"
)
NO_PROGRESS_PRODUCTS = (
    "Newton's method made no progress with products, so all that follows looks at the entries of Q"
)
NO_PROGRESS_JAMMED = (
    "the proximal loop got nowhere and goes on from the best point, by other paths to begin with"
)


@dataclass(frozen=True)
class Auto(Method):
    """The default method. `preconditioner` is that of Newton's steps where Q is known by its
    products: a name, 'none', or None for the best that fits the contacts.
    """

    preconditioner: str | None = None
    implicit: ClassVar[bool] = True
    sparse: ClassVar[bool] = True
    unsymmetric: ClassVar[bool] = True
    wanders: ClassVar[bool] = True

    def __post_init__(self) -> None:
        find_preconditioner(self.preconditioner)

    def iterate(
        self, problem: InterfaceProblem, start: Iterate | None = None
    ) -> Iterator[Iterate | Known]:
        sparse, sweeping = form(problem.Q) == "sparse", problem
        if sparse and problem.q.size <= constants.SMALL:
            problem = problem.altered(Q=problem.Q.toarray())
        swept = _Swept(sweeping, start)
        if not swept.tried:
            first = constants.FIRST_SWEEPS, constants.FIRST_BETWEEN
            yield from swept.points(*first, constants.SWEEPING)
        # asked only now, because a factorisation tells
        loose = sparse and not (problem.symmetric and definite(problem.Q))
        if loose:
            reached = start or at_rest(problem)
        else:
            if form(problem.Q) == "convolution":
                points = Nested().with_residuals(problem, start)
                best, _ = yield from _followed(
                    points, lambda steps, since: since >= constants.PATIENCE
                )
                start = best or start
                note(logger, NO_PROGRESS_NESTED)
            reached = yield from _newton(problem, start, self.preconditioner)
            if not has_entries(problem.Q):
                note(logger, NO_PROGRESS_PRODUCTS)
                try:
                    problem = problem.explicit()
                except InputError as error:
                    note(logger, f"the default method ends with Newton's steps: {error}")
                    return
                reached = yield from _newton(problem, None, None)  # its steps are exact now
            note(logger, NO_PROGRESS)
        yield from _Robust(problem, loose, swept).iterates(start, reached)


class _Swept:
    """Accelerated Gauss-Seidel sweeps, as long as they are cheap."""

    def __init__(self, problem: InterfaceProblem, start: Iterate | None):
        self.problem = problem
        # where contactopt.methods.small tried them
        self.tried = "swept" in problem.__dict__
        first = problem.__dict__["swept"] if self.tried else (start or at_rest(problem))[0]
        self.r = np.array(first, order="C")

    def points(self, most: int, between: int, budget: float) -> Iterator[Iterate]:
        """Points that `most` sweeps reach within a number of multiplications: rough, then exact."""
        problem = self.problem
        explicit = has_entries(problem.Q)
        size = problem.Q.nnz if form(problem.Q) == "sparse" else problem.q.size**2
        cost = size + constants.LOCAL * problem.contacts
        left = int(min(most, budget / cost))
        if not explicit or left < constants.FEWEST_SWEEPS:
            return
        if not (NSGS().solves(problem.law) and Sweeps.can(problem)):
            return
        sweeps = Sweeps(problem, constants.SWEEPS_KEPT, between)
        often = int(constants.MOMENT // cost) + 1
        done = self.reached(constants.NEARLY_SWEPT, sweeps, left, often)
        if not done:
            return
        if done * cost > constants.LOOK:
            yield self.r.copy(), np.zeros(0)
        # the last digits take less than the first
        self.reached(constants.SWEPT, sweeps, 2 * done, often)
        yield self.r.copy(), np.zeros(0)

    def reached(self, enough: float, sweeps: Sweeps, most: int, often: int) -> int:
        """The number of sweeps, at most so many, until a change is small enough; else 0."""
        for done in range(0, most, often):
            check_time()
            change, more = sweeps(self.r, min(often, most - done), enough=enough)
            if change <= enough:
                return done + more
        return 0


class _Robust:
    """The stages after Newton's method, on a problem whose Q is an array or sparse. A stage yields
    its iterates, and returns the best of its points or a better one that it was given.
    """

    def __init__(self, problem: InterfaceProblem, loose: bool, swept: _Swept):
        self.swept = swept
        self.problem, self.matrix = problem, block_matrix(problem.Q, problem.dim)
        self.loose = loose
        self.conic = AcaryCadoux().solves(problem.law) and not problem.law.dilatant
        self.evaluate = coulomb_equations(problem).evaluate
        self.met = False

    @cached_property
    def tree(self) -> StateTree | None:
        """The tree over the states of few contacts."""
        few = self.problem.contacts <= constants.MOST_STATES[self.problem.dim]
        return StateTree(self.problem.explicit()) if few and can(self.problem) else None

    @cached_property
    def branches(self) -> Iterator[Point | None]:
        return self.tree.points() if self.tree else iter(())

    def better(self, *points: Iterate) -> Iterate:
        """The point with the least residual, the first of equal ones."""
        return min(points, key=lambda point: self.evaluate(*point)[0])

    def iterates(
        self, start: Iterate | None, reached: Iterate
    ) -> Generator[Iterate | Known, None, None]:
        problem = self.problem
        if self.loose and start is not None:
            reached = yield from self.proximal(start, constants.POLISH, constants.LEAST_ALPHA)
        elif self.loose:
            self.swept.r[:] = 0.0
            again = constants.FIRST_SWEEPS, constants.MORE_BETWEEN
            yield from self.swept.points(*again, constants.SWEEPING)
            reached = yield from self.proximal(reached, 1, constants.EAGER_ALPHA, "eager")
        else:
            residual = coulomb_equations(problem).evaluate(*reached)[0]
            if residual <= constants.NEARBY * np.linalg.norm(reached[0]):
                reached = yield from self.proximal(
                    reached, 1, constants.LEAST_ALPHA, aim=residual / 2
                )
            yield from self.swept.points(constants.MORE_SWEEPS, constants.MORE_BETWEEN, np.inf)
        if self.conic:
            for full in (True, False):
                path = interior_iterates(problem, self.matrix, Path(full))
                reached = yield from self.interior(reached, path)
        if infeasibility(problem) is not None:  # the driver says so
            return
        if self.conic and problem.symmetric and not self.loose:
            reached = yield from self.cones(reached)
        yield from self.searched(constants.TREE_WORK)
        yield from self.jammed(reached) if self.loose else self.restarted(reached)

    def searched(self, work: float) -> Iterator[Iterate | Known]:
        """The points that so much work on the tree finds; NoSolution if it ends without any."""
        if self.tree is None or self.tree.done:
            return
        end = self.tree.work + work
        for found in self.branches:
            if found is not None:
                self.met = True
                yield from self.proximal(found[:2], constants.POLISH, constants.LEAST_ALPHA)
            if self.tree.work > end:
                return
        if self.tree.done and not self.met:
            raise NoSolution(self.tree.proof)

    def restarted(self, reached: Iterate) -> Generator[Iterate | Known, None, None]:
        """Without end: the proximal loop from `reached`, and then from random forces."""
        random = np.random.default_rng(0)
        for restarts in count():
            last = yield from self.proximal(reached, constants.ROUND * 2**restarts, Proximal.alpha)
            r = random.normal(size=self.problem.q.shape)
            r[:, 0] = np.abs(r[:, 0])
            r *= constants.LARGER * np.sqrt(np.mean(last[0] ** 2)) or 1.0
            reached = self.problem.law.nearest(r, r[:, 0]), last[1]
            note(logger, "the proximal loop got nowhere and started again from random forces")
            yield from self.searched(constants.TREE_WORK * 2 ** (restarts + 1))

    def jammed(self, reached: Iterate) -> Generator[Iterate | Known, None, None]:
        """Paths drawn at random and the gentle proximal loop from the best point, without end."""
        problem, matrix, random = self.problem, self.matrix, np.random.default_rng(0)
        for restarts in count():
            for _ in range(constants.PATHS if self.conic else 0):
                path = Path.random(random, problem.contacts)
                points = interior_iterates(problem, matrix, path)
                reached = yield from self.interior(reached, points)
            patience = constants.SPARSE_ROUND * 2**restarts
            last = yield from self.proximal(reached, patience, constants.GENTLE_ALPHA, "gentle")
            reached = self.better(reached, last)
            note(logger, NO_PROGRESS_JAMMED)
            yield from self.searched(constants.TREE_WORK * 2 ** (restarts + 1))

    def cones(self, start: Iterate) -> Generator[Iterate | Known, None, Iterate]:
        """A few cone programs."""
        evaluate = coulomb_equations(self.problem).evaluate
        points = ((point, evaluate(*point)[0]) for point in AcaryCadoux().iterate(self.problem))
        try:
            found, residual = yield from _followed(
                points, lambda steps, since: steps >= constants.CONE_PROGRAMS
            )
        except BackendError as error:  # no answer: the proximal loop needs none
            note(logger, f"the cone programs of the default method gave no answer: {error}")
            return start
        return found if found is not None and residual < evaluate(*start)[0] else start

    def interior(
        self, start: Iterate, points: Iterator[tuple[Iterate, float]]
    ) -> Generator[Iterate | Known, None, Iterate]:
        """Points with their errors and, near a solution, a few proximal steps."""
        found, best = yield from _followed(points, lambda steps, since: False)
        reached = found or start
        if best < constants.CLOSE:
            reached = yield from self.proximal(
                reached, constants.POLISH, max(constants.LEAST_ALPHA, 100 * best)
            )
        return self.better(start, reached)

    def proximal(
        self,
        start: Iterate,
        patience: int,
        alpha: float,
        pace: Pace = "steady",
        aim: float = np.inf,
    ) -> Generator[Iterate | Known, None, Iterate]:
        """The last proximal iterate, while every `patience` of them halve the residual."""
        equations = coulomb_equations(self.problem)
        best, target, point = np.inf, aim, start
        iterates = proximal_iterates(self.problem, self.matrix, start, alpha, pace)
        for done, point in enumerate(iterates, start=1):
            try:
                yield point
            except Repeated:
                break
            best = min(best, equations.evaluate(*point)[0])
            if done % patience == 0:
                if best > target:
                    break
                target = best / 2
        if point is start:  # not a single subproblem could be solved from there
            yield point
        return point


def _newton(
    problem: InterfaceProblem, start: Iterate | None, preconditioner: str | None
) -> Generator[Iterate | Known, None, Iterate]:
    """The best of Newton's iterates; a start that fails is replaced by the bonded solution."""
    Q = problem.Q
    dear = not has_entries(Q) and (Q.coupled is not None or problem.q.size > constants.FEW_ENTRIES)

    def tired(steps: int, since: int) -> bool:
        return since >= constants.PATIENCE or steps > constants.NEWTON_STEPS

    def spent(steps: int, since: int) -> bool:
        cheaper = dear and not has_entries(Q) and Q.products < problem.q.size
        return tired(steps, since) and not cheaper

    method, warm, least = Newton(preconditioner=preconditioner), start, np.inf
    if start is not None:
        found, least = yield from _followed(method.with_residuals(problem, start), tired)
        warm = found or start
        note(
            logger,
            "Newton's method made no progress from the given start and starts again without it",
        )
    found, residual = yield from _followed(method.with_residuals(problem, None), spent)
    return (found if residual < least else warm) or cold_start(problem)


def _followed(
    points: Iterator[tuple[Iterate | Known, float]], tired: Callable[[int, int], bool]
) -> Generator[Iterate | Known, None, tuple[Iterate | None, float]]:
    """Hand points on until a stage is `tired` or repeats itself; returns the best, its residual."""
    best, reached, since, seen = np.inf, None, 0, np.zeros(0)
    for steps, (point, residual) in enumerate(points, start=1):
        try:
            yield point
        except Repeated:
            break
        since = 0 if residual < constants.PROGRESS * best else since + 1
        if residual < best:
            best, reached = residual, point[:2]
        if tired(steps, since) or np.any(np.abs(seen - residual) <= SAME * residual):
            break
        seen = np.append(seen, residual)
    return reached, best
