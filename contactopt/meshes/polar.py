"""Structured meshes of round bodies: rings and sectors of rings, half discs and discs, divided
evenly around the origin, with elements of second order that bend along circles.
"""

import numpy as np
from skfem import MeshQuad, MeshQuad2

from contactopt.defaults import EQUAL
from contactopt.meshes.discs import half_disc
from contactopt.meshes.structured import tensor_mesh


def ring(radii: np.ndarray, angles: np.ndarray) -> MeshQuad2:
    """Quadrilaterals between circles of ascending radii (m,) [length] and rays at ascending angles
    (n,) from the x axis towards y [rad]; their edges along circles bend with them.

    The boundaries are 'inner' and 'outer', and 'start' and 'end' at the first and the last angle
    unless the ring is closed.
    """
    flat = tensor_mesh(angles, radii)
    angle, radius = flat.p
    points = radius * np.stack([np.cos(angle), np.sin(angle)])
    names = {"inner": "y-", "outer": "y+", "start": "x-", "end": "x+"}
    if angles[-1] - angles[0] < 2 * np.pi * (1 - EQUAL):
        made = _quads(points, flat.t)
        old = flat.boundaries
        return _on_circles(made.with_boundaries({new: old[name] for new, name in names.items()}))
    first, last = (np.flatnonzero(angle == value) for value in (angles[0], angles[-1]))
    number = np.arange(len(angle))
    number[last[np.argsort(radius[last])]] = first[np.argsort(radius[first])]
    kept = np.unique(number)
    made = _quads(points[:, kept], np.searchsorted(kept, number[flat.t]))
    facets = made.boundary_facets()
    inner = radius[kept][made.facets[0, facets]] < (radii[0] + radii[-1]) / 2
    return _on_circles(made.with_boundaries({"inner": facets[inner], "outer": facets[~inner]}))


def right_half_disc(radius: float, sectors: int) -> MeshQuad2:
    """The half disc x >= 0 with 'rim' and 'axis', its arc in 4 * sectors parts."""
    (x, y), t = half_disc(np.linspace(0.0, radius, 2 * sectors + 1), sectors)
    made = _quads(np.stack([y, -x]), t)
    facets = made.boundary_facets()
    axis = np.all(np.abs(made.p[0, made.facets[:, facets]]) < EQUAL * radius, axis=0)
    return _on_circles(made.with_boundaries({"rim": facets[~axis], "axis": facets[axis]}), radius)


def disc(radius: float, sectors: int) -> MeshQuad2:
    """The whole disc with the boundary 'rim', whose nodes divide it into 8 * sectors even parts."""
    (x, y), t = half_disc(np.linspace(0.0, radius, 2 * sectors + 1), sectors)
    diameter = np.flatnonzero(np.abs(y) < EQUAL * radius)
    along = diameter[np.argsort(x[diameter])]
    # the node that each becomes when the half disc is turned by half a turn
    other = np.full(len(x), -1)
    other[along] = along[::-1]
    above = np.flatnonzero(other < 0)
    other[above] = len(x) + np.arange(len(above))
    points = np.stack([x, y])
    points = np.concatenate([points, -points[:, above]], axis=1)
    made = _quads(points, np.concatenate([t, other[t]], axis=1))
    return _on_circles(made.with_boundaries({"rim": made.boundary_facets()}), radius)


def _quads(points: np.ndarray, t: np.ndarray) -> MeshQuad:
    return MeshQuad(np.ascontiguousarray(points), np.ascontiguousarray(t))


def _on_circles(mesh: MeshQuad, only: float | None = None) -> MeshQuad2:
    """Elements of second order whose edges between nodes of a circle, or of one radius, bend."""
    made = MeshQuad2.from_mesh(mesh)
    ends = mesh.p[:, mesh.facets]
    first, second = np.linalg.norm(ends, axis=0)
    bent = np.flatnonzero(np.abs(first - second) <= EQUAL * second.max())
    if only is not None:
        bent = bent[np.abs(first[bent] - only) <= EQUAL * only]
    points = made.doflocs.copy()
    size = np.linalg.norm(ends[:, :, bent].mean(axis=1), axis=0)
    stretch = np.ones(points.shape[1])
    stretch[made.dofs.facet_dofs[0, bent]] = first[bent] / np.where(size > 0, size, 1.0)
    points *= stretch
    return MeshQuad2(points, made.t).with_boundaries(mesh.boundaries)


def even(start: float, end: float, parts: int) -> np.ndarray:
    """Ascending radii of about square elements from start to end, so many along half the circle."""
    count = max(1, round(np.log(end / start) * parts / np.pi))
    return np.asarray(np.geomspace(start, end, count + 1))
