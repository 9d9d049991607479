"""Error of the peak pressure against processor time on one scene, for four ways to model it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from contactopt import HalfSpace, Part, Rigid, Scene, Support, analytic
from contactopt.accuracy import refine
from contactopt.figures.style import GREY, LETTERS, draw_lines, paper_axes
from contactopt.meshes.structured import contact_grid, graded, rename, tensor_mesh
from contactopt.readings.quantities import value_of
from contactopt.scenes.common import RUBBER
from contactopt.solving.limits import Limits
from contactopt.solving.solve_scene import solve_scene

Row = dict[str, Any]

# the errors of one force alone can be small by luck
RADIUS, FORCES = 400.0, (0.8, 0.9, 1.0, 1.1, 1.2)
EXACT = {
    force: analytic.hertz_line(force, RADIUS, analytic.contact_modulus(RUBBER)) for force in FORCES
}
A = EXACT[1.0].half_width
SIZE = 60 * A  # half-width and depth of the block
DEGREE = 2  # of the finite elements
UNIFORM = (64, 128, 192, 256)  # elements across the block
GRADED = (3, 6, 12, 24)  # elements across the contact half-width
GOALS = (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)  # of adaptive refinement
POINTS = (16, 32, 64, 128, 256)  # of a half-plane

Answer = tuple[int, float]  # unknowns, peak pressure


def block(mesh: Any, force: float) -> Scene:
    """A rigid cylinder on a block that is clamped below."""
    named = rename(mesh, bottom="y-", top="y+")
    part = Part("block", named, RUBBER, (Support("bottom"),), contact="top")
    return Scene(
        "cylinder on a block", _cylinder(force), part, 0.0, law="frictionless", degree=DEGREE
    )


def _cylinder(force: float) -> Rigid:
    return Rigid("cylinder", gap=lambda p: p[0] ** 2 / (2 * RADIUS), force={"y": -force})


def uniform(count: float, force: float) -> Answer:
    """Squares of one size everywhere."""
    ticks = np.linspace(-SIZE, SIZE, int(count) + 1), np.linspace(-SIZE, 0, int(count) // 2 + 1)
    return solved(block(tensor_mesh(*ticks), force))


def graded_by_hand(count: float, force: float) -> Answer:
    """Squares that grow away from the contact, the more slowly the finer they are."""
    growth = 1 + 1.6 / count
    side = contact_grid(1.5 * A, round(1.5 * count), SIZE, growth)
    mesh = tensor_mesh(np.concatenate([-side[:0:-1], side]), -graded(SIZE, A / count, growth)[::-1])
    return solved(block(mesh, force))


def half_plane(count: float, force: float) -> Answer:
    """No mesh: points across three contact half-widths."""
    x = (np.arange(count) + 0.5) * 3 * A / count - 1.5 * A
    plane = HalfSpace("block", RUBBER, x, depth=SIZE)
    return solved(Scene("cylinder", _cylinder(force), plane, 0.0, law="frictionless"))


def solved(scene: Scene) -> Answer:
    """Unknowns and peak pressure."""
    found = solve_scene(scene)
    return found.reduction.dofs, value_of("pressure", found.reduction, found.solution)


def adaptive(goal: float, force: float) -> Answer:
    """The last of the meshes of a refinement; the time is that of all of them."""
    coarse = tensor_mesh(np.linspace(-SIZE, SIZE, 17), np.linspace(-SIZE, 0, 9))
    found, estimate = refine(
        [block(coarse, force)], "pressure", goal, limits=Limits(60_000), adaptive=True
    )
    return found.reduction.dofs, estimate.value


WAYS: dict[str, tuple[Callable[[float, float], Answer], tuple[float, ...]]] = {
    "half-plane": (half_plane, POINTS),
    "graded": (graded_by_hand, GRADED),
    "adaptive": (adaptive, GOALS),
    "uniform": (uniform, UNIFORM),
}


def chart_rows() -> list[Row]:
    """One row for every setting: root mean square of errors, least seconds over all forces."""
    rows = []
    for way, (run, settings) in WAYS.items():
        run(settings[0], 1.0)  # imports and caches do not count
        for setting in settings:
            errors, seconds, unknowns = [], [], []
            for force in FORCES:
                begin = time.process_time()
                size, value = run(setting, force)
                seconds.append(time.process_time() - begin)
                errors.append(value / EXACT[force].peak - 1)
                unknowns.append(size)
            row = {"model": way, "setting": setting, "unknowns": round(float(np.median(unknowns)))}
            row |= {"error of the peak": float(np.sqrt(np.mean(np.square(errors))))}
            rows.append(row | {"processor seconds": min(seconds)})
            print(rows[-1], flush=True)
    return rows


def bias() -> float:
    """By how much the block's peak misses that of a half-plane, on the finest graded mesh."""
    return graded_by_hand(GRADED[-1], 1.0)[1] / EXACT[1.0].peak - 1


NAMES = {"half-plane": "half-plane, no mesh", "graded": "graded by hand"}


def draw_chart(rows: list[Row], model_error: float) -> Any:
    """Error over time, each way named at its curve."""
    figure, (ax,) = paper_axes()
    lines = []
    for way in WAYS:
        own = [row for row in rows if row["model"] == way]
        xy = ([row[key] for row in own] for key in ("processor seconds", "error of the peak"))
        lines.append((NAMES.get(way, way), *xy))
    draw_lines(ax, lines)
    ax.axhline(model_error, color=GREY, ls=":", lw=0.8)
    where = {"xycoords": ("axes fraction", "data"), "ha": "right", "va": "top"}
    text = "effect of the block's end"
    ax.annotate(text, (0.98, model_error), color=GREY, fontsize=LETTERS, **where)
    ax.set(xlabel="CPU time [s]", ylabel="error of the peak pressure [-]")
    return figure
