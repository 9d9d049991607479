"""Pictures of the deformed bodies, coloured by the von Mises stress."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.coupling.back_to_bodies import Fields
from contactopt.coupling.coupling import Coupling
from contactopt.figures.closing import closing, gap_vectors
from contactopt.figures.pieces import mesh_lines, outline, pieces, segments, surface, triangles
from contactopt.figures.solids import draw_frame, picture, seen_from
from contactopt.figures.style import (
    COLUMN,
    DPI,
    HEIGHT,
    add_colours,
    dress,
    highest_colour,
    magnification,
    make_axes,
    symbols,
)
from contactopt.meshes.cells import elements_of
from contactopt.problem import InterfaceProblem
from contactopt.scenes.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ELEVATION, AZIMUTH = 22.0, -130.0  # degrees, from where solids are seen
PIXELS = 800  # of the longer side of the picture of solids, more than it takes in a PNG file


def deformed(
    scene: Scene,
    problem: InterfaceProblem,
    fields: Sequence[Fields],
    ax: Axes | None = None,
    couplings: Sequence[Coupling] = (),
) -> Any:
    """Draw deformed bodies, coloured by von Mises stress and mirrored; contacts are closed."""
    size = _reach(scene, fields) or max(float(np.ptp(f.mesh.p, axis=1).max()) for f in fields)
    largest = max(float(np.abs(f.displacement).max()) for f in fields)
    gaps = [own.gap for own in couplings] or [problem.q[:, 0] - problem.q[:, 0].mean()]
    scale = magnification(size, largest, gaps)
    if couplings and scale > 1:
        fields = _closed(scene, couplings, fields, 1.0 - 1.0 / scale, _mirror_plane(scene, problem))
    top = highest_colour([f.von_mises for f in fields])
    if scene.dim == 3:
        ax = _draw_solid(scene, fields, scale, top, ax)
    else:
        ax = _draw_section(scene, fields, scale, top, ax, _mirror_plane(scene, problem))
    times = f", displacements \N{MULTIPLICATION SIGN} {scale:g}" if scale != 1 else ""
    title = f"{scene.name}, {symbols(scene.friction)}{times}"
    ax.set_title(title, fontsize=ax.xaxis.label.get_size())
    return ax


def _closed(
    scene: Scene,
    couplings: Sequence[Coupling],
    fields: Sequence[Fields],
    share: float,
    plane: tuple[int, float] | None,
) -> list[Fields]:
    """The fields with a share of the initial gaps added to their displacements."""
    made, kept = [], [] if plane is None else [plane]
    for f in fields:
        surfaces = [
            (own.positions.T, gap_vectors(own.gap, own.frames[:, 0], f.name == pair.bodies[0]))
            for pair, own in zip(scene.pairs, couplings)
            if f.name in pair.bodies
        ]
        d = closing(f.mesh.p.T, surfaces, kept)
        made.append(replace(f, displacement=f.displacement + share * d.T))
    return made


def _mirror_plane(scene: Scene, problem: InterfaceProblem) -> tuple[int, float] | None:
    """The axis and place [length] beyond which a section is mirrored; None if whole."""
    if scene.analysis.revolved:
        return 0, 0.0
    chart, x = problem.chart, problem.coordinates
    if scene.copies != 2 or not chart.mirrored[0] or len(x) != 2:
        return None
    nearest = np.argsort(np.abs(chart.places[0]))[:2]
    axis = int(np.argmax(np.abs(np.diff(x[:, nearest], axis=1))))
    return axis, float(x[axis, nearest[0]])


def _draw_section(
    scene: Scene,
    fields: Sequence[Fields],
    scale: float,
    top: float,
    ax: Axes,
    plane: tuple[int, float] | None,
) -> Any:
    from matplotlib.collections import LineCollection

    ax, bar = (ax, None) if ax is not None else _placed_axes()
    axis, place = plane or (0, 0.0)
    for f in fields:
        points = f.mesh.p + scale * f.displacement
        kind, elements = elements_of(f.mesh)
        cells, rim = triangles(pieces(kind, elements)), segments(outline(kind, elements)).T
        if plane is not None:  # the plane of symmetry is no edge of the whole body
            rim = rim[:, ~np.all(np.isclose(f.mesh.p[axis][rim], place), axis=0)]
        images = [points]
        if plane is not None:
            images.append(points.copy())
            images[1][axis] = 2 * place - points[axis]
        for x in images:
            colours = ax.tripcolor(
                *x, cells, f.von_mises, shading="gouraud", cmap="viridis", vmin=0, vmax=top
            )
            ax.add_collection(LineCollection(x.T[rim.T], colors="black", linewidths=0.6))
    across, up = scene.components
    ax.autoscale_view()
    length = scene.units[0]
    ax.set(xlabel=f"{across} [{length}]", ylabel=f"{up} [{length}]", aspect="equal")
    reach = _reach(scene, fields)
    if reach is not None:
        ax.set(xlim=(-reach, reach), ylim=(-0.9 * reach, 0.6 * reach))
    room = {} if bar is None else {"cax": bar}
    add_colours(colours, ax, f"von Mises stress [{scene.units[1]}]", extend="max", **room)
    return ax


def _placed_axes() -> tuple[Any, Any]:
    """Axes and those of a colour bar at fixed places: a layout takes as long as drawing."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(COLUMN, HEIGHT), dpi=DPI)
    dress(ax := figure.add_axes((0.13, 0.13, 0.66, 0.79)))
    return ax, figure.add_axes((0.82, 0.2, 0.03, 0.64))


def _reach(scene: Scene, fields: Sequence[Fields]) -> float | None:
    """How far from the centre to look at a small contact on large bodies; None: at all of them."""
    half_width = scene.reference.half_width if scene.reference else scene.zone
    large = half_width is not None and max(np.ptp(f.mesh.p[0]) for f in fields) > 16 * half_width
    return 4 * half_width if half_width is not None and large and scene.dim == 2 else None


def _draw_solid(scene: Scene, fields: Sequence[Fields], scale: float, top: float, ax: Axes) -> Any:
    """The surfaces of all bodies with a depth buffer: nearer ones hide those behind them."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    ax = make_axes(ax)
    shade, view = ScalarMappable(Normalize(0, top), "viridis"), seen_from(ELEVATION, AZIMUTH)
    drawn = []
    for f in fields:
        # of bodies that fly away, which are drawn at rest
        move = np.nan_to_num(f.displacement, posinf=0.0, neginf=0.0)
        points = (f.mesh.p + scale * move).T
        plane, faces = surface(*elements_of(f.mesh), points)
        cells = triangles(pieces(plane, faces))
        opposite = np.stack([cells[:, [1, 2]], cells[:, [2, 0]], cells[:, [0, 1]]], axis=1)
        lines = segments(mesh_lines(plane, faces))
        lined = np.isin(_key(opposite, len(points)), _key(lines, len(points)))
        drawn.append((points[cells], f.von_mises[cells], lined))
    corners, values, lined = (np.concatenate(parts) for parts in zip(*drawn))
    image, extent = picture(corners @ view, values, lined, shade.to_rgba, PIXELS)
    ax.imshow(image, extent=extent, origin="lower", aspect="equal", zorder=2)
    names = [f"{name} [{scene.units[0]}]" for name in scene.components]
    draw_frame(ax, view, corners.min(axis=(0, 1)), corners.max(axis=(0, 1)), names)
    ax.set_axis_off()
    ax.margins(0.12)
    room = {"extend": "max", "shrink": 0.7, "pad": 0.04}
    add_colours(shade, ax, f"von Mises stress [{scene.units[1]}]", **room)
    return ax


def _key(pairs: np.ndarray, count: int) -> np.ndarray:
    """One number for every pair (..., 2) of nodes, whatever their order, of `count` nodes."""
    return np.asarray(pairs.min(axis=-1) * count + pairs.max(axis=-1))
