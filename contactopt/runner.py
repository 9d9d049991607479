"""The whole way in one call: scene -> reduction -> solution -> fields -> figures and files."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.checks import meant, overheard, said_once
from contactopt.coupling.back_to_bodies import recover
from contactopt.errors import InputError
from contactopt.figures.output import PAGE, draw, earlier_files, not_drawable, write
from contactopt.figures.style import FORMATS
from contactopt.files.writing import check_folder, finite, whole_folder
from contactopt.methods import default_method, find_method
from contactopt.methods.method import Method
from contactopt.methods.notes import collected
from contactopt.outcome import Outcome
from contactopt.readings.chords import chord_remarks
from contactopt.readings.corners import corner_remarks
from contactopt.readings.plausibility import said_of_meshes
from contactopt.readings.quantities import quantity_of_states
from contactopt.readings.summary import summary_of
from contactopt.readings.validity import impossible
from contactopt.run_options import OPTIONS, RunOptions, choose, takes_options
from contactopt.scenes import PATHS, make_path, make_scene
from contactopt.scenes.scene import Scene
from contactopt.solving import solve_states
from contactopt.solving.limits import Limits, too_large
from contactopt.solving.restart import FILE, Restart, make_restart
from contactopt.solving.solve_scene import Options, Solved

if TYPE_CHECKING:
    from contactopt.accuracy.estimate import Estimate
    from contactopt.scenes.scene_files import SceneFile

Note = Callable[[str], None]
PATH_KEYS = (
    "approach", "shift", "shear_force", "contact_half_width", "stick_half_width", "friction_work",
)  # fmt: skip
# option -> field of Limits
BOUNDS = {"max_unknowns": "unknowns", "time_limit": "seconds", "max_memory": "memory"}


class Result(Outcome):
    __doc__ = Outcome.__doc__

    def _repr_html_(self) -> str:
        from contactopt.figures.notebook import result_card

        return result_card(self)

    def view(self, file: str | Path | None = None, show: bool = True) -> Path:
        """Write the result as one page to explore in a browser, by default into a temporary file,
        and open it. InputError if the file, whose name ends in .html, cannot be written.

        The page needs no network and nothing but the browser (contactopt.figures.view_page says
        what is on it).
        """
        import tempfile
        import webbrowser

        from contactopt.figures.view_page import write_page

        if file is None:
            file = Path(tempfile.mkdtemp(prefix="contactopt-")) / PAGE
        with tempfile.TemporaryDirectory() as folder:
            write(self, Path(folder))
            (Path(folder) / "summary.json").write_text(json.dumps(self.summary))
            made = write_page(folder, file)
        if show:
            webbrowser.open(made.resolve().as_uri())
        return made


@takes_options
def run(
    scene: str | Path | Scene,
    out: str | Path | None = None,
    *,
    note: Note = lambda text: None,
    **changes: Any,
) -> Result:
    """Solve a scene end to end, and write its figures and files into a folder if one is given.

    Parameters
    ----------
    scene : a name of contactopt.scenes.SCENES, which is solved along its load path if it has one; a
        scene file, whose name ends in .toml; or a Scene
    out : folder for the files; None: nothing is written
    note : receives progress messages
    OPTIONS
    changes : to the arguments of a named scene, such as `elements`, or to the fields of a Scene

    Options from `method` to `max_memory` may stand in a scene file; those given here win. None
    means the default.

    Returns
    -------
    Result : the solution with its interface problem, the fields of the bodies, and a summary. With
        `simplest`, its `scene` is what was solved

    Raises
    ------
    InputError : with a sentence that says what to do; nothing is left half-written
    """
    start = time.perf_counter()
    with overheard() as told, collected() as noted:
        file = _scene_file(scene, changes)
        options, changes = choose(changes, {} if file is None else file.solve)
        _check_output(out, options)
        states = _states(scene, file, changes)
        with _located(file):
            return _run(states, out, note, options, lambda: (*told, *noted), start)


@contextmanager
def _located(file: SceneFile | None) -> Iterator[None]:
    """Within this block errors name the scene file, and the line in it."""
    try:
        yield
    except InputError as error:
        if file is None:
            raise
        raise file.located(error) from error


def _run(
    states: tuple[Scene, ...],
    out: str | Path | None,
    note: Note,
    options: RunOptions,
    told: Callable[[], tuple[str, ...]],
    start: float,
) -> Result:
    """As run(); `told` gives the remarks that were made so far outside of the solution."""
    of_meshes = said_of_meshes(states[-1])
    name = options.method or default_method(options.settings)
    method = find_method(name, **options.settings)
    method.backends(states[-1].dim)  # refused before any work if one of them cannot be used
    for quantity in options.read:
        quantity_of_states(quantity, states)
    restart = make_restart(out, options.resume, options.start, len(states) > 1, note)
    limits = Limits(**{BOUNDS[bound]: value for bound, value in options.limits.items()})
    how = _how(options, method, start, restart, note)
    prepared = time.perf_counter() - start
    try:
        solved, estimate = None, None
        if options.simplest:
            states, solved = _simplest(states, how)
        if solved is None or options.accuracy is not None:
            solved, estimate = _solved(states, options, limits, how)
        names = (name, *method.backends(states[-1].dim))
        result = _result(solved, estimate, names, (*of_meshes, *told()))
        if options.read:
            from contactopt.accuracy.indicators import read_once  # with the room of derivatives

            with _clock(result.summary["seconds"], "quantities"):
                found = {one: read_once(solved, one) for one in options.read}
                result.summary["quantities"] = finite(found)
        result.summary["seconds"] = {"scene": prepared} | result.summary["seconds"]
        return _written(result, out, options, start, note, restart)
    except MemoryError as error:
        restart.stopped(note)
        raise InputError(too_large(states[-1], str(error))) from error
    except KeyboardInterrupt:
        restart.stopped(note)
        raise


def scene_of(scene: str | Path | Scene, **changes: Any) -> Scene:
    """The scene of a name or file, with changes as for run(); of a load path its last state."""
    return states_of(scene, **changes)[0][-1]


def states_of(
    scene: str | Path | Scene, **changes: Any
) -> tuple[tuple[Scene, ...], dict[str, Any]]:
    """As scene_of(), all states of a load path, and the options of a run that the file gives."""
    file = _scene_file(scene, changes)
    return _states(scene, file, changes), {} if file is None else file.solve


@said_once()
def _scene_file(scene: str | Path | Scene, changes: dict[str, Any]) -> SceneFile | None:
    """The scene file that a scene's name stands for, with changed entries; else None."""
    if isinstance(scene, Scene) or not str(scene).endswith(".toml"):
        return None
    from contactopt.scenes.scene_files import read_scene_file

    own = {name: value for name, value in changes.items() if name not in OPTIONS}
    return read_scene_file(scene, {key: value for key, value in own.items() if value is not None})


def _states(scene: Any, file: SceneFile | None, changes: dict[str, Any]) -> tuple[Scene, ...]:
    """The scene, or the states of its load path."""
    if changes.get("elements", 0) is None:
        changes = {name: value for name, value in changes.items() if name != "elements"}
    if file is not None:
        return file.states
    if isinstance(scene, str | Path):
        if Path(scene).is_file():
            raise InputError(f"'{scene}' is no scene file: the name of one ends in .toml.")
        name = str(scene)
        return make_path(name, **changes) if name in PATHS else (make_scene(name, **changes),)
    if not isinstance(scene, Scene):
        raise InputError(
            "a scene is a Scene, its name or a scene file; got"
            f" {type(scene).__name__}. contactopt.follow solves the scenes of a load path."
        )
    known = [field.name for field in fields(scene)]
    for name in changes:
        if name not in known:
            raise InputError(
                f"a Scene has no field {name!r}; its fields are"
                f" {', '.join(known)}{meant(name, [*known, *OPTIONS])}"
            )
    return (replace(scene, **changes),)


def _how(
    options: RunOptions, method: Method, begin: float, restart: Restart, note: Note
) -> Options:
    """How each state is solved, of a run that began at a time [s]."""
    form = options.Q if options.preconditioner is None else "implicit"
    limit = options.time_limit if options.accuracy is None else None
    until = np.inf if limit is None else begin + limit
    return Options(form, options.solver, method, options.tol, {}, note, restart, until)


def _check_output(out: str | Path | None, options: RunOptions) -> None:
    """Raise InputError, before any work, for what cannot be written."""
    figures = options.figures
    if isinstance(figures, str) or not set(figures) <= set(FORMATS):
        raise InputError(
            f"figures must be formats of {', '.join(FORMATS)}, or () for none; got {figures!r}."
        )
    if out is not None:
        check_folder(Path(out))


def _simplest(states: tuple[Scene, ...], how: Options) -> tuple[tuple[Scene, ...], Solved | None]:
    """The scene after all exact simplifications, and its solution, which proved them."""
    if len(states) > 1:
        raise InputError(
            f"scene '{states[0].name}' has a load path, whose states would all have to be"
            " symmetric; ask contactopt.simplify for each state."
        )
    from contactopt.simplification.search import proved_part

    found, solved = proved_part(states[0], how)
    return (found.scene,), solved


@said_once()
def _solved(
    states: tuple[Scene, ...], options: RunOptions, limits: Limits, how: Options
) -> tuple[Solved, Estimate | None]:
    """The scene or its load path, on its own mesh or on meshes refined to an accuracy."""
    if options.accuracy is None or options.quantity is None:
        return solve_states(states, options=how), None
    from contactopt.accuracy.loop import refine  # it brings the room of derivatives with it

    return refine(
        states,
        options.quantity,
        options.accuracy,
        how,
        limits,
        adaptive=options.adaptive,
        bound=options.bound,
    )


def _result(
    solved: Solved,
    estimate: Estimate | None,
    names: tuple[str, str, str],
    told: tuple[str, ...] = (),
) -> Result:
    """The result with the fields of the bodies; `told` are remarks made before."""
    reduction, ended, path = solved.reduction, solved.solution, solved.path
    solution = path.states[-1].solution if path else ended
    seconds = dict(ended.seconds)
    with _clock(seconds, "recover"):
        fields = recover(reduction, solution)
    with _clock(seconds, "readings"):
        states = [] if path is None else [state.scene for state in path.states]
        summary = summary_of(reduction, solution, names, states)
        summary |= {"status": ended.status.label, "message": ended.message}
        if estimate is None:  # which knows the curves, and refines the chords
            summary["remarks"] += chord_remarks(reduction, solution)
        known = estimate.message if estimate else ""
        summary["remarks"] += [s for s in corner_remarks(reduction, solution) if s not in known]
    noted = [solution] if path is None else path.solutions
    every = [*told, *(text for own in noted for text in own.notes), *summary["remarks"]]
    if solution.solved:  # the states of a path before are kept
        refuse = path is None
        every = impossible(summary["limits"], reduction.couplings, refuse) + every
    summary["remarks"] = list(dict.fromkeys(every))
    if path is not None:
        single = len(reduction.problem.pairs) == 1
        keys = [key for key in PATH_KEYS if single or not key.endswith(("half_width", "_force"))]
        summary["states"], summary["shown"] = len(path.states), path.shown
        summary |= {key: float(path.history[key][-1]) for key in keys}
    if estimate is not None:
        summary["accuracy"] = asdict(estimate)
    summary = finite(summary) | {"seconds": seconds}
    return Result(reduction.scene, reduction, ended, fields, solved.zones, summary, path, estimate)


def _written(
    result: Result,
    out: str | Path | None,
    options: RunOptions,
    start: float,
    note: Note,
    restart: Restart,
) -> Result:
    """The result with its figures and files in a folder, if any, and the total of seconds."""
    seconds = result.summary["seconds"]
    if out is None:
        seconds["total"] = time.perf_counter() - start
        return result
    if (options.figures or options.html) and (beyond := not_drawable(result)):
        options = replace(options, figures=(), html=False)
        result.summary["remarks"].append(beyond)
    note("drawing figures, writing files" if options.figures else "writing files")
    with whole_folder(out, earlier_files(Path(out))) as folder:
        if options.figures:
            with _clock(seconds, "figures"):
                draw(result, folder, options.figures)
        with _clock(seconds, "files"):
            write(result, folder)
            found = [result.solution] if result.path is None else result.path.solutions
            restart.ended(result.reduction, found)
            restart.save(folder / FILE, result.solution.solved)
        seconds["total"] = time.perf_counter() - start
        (folder / "summary.json").write_text(json.dumps(result.summary, indent=2) + "\n")
        if options.html:
            from contactopt.figures.view_page import write_page

            write_page(folder, folder / PAGE)
    return result


@contextmanager
def _clock(seconds: dict[str, float], phase: str) -> Iterator[None]:
    begin = time.perf_counter()
    yield
    seconds[phase] = time.perf_counter() - begin
