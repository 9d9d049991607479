"""The files of a run: figures, fields and numbers, and those that an earlier run left."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np

from contactopt.bodies.given_matrices import GivenMatrices
from contactopt.figures.style import FORMATS, save_figure
from contactopt.outcome import Outcome, squeeze
from contactopt.problem import alone, part_of
from contactopt.problem.contact_status import contact_status
from contactopt.readings.contact_fields import ContactFields, contact_fields, on_nodes
from contactopt.scenes.scene import HalfSpace
from contactopt.solving.follow import state_of
from contactopt.solving.paths import PathResult
from contactopt.solving.restart import FILE
from contactopt.solving.solve_scene import Solved

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from contactopt.coupling.back_to_bodies import Fields

PAGE = "view.html"
PICTURES = ("deformed", "maps", "pressure", "path", "refinement")
SERIES = "states.pvd"
SINGLE = re.compile(r"-state\d{4}\.vtu$")  # names of the files of single states
VTU = re.compile(r"(.*?)(-state\d{4})?\.vtu")  # of all fields
FAR = 1e3  # sizes of a body that it moves in an iterate which no figure can show
UNDRAWN = (
    "no figure and no page was made: the last iterate moves a body by more than a thousand times"
    " its size."
)
# of the bodies at all states of a load path, above which only the last state is written
MOST_NUMBERS = 3_000_000
# What a run writes beside summary.json and one VTU file per body.
RUN_FILES = (
    *(f"{name}.{ending}" for name in PICTURES for ending in FORMATS),
    PAGE, "interface.npz", "history.csv", "path.npz", SERIES, FILE,
)  # fmt: skip


def draw(result: Outcome, folder: Path, formats: Sequence[str]) -> None:
    """Draw bodies, the surfaces of every pair, maps and load path into files of every format."""
    from contactopt.figures import plots

    def save(figure: Figure, name: str) -> None:
        for ending in formats:
            save_figure(figure, folder / f"{name}.{ending}")

    problem, solution = result.problem, result.shown
    if result.fields:
        first, couplings = part_of(problem, problem.pairs[0]), result.reduction.couplings
        picture = plots.deformed(result.scene, first, result.fields, couplings=couplings)
        save(picture.figure, "deformed")
    if any(isinstance(part, HalfSpace) for part in result.scene.parts):
        save(plots.maps_figure(result.reduction, result.shown), "maps")
    for pair in problem.pairs:
        name = "pressure" if len(problem.pairs) == 1 else f"pressure-{pair.name}"
        save(plots.contact_figure(result.scene, *alone(problem, solution, pair)), name)
    if result.path is not None:
        save(plots.path_figure(result.path), "path")
    if result.estimate is not None:
        save(plots.refinement_figure(result.estimate), "refinement")


def write(result: Outcome, folder: Path) -> None:
    """Write fields (VTU), contacts and states (tables), forces and load path into a folder."""
    surfaces = contact_fields(result.reduction, result.shown)
    for fields in on_nodes(result.reduction, result.fields, surfaces):
        fields.write_vtu(folder / f"{fields.name}.vtu")
    displaced = result.reduction.displaced(result.shown)
    for body, B, U in zip(result.reduction.bodies, result.reduction.maps, displaced):
        if isinstance(body.view, GivenMatrices):
            force = B.T @ result.shown.reactions.ravel()
            body.view.write_vtu(folder / f"{body.name}.vtu", U, force)
    for surface in surfaces:
        surface.write_vtu(folder / f"contact-{surface.name}.vtu")
    problem, r = result.problem, result.shown.reactions
    places = np.concatenate([pair.chart.places for pair in problem.pairs], axis=1)
    x = places.T if problem.dim == 3 else places[0]
    status, bound = contact_status(problem, r), problem.law.bound_along(r)
    np.savez(
        folder / "interface.npz",
        x=x,  # along the contact surface
        coordinates=problem.coordinates,
        r_n=r[:, 0],
        r_t=squeeze(r[:, 1:]),
        pressure=result.pressure,
        traction=result.traction,
        bound=np.divide(
            bound, problem.areas, out=np.zeros_like(bound), where=problem.areas > 0
        ),  # of friction [stress]
        status=status.stick + 2 * status.slip,  # 0 open, 1 stick, 2 slip
    )
    path = result.path
    if path is None:
        only = state_of(Solved(result.reduction, result.shown))[0]
        PathResult((only,), result.reduction).write_history(folder / "history.csv")
    else:
        path.write(folder)
        write_series(path, result.fields, folder)
    write_tables(result, surfaces, folder)


def not_drawable(result: Outcome) -> str:
    """Why nobody can draw an answer, one sentence; empty where a figure can show it."""
    still = result.shown.solved or all(
        bool(np.abs(own.displacement).max(initial=0.0) <= FAR * np.ptp(own.mesh.p))
        for own in result.fields
    )
    return "" if still else UNDRAWN


def write_tables(result: Outcome, surfaces: Sequence[ContactFields], folder: Path) -> None:
    """Write contact-PAIR.csv, one row per contact and state (the last alone if these are many)."""
    scene, problem, states = result.scene, result.problem, [surfaces]
    if result.path is not None and problem.contacts * len(result.path.states) <= MOST_NUMBERS:
        steps = range(len(result.path.states))
        states = [contact_fields(*result.path.at(step)) for step in steps]
    for number, pair in enumerate(problem.pairs):
        with open(folder / f"contact-{pair.name}.csv", "w", newline="") as file:
            rows = csv.writer(file)
            for step, found in enumerate(states, 1 + result.summary.get("states", 1) - len(states)):
                head, values = found[number].rows(scene.components, scene.units)
                if file.tell() == 0:
                    rows.writerow(["state", *head])
                rows.writerows([step, *own] for own in values)


def write_series(path: PathResult, last: tuple[Fields, ...], folder: Path) -> None:
    """Write all states as VTU files and states.pvd, unless the path kept none, or too many."""
    if not _fits(path, last):
        return
    lines = []
    for step in range(len(path.states)):
        surfaces = contact_fields(*path.at(step))
        bodies = on_nodes(path.reduction, path.fields(step), surfaces)
        made: list[tuple[Any, str]] = [(own, own.name) for own in bodies]
        made += [(own, f"contact-{own.name}") for own in surfaces]
        for part, (own, name) in enumerate(made):
            file = f"{name}-state{step + 1:04d}.vtu"
            own.write_vtu(folder / file)
            lines.append(f'<DataSet timestep="{step + 1}" part="{part}" file={quoteattr(file)}/>')
    body = "\n".join(lines)
    (folder / SERIES).write_text(
        f'<VTKFile type="Collection" version="0.1"><Collection>\n{body}\n</Collection></VTKFile>\n'
    )


def _fits(path: PathResult, last: tuple[Fields, ...]) -> bool:
    """Whether a path kept displacements, and not too many numbers for files."""
    numbers = len(path.states) * sum(own.displacement.size + own.von_mises.size for own in last)
    return bool(path.states[-1].bodies) and 0 < numbers <= MOST_NUMBERS


def earlier_files(folder: Path) -> set[str]:
    """The files that an earlier run wrote into a folder, by the names in its summary.json."""
    told = folder / "summary.json"
    with suppress(OSError, ValueError, TypeError, LookupError):
        summary = json.loads(told.read_text()) if told.is_file() else {}
        pairs, bodies = [*summary["pairs"]], [*summary["limits"]["bodies"]]
        fixed = {f"pressure-{pair}.{ending}" for pair in pairs for ending in FORMATS}
        fixed |= {f"contact-{pair}.csv" for pair in pairs} | set(RUN_FILES)
        names = {*bodies, *(f"contact-{pair}" for pair in pairs)}
        found = {file.name for file in folder.iterdir()}
        fields = {file for file in found if (of := VTU.fullmatch(file)) and of[1] in names}
        return found & fixed | fields
    return set()
