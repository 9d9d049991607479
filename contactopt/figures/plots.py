"""Every figure: f(data, ax=None) -> ax. Draws, never solves. Colours are those of Okabe and Ito, legible to all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from contactopt.analysis.edges import contact_area, contact_edge
from contactopt.analysis.status import contact_status
from contactopt.derivatives.design import Design
from contactopt.derivatives.fit import Fit
from contactopt.interface.recovery import Fields
from contactopt.problem import InterfaceProblem, Solution
from contactopt.scenes.scene import Scene

ARROWS = 1000  # about as many arrows as a map of tractions can show
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#666666"


def _axes(ax: Any, **options: Any) -> Any:
    if ax is not None:
        return ax
    from matplotlib.figure import Figure

    return Figure(figsize=(6.4, 4.8), layout="constrained").add_subplot(**options)


def magnification(scene: Scene, problem: InterfaceProblem, fields: Sequence[Fields]) -> float:
    """Factor by which displacements are drawn: a round number, 1 where bodies are apart at first."""
    displacement = max(float(np.abs(f.displacement).max()) for f in fields)
    if displacement == 0 or np.ptp(problem.q[:, 0]) > 1e-3 * displacement:
        return 1.0
    size = _reach(scene, fields) or max(float(np.ptp(f.mesh.p, axis=1).max()) for f in fields)
    target = 0.08 * size / displacement
    if not 1.0 < target < np.inf:  # also where displacements are beyond all numbers
        return 1.0
    power = 10.0 ** np.floor(np.log10(target))
    return float(max(1.0, power * max(m for m in (1, 2, 5) if m * power <= target)))


def deformed(scene: Scene, problem: InterfaceProblem, fields: Sequence[Fields], ax: Any = None) -> Any:
    """Deformed bodies coloured by von Mises stress, mirrored to the whole section (paper, figures 1 and 2)."""
    scale = magnification(scene, problem, fields)
    top = float(np.quantile(np.concatenate([f.von_mises for f in fields]), 0.998)) or 1.0
    if scene.dim == 3:
        ax = _draw_solid(scene, fields, scale, top, ax)
    else:
        ax = _draw_section(scene, fields, scale, top, ax, mirror_plane(scene, problem))
    times = f", displacements x {scale:g}" if scale != 1 else ""
    ax.set_title(f"{scene.name}: deformed bodies, {scene.friction}{times}")
    return ax


def mirror_plane(scene: Scene, problem: InterfaceProblem) -> tuple[int, float] | None:
    """Coordinate axis of a plane section and place on it beyond which the bodies are mirrored; None: they are whole.

    It is the axis of revolution, or the plane of symmetry of a half model: that cuts the contact line at the origin of
    its chart, across the line.
    """
    if scene.kind == "axisymmetric":
        return 0, 0.0
    chart, x = problem.chart, problem.coordinates
    if scene.copies != 2 or not chart.mirrored[0] or len(x) != 2:
        return None
    nearest = np.argsort(np.abs(chart.places[0]))[:2]
    axis = int(np.argmax(np.abs(np.diff(x[:, nearest], axis=1))))
    return axis, float(x[axis, nearest[0]])


def _draw_section(
    scene: Scene, fields: Sequence[Fields], scale: float, top: float, ax: Any, plane: tuple[int, float] | None
) -> Any:
    ax = _axes(ax)
    axis, place = plane or (0, 0.0)
    for f in fields:
        points = f.mesh.p + scale * f.displacement
        corners = f.mesh.t.T
        cells = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]]) if corners.shape[1] == 4 else corners
        outline = f.mesh.facets[:, f.mesh.boundary_facets()]
        if plane is not None:  # the plane of symmetry is no edge of the whole body
            outline = outline[:, ~np.all(np.isclose(f.mesh.p[axis][outline], place), axis=0)]
        for image in (False, True) if plane is not None else (False,):
            x = points.copy()
            x[axis] = 2 * place - x[axis] if image else x[axis]
            colours = ax.tripcolor(*x, cells, f.von_mises, shading="gouraud", cmap="viridis", vmin=0, vmax=top)
            ax.plot(x[0][outline], x[1][outline], color="black", lw=0.6)
    across, up = scene.components
    ax.set(xlabel=f"{across} [{scene.units[0]}]", ylabel=f"{up} [{scene.units[0]}]", aspect="equal")
    reach = _reach(scene, fields)
    if reach is not None:
        ax.set(xlim=(-reach, reach), ylim=(-0.9 * reach, 0.6 * reach))
    ax.figure.colorbar(colours, ax=ax, label=f"von Mises stress [{scene.units[1]}]", extend="max", shrink=0.8)
    return ax


def _reach(scene: Scene, fields: Sequence[Fields]) -> float | None:
    """How far from the centre to look at a small contact on large bodies; None: show the whole bodies."""
    half_width = scene.reference.half_width if scene.reference else scene.zone
    large = half_width is not None and max(np.ptp(f.mesh.p[0]) for f in fields) > 16 * half_width
    return 4 * half_width if half_width is not None and large and scene.dim == 2 else None


def _singular(scene: Scene) -> bool:
    """Whether tractions are known to be infinite somewhere, so that the largest nodal value means nothing."""
    return scene.reference is not None and scene.reference.peak is None


def _draw_solid(scene: Scene, fields: Sequence[Fields], scale: float, top: float, ax: Any) -> Any:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    ax = _axes(ax, projection="3d")
    shade = ScalarMappable(Normalize(0, top), "viridis")
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for f in fields:
        points = (f.mesh.p + scale * f.displacement).T
        facets = f.mesh.facets[:, f.mesh.boundary_facets()].T
        facets = _in_cycle(facets, points)
        colours = shade.to_rgba(f.von_mises[facets].mean(axis=1))
        ax.add_collection3d(
            Poly3DCollection(points[facets], facecolors=colours, edgecolors=(0, 0, 0, 0.15), linewidths=0.2)
        )
        low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low)
    ax.view_init(elev=22, azim=-130)
    ax.set(xlabel=f"x [{scene.units[0]}]", ylabel=f"y [{scene.units[0]}]", zlabel=f"z [{scene.units[0]}]")
    ax.figure.colorbar(shade, ax=ax, label=f"von Mises stress [{scene.units[1]}]", extend="max", shrink=0.7, pad=0.12)
    return ax


def _in_cycle(facets: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Corners of quadrilateral facets in the order of their perimeter: the farthest from the first comes third."""
    if facets.shape[1] != 4:
        return facets
    centre = points[facets].mean(axis=1, keepdims=True)
    arms = points[facets] - centre
    first, second = arms[:, 0], arms[:, 1]
    normal = np.cross(first, second)
    normal[np.linalg.norm(normal, axis=1) == 0] = 1.0
    side = np.cross(normal, first)
    angle = np.arctan2(
        np.einsum("fic,fc->fi", arms, side) / np.linalg.norm(side, axis=1)[:, None],
        np.einsum("fic,fc->fi", arms, first) / np.linalg.norm(first, axis=1)[:, None],
    )
    return np.asarray(np.take_along_axis(facets, np.argsort(angle, axis=1), axis=1))


def contact_line(problem: InterfaceProblem) -> np.ndarray:
    """Contact nodes along the first direction of the surface, in order; in 3D those of the row nearest to its origin."""
    x = problem.chart.places
    row = np.ones(x.shape[1], dtype=bool)
    if problem.dim == 3:
        nearest = x[1, np.argmin(np.abs(x[1]))]
        row = np.abs(x[1] - nearest) <= 1e-6 * (1e-300 + np.ptp(x[1]))
    chosen = np.flatnonzero(row)
    return np.asarray(chosen[np.argsort(x[0, chosen])])


def pressure(scene: Scene, problem: InterfaceProblem, solution: Solution, ax: Any = None) -> Any:
    """Contact pressure over its mean against position over half-width (paper, figure 3), with the exact curve."""
    ax = _axes(ax)
    line = contact_line(problem)
    x = problem.chart.places[0, line]
    p = solution.reactions[line, 0] / problem.areas[line]
    a = contact_edge(scene, problem, solution.reactions)
    mean = solution.reactions[:, 0].sum() / contact_area(scene, a) if a > 0 else 0.0
    a, mean = a or 1.0, mean or 1.0
    ax.plot(x / a, p / mean, "o-", color=BLUE, ms=4, lw=1, label="contactopt")
    if scene.reference is not None:
        fine = np.linspace(x.min(), x.max(), 801)
        with np.errstate(all="ignore"):
            exact = scene.reference.pressure(fine) / mean
        ax.plot(fine / a, exact, color=ORANGE, lw=1.5, label=f"exact: {scene.reference.label}", zorder=1)
    across = scene.components[0]
    where = ", y = 0" if problem.dim == 3 else ""
    ax.set(
        xlabel=f"{across} / a [-]{where}, a = {a:.4g} {scene.units[0]}",
        ylabel=f"p / mean p [-], mean p = {mean:.4g} {scene.units[1]}",
        ylim=(0, 5.0 if _singular(scene) else 1.15 * float((p / mean).max() or 1.0)),
    )
    ax.legend(frameon=False)
    return ax


def traction(scene: Scene, problem: InterfaceProblem, solution: Solution, ax: Any = None) -> Any:
    """Tangential traction against position with the friction bound; sticking and slipping nodes marked."""
    ax = _axes(ax)
    line = contact_line(problem)
    x = problem.chart.places[0, line]
    t = solution.reactions[line, 1] / problem.areas[line]
    bound = problem.mu[line] * np.abs(solution.reactions[line, 0]) / problem.areas[line]
    status = contact_status(problem, solution.reactions)
    ax.plot(x, bound, color=GREY, lw=1, ls="--", label="friction bound, +/- mu p")
    ax.plot(x, -bound, color=GREY, lw=1, ls="--")
    ax.plot(x, t, color=BLUE, lw=1)
    if scene.reference is not None and scene.reference.shear is not None:
        fine = np.linspace(x.min(), x.max(), 801)
        with np.errstate(all="ignore"):
            exact = -scene.reference.shear(fine)
        exact[np.abs(exact) > 1.1 * bound.max(initial=0.0)] = np.nan  # singular at the edge of a punch
        ax.plot(fine, exact, color="black", lw=1, label=f"exact: {scene.reference.label}", zorder=3)
    if _singular(scene) and np.any(bound):
        mean = float(np.average(bound, weights=problem.areas[line]))
        ax.set_ylim(-5 * mean, 5 * mean)
    sticking, slipping = status.stick[line], status.slip[line]
    ax.plot(x[sticking], t[sticking], "o", color=BLUE, ms=5, label="stick")
    ax.plot(x[slipping], t[slipping], "s", color=ORANGE, ms=5, mfc="white", label="slip")
    across = scene.components[0]
    where = ", y = 0" if problem.dim == 3 else ""
    ax.set(
        xlabel=f"{across} [{scene.units[0]}]{where}", ylabel=f"tangential traction on the upper body [{scene.units[1]}]"
    )
    ax.legend(frameon=False)
    return ax


def stick_map(scene: Scene, problem: InterfaceProblem, solution: Solution, ax: Any = None) -> Any:
    """Contact patch of a 3D scene: sticking, slipping and open nodes, with the tangential traction as arrows."""
    ax = _axes(ax)
    x, y = problem.chart.places
    status = contact_status(problem, solution.reactions)
    for mask, colour, marker, label in (
        (status.stick, BLUE, "o", "stick"),
        (status.slip, ORANGE, "s", "slip"),
        (status.open, GREY, "x", "open"),
    ):
        if mask.any():
            face = {} if marker == "x" else {"facecolors": colour if marker == "o" else "white"}
            ax.scatter(x[mask], y[mask], s=14, marker=marker, color=colour, label=label, **face)
    t = solution.reactions[:, 1:] / problem.areas[:, None]
    if np.any(t):
        shown = np.flatnonzero(status.touching)
        shown = shown[:: max(1, len(shown) // ARROWS)]
        ax.quiver(x[shown], y[shown], t[shown, 0], t[shown, 1], color="black", width=0.003)
    ax.set(
        xlabel=f"x [{scene.units[0]}]",
        ylabel=f"y [{scene.units[0]}]",
        aspect="equal",
        title="arrows: tangential traction",
    )
    ax.legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1))
    return ax


def contact_figure(scene: Scene, problem: InterfaceProblem, solution: Solution) -> Any:
    """Pressure and tangential traction side by side, with the map of stick and slip in 3D; a Figure."""
    from matplotlib.figure import Figure

    panels = [pressure, traction] + ([stick_map] if problem.dim == 3 else [])
    figure = Figure(figsize=(5.4 * len(panels), 4.2), layout="constrained")
    for draw, ax in zip(panels, figure.subplots(1, len(panels))):
        draw(scene, problem, solution, ax)
    figure.suptitle(f"{scene.name}, {scene.friction}: {solution.status}, residual {solution.residual:.1e}")
    return figure


def convergence(solutions: dict[str, Solution], ax: Any = None) -> Any:
    """Natural-map residual against outer iterations, one line per solve."""
    ax = _axes(ax)
    for colour, (label, solution) in zip((BLUE, ORANGE, GREEN, GREY, "#CC79A7", "#56B4E9"), solutions.items()):
        residual = [h["residual"] for h in solution.history]
        ax.semilogy(range(1, len(residual) + 1), residual, "o-", ms=3, color=colour, label=label)
    ax.set(xlabel="outer iteration", ylabel="natural-map residual [-]")
    ax.legend(frameon=False)
    return ax


def fit(found: Fit, ax: Any = None) -> Any:
    """What the model leaves of the data, over the standard deviation of the noise, state by state."""
    ax = _axes(ax)
    for (name, measured), colour in zip(found.data.items(), (BLUE, ORANGE, GREEN, GREY)):
        rest = (measured - found.model[name]) / (found.noise[name] or 1.0)
        ax.plot(np.arange(len(rest)), rest, "o-", color=colour, lw=0.8, ms=4, label=name)
    ax.axhline(0.0, color=GREY, lw=0.8)
    ax.axhspan(-1.96, 1.96, color=GREY, alpha=0.12, lw=0, label="95 % of normal noise")
    ax.set(xlabel="state", ylabel="(measured - computed) / noise")
    ax.set_title("; ".join(f"{name} = {value:.4g}" for name, value in found.values.items()))
    ax.legend(frameon=False)
    return ax


def design(found: Design, ax: Any = None) -> Any:
    """The pressure of the designed contact over the place along the surface, and its mean."""
    ax = _axes(ax)
    problem = found.reduction.problem
    place = problem.chart.places[0]
    order = np.argsort(place)
    touching = problem.law.pressed(found.solution.reactions)
    mean = float(np.average(found.pressure[touching], weights=problem.areas[touching]))
    unit, stress = found.reduction.scene.units
    ax.plot(place[order], found.pressure[order], "." if problem.dim == 3 else ".-", color=BLUE, label="pressure")
    ax.axhline(mean, color=GREY, lw=0.8, label="mean over the contact")
    ax.set(xlabel=f"place [{unit}]", ylabel=f"pressure [{stress}]", ylim=(0.0, 1.2 * found.peak))
    ax.set_title(f"{found.reduction.scene.name}: largest over mean pressure {found.unevenness:.4f}")
    ax.legend(frameon=False)
    return ax
