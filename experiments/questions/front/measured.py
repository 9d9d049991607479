"""Errors and seconds of a model on a mesh: rows for tolerances of the solver and for readings."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import cache, partial
from statistics import median
from typing import Any

import numpy as np

from contactopt import Scene
from contactopt.errors import InputError
from contactopt.problem.contact_status import contact_status
from contactopt.readings.quantities import value_of
from contactopt.solving.solve_scene import Options, Solved
from contactopt.solving.zone import solve_zone
from experiments.questions.front.models import FINEST, WAVES, Model, rough_scene

Row = dict[str, Any]
QUANTITIES = ("peak", "width", "stick", "approach", "force", "area")
READINGS = ("fitted", "nodes")
TIGHT = 1e-10
TOLERANCES = (1e-1, 1e-2, 1e-4)
SHORT, REPEATS = 0.2, 3  # CPU seconds, below which the median of so many runs counts
MOST = 20000  # iterations


def timed(act: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds, the median of three where they are few, and the answer."""
    seconds: list[float] = []
    while not seconds or (len(seconds) < REPEATS and seconds[0] < SHORT):
        start = time.process_time()
        answer = act()
        seconds.append(time.process_time() - start)
    return median(seconds), answer


def solved(scene: Scene, mesh: int, tol: float, method: str) -> Solved:
    """A scene from its mesh to its answer."""
    own = {"settings": {"max_iterations": MOST}} if method != "auto" else {}
    return solve_zone(scene, mesh, Options(tol=tol, method=method, **own))


def read(found: Solved, reading: str) -> dict[str, float]:
    """All quantities that a solved scene has, fitted around nodes or those of the nodes alone."""
    if reading == "nodes":
        return at_nodes(found)
    names = {"peak": "pressure", "width": "width", "stick": "stick", "approach": "approach"}
    values = {}
    for quantity, name in names.items():
        try:
            values[quantity] = abs(value_of(name, found.reduction, found.solution))
        except InputError:
            continue
    nodal = at_nodes(found)
    return values | {key: nodal[key] for key in ("area", "force")}


def at_nodes(found: Solved) -> dict[str, float]:
    """The largest pressure of a node, and zones by the areas of the nodes in them."""
    scene, problem, r = found.reduction.scene, found.reduction.problem, found.solution.reactions
    status = contact_status(problem, r)
    area, stuck = (float(problem.areas[own].sum()) for own in (status.touching, status.stick))
    power, unit = (1.0, 2 * scene.thickness) if scene.kind == "plane-strain" else (0.5, np.pi)
    return {
        "peak": float((r[:, 0] / problem.areas).max()),
        "width": (area / unit) ** power,
        "stick": (stuck / area) ** power if area else 0.0,
        "force": float(r[:, 0].sum() / problem.areas.sum()),
        "area": area / float(problem.areas.sum()),
    }


@cache
def truth_of_rough() -> dict[str, float]:
    """The rough surface on its finest grid."""
    return read(solved(rough_scene(WAVES), FINEST, 1e-8, "auto"), "fitted")


def truth(model: Model, scene: Scene) -> dict[str, float]:
    """The known answers of a scene."""
    if model.scene == "rough surface":
        return {key: truth_of_rough()[key] for key in ("peak", "approach", "area")}
    exact = scene.reference
    known: dict[str, float] = {}
    if exact.peak is not None:
        known["peak"] = exact.peak
    if model.scene == "press fit":
        known["force"] = exact.peak  # of the whole surface, over its area
    if exact.approach is not None:
        known["approach"] = exact.approach
    if model.scene not in ("press fit", "Spence, disc", "flat punch, disc"):
        known["width"] = exact.half_width
    if exact.stick_half_width:
        known["stick"] = exact.stick_half_width / exact.half_width
    return known


def measure_model(model: Model) -> Iterator[Row]:
    """All meshes of a model, all tolerances on each, all readings of each."""
    scene = model.make()
    known = truth(model, scene)
    for mesh in model.meshes:
        for tol in (*(TOLERANCES if not model.wrong else ()), TIGHT):
            row: Row = {"scene": model.scene, "model": model.name, "wrong": model.wrong}
            row |= {"mesh": mesh, "tolerance": tol, "reading": "fitted", "unknowns": 0}
            row |= {"cpu": np.nan} | dict.fromkeys(QUANTITIES, np.nan)
            try:
                row["cpu"], found = timed(partial(solved, scene, mesh, tol, model.method))
            except Exception as error:
                yield row | {"end": str(error).partition(".")[0][:80]}
                continue
            row["unknowns"] = sum(body.unknowns for body in found.reduction.bodies)  # type: ignore[attr-defined]
            row |= {"certificate": found.solution.residual, "end": str(found.solution.status)}
            for reading in READINGS:
                values = read(found, reading)
                errors = {q: values[q] / known[q] - 1 for q in known if q in values}
                yield row | {"reading": reading} | errors
