"""Follow a load path: one state after the other, on bodies, coupling and Q of the first."""

from collections.abc import Callable, Iterable, Sized
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.cards import count
from contactopt.defaults import TOL
from contactopt.errors import InputError, Unbalanced
from contactopt.problem import Solution, Status
from contactopt.readings.plate_motions import motion
from contactopt.readings.resultants import columns
from contactopt.scenes.scene import Scene
from contactopt.solving.paths import PathResult, State
from contactopt.solving.sliding import ending, sliding, sliding_words, unheld_words
from contactopt.solving.solve_scene import Options, Solved, solve_loaded, solve_scene

Forces = list[tuple[np.ndarray, np.ndarray]]
KEPT = 500_000  # displacement unknowns of all bodies, up to which every state of a path keeps them


def follow(
    scenes: Iterable[Scene],
    elements: int | None = None,
    zone: float | None = None,
    note: Callable[[str], None] = lambda text: None,
    Q: str = "auto",
    solver: str = "auto",
    **settings: Any,
) -> PathResult:
    """Solve a load path: the states of one scene in their order, from the unloaded bodies on.

    Parameters
    ----------
    scenes : states that differ in their loads only: forces, tractions, prescribed displacements
    elements : across the contact half-width; the scene's own number by default. One mesh serves the
        whole path.
    zone : half-width that the mesh resolves [length]; by default the scene's
    note : receives one short sentence after every state, "state 17 of 41: ..." where the number of
        states is known
    Q, solver : form of Q and solver of the bodies, as for reduce()
    settings : arguments of solve(). Each step starts from the solution of the one before.

    Returns
    -------
    PathResult : the states with their solutions, in their order

    Raises
    ------
    InputError : for an empty path, for states that are not those of one scene, and for a state
        whose loads nothing can hold, which it names
    """
    if not isinstance(scenes, Iterable) or isinstance(scenes, np.ndarray) or sp.issparse(scenes):
        raise InputError(f"a path is a list of scenes; got {type(scenes).__name__}.")
    method, tol = settings.pop("method", None), settings.pop("tol", TOL)
    return follow_path(scenes, elements, zone, Options(Q, solver, method, tol, settings, note))


def follow_path(
    scenes: Iterable[Scene], elements: int | None, zone: float | None, options: Options
) -> PathResult:
    """Solve a load path with the same options for all states; the errors are those of follow()."""
    total = f" of {len(scenes)}" if isinstance(scenes, Sized) else ""
    states: list[State] = []
    solved: Solved | None = None
    failed: Solution | None = None
    bodies: Forces | None = None
    for scene in scenes:
        said = getattr(scene, "state", "")  # what is no scene is told below
        named = f"state {len(states) + 1}{total}{said and f' ({said})'}"
        if solved is None:
            once = isinstance(scenes, Sized) and len(scenes) == 1
            now = solve_scene(scene, elements, zone, options, once=once)
        else:
            now = _next_state(scene, named, solved, states, options)
        steps = count(now.solution.iterations, "iteration")
        options.note(f"{named}: {now.solution.status}, {steps}")
        if states and not now.solution.solved:
            failed = _ended(now, states, named)
            break
        solved = now
        state, bodies = state_of(solved, states[-1] if states else None, bodies)
        states.append(state)
        if not state.solution.solved:
            break
        if options.restart is not None:
            options.restart.finished(state.solution)
    if solved is None:
        raise InputError("the path has no states; give at least one scene.")
    return PathResult(tuple(states), solved.reduction, failed)


def _next_state(
    scene: Scene, named: str, solved: Solved, states: list[State], options: Options
) -> Solved:
    """The next state of a path; errors name it, or bring the path so far."""
    try:
        return solve_loaded(scene, solved, states[-1].displacements[:, 1:], options)
    except InputError as error:
        if not isinstance(error, Unbalanced):
            raise type(error)(f"{named}: {error}") from error
        problem, last = solved.reduction.loaded(scene).problem, states[-1]
        names = named, f"state {len(states)}"
        words = unheld_words(str(error), problem, scene, (last.solution, last.s), names)
        failed = replace(last.solution, status=Status.INFEASIBLE, residual=np.inf, message=words)
        raised = Unbalanced(words)
        raised.path = PathResult(tuple(states), solved.reduction, failed)
        raise raised from error


def _ended(now: Solved, states: list[State], named: str) -> Solution:
    """The last iterate of a state that was not solved; its message says where the path ends."""
    solution, before = now.solution, f"state {len(states)}"
    slid = sliding(now.reduction.problem, solution, states[-1].solution)
    if slid is None:
        message = f"{named}: {solution.message}{ending(before)}"
    else:
        message = sliding_words(slid, now.reduction.scene, named, before)
    return replace(solution, message=message)


def state_of(
    solved: Solved, before: State | None = None, last: Forces | None = None
) -> tuple[State, Forces]:
    """What is kept of a state, and U and external forces F of each body, from the last one's."""
    reduction, solution = solved.reduction, solved.solution
    problem, r = reduction.problem, solution.reactions
    gap, earlier = np.zeros(r.shape), np.zeros(r.shape)
    gap[:, 0] = reduction.gap
    if before is not None:
        earlier[:, 1:] = before.displacements[:, 1:]
    slip = problem.displacements(r, solution.multipliers)
    U = reduction.displaced(solution)
    inner, now, elastic = zip(reduction.bodies, reduction.maps, U), [], 0.0
    for body, B, own in inner:
        force = B.T @ r.ravel()
        resisted = body.internal_forces(own, force)
        now.append((own, resisted - force))
        elastic += float(own @ resisted) / 2
    # before the first state are the unloaded bodies
    u0, r0 = (gap, 0.0) if before is None else (before.displacements, before.solution.reactions)
    risen, shifted = (motion(reduction, U, component) for component in (0, 1))
    steps = zip(now, last or [(0 * own, 0 * force) for own, force in now])
    here = all(isinstance(own, np.ndarray) for own in U) and sum(own.size for own in U) <= KEPT
    state = State(
        reduction.scene,
        solution,
        problem.q,
        problem.s,
        slip + earlier,
        slip[:, 1:],
        np.nan if risen is None else risen.value,
        np.nan if shifted is None else shifted.value,
        elastic=elastic,
        external=sum(float((F + F0) @ (own - U0)) for (own, F), (U0, F0) in steps) / 2,
        contact=-float(np.sum((r + r0) * (slip + earlier - u0))) / 2,
        bodies=U if here else (),
        columns=columns(reduction, solution),
    )
    return state, now
