"""The whole way in one call: scene -> reduction -> solution -> fields -> figures and files."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from contactopt.bodies.ranks import Team, spread
from contactopt.cards import card, count, line
from contactopt.coupling.back_to_bodies import Fields, recover
from contactopt.coupling.reduction import Reduction
from contactopt.errors import InputError
from contactopt.figures.output import PAGE, draw, earlier_files, squeeze, write
from contactopt.figures.style import FORMATS
from contactopt.files.writing import check_folder, whole_folder
from contactopt.linear.operators import InterfaceOperator
from contactopt.methods import default_method, find_method
from contactopt.problem import InterfaceProblem, Solution
from contactopt.readings.edges import contact_edge, stick_width
from contactopt.readings.peaks import Reading, pressure_reading
from contactopt.readings.quantities import approach
from contactopt.readings.resolution import remarks
from contactopt.readings.resultants import mirrors, tables
from contactopt.readings.validity import validity
from contactopt.scenes import PATHS, make_path, make_scene
from contactopt.scenes.scene import Part, Scene
from contactopt.solving.limits import Limits
from contactopt.solving.paths import PathResult, solve_states
from contactopt.solving.progress import resident_memory
from contactopt.solving.solve_scene import Options, Solved

if TYPE_CHECKING:
    from contactopt.accuracy.estimate import Estimate
    from contactopt.scenes.scene_files import SceneFile

Note = Callable[[str], None]
APART = 0.05  # relative difference of two readings of the largest pressure that is told
PATH_KEYS = (
    "approach",
    "shift",
    "shear_force",
    "contact_half_width",
    "stick_half_width",
    "friction_work",
)


@dataclass(frozen=True, eq=False)
class Result:
    """A solved scene.

    `summary` is what summary.json holds; `zones` the half-widths of the contact-zone loop.

    `summary["seconds"]` holds the wall time [s] of each phase: those of the solution (see
    contactopt.solving.solve_scene), `recover` of the fields, `figures` and `files` where some were
    asked for, and `total` of the whole run.

    `path` holds all states of a scene that has a load path; the rest of the result is then that of
    the last state. `estimate` is what refinement to an asked accuracy found.
    """

    scene: Scene
    reduction: Reduction
    solution: Solution
    fields: tuple[Fields, ...]
    zones: tuple[float, ...]
    summary: dict[str, Any]
    path: PathResult | None = None
    estimate: Estimate | None = None

    def __repr__(self) -> str:
        s = self.summary
        states = "" if self.path is None else count(len(self.path.states), "state")
        contacts = count(s["contact_nodes"], "contact")
        aim = "" if self.estimate is None else repr(self.estimate)
        return line(
            "Result",
            self.scene.name,
            s["status"],
            f"residual {s['residual']:.1e}",
            contacts,
            states,
            aim,
        )

    def _repr_html_(self) -> str:
        s, (length, stress) = self.summary, self.scene.units
        rows: dict[str, object] = {
            "status": f"{s['status']}: {self.solution.message}",
            "residual (certificate)": f"{s['residual']:.2e}",
            "unknowns, contacts": f"{s['dofs']}, {s['contact_nodes']}",
            "sum of normal forces": f"{s['normal_force']:.6g} {stress} {length}^2",
            "largest pressure": f"{s['max_pressure']:.6g} {stress}",
        }
        for key in ("approach", "contact_half_width", "stick_half_width"):
            if s[key] is not None:
                rows[key.replace("_", " ")] = f"{s[key]:.6g} {length}"
        if self.estimate is not None:
            rows[self.estimate.quantity] = f"{self.estimate.value:.6g}; {self.estimate.message}"
            rows["meshes"] = "; ".join(
                f"{level.unknowns}: {level.value:.6g}" for level in self.estimate.levels
            )
        return card(f"{self.scene.name}, {self.scene.friction}", rows)

    def view(self, file: str | Path | None = None, show: bool = True) -> Path:
        """Write the result as one page to explore in a browser, and open it.

        The page needs no network and nothing but the browser (contactopt.figures.view_page says
        what is on it).

        Parameters
        ----------
        file : where to write the page, ends in .html; None: a temporary file
        show : whether to open it in the browser

        Returns
        -------
        Path : of the page

        Raises
        ------
        InputError : if plotly is not installed, which the page takes its drawing program from, or
            if the file cannot be written
        """
        import tempfile
        import webbrowser

        from contactopt.figures.view_page import write_page

        if file is None:
            file = Path(tempfile.mkdtemp(prefix="contactopt-")) / PAGE
        with tempfile.TemporaryDirectory() as folder:
            write(self, Path(folder), states=True)
            (Path(folder) / "summary.json").write_text(json.dumps(self.summary))
            made = write_page(folder, file)
        if show:
            webbrowser.open(made.resolve().as_uri())
        return made

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
        return squeeze(self.solution.reactions[:, 1:] / self.problem.areas[:, None])


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
    adaptive: bool = False,
    simplest: bool = False,
    max_unknowns: int | None = None,
    time_limit: float | None = None,
    max_memory: float | None = None,
    figures: Sequence[str] = ("png",),
    html: bool = False,
    note: Note = lambda text: None,
    team: Team | None = None,
    **changes: Any,
) -> Result:
    """Solve a scene end to end, and write its figures and files into a folder if one is given.

    Parameters
    ----------
    scene : a name (see contactopt.scenes.SCENES), which is solved along its load path if it has one
        (PATHS); a scene file, whose name ends in .toml; or a Scene
    out : folder for the files; None: nothing is written
    method, normal, tangential : names; by default `auto`, or `alternating` if a backend is named
    preconditioner : a name in contactopt.methods.preconditioners, of methods that take products
        with Q; it selects Q = 'implicit'
    Q, solver : form of Q and solver of the bodies, see reduce(); 'auto' by default
    tol : bound on the natural-map residual; 1e-8 by default
    elements : across the contact half-width
    accuracy : bound on the estimated relative error of `quantity`. Meshes are then refined until it
        is met, or until a sentence in `Result.estimate` says why not; `elements` only scales the
        first mesh
    quantity : a name of contactopt.readings.quantities; of one of several pairs of surfaces
        'NAME:PAIR'; or one of contactopt.readings.places, such as 'von_mises:BODY:BOUNDARY' or
        'pressure@X,Y'
    adaptive : whether meshes are refined only where the quantity needs it (contactopt.accuracy),
        each body by itself, and not everywhere; quadrilaterals become triangles
    max_unknowns, time_limit, max_memory : bounds on the search for the accuracy: unknowns of a
        mesh, seconds and GB of all. No further mesh is begun that would pass one; the result is
        then the best answer so far, with its estimate All arguments from `method` to here may stand
        in a scene file; those given here win.
    simplest : whether all that can be left out exactly is left out first: halves across planes of
        symmetry, the third dimension of plates between rollers (contactopt.simplify). The
        certificate of the whole proves it on the first mesh, or the whole is solved. `Result.scene`
        is what was solved
    figures : the formats in which figures are written, of png, svg and pdf; (): none are drawn,
        which saves half of the time of a small scene
    html : whether to write view.html too, the result as a page to explore (needs `pip install
        'contactopt[view]'`)
    note : receives progress messages
    team : ranks among which the bodies are dealt out (contactopt.bodies.ranks); None: all bodies
        live in this process
    changes : to the arguments of a named scene, or to the fields of a Scene

    Returns
    -------
    Result : the solution with its interface problem, the fields of the bodies, and a summary

    Raises
    ------
    InputError : on input that cannot be used, with a sentence that says what to do; nothing is left
        half-written
    """
    start = time.perf_counter()
    files = _wanted_files(figures, html)
    file = _scene_file(scene)
    told = {} if file is None else file.solve

    def choose(key: str, value: Any, usual: Any = None) -> Any:
        return told.get(key, usual) if value is None else value

    changes |= {} if elements is None else {"elements": elements}
    states = _states(scene, changes) if file is None else _states_of_file(file, changes)
    names = {"normal": normal, "tangential": tangential, "preconditioner": preconditioner}
    given = {key: choose(key, name) for key, name in names.items() if choose(key, name) is not None}
    method = choose("method", method) or default_method(given)
    bounds = {"unknowns": max_unknowns, "seconds": time_limit, "memory": max_memory}
    keys = dict(zip(bounds, ("max_unknowns", "time_limit", "max_memory")))
    bounds = {name: choose(keys[name], value) for name, value in bounds.items()}
    aim = _aim(
        choose("accuracy", accuracy),
        choose("quantity", quantity),
        choose("adaptive", adaptive or None, False),
        {name: value for name, value in bounds.items() if value is not None},
    )
    chosen = find_method(method, **given)
    # refused here, before any work, if one of them cannot be used
    backends = chosen.backends(states[-1].dim)
    form = _form(choose("Q", Q, "auto"), given.get("preconditioner"))
    options = Options(
        form, choose("solver", solver, "auto"), chosen, choose("tol", tol, 1e-8), note=note
    )
    known = None
    if simplest:
        states, known = _simplest(states, options)
        backends = chosen.backends(states[-1].dim)
    if team is not None:
        idle = team.size - sum(isinstance(part, Part) for part in states[-1].parts)
        if idle > 0:
            note(
                f"{idle} of {team.size} ranks have nothing to do: there are no more elastic bodies"
            )
        states = tuple(spread(state, team) for state in states)
    try:
        known = known if team is None and aim is None else None
        return _finish(states, out, files, (method, *backends), options, aim, start, known)
    except MemoryError as error:
        raise InputError(_too_large(states[-1], str(error))) from error
    except InputError as error:
        raise error if file is None else file.located(error) from error


def _too_large(scene: Scene, why: str) -> str:
    """The sentence for a run that took all the memory there was."""
    bodies = count(len(scene.parts), "body", "bodies")
    held = f"{resident_memory() / 1e9:.2g} GB were taken when more was asked for"
    return (
        f"scene '{scene.name}' of {bodies} with elements = {scene.elements} needs more memory than"
        f" there is: {held}{f' ({why})' if why else ''}; take fewer elements."
    )


def _wanted_files(figures: Sequence[str], html: bool) -> tuple[str, ...]:
    """The formats of the figures, and 'html' for the page; InputError, before any work, for what
    cannot be written.
    """
    if isinstance(figures, str) or not set(figures) <= set(FORMATS):
        raise InputError(
            f"figures must be formats of {', '.join(FORMATS)}, or () for none; got {figures!r}."
        )
    if html:
        from contactopt.figures.view_page import check_installed

        check_installed()
    return (*figures, *(["html"] if html else []))


def _finish(
    states: tuple[Scene, ...],
    out: str | Path | None,
    files: tuple[str, ...],
    names: tuple[str, str, str],
    options: Options,
    aim: Aim | None,
    start: float,
    known: Solved | None,
) -> Result:
    """Solve the states, unless the solution is known, and write figures and files.

    `names` are those of the method and its backends; `start` is when the clock began.
    """
    if out is not None:
        check_folder(Path(out))
    solved, path, estimate = _solve(states, aim, options) if known is None else (known, None, None)
    seconds = dict(solved.solution.seconds)
    with _clock(seconds, "recover"):
        fields = recover(solved.reduction, solved.solution)
    summary = _summary(solved, names[0], names[1:], path, estimate)
    made = Result(
        solved.reduction.scene,
        solved.reduction,
        solved.solution,
        fields,
        solved.zones,
        summary,
        path,
        estimate,
    )
    if out is None:
        return replace(made, summary=summary | _seconds(seconds, start))
    formats = [name for name in files if name != "html"]
    options.note("drawing figures, writing files" if formats else "writing files")
    with whole_folder(out, earlier_files(Path(out))) as folder:
        if formats:
            with _clock(seconds, "figures"):
                draw(made, folder, formats)
        with _clock(seconds, "files"):
            write(made, folder, states="html" in files)
        made = replace(made, summary=summary | _seconds(seconds, start))
        (folder / "summary.json").write_text(json.dumps(made.summary, indent=2) + "\n")
        if "html" in files:
            from contactopt.figures.view_page import write_page

            write_page(folder, folder / PAGE)
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
    known = [field.name for field in fields(scene)]
    for name in changes:
        if name not in known:
            raise InputError(f"a Scene has no field {name!r}; its fields are {', '.join(known)}.")
    return (replace(scene, **changes),)


def scene_of(scene: str | Path | Scene, **changes: Any) -> Scene:
    """The scene that a name or a scene file stands for, of a load path its last state.

    Parameters
    ----------
    scene, changes : as for run()

    Returns
    -------
    Scene

    Raises
    ------
    InputError : for an unknown name, a file with a mistake, or changes that do not fit
    """
    file = _scene_file(scene)
    return (_states(scene, changes) if file is None else _states_of_file(file, changes))[-1]


def _simplest(
    states: tuple[Scene, ...], options: Options
) -> tuple[tuple[Scene, ...], Solved | None]:
    """The scene after all exact simplifications, and its solution, which proved them on its first
    mesh.
    """
    if len(states) > 1:
        raise InputError(
            f"scene '{states[0].name}' has a load path, whose states would all have to be"
            " symmetric; ask contactopt.simplify for each state."
        )
    from contactopt.simplification.search import proved_part

    found, solved = proved_part(states[0], options)
    return (found.scene,), solved


def _form(Q: str, preconditioner: str | None) -> str:
    if preconditioner is None:
        return Q
    if Q == "explicit":
        raise InputError(
            "a preconditioner serves products with Q, but Q = 'explicit' was asked for; drop one of"
            " them."
        )
    return "implicit"


class Aim(NamedTuple):
    """An accuracy to be reached: the bound, what it bounds, whether meshes are refined only where
    that needs it, and limits.
    """

    accuracy: float
    quantity: str
    adaptive: bool
    limits: Limits


def _aim(
    accuracy: float | None, quantity: str | None, adaptive: bool, bounds: dict[str, Any]
) -> Aim | None:
    if (accuracy is None) != (quantity is None):
        raise InputError(
            "accuracy and quantity belong together: the bound, and the name of what it bounds."
        )
    if accuracy is None or quantity is None:
        if adaptive:
            raise InputError("adaptive refinement needs an aim: give an accuracy and a quantity.")
        if bounds:
            raise InputError(
                "bounds on unknowns, time and memory end the search for an accuracy: give an"
                " accuracy and a quantity."
            )
        return None
    return Aim(accuracy, quantity, adaptive, Limits(**bounds))


def _solve(
    states: tuple[Scene, ...], aim: Aim | None, options: Options
) -> tuple[Solved, PathResult | None, Estimate | None]:
    """The scene or its load path, on its own mesh or on meshes refined to an accuracy."""
    if aim is None:
        solved = solve_states(states, options=options)
        return solved, solved.path, None
    from contactopt.accuracy.loop import refine  # it brings the room of derivatives with it

    solved, estimate = refine(states, aim.quantity, aim.accuracy, options, aim.limits, aim.adaptive)
    return solved, solved.path, estimate


def _summary(
    solved: Solved,
    method: str,
    backends: tuple[str, str],
    path: PathResult | None,
    estimate: Estimate | None,
) -> dict[str, Any]:
    """What is known of the answer but for the seconds: half-widths and pressure are the quantities
    that accuracy bounds.
    """
    reduction, solution = solved.reduction, solved.solution
    problem, r = reduction.problem, solution.reactions
    found = tables(reduction, solution)
    single = len(problem.pairs) == 1
    largest = max(pair["max_pressure"] for pair in found["pairs"].values())
    peak = pressure_reading(reduction, solution) if single else None
    limits, beyond = validity(reduction, solution)
    summary: dict[str, Any] = {
        "scene": reduction.scene.name,
        "kind": reduction.scene.kind,
        "units": list(reduction.scene.units),
        "mirrors": mirrors(reduction),
        "dofs": reduction.dofs,
        "contact_nodes": problem.contacts,
        "mu": float(problem.mu.max(initial=0.0)),
        "method": method,
        "normal_backend": backends[0],
        "tangential_backend": backends[1],
        "status": solution.status.label,
        "message": solution.message,
        "residual": float(solution.residual),
        "outer_iterations": solution.iterations,
        "normal_force": float(r[:, 0].sum()),
        "approach": approach(problem, solution),
        "contact_half_width": contact_edge(reduction.scene, problem, r) if single else None,
        "stick_half_width": stick_width(reduction, solution)[0] if single else None,
        "max_pressure": largest,
        "pressure": None if peak is None else peak.value,
        "q": "implicit" if isinstance(problem.Q, InterfaceOperator) else "explicit",
        "products": solution.products,
        "remarks": [
            *remarks(reduction, solution),
            *beyond,
            *([] if peak is None else _smoothed(peak, largest)),
        ],
        **found,
        "limits": limits,
    }
    if path is not None:
        keys = [key for key in PATH_KEYS if single or not key.endswith("half_width")]
        summary |= {"states": len(path.states)} | {
            key: float(path.history[key][-1]) for key in keys
        }
    if estimate is not None:
        summary["accuracy"] = asdict(estimate)
    return summary


def _smoothed(peak: Reading, largest: float) -> list[str]:
    """One sentence where the largest pressure at a node and the one that is read around it are not
    the same.
    """
    if abs(largest - peak.value) <= APART * abs(largest):
        return []
    return [
        f"the largest pressure at a node is {largest:.4g}, what its neighbours let expect is"
        f" {peak.value:.4g}, give or take {peak.uncertainty:.2g}: refine the meshes there, or ask"
        " for an accuracy."
    ]


@contextmanager
def _clock(seconds: dict[str, float], phase: str) -> Iterator[None]:
    begin = time.perf_counter()
    yield
    seconds[phase] = time.perf_counter() - begin


def _seconds(seconds: dict[str, float], start: float) -> dict[str, Any]:
    return {"seconds": seconds | {"total": time.perf_counter() - start}}
