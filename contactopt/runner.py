"""The whole way in one call: scene -> reduction -> solution -> fields -> figures and files."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.analysis.accuracy import Estimate, refine
from contactopt.analysis.edges import contact_edge, stick_edge
from contactopt.analysis.paths import PathResult, follow
from contactopt.analysis.quantities import approach
from contactopt.analysis.zone import solve_zone
from contactopt.benchmark.files import earlier_files, make_folder, remove_empty, remove_files
from contactopt.errors import InputError
from contactopt.interface.recovery import Fields, recover
from contactopt.interface.reduction import Reduction
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.operators import InterfaceOperator
from contactopt.scenes import PATHS, make_path, make_scene
from contactopt.scenes.scene import Scene
from contactopt.solving.methods import default_method, find_method

Note = Callable[[str], None]
PATH_KEYS = ("approach", "shift", "shear_force", "contact_half_width", "stick_half_width", "friction_work")


@dataclass(frozen=True, eq=False)
class Result:
    """A solved scene. `summary` is what summary.json holds; `zones` the half-widths of the contact-zone loop.

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
    scene: str | Scene,
    out: str | Path | None = None,
    *,
    method: str | None = None,
    normal: str | None = None,
    tangential: str | None = None,
    preconditioner: str | None = None,
    Q: str = "auto",
    solver: str = "auto",
    tol: float = 1e-8,
    elements: int | None = None,
    accuracy: float | None = None,
    quantity: str | None = None,
    note: Note = lambda text: None,
    **changes: Any,
) -> Result:
    """Solve a scene end to end, and write its figures and files into the directory `out` if one is given.

    scene     a name (see contactopt.scenes.SCENES), `changes` to its arguments, with its load path if it has one
              (PATHS); or a Scene, `changes` to its fields
    method, normal, tangential   names; by default `auto`, or `alternating` if a backend is named
    preconditioner   of methods that take products with Q, a name in contactopt.solving.preconditioners; selects Q = 'implicit'
    Q, solver  form of Q and solver of the bodies, see reduce()
    elements  across the contact half-width;  tol  bound on the natural-map residual;  note  receives progress messages
    accuracy  bound on the estimated relative error of `quantity`, a name in contactopt.analysis.quantities.QUANTITIES: meshes are then
              refined until it is met or a sentence says why not (Result.estimate); `elements` only scales the first mesh
    Raises InputError with a sentence that says what to do; nothing is left half-written.
    """
    start = time.perf_counter()
    if elements is not None:
        changes["elements"] = elements
    states = make_path(scene, **changes) if isinstance(scene, str) and scene in PATHS else ()
    if isinstance(scene, str):
        scene = states[-1] if states else make_scene(scene, **changes)
    else:
        scene = _changed(scene, changes)
    if preconditioner is not None and Q == "explicit":
        raise InputError("a preconditioner serves products with Q, but Q = 'explicit' was asked for; drop one of them.")
    Q = "implicit" if preconditioner is not None else Q
    names = {"normal": normal, "tangential": tangential, "preconditioner": preconditioner}
    given = {key: name for key, name in names.items() if name is not None}
    method = method or default_method(given)
    chosen = find_method(method, **given)
    backends = chosen.backends(scene.dim)  # refused here, before any work, if one of them cannot be used
    if (accuracy is None) != (quantity is None):
        raise InputError("accuracy and quantity belong together: the bound, and the name of what it bounds.")
    target = None if out is None else _writable(Path(out))
    path, zones, estimate = None, list[float](), None
    if accuracy is not None and quantity is not None:
        refined, estimate = refine(states or (scene,), quantity, accuracy, note, Q, solver, method=chosen, tol=tol)
        reduction, solution, zones, path = refined.reduction, refined.solution, list(refined.zones), refined.path
        scene = reduction.scene
    elif states:
        path = follow(states, note=note, Q=Q, solver=solver, method=chosen, tol=tol)
        scene, reduction, solution = path.states[-1].scene, path.reduction, path.solution
    else:
        reduction, solution, zones = solve_zone(scene, note=note, Q=Q, solver=solver, method=chosen, tol=tol)
    seconds = dict(solution.seconds)
    with _Timer(seconds, "recover"):
        fields = recover(reduction, solution)
    summary = _summary(scene, reduction, solution, method, backends, zones)
    if path is not None:
        summary |= {"states": len(path.states)} | {key: float(path.history[key][-1]) for key in PATH_KEYS}
    if estimate is not None:
        summary["accuracy"] = asdict(estimate)
    result = Result(scene, reduction, solution, fields, tuple(zones), summary, path, estimate)
    summary["seconds"] = seconds
    if target is not None:
        note("drawing figures, writing files")
        _write(result, target, seconds, start)
    seconds["total"] = time.perf_counter() - start
    return result


def _changed(scene: Scene, changes: dict[str, Any]) -> Scene:
    try:
        return replace(scene, **changes)
    except TypeError as error:
        raise InputError(f"scene '{scene.name}': {error}.") from error


def _summary(
    scene: Scene,
    reduction: Reduction,
    solution: Solution,
    method: str,
    backends: tuple[str, str],
    zones: list[float],
) -> dict[str, Any]:
    problem, r = reduction.problem, solution.reactions
    width = zones[-1] if zones else contact_edge(scene, problem, r)
    slip = problem.displacements(r, solution.multipliers)[:, 1:]
    return {
        "scene": scene.name,
        "dofs": reduction.dofs,
        "contact_nodes": problem.contacts,
        "mu": float(scene.mu),
        "method": method,
        "normal_backend": backends[0],
        "tangential_backend": backends[1],
        "status": solution.status.label,
        "residual": float(solution.residual),
        "outer_iterations": solution.iterations,
        "normal_force": float(r[:, 0].sum()),
        "approach": approach(problem, solution),
        "contact_half_width": float(width),
        "stick_half_width": min(float(width), stick_edge(scene, problem, r, slip)[0]),
        "max_pressure": float((r[:, 0] / problem.areas).max()),
        "q": "implicit" if isinstance(problem.Q, InterfaceOperator) else "explicit",
        "products": solution.products,
    }


def _squeeze(t: np.ndarray) -> np.ndarray:
    return t[:, 0] if t.shape[1] == 1 else t


class _Timer:
    def __init__(self, seconds: dict[str, float], phase: str):
        self.seconds, self.phase = seconds, phase

    def __enter__(self) -> None:
        self.start = time.perf_counter()

    def __exit__(self, *error: object) -> None:
        self.seconds[self.phase] = time.perf_counter() - self.start


def _writable(out: Path) -> Path:
    """Check, before any work, that files can be put there; InputError if not. Leaves nothing behind."""
    existing = out
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    try:
        if not existing.is_dir():
            raise NotADirectoryError(f"{existing} is not a directory")
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        raise _unwritable(out, error) from error
    return out


def _unwritable(out: Path, error: OSError) -> InputError:
    return InputError(f"cannot write into '{out}': {error.strerror or error}; choose another output directory.")


def _write(result: Result, out: Path, seconds: dict[str, float], start: float) -> None:
    """All files into a temporary neighbour first, then into place."""
    made: list[Path] = []
    try:
        made = make_folder(out)
        staging = Path(tempfile.mkdtemp(prefix=".contactopt-", dir=out))
    except OSError as error:
        raise _unwritable(out, error) from error
    try:
        with _Timer(seconds, "figures"):
            _draw(result, staging)
        with _Timer(seconds, "files"):
            for fields in result.fields:
                fields.write_vtu(staging / f"{fields.name}.vtu")
            _write_interface(result, staging / "interface.npz")
            if result.path is not None:
                result.path.write(staging)
        seconds["total"] = time.perf_counter() - start
        (staging / "summary.json").write_text(json.dumps(result.summary, indent=2) + "\n")
        stale = earlier_files(out) - {file.name for file in staging.iterdir()}
        for file in staging.iterdir():
            os.replace(file, out / file.name)
        remove_files(out, stale)
    except OSError as error:
        raise _unwritable(out, error) from error
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        remove_empty(made)


def _draw(result: Result, folder: Path) -> None:
    from contactopt import plots

    picture = plots.deformed(result.scene, result.problem, result.fields)
    picture.figure.savefig(folder / "deformed.png", dpi=130)
    plots.contact_figure(result.scene, result.problem, result.solution).savefig(folder / "pressure.png", dpi=130)
    if result.path is not None:
        from contactopt.figures.animation import path_figure

        path_figure(result.path).savefig(folder / "path.png", dpi=130)


def _write_interface(result: Result, path: Path) -> None:
    problem, r = result.problem, result.solution.reactions
    x = problem.coordinates[:2].T if problem.dim == 3 else problem.coordinates[0]
    np.savez(path, x=x, r_n=r[:, 0], r_t=_squeeze(r[:, 1:]), pressure=result.pressure, traction=result.traction)
