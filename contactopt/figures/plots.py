"""Every figure of a solved scene: f(data, ax=None) -> ax. Draws, never solves.

A contact line is drawn over the arc length from its centre. A contact surface in 3D is drawn along
the row of contacts through its centre where its nodes lie in rows, and as a coloured map where they
do not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.coupling.reduction import Reduction
from contactopt.defaults import CLOSE
from contactopt.figures.bodies import deformed
from contactopt.figures.path_plots import energies, loop, path_figure
from contactopt.figures.pieces import triangles
from contactopt.figures.style import (
    BLUE,
    GREY,
    LETTERS,
    MARK,
    ORANGE,
    add_colours,
    add_legend,
    make_axes,
    paper_axes,
    symbols,
)
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.contact_status import contact_status
from contactopt.readings.edges import contact_area, contact_edge
from contactopt.readings.half_space_readings import surface_maps
from contactopt.scenes.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from contactopt.accuracy.estimate import Estimate

__all__ = [
    "contact_figure", "contact_line", "contact_place", "deformed", "energies",
    "loop", "maps_figure", "path_figure", "pressure", "refinement_figure",
    "stick_map", "traction",
]  # fmt: skip
# a contact zone whose centre is off the origin by less than this fraction of its half-width
CENTRED = 0.1
COLUMNS = 2  # of panels: more could not be read where the figure is 400 pixels wide


def contact_line(problem: InterfaceProblem) -> np.ndarray:
    """The contacts (j,) in order along a surface; in 3D of the row nearest to its origin."""
    x = problem.chart.places
    row = np.ones(x.shape[1], dtype=bool)
    if problem.dim == 3:
        nearest = x[1, np.argmin(np.abs(x[1]))]
        row = np.abs(x[1] - nearest) <= 1e-6 * (1e-300 + np.ptp(x[1]))
    chosen = np.flatnonzero(row)
    return np.asarray(chosen[np.argsort(contact_place(problem)[chosen], kind="stable")])


def contact_place(problem: InterfaceProblem) -> np.ndarray:
    """Places (k,) along the surface [length]; of a closed line from its origin either way."""
    x, period = problem.chart.places[0], problem.chart.period
    return x if period is None else np.asarray((x + period / 2) % period - period / 2)


def _in_rows(problem: InterfaceProblem) -> bool:
    """Whether a row of contacts crosses the surface, along which to draw values; always in 2D."""
    return problem.dim == 2 or len(contact_line(problem)) >= max(3.0, np.sqrt(problem.contacts) / 3)


def _place_names(scene: Scene, problem: InterfaceProblem) -> tuple[str, str]:
    """What the places along the contact line are, a coordinate or arc length, and where it is."""
    if problem.dim == 3:
        return "x", ", y = 0"
    return scene.components[0] if _straight(problem) else "arc length s", ""


def _straight(problem: InterfaceProblem) -> bool:
    """Whether the contact line follows the first coordinate; true of every surface in 3D."""
    extent = np.ptp(problem.coordinates, axis=1)
    return problem.dim == 3 or len(extent) < 2 or bool(extent[1] <= CLOSE * extent[0])


def _singular(scene: Scene) -> bool:
    """Whether tractions are known to be infinite somewhere: the largest at a node means nothing."""
    return scene.reference is not None and scene.reference.peak is None


def pressure(
    scene: Scene, problem: InterfaceProblem, solution: Solution, ax: Axes | None = None
) -> Any:
    """Contact pressure over its mean, with the exact curve, against position or position / a."""
    ax, (length, stress) = make_axes(ax), scene.units
    if not _in_rows(problem):
        values = solution.reactions[:, 0] / problem.areas
        return _map(scene, problem, values, f"pressure [{stress}]", ax)
    line, place = contact_line(problem), contact_place(problem)
    x, p = place[line], solution.reactions[line, 0] / problem.areas[line]
    a = contact_edge(scene, problem, solution.reactions)
    area = contact_area(scene, problem, solution.reactions, a)
    mean = solution.reactions[:, 0].sum() / area if area > 0 else 0.0
    scaled, mean = _about_origin(problem, solution, place, a), mean or 1.0
    unit = a if scaled else 1.0
    ax.plot(x / unit, p / mean, "o-", color=BLUE, label="contactopt")
    if scene.reference is not None:
        fine = np.linspace(x.min(), x.max(), 801)
        with np.errstate(all="ignore"):
            exact = scene.reference.pressure(fine) / mean
        label = f"exact: {scene.reference.label}"
        ax.plot(fine / unit, exact, color=ORANGE, label=label, zorder=1)
    name, where = _place_names(scene, problem)
    over_a = f"{name} / a [-]{where}, a = {a:.4g} {length}"
    ax.set(
        xlabel=over_a if scaled else f"{name} [{length}]{where}",
        ylabel=f"pressure / mean [-], mean = {mean:.4g} {stress}",
        ylim=(0, 5.0 if _singular(scene) else 1.15 * float((p / mean).max() or 1.0)),
    )
    ax.set_xlim(*_shown(problem, solution, place, unit))
    add_legend(ax)
    return ax


def _shown(
    problem: InterfaceProblem, solution: Solution, place: np.ndarray, unit: float = 1.0
) -> tuple[float | None, float | None]:
    """The limits of the places that are drawn: all, or those about a small zone that touches."""
    touching = place[contact_status(problem, solution.reactions).touching]
    extent = float(np.ptp(touching)) if len(touching) else 0.0
    if extent == 0 or 6.0 * extent > np.ptp(place):  # then the zone is drawn alone
        return None, None
    low, high = touching.min() - extent, touching.max() + extent
    return (low / unit if low > place.min() else None, high / unit if high < place.max() else None)


def _about_origin(
    problem: InterfaceProblem, solution: Solution, place: np.ndarray, half_width: float
) -> bool:
    """Whether the contacts that touch are one zone about the origin, measured by the half-width."""
    touching = contact_status(problem, solution.reactions).touching
    if half_width <= 0 or not touching.any():
        return False
    if touching.all() and not _straight(problem):
        return False
    first, last = place[touching].min(), place[touching].max()
    if problem.chart.mirrored[0]:
        return bool(first <= CENTRED * half_width)
    return bool(abs(first + last) / 2 <= CENTRED * half_width and last - first <= 2.5 * half_width)


def traction(
    scene: Scene, problem: InterfaceProblem, solution: Solution, ax: Axes | None = None
) -> Any:
    """Tangential traction against position with the friction bound; stick and slip are marked."""
    ax, (length, stress) = make_axes(ax), scene.units
    if not _in_rows(problem):
        values = np.linalg.norm(solution.reactions[:, 1:], axis=1) / problem.areas
        return _map(scene, problem, values, f"size of the tangential traction [{stress}]", ax)
    line, place = contact_line(problem), contact_place(problem)
    x, t = place[line], solution.reactions[line, 1] / problem.areas[line]
    bound = problem.law.bound_along(solution.reactions)[line] / problem.areas[line]
    bound[np.isinf(bound)] = 0.0  # glued contacts have none
    status = contact_status(problem, solution.reactions)
    ax.plot(x, bound, color=GREY, ls="--", label="bound ± μ p")
    ax.plot(x, -bound, color=GREY, ls="--")
    ax.plot(x, t, color=BLUE)
    if scene.reference is not None and scene.reference.shear is not None:
        fine = np.linspace(x.min(), x.max(), 801)
        with np.errstate(all="ignore"):
            exact = -scene.reference.shear(fine)
        # singular at the edge of a punch
        exact[np.abs(exact) > 1.1 * bound.max(initial=0.0)] = np.nan
        ax.plot(fine, exact, color="black", label=f"exact: {scene.reference.label}", zorder=3)
    if _singular(scene) and np.any(bound):
        mean = float(np.average(bound, weights=problem.areas[line]))
        ax.set_ylim(-5 * mean, 5 * mean)
    sticking, slipping = status.stick[line], status.slip[line]
    if sticking.any():
        ax.plot(x[sticking], t[sticking], "o", color=BLUE, label="stick")
    if slipping.any():
        ax.plot(x[slipping], t[slipping], "s", color=ORANGE, mfc="white", label="slip")
    name, where = _place_names(scene, problem)
    ax.set(xlabel=f"{name} [{length}]{where}")
    ax.set(ylabel=f"tangential traction\non the upper body [{stress}]")
    ax.set_xlim(*_shown(problem, solution, place))
    add_legend(ax)
    return ax


def _map(scene: Scene, problem: InterfaceProblem, values: np.ndarray, label: str, ax: Axes) -> Any:
    """Values (k,) of the contacts of a surface as colours over its chart."""
    x, y = problem.chart.places
    cells = problem.chart.cells
    if cells is None or len(cells) not in (3, 4):
        drawn = ax.scatter(x, y, c=values, s=14, cmap="viridis")
    else:
        drawn = ax.tripcolor(x, y, triangles(cells.T), values, shading="gouraud", cmap="viridis")
    _plane(scene, problem, ax)
    add_colours(drawn, ax, label)
    return ax


def _plane(scene: Scene, problem: InterfaceProblem, ax: Axes) -> None:
    """Name the axes of a surface in 3D, which are x and y where it lies across z."""
    places, unit = problem.chart.places, scene.units[0]
    flat = np.allclose(places, problem.coordinates[:2], atol=CLOSE * np.ptp(places))
    first, second = ("x", "y") if flat else ("s on the surface", "t on the surface")
    ax.set(xlabel=f"{first} [{unit}]", ylabel=f"{second} [{unit}]", aspect="equal")


def stick_map(
    scene: Scene, problem: InterfaceProblem, solution: Solution, ax: Axes | None = None
) -> Any:
    """Sticking, slipping and open nodes in 3D, with the tangential traction as arrows."""
    ax = make_axes(ax)
    x, y = problem.chart.places
    status = contact_status(problem, solution.reactions)
    spacing = np.sqrt(np.ptp(x) * np.ptp(y) / problem.contacts) or 1.0
    size = min(MARK, 100.0 * spacing / max(np.ptp(x), np.ptp(y)))
    marks = (
        ("stick", status.stick, {"marker": ".", "color": BLUE}),
        ("slip", status.slip, {"marker": "s", "ec": ORANGE, "fc": "white"}),
        ("open", status.open, {"marker": "x", "color": GREY}),
    )
    for label, mask, look in marks:
        if mask.any():
            ax.scatter(x[mask], y[mask], s=size**2, lw=0.5, label=label, **look)
    t = solution.reactions[:, 1:] / np.where(problem.areas > 0, problem.areas, np.inf)[:, None]
    largest = float(np.linalg.norm(t, axis=1).max())
    add_legend(ax)
    _plane(scene, problem, ax)
    if largest > 0:
        every = np.ceil(np.sqrt(status.touching.sum() / 300))  # arrows can be told apart
        row = np.round(problem.chart.places / spacing) % every == 0
        shown = np.flatnonzero(status.touching & row.all(axis=0))
        look = {"angles": "xy", "scale_units": "xy", "scale": largest / (3 * spacing * every)}
        ax.quiver(x[shown], y[shown], t[shown, 0], t[shown, 1], width=0.004, zorder=3, **look)
        longest = f"largest traction (longest arrow): {largest:.3g} {scene.units[1]}"
        ax.set_xlabel(f"{ax.get_xlabel()}\n{longest}")
    return ax


def contact_figure(scene: Scene, problem: InterfaceProblem, solution: Solution) -> Any:
    """Pressure above tangential traction of one pair, with the map of stick in 3D."""
    panels = [pressure, traction] + ([stick_map] if problem.dim == 3 else [])
    # Two plain panels have fixed places, because working out places takes as long as drawing.
    placed = problem.dim == 3
    figure, axes = paper_axes(rows=len(panels), placed=placed)
    if not placed:
        figure.subplots_adjust(left=0.21, right=0.97, bottom=0.08, top=0.91, hspace=0.36)
    for draw, ax in zip(panels, axes):
        draw(scene, problem, solution, ax)
    status = "" if solution.solved else f": {solution.status}"
    figure.suptitle(f"{scene.name}, {symbols(scene.friction)}{status}", fontsize=LETTERS)
    return figure


def maps_figure(reduction: Reduction, solution: Solution) -> Any:
    """Draw pressure, gap, and where there is friction traction, slip and stick, of half-spaces."""
    from matplotlib.colors import ListedColormap

    scene, problem, maps = reduction.scene, reduction.problem, surface_maps(reduction, solution)
    length, stress = scene.units
    closed = maps["status"] > 0
    panels = [
        ("pressure", closed, maps["pressure"], f"pressure [{stress}]", "viridis"),
        ("gap", ~closed, maps["gap"], f"gap [{length}]", "cividis"),
    ]
    if problem.law.rough.any():
        traction, slip = (np.linalg.norm(maps[name], axis=-1) for name in ("traction", "slip"))
        two = ListedColormap([BLUE, ORANGE])
        panels += [
            ("traction", closed, traction, f"tangential traction [{stress}]", "viridis"),
            ("slip", closed, slip, f"slip [{length}]", "cividis"),
            ("status", closed, maps["status"], "", two),
        ]
    line = maps["pressure"].ndim == 1
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    figure, axes = paper_axes(columns, rows, height=1.7 if line else 2.3)
    for (name, where, known, label, colours), ax in zip(panels, axes):
        values = np.where(where, known, np.nan)
        if line:
            ax.plot(problem.chart.places[0], values)
            ax.set(xlabel=f"{scene.components[0]} [{length}]", ylabel=label)
            continue
        x, y = problem.chart.places
        extent = (x.min(), x.max(), y.min(), y.max())
        look = {"origin": "lower", "interpolation": "nearest", "cmap": colours}
        image = ax.imshow(values.T, extent=extent, **look)
        ax.set(xlabel=f"x [{length}]", ylabel=f"y [{length}]")
        bar = add_colours(image, ax, label, orientation="horizontal", shrink=1.0)
        if name == "status":
            image.set_clim(0.5, 2.5)
            bar.set_ticks([1, 2], labels=["stick", "slip"])
    for ax in axes[len(panels) :]:
        ax.set_axis_off()
    return figure


def refinement_figure(estimate: Estimate) -> Any:
    """Estimated errors with the target, and the value, over the unknowns of each mesh."""
    from matplotlib.ticker import NullFormatter

    figure, (left, right) = paper_axes(2, wide=True)
    unknowns = np.array([level.unknowns for level in estimate.levels])
    errors = np.array([np.nan if level.error is None else level.error for level in estimate.levels])
    energy = np.array([level.energy_error for level in estimate.levels])
    known = np.isfinite(errors)
    if known.any():
        left.plot(unknowns[known], errors[known], "o-", color=BLUE, label=f"of {estimate.quantity}")
    if np.any(energy > 0):
        left.plot(unknowns, energy, "s--", color=GREY, mfc="none", label="in the energy norm")
    left.axhline(estimate.target, color=ORANGE, lw=1, label="asked for")
    left.set(xscale="log", yscale="log", ylabel="estimated relative error [-]")
    add_legend(left)
    values = np.array([level.value for level in estimate.levels])
    bar = np.nan_to_num(errors) * np.abs(values)
    right.errorbar(unknowns, values, bar, fmt="o-", color=BLUE, capsize=3)
    if estimate.extrapolated is not None:
        right.axhline(estimate.extrapolated, color=GREY, lw=1, ls=":")
    right.set(xscale="log", ylabel=f"{estimate.quantity}, with its estimated error")
    # all values are shown, and of the error bars those from the second half of the meshes
    late = slice(len(values) // 2, None)
    low = min(values.min(), (values - bar)[late].min())
    high = max(values.max(), (values + bar)[late].max())
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    right.set_ylim(low - margin, high + margin)
    for axes in (left, right):
        axes.set_xlabel("unknowns [-]")
        axes.xaxis.set_minor_formatter(NullFormatter())
    return figure
