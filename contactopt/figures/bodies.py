"""Pictures of the deformed bodies, coloured by the von Mises stress."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from contactopt.figures.style import make_axes
from contactopt.interface.recovery import Fields
from contactopt.problem import InterfaceProblem
from contactopt.scenes.scene import Scene

ELEVATION, AZIMUTH = 22.0, -130.0  # degrees, from where solids are seen


def magnification(scene: Scene, problem: InterfaceProblem, fields: Sequence[Fields]) -> float:
    """Choose the factor by which displacements are drawn: a round number, 1 where bodies are apart at first.

    Parameters
    ----------
    scene
        The scene.
    problem
        Its interface problem.
    fields
        The displacements of its bodies.

    Returns
    -------
    float
        The factor, at least 1.
    """
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
    """Draw the deformed bodies coloured by von Mises stress, mirrored to the whole section (paper, figures 1 and 2).

    Parameters
    ----------
    scene
        The scene.
    problem
        Its interface problem.
    fields
        Displacements and stresses of its bodies.
    ax
        Axes to draw on; by default new ones.

    Returns
    -------
    Axes
        The axes.
    """
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
    """Find beyond which place of a plane section the bodies are mirrored.

    It is the axis of revolution, or the plane of symmetry of a half model: that cuts the contact line at the origin of
    its chart, across the line.

    Parameters
    ----------
    scene
        The scene.
    problem
        Its interface problem.

    Returns
    -------
    tuple or None
        The number of a coordinate axis and the place on it [length]; None where the bodies are whole.
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
    from matplotlib.collections import LineCollection

    ax = make_axes(ax)
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
            ax.add_collection(LineCollection(x.T[outline.T], colors="black", linewidths=0.6))
    across, up = scene.components
    ax.autoscale_view()
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


def _draw_solid(scene: Scene, fields: Sequence[Fields], scale: float, top: float, ax: Any) -> Any:
    """The faces of all bodies that look at the viewer, in one collection, so that nearer ones hide those behind them.

    The projection is parallel, so that which faces look at the viewer depends on their normals alone.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    ax = make_axes(ax, projection="3d")
    ax.set_proj_type("ortho")
    shade = ScalarMappable(Normalize(0, top), "viridis")
    drawn, colours = [], []
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for f in fields:
        points = (f.mesh.p + scale * f.displacement).T
        boundary = f.mesh.boundary_facets()
        facets = in_cycle(f.mesh.facets[:, boundary].T, points)
        seen = outward_normals(f.mesh, boundary, facets, points) @ towards_viewer(ELEVATION, AZIMUTH) > 0
        drawn += list(points[facets[seen]])
        colours.append(shade.to_rgba(f.von_mises[facets[seen]].mean(axis=1)))
        low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    faces = Poly3DCollection(drawn, facecolors=np.concatenate(colours), edgecolors=(0, 0, 0, 0.15), linewidths=0.2)
    faces.set_zsort("average")
    ax.add_collection3d(faces)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low)
    ax.view_init(elev=ELEVATION, azim=AZIMUTH)
    ax.set(xlabel=f"x [{scene.units[0]}]", ylabel=f"y [{scene.units[0]}]", zlabel=f"z [{scene.units[0]}]")
    ax.figure.colorbar(shade, ax=ax, label=f"von Mises stress [{scene.units[1]}]", extend="max", shrink=0.7, pad=0.12)
    return ax


def towards_viewer(elevation: float, azimuth: float) -> np.ndarray:
    """Unit vector (3,) from the bodies to the eye; angles in degrees as in Matplotlib."""
    e, a = np.radians(elevation), np.radians(azimuth)
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def outward_normals(mesh: Any, boundary: np.ndarray, facets: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Normals (m, 3), of no particular length, that point out of the body: away from the centre of each facet's cell.

    facets  (m, c) corners of the facets `boundary` (m,) of the mesh in the order of their perimeter;  points (n, 3)
    """
    corners = points[facets]
    diagonals = (corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
    normals = np.cross(*diagonals) if facets.shape[1] == 4 else np.cross(corners[:, 1] - corners[:, 0], diagonals[0])
    cells = points[mesh.t[:, mesh.f2t[0, boundary]].T].mean(axis=1)
    outside = np.sum(normals * (corners.mean(axis=1) - cells), axis=1)
    return np.asarray(np.where(outside >= 0, 1.0, -1.0)[:, None] * normals)


def in_cycle(facets: np.ndarray, points: np.ndarray) -> np.ndarray:
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
