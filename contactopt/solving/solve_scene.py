"""The one place that solves a scene: reduce it to its interface, find a start, solve.

Whatever solves scenes is a loop around the two functions of this module: the contact zone and load
paths (contactopt.solving), and refinement (contactopt.accuracy).
"""

import logging
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.linalg as la

from contactopt.cards import count
from contactopt.coupling.posed import Posed, posed
from contactopt.coupling.reduction import Reduction, reduce_bodies
from contactopt.defaults import TOL
from contactopt.errors import InputError
from contactopt.linear.budget import NextBest, TooDear, open_budget
from contactopt.linear.operators import form, loosened
from contactopt.methods.auto import Auto
from contactopt.methods.driver import solve
from contactopt.methods.method import Method
from contactopt.problem import InterfaceProblem, Solution, Status, natural_map_residual
from contactopt.problem.transfer import transfer
from contactopt.readings.constants import (
    BALANCED,
    BEARABLE,
    BORNE,
    COARSEST,
    FACTOR,
    ROUGH,
    ROUNDS,
    SLOW,
)
from contactopt.readings.validity import validity
from contactopt.scenes.scene import Scene
from contactopt.solving.paths import PathResult
from contactopt.solving.progress import progress_lines
from contactopt.solving.restart import Restart, certified
from contactopt.solving.sliding import sliding, sliding_words

Note = Callable[[str], None]
log = logging.getLogger(__name__)
# Steps of the default method, of which those of Newton and along interior paths are some forty,
# until it is asked whether a state slides. One that does not starts again, without this bound.
FIRST_TRY = 64
REACHED = 1e-2  # certificate from which on what a way has reached is the start of the next one
STEPS = (None, "auto", "newton")  # methods that take Newton's steps by themselves


@dataclass(frozen=True)
class Options:
    """How scenes are solved, whatever loop goes around it. The fields not named here are arguments
    of contactopt.reduce and contactopt.solve.

    tol        above the usual one the last step comes no further, and what is read off the bodies
               is as accurate
    settings   further arguments of contactopt.solve
    note       receives one short sentence before every step that takes time, and in long solves
               one after each iteration
    restart    keeps what is found on the way, and may give a start
    until      when solves end that are not done yet, on the clock time.perf_counter() [s]
    """

    Q: str = "auto"
    solver: str = "auto"
    method: str | Method | None = None
    tol: float = TOL
    settings: Mapping[str, Any] = field(default_factory=dict)
    note: Note = lambda text: None
    restart: Restart | None = None
    until: float = np.inf

    @property
    def of_solve(self) -> dict[str, Any]:
        """The arguments of contactopt.solve."""
        limit = {}
        if self.until < np.inf:
            limit["time_limit"] = max(0.0, self.until - time.perf_counter())
        return {"method": self.method, "tol": self.tol} | limit | dict(self.settings)


@dataclass(frozen=True, eq=False)
class Solved:
    """A scene that was reduced and solved.

    `solution.seconds` holds the wall time [s] of each phase, summed over all that led to this
    solution: `assemble`, `factorise` and `compliance` of the bodies, `load` of further states of a
    path, `checks` of the interface problem, `solve` of it by the method, `certificate` of the
    answer, `coarse` for everything that was done on coarser meshes, and `given up` for a way that
    was left because it took more work than expected.

    zones  half-widths of the contact zone [length]: for which the first mesh was made, and read
           from each solution; none if the scene has no zone
    path   all states of a load path, of which this is the last one; None where there is one state
           only
    turned the way that was taken in place of one that turned out to be too dear; None where the
           first choice was kept
    """

    reduction: Reduction
    solution: Solution
    zones: tuple[float, ...] = ()
    path: PathResult | None = None
    turned: NextBest | None = None


def solve_scene(
    scene: Scene,
    elements: int | None = None,
    zone: float | None = None,
    options: Options | None = None,
    start: Solved | None = None,
    once: bool = True,
) -> Solved:
    """Reduce a scene on one mesh and solve it, by default with its own number of elements and zone.

    `start` is the scene solved on another mesh. Without one, where Newton's steps take products
    with Q, a coarser mesh comes first, if the bodies can make one. `once`: no further states follow
    that the bodies' factors would serve.
    """
    options = options or Options()
    if not isinstance(scene, Scene):
        raise InputError(f"a scene must be a Scene; got {type(scene).__name__}.")
    elements = scene.elements if elements is None else elements
    once = once and options.method in STEPS
    zoned = f", zone {zone:.6g}" if zone is not None else ""
    options.note(f"reducing {scene.name}{zoned}: meshes and coupling")
    made = posed(scene, elements, zone, options.Q)
    if start is not None and start.turned is not None:
        options = replace(options, Q=start.turned.Q, solver=start.turned.solver)
        solved = _one_way(scene, elements, zone, options, start, once, made)
        return replace(solved, turned=start.turned)
    gone = 0.0
    notes: tuple[str, ...] = ()
    turned: NextBest | None = None
    reached: Solution | None = None
    while True:
        begin = time.perf_counter()
        try:
            with open_budget(turned and turned.then):
                solved = _one_way(scene, elements, zone, options, start, once, made, reached)
            break
        except TooDear as too_dear:
            turned = too_dear.instead
            if too_dear.reached is not None and too_dear.reached[0] < REACHED:
                residual, r, multipliers = too_dear.reached
                reached = Solution(r, multipliers, Status.SETTLED, residual, 0, "given")
        gone += time.perf_counter() - begin
        notes = (*notes, _left(turned))
        options.note(notes[-1])
        options = replace(options, Q=turned.Q, solver=turned.solver)
    if turned is None:
        return solved
    solution = solved.solution
    solution = replace(
        solution, seconds=solution.seconds | {"given up": gone}, notes=(*solution.notes, *notes)
    )
    return replace(solved, solution=solution, turned=turned)


def _left(other: NextBest) -> str:
    steps = {"coupled": "V-cycles of multigrid", "products": "products with Q"}[other.left]
    return f"more {steps} are needed than expected; an {other.Q} Q by {other.solver} replaces them"


def _one_way(
    scene: Scene,
    elements: int,
    zone: float | None,
    options: Options,
    start: Solved | None,
    once: bool,
    made: Posed,
    reached: Solution | None = None,
) -> Solved:
    """The scene with `made` bodies, solved by the named or cheapest way, from what another way has
    `reached`; TooDear if it is slow.
    """
    reduction = reduce_bodies(
        scene, elements, zone, options.Q, options.solver, once=once, made=made, note=options.note
    )
    coarse: dict[str, float] = {}
    Q = reduction.problem.Q
    # half-spaces have coarse grids of their own
    products = form(Q) == "products"
    coarser = elements // FACTOR[scene.dim]
    first = reached if reached is not None and _fits(reached, reduction.problem) else None
    if first is None and options.restart and start is None:
        first = options.restart.start(reduction)
    if start is None and first is None and products and not scene.given and coarser >= COARSEST:
        begin = time.perf_counter()
        start = solve_scene(scene, coarser, zone, replace(options, tol=max(ROUGH, options.tol)))
        coarse = {"coarse": time.perf_counter() - begin}
    options.note(f"solving {count(reduction.problem.contacts, 'contact')}")
    if start is not None and first is None:
        first = transfer(start.reduction.problem, start.solution, reduction.problem)
    solved = _solved(reduction, first, options, coarse)
    log.info("%s: %s, %s", scene.name, count(elements, "element"), solved.solution.status)
    return solved


def _fits(start: Solution, problem: InterfaceProblem) -> bool:
    return start.reactions.shape == problem.q.shape and start.multipliers.shape == problem.s.shape


def solve_loaded(scene: Scene, before: Solved, slipped: np.ndarray, options: Options) -> Solved:
    """Solve the next state of a load path: the same bodies, coupling and Q under other loads, from
    the state before, slip measured from its tangential displacements (k, dim - 1) [length].
    InputError if more than loads and friction differ.
    """
    step = before.reduction.loaded(scene).after(slipped)
    known = options.restart.start(step) if options.restart else None
    touched = np.any(before.solution.reactions)  # an unloaded state tells nothing of a loaded one
    return _solved(step, known or (before.solution if touched else None), options, {})


def _solved(
    reduction: Reduction, start: Solution | None, options: Options, earlier: Mapping[str, float]
) -> Solved:
    """The solution of a reduced scene, with the seconds of all that came earlier."""
    lines = progress_lines(options.note, reduction.problem, options.tol)
    if options.restart is not None:
        options.restart.begin(reduction)
        lines = options.restart.watching(lines)

    def answer(problem: InterfaceProblem, start: Solution | None) -> Solution:
        found = certified(problem, start, options.tol) or _unloaded(problem, options.tol)
        usual = (
            options.method in (None, "auto", Auto()) and "max_iterations" not in options.settings
        )
        if found is None and usual and problem.motions:
            few: dict[str, Any] = {
                "progress": lines,
                "max_iterations": FIRST_TRY,
            } | options.of_solve
            tried = solve(problem, start=start, **few)
            ended = tried.status is not Status.ITERATION_LIMIT
            found = tried if ended or sliding(problem, tried, start) else None
        return found or solve(problem, start=start, **({"progress": lines} | options.of_solve))

    seconds = Counter(reduction.seconds)
    seconds.update(earlier)
    held = reduction.grounded()
    found = [] if held is None else [_on_ground(held, start, answer)]
    if not found or _doubt(*found[0]) > BALANCED:
        try:
            found.append((reduction, answer(reduction.problem, start)))
        except InputError:  # so thin that its compliance is rounding alone
            if not found:
                raise
    for _, solution in found:
        seconds.update(solution.seconds)
    # What bends by itself needs no ground, however far its surfaces miss each other without it.
    doubts = [0.0] if len(found) == 1 else [_doubt(*pair) for pair in found]
    ranks = range(len(found), 0, -1) if doubts[0] > BEARABLE else doubts
    reduction, solution = min(zip(ranks, found), key=lambda one: (not one[1][1].solved, one[0]))[1]
    if not solution.solved and (slid := sliding(reduction.problem, solution, None)):
        words = sliding_words(slid, reduction.scene, "the scene", "")
        solution = replace(solution, message=f"{words} ({solution.message})")
    return Solved(
        _knowing(reduction, solution, options.tol), replace(solution, seconds=dict(seconds))
    )


def _unloaded(problem: InterfaceProblem, tol: float) -> Solution | None:
    """Without loads and overlaps, no forces and the motions with the least slip, where the laws
    allow them; no method is needed, and Newton's meets a singular system.
    """
    if not len(problem.s) or np.any(problem.s) or np.any(problem.q[:, 0] < 0):
        return None
    V = problem.V.reshape(*problem.q.shape, -1)
    along = la.null_space(V[:, 0])
    slips = V[:, 1:].reshape(-1, len(problem.s)) @ along
    lam = along @ np.linalg.lstsq(slips, -problem.q[:, 1:].ravel(), rcond=None)[0]
    r, status = np.zeros(problem.q.shape), Status.SOLVED
    residual = natural_map_residual(problem, r, lam)
    if residual > tol:
        return None
    seconds = {"solve": 0.0, "certificate": 0.0}
    return Solution(
        r, lam, status, residual, 0, "none", seconds=seconds, message=f"{status.sentence}, no load"
    )


def _knowing(reduction: Reduction, solution: Solution, tol: float) -> Reduction:
    """With a Q that knows the displacements of the solution, as accurately as it was asked for."""
    problem = reduction.problem
    if solution.displacements is None:
        return reduction
    Q = problem.Q.knowing(solution.reactions.ravel(), solution.displacements)
    Q = loosened(Q, tol) if tol > TOL else Q
    return replace(reduction, problem=problem.altered(Q=Q))


def _doubt(reduction: Reduction, solution: Solution) -> float:
    """The largest imbalance of a body and misfit of a pair."""
    limits = validity(reduction, solution)[0]
    parts = (limits["bodies"], "imbalance"), (limits["pairs"], "misfit")
    return max((own[key] for table, key in parts for own in table.values()), default=0.0)


def _on_ground(
    held: Reduction,
    start: Solution | None,
    answer: Callable[[InterfaceProblem, Solution | None], Solution],
) -> tuple[Reduction, Solution]:
    """The answer for thin bodies, held by a ground until it bears nothing or no less."""
    before = np.inf
    solution = answer(held.problem, start)
    seconds = Counter(solution.seconds)
    for _ in range(ROUNDS):
        left = _doubt(held, solution)
        if left <= BORNE or left > SLOW * before or not solution.solved:
            break
        held, before = held.pulled(solution), left
        solution = answer(held.problem, solution)
        seconds.update(solution.seconds)
    return held, replace(solution, seconds=dict(seconds))
