"""The whole way in one call: scene -> reduction -> solution -> fields -> figures and files."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.analysis.accuracy import Estimate, refine
from contactopt.analysis.paths import PathResult, follow
from contactopt.analysis.quantities import approach, peak_pressure, stick_width, width
from contactopt.analysis.resultants import tables
from contactopt.analysis.solve_scene import Options, Solved
from contactopt.analysis.surfaces import contact_fields, on_nodes
from contactopt.analysis.zone import solve_zone
from contactopt.bodies.ranks import Team, spread
from contactopt.errors import InputError
from contactopt.files import check_folder, whole_folder
from contactopt.interface.recovery import Fields, recover
from contactopt.interface.reduction import Reduction
from contactopt.problem import InterfaceProblem, Solution, alone, part_of
from contactopt.problem.operators import InterfaceOperator
from contactopt.scenes import PATHS, make_path, make_scene
from contactopt.scenes.scene import HalfSpace, Part, Scene
from contactopt.solving.methods import default_method, find_method

if TYPE_CHECKING:
    from contactopt.scenes.scene_files import SceneFile

# What a run writes beside summary.json and one VTU file per body.
RUN_FILES = ("deformed.png", "maps.png", "pressure.png", "path.png", "interface.npz", "history.csv", "path.npz")
Note = Callable[[str], None]
PATH_KEYS = ("approach", "shift", "shear_force", "contact_half_width", "stick_half_width", "friction_work")


@dataclass(frozen=True, eq=False)
class Result:
    """A solved scene. `summary` is what summary.json holds; `zones` the half-widths of the contact-zone loop.

    `summary["seconds"]` holds the wall time [s] of each phase: those of the solution (see contactopt.analysis.solve_scene),
    `recover` of the fields, `figures` and `files` where some were asked for, and `total` of the whole run.

    `path` holds all states of a scene that has a load path; the rest of the result is then that of the last state.
    `estimate` is what refinement to an asked accuracy found.
    """

    scene: Scene
    reduction: Reduction
    solution: Solution
    fields: tuple[Fields, ...]
    zones: tuple[float, ...]
    summary: dict[str, Any]
    path: PathResult | None = None
    estimate: Estimate | None = None

    @property
    def problem(self) -> InterfaceProblem:
        return self.reduction.problem

    @property
    def pressure(self) -> np.ndarray:
        """Contact pressure at the contact nodes, (k,) [stress]."""
        return np.asarray(self.solution.reactions[:, 0] / self.problem.areas)

    @property
    def traction(self) -> np.ndarray:
        """Tangential traction on the upper body, (k,) or in 3D (k, 2) [stress]."""
        return _squeeze(self.solution.reactions[:, 1:] / self.problem.areas[:, None])


def run(
    scene: str | Path | Scene,
    out: str | Path | None = None,
    *,
    method: str | None = None,
    normal: str | None = None,
    tangential: str | None = None,
    preconditioner: str | None = None,
    Q: str | None = None,
    solver: str | None = None,
    tol: float | None = None,
    elements: int | None = None,
    accuracy: float | None = None,
    quantity: str | None = None,
    note: Note = lambda text: None,
    team: Team | None = None,
    **changes: Any,
) -> Result:
    """Solve a scene end to end, and write its figures and files into a folder if one is given.

    Parameters
    ----------
    scene : a name (see contactopt.scenes.SCENES), which is solved along its load path if it has one (PATHS); a scene file, whose
        name ends in .toml; or a Scene
    out : folder for the files; None: nothing is written
    method, normal, tangential : names; by default `auto`, or `alternating` if a backend is named
    preconditioner : a name in contactopt.solving.preconditioners, of methods that take products with Q; it selects
        Q = 'implicit'
    Q, solver : form of Q and solver of the bodies, see reduce(); 'auto' by default
    tol : bound on the natural-map residual; 1e-8 by default
    elements : across the contact half-width
    accuracy : bound on the estimated relative error of `quantity`. Meshes are then refined until it is met, or until a
        sentence in `Result.estimate` says why not; `elements` only scales the first mesh
    quantity : a name in contactopt.analysis.quantities.QUANTITIES
        All arguments from `method` to here may stand in a scene file; those given here win.
    note : receives progress messages
    team : ranks among which the bodies are dealt out (contactopt.bodies.ranks); None: all bodies live in this process
    changes : to the arguments of a named scene, or to the fields of a Scene

    Returns
    -------
    Result : the solution with its interface problem, the fields of the bodies, and a summary

    Raises
    ------
    InputError : on input that cannot be used, with a sentence that says what to do; nothing is left half-written
    """
    start = time.perf_counter()
    file = _scene_file(scene)
    told = {} if file is None else file.solve

    def choose(key: str, value: Any, usual: Any = None) -> Any:
        return told.get(key, usual) if value is None else value

    changes |= {} if elements is None else {"elements": elements}
    states = _states(scene, changes) if file is None else _states_of_file(file, changes)
    names = {"normal": normal, "tangential": tangential, "preconditioner": preconditioner}
    given = {key: choose(key, name) for key, name in names.items() if choose(key, name) is not None}
    method = choose("method", method) or default_method(given)
    accuracy, quantity = choose("accuracy", accuracy), choose("quantity", quantity)
    chosen = find_method(method, **given)
    backends = chosen.backends(states[-1].dim)  # refused here, before any work, if one of them cannot be used
    form = _form(choose("Q", Q, "auto"), given.get("preconditioner"))
    options = Options(form, choose("solver", solver, "auto"), chosen, choose("tol", tol, 1e-8), note=note)
    if team is not None:
        idle = team.size - sum(isinstance(part, Part) for part in states[-1].parts)
        if idle > 0:
            note(f"{idle} of {team.size} ranks have nothing to do: there are no more elastic bodies")
        states = tuple(spread(state, team) for state in states)
    try:
        return _finish(states, out, method, backends, options, accuracy, quantity, start)
    except InputError as error:
        raise error if file is None else file.located(error) from error


def _finish(
    states: tuple[Scene, ...],
    out: str | Path | None,
    method: str,
    backends: tuple[str, str],
    options: Options,
    accuracy: float | None,
    quantity: str | None,
    start: float,
) -> Result:
    """Solve the states, and write figures and files; `start` is when the clock began."""
    if out is not None:
        check_folder(Path(out))
    solved, path, estimate = _solve(states, accuracy, quantity, options)
    seconds = dict(solved.solution.seconds)
    with _clock(seconds, "recover"):
        fields = recover(solved.reduction, solved.solution)
    summary = _summary(solved, method, backends, path, estimate)
    made = Result(
        solved.reduction.scene, solved.reduction, solved.solution, fields, solved.zones, summary, path, estimate
    )
    if out is None:
        return replace(made, summary=summary | _seconds(seconds, start))
    options.note("drawing figures, writing files")
    with whole_folder(out, _earlier_files(Path(out))) as folder:
        with _clock(seconds, "figures"):
            _draw(made, folder)
        with _clock(seconds, "files"):
            _write(made, folder)
        made = replace(made, summary=summary | _seconds(seconds, start))
        (folder / "summary.json").write_text(json.dumps(made.summary, indent=2) + "\n")
    return made


def _scene_file(scene: Any) -> SceneFile | None:
    """The scene file that the name of a scene stands for; None for all other scenes."""
    if isinstance(scene, Scene) or not str(scene).endswith(".toml"):
        return None
    from contactopt.scenes.scene_files import read_scene_file

    return read_scene_file(scene)


def _states_of_file(file: SceneFile, changes: dict[str, Any]) -> tuple[Scene, ...]:
    from contactopt.scenes.scene_files import with_degree

    return with_degree(file, changes)


def _states(scene: Any, changes: dict[str, Any]) -> tuple[Scene, ...]:
    """The scene, or the states of its load path."""
    if isinstance(scene, str):
        return make_path(scene, **changes) if scene in PATHS else (make_scene(scene, **changes),)
    try:
        return (replace(scene, **changes),)
    except TypeError as error:
        raise InputError(f"scene '{scene.name}': {error}.") from error


def _form(Q: str, preconditioner: str | None) -> str:
    if preconditioner is None:
        return Q
    if Q == "explicit":
        raise InputError("a preconditioner serves products with Q, but Q = 'explicit' was asked for; drop one of them.")
    return "implicit"


def _solve(
    states: tuple[Scene, ...], accuracy: float | None, quantity: str | None, options: Options
) -> tuple[Solved, PathResult | None, Estimate | None]:
    """One of three loops: refinement to an accuracy, a load path, or the contact zone of one scene."""
    if (accuracy is None) != (quantity is None):
        raise InputError("accuracy and quantity belong together: the bound, and the name of what it bounds.")
    if accuracy is not None and quantity is not None:
        mesh, estimate = refine(states, quantity, accuracy, options)
        return mesh.solved, mesh.path, estimate
    if len(states) > 1:
        path = follow(states, note=options.note, Q=options.Q, solver=options.solver, **options.of_solve)
        return Solved(path.reduction, path.solution), path, None
    return solve_zone(states[0], options=options), None, None


def _summary(
    solved: Solved, method: str, backends: tuple[str, str], path: PathResult | None, estimate: Estimate | None
) -> dict[str, Any]:
    """What is known of the answer but for the seconds: half-widths and pressure are the quantities that accuracy bounds."""
    reduction, solution = solved.reduction, solved.solution
    problem, r = reduction.problem, solution.reactions
    found = tables(reduction, solution)
    single = len(problem.pairs) == 1
    summary: dict[str, Any] = {
        "scene": reduction.scene.name,
        "dofs": reduction.dofs,
        "contact_nodes": problem.contacts,
        "mu": float(problem.mu.max(initial=0.0)),
        "method": method,
        "normal_backend": backends[0],
        "tangential_backend": backends[1],
        "status": solution.status.label,
        "residual": float(solution.residual),
        "outer_iterations": solution.iterations,
        "normal_force": float(r[:, 0].sum()),
        "approach": approach(problem, solution),
        "contact_half_width": width(reduction, solution) if single else None,
        "stick_half_width": stick_width(reduction, solution)[0] if single else None,
        "max_pressure": max(pair["max_pressure"] for pair in found["pairs"].values()),
        "pressure": peak_pressure(reduction, solution) if single else None,
        "q": "implicit" if isinstance(problem.Q, InterfaceOperator) else "explicit",
        "products": solution.products,
        **found,
    }
    if path is not None:
        keys = [key for key in PATH_KEYS if single or not key.endswith("half_width")]
        summary |= {"states": len(path.states)} | {key: float(path.history[key][-1]) for key in keys}
    if estimate is not None:
        summary["accuracy"] = asdict(estimate)
    return summary


def _squeeze(t: np.ndarray) -> np.ndarray:
    return t[:, 0] if t.shape[1] == 1 else t


@contextmanager
def _clock(seconds: dict[str, float], phase: str) -> Iterator[None]:
    begin = time.perf_counter()
    yield
    seconds[phase] = time.perf_counter() - begin


def _seconds(seconds: dict[str, float], start: float) -> dict[str, Any]:
    return {"seconds": seconds | {"total": time.perf_counter() - start}}


def _draw(result: Result, folder: Path) -> None:
    from contactopt import plots

    problem, solution = result.problem, result.solution
    if result.fields:
        picture = plots.deformed(result.scene, part_of(problem, problem.pairs[0]), result.fields)
        picture.figure.savefig(folder / "deformed.png", dpi=130)
    if any(isinstance(part, HalfSpace) for part in result.scene.parts):
        from contactopt.figures.maps import maps_figure

        maps_figure(result.reduction, result.solution).savefig(folder / "maps.png", dpi=130)
    for pair in problem.pairs:
        name = "pressure" if len(problem.pairs) == 1 else f"pressure-{pair.name}"
        plots.contact_figure(result.scene, *alone(problem, solution, pair)).savefig(folder / f"{name}.png", dpi=130)
    if result.path is not None:
        from contactopt.figures.animation import path_figure

        path_figure(result.path).savefig(folder / "path.png", dpi=130)


def _write(result: Result, folder: Path) -> None:
    surfaces = contact_fields(result.reduction, result.solution)
    for fields in on_nodes(result.reduction, result.fields, surfaces):
        fields.write_vtu(folder / f"{fields.name}.vtu")
    for surface in surfaces:
        surface.write_vtu(folder / f"contact-{surface.name}.vtu")
    problem, r = result.problem, result.solution.reactions
    places = np.concatenate([pair.chart.places for pair in problem.pairs], axis=1)
    x = places.T if problem.dim == 3 else places[0]
    np.savez(
        folder / "interface.npz",
        x=x,  # along the contact surface
        coordinates=problem.coordinates,
        r_n=r[:, 0],
        r_t=_squeeze(r[:, 1:]),
        pressure=result.pressure,
        traction=result.traction,
    )
    if result.path is not None:
        result.path.write(folder)


def _earlier_files(folder: Path) -> set[str]:
    """Names of the files that an earlier `contactopt run` wrote into the folder; empty where none has run.

    A folder in which one has run holds its summary.json. Its other files have fixed names, but for a VTU file per body and
    per pair of surfaces, told from other people's by the fields in them, and pictures of the pairs that the summary names.
    """
    with suppress(OSError, ValueError, TypeError):
        summary = json.loads(_plain_text(folder / "summary.json"))
        if "contact_nodes" in summary:
            marks = ('"von_mises"', '"contact_pressure"')
            found = {file.name for file in folder.glob("*.vtu") if any(mark in _plain_text(file) for mark in marks)}
            pictures = {f"pressure-{pair}.png" for pair in summary.get("pairs", {})}
            found |= {file.name for file in folder.glob("pressure-*.png") if file.name in pictures}
            return found | {name for name in RUN_FILES if (folder / name).exists()}
    return set()


def _plain_text(file: Path) -> str:
    """What a regular file holds; nothing for links and devices."""
    return "" if file.is_symlink() or not file.is_file() else file.read_text(errors="replace")
