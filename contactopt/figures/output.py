"""The files of a run: its figures, fields and numbers, and which of them an earlier run left in a
folder.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.figures.style import FORMATS, save_figure
from contactopt.outcome import Outcome, squeeze
from contactopt.problem import alone, part_of
from contactopt.problem.contact_status import contact_status
from contactopt.readings.contact_fields import contact_fields, on_nodes

if TYPE_CHECKING:
    from contactopt.coupling.back_to_bodies import Fields
    from contactopt.solving.paths import PathResult

PAGE = "view.html"
PICTURES = ("deformed", "maps", "pressure", "path", "refinement")
STATES = "states.npz"
# of the bodies at all states of a load path, above which only the last state is written
MOST_NUMBERS = 3_000_000
# What a run writes beside summary.json and one VTU file per body.
RUN_FILES = (
    *(f"{name}.{ending}" for name in PICTURES for ending in FORMATS),
    PAGE, "interface.npz", "history.csv", "path.npz", STATES,
)  # fmt: skip


def draw(result: Outcome, folder: Path, formats: Sequence[str]) -> None:
    """Draw bodies, the surfaces of every pair, maps and load path into files of every format."""
    from contactopt.figures import plots

    def save(figure: Any, name: str) -> None:
        for ending in formats:
            save_figure(figure, folder / f"{name}.{ending}")

    problem, solution = result.problem, result.solution
    if result.fields:
        picture = plots.deformed(result.scene, part_of(problem, problem.pairs[0]), result.fields)
        save(picture.figure, "deformed")
    if any(part.elastic and not part.meshed for part in result.scene.parts):
        from contactopt.figures.maps import maps_figure

        save(maps_figure(result.reduction, result.solution), "maps")
    for pair in problem.pairs:
        name = "pressure" if len(problem.pairs) == 1 else f"pressure-{pair.name}"
        save(plots.contact_figure(result.scene, *alone(problem, solution, pair)), name)
    if result.path is not None:
        from contactopt.figures.animation import path_figure

        save(path_figure(result.path), "path")
    if result.estimate is not None:
        save(plots.refinement_figure(result.estimate), "refinement")


def write(result: Outcome, folder: Path, states: bool) -> None:
    """Write the fields of a result as VTU files, its contact forces and its load path as arrays,
    into a folder. With `states` also the bodies at all states of the path, for a page on which they
    move.
    """
    surfaces = contact_fields(result.reduction, result.solution)
    for fields in on_nodes(result.reduction, result.fields, surfaces):
        fields.write_vtu(folder / f"{fields.name}.vtu")
    for surface in surfaces:
        surface.write_vtu(folder / f"contact-{surface.name}.vtu")
    problem, r = result.problem, result.solution.reactions
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
    if result.path is not None:
        result.path.write(folder)
        if states and (found := body_states(result.path, result.fields)):
            np.savez(folder / STATES, **found)


def body_states(path: PathResult, last: tuple[Fields, ...]) -> dict[str, Any]:
    """The bodies at the n states of a path, by "QUANTITY/BODY": displacement (n, nodes, dim) and
    von_mises (n, nodes).

    It is empty where there would be more than MOST_NUMBERS, or where the path kept no
    displacements.
    """
    numbers = len(path.states) * sum(own.displacement.size + own.von_mises.size for own in last)
    if not path.states[-1].bodies or not 0 < numbers <= MOST_NUMBERS:
        return {}
    made = {}
    for own in zip(*(path.fields(step) for step in range(len(path.states)))):
        made[f"displacement/{own[0].name}"] = np.array(
            [f.displacement.T for f in own], dtype=np.float32
        )
        made[f"von_mises/{own[0].name}"] = np.array([f.von_mises for f in own], dtype=np.float32)
    return made


def earlier_files(folder: Path) -> set[str]:
    """Name the files that an earlier `contactopt run` wrote into a folder; none where none has run.

    A folder in which one has run holds its summary.json. Its other files have fixed names, but for
    a VTU file per body and per pair of surfaces, told from other people's by the fields in them,
    and pictures of the pairs that the summary names.
    """
    with suppress(OSError, ValueError, TypeError):
        summary = json.loads(_plain_text(folder / "summary.json"))
        if "contact_nodes" in summary:
            marks = ('"von_mises"', '"contact_pressure"')
            found = {
                file.name
                for file in folder.glob("*.vtu")
                if any(mark in _plain_text(file) for mark in marks)
            }
            pictures = {
                f"pressure-{pair}.{ending}"
                for pair in summary.get("pairs", {})
                for ending in FORMATS
            }
            found |= {file.name for file in folder.glob("pressure-*") if file.name in pictures}
            return found | {name for name in RUN_FILES if (folder / name).exists()}
    return set()


def _plain_text(file: Path) -> str:
    """What a regular file holds; nothing for links and devices."""
    return "" if file.is_symlink() or not file.is_file() else file.read_text(errors="replace")
