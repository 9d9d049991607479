"""The files of a run: its figures, fields and numbers, and which of them an earlier run left in a folder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.analysis.status import contact_status
from contactopt.analysis.surfaces import contact_fields, on_nodes
from contactopt.figures.style import FORMATS, save_figure
from contactopt.problem import alone, part_of
from contactopt.scenes.scene import HalfSpace

if TYPE_CHECKING:
    from contactopt.runner import Result

PAGE = "view.html"
PICTURES = ("deformed", "maps", "pressure", "path", "refinement")
# What a run writes beside summary.json and one VTU file per body.
RUN_FILES = (
    *(f"{name}.{ending}" for name in PICTURES for ending in FORMATS),
    PAGE, "interface.npz", "history.csv", "path.npz",
)  # fmt: skip


def squeeze(t: np.ndarray) -> np.ndarray:
    return t[:, 0] if t.shape[1] == 1 else t


def draw(result: Result, folder: Path, formats: Sequence[str]) -> None:
    """The figures of a result in each of the formats: bodies, pressure and traction of every pair, maps, load path."""
    from contactopt.figures import plots

    def save(figure: Any, name: str) -> None:
        for ending in formats:
            save_figure(figure, folder / f"{name}.{ending}")

    problem, solution = result.problem, result.solution
    if result.fields:
        picture = plots.deformed(result.scene, part_of(problem, problem.pairs[0]), result.fields)
        save(picture.figure, "deformed")
    if any(isinstance(part, HalfSpace) for part in result.scene.parts):
        from contactopt.figures.maps import maps_figure

        save(maps_figure(result.reduction, result.solution), "maps")
    for pair in problem.pairs:
        name = "pressure" if len(problem.pairs) == 1 else f"pressure-{pair.name}"
        save(plots.contact_figure(result.scene, *alone(problem, solution, pair)), name)
    if result.path is not None:
        from contactopt.figures.animation import path_figure

        save(path_figure(result.path), "path")
    if result.estimate is not None:
        from contactopt.adaptivity.loop import AdaptedEstimate
        from contactopt.figures.refinement import refinement_figure

        if isinstance(result.estimate, AdaptedEstimate):
            save(refinement_figure(result.estimate), "refinement")


def write(result: Result, folder: Path) -> None:
    """The fields of a result as VTU files, its contact forces and its load path as arrays."""
    surfaces = contact_fields(result.reduction, result.solution)
    for fields in on_nodes(result.reduction, result.fields, surfaces):
        fields.write_vtu(folder / f"{fields.name}.vtu")
    for surface in surfaces:
        surface.write_vtu(folder / f"contact-{surface.name}.vtu")
    problem, r = result.problem, result.solution.reactions
    places = np.concatenate([pair.chart.places for pair in problem.pairs], axis=1)
    x = places.T if problem.dim == 3 else places[0]
    status, bound = contact_status(problem, r), problem.law.bound(r[:, 0])
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
    if result.path is not None:
        result.path.write(folder)


def earlier_files(folder: Path) -> set[str]:
    """Names of the files that an earlier `contactopt run` wrote into the folder; empty where none has run.

    A folder in which one has run holds its summary.json. Its other files have fixed names, but for a VTU file per body and
    per pair of surfaces, told from other people's by the fields in them, and pictures of the pairs that the summary names.
    """
    with suppress(OSError, ValueError, TypeError):
        summary = json.loads(_plain_text(folder / "summary.json"))
        if "contact_nodes" in summary:
            marks = ('"von_mises"', '"contact_pressure"')
            found = {file.name for file in folder.glob("*.vtu") if any(mark in _plain_text(file) for mark in marks)}
            pictures = {f"pressure-{pair}.{ending}" for pair in summary.get("pairs", {}) for ending in FORMATS}
            found |= {file.name for file in folder.glob("pressure-*") if file.name in pictures}
            return found | {name for name in RUN_FILES if (folder / name).exists()}
    return set()


def _plain_text(file: Path) -> str:
    """What a regular file holds; nothing for links and devices."""
    return "" if file.is_symlink() or not file.is_file() else file.read_text(errors="replace")
