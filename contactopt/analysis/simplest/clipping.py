"""One half of a mesh, on one side of a plane normal to an axis.

A mesh of which no element crosses the plane is restricted to its elements on that side. Others are clipped: nodes near the plane
move onto it, edges that cross it are divided where they cross, and so are the triangles or tetrahedra along them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import skfem
from scipy.spatial import KDTree

from contactopt.analysis.simplest.planes import Plane
from contactopt.bodies.elements import is_curved, straight
from contactopt.bodies.local_refinement import named_like, simplices

NEAR = 1e-9  # nodes lie in the plane within this fraction of the body's size
OFF = 1e-3  # of that edge: how far such a move may lead out of the boundary
SNAP = 0.3  # nodes nearer to the plane than this fraction of a crossing edge move onto it


@dataclass(frozen=True)
class Side:
    """The half x_axis >= place of space; `sense` is -1 for x_axis <= place."""

    axis: int
    place: float
    sense: float = 1.0

    def height(self, points: np.ndarray) -> np.ndarray:
        """(k,) how far points (dim, k) are on this side."""
        return np.asarray(self.sense * (points[self.axis] - self.place))


def half_mesh(side: Side, cut: str, curve_of: Callable[[str], Any]) -> Callable[[Any], Any]:
    """The function that cuts a mesh: its half with a boundary of that name in the plane."""

    def change(mesh: Any) -> Any:
        size = float(np.ptp(mesh.p, axis=1).max())
        if crosses(mesh, side):
            mesh = _clipped(mesh, side, curve_of)
        inside = side.height(mesh.p[:, mesh.t].mean(axis=1)) > 0
        own = _restricted(mesh, np.flatnonzero(inside))
        kept = {name: facets for name, facets in (own.boundaries or {}).items() if len(facets)}
        plane = own.facets_satisfying(lambda x: np.abs(side.height(x)) < NEAR * size, True)
        return replace(own, _boundaries=None, _subdomains=None).with_boundaries(kept | {cut: plane})

    return change


def _restricted(mesh: Any, elements: np.ndarray) -> Any:
    """The mesh of some elements; those of second order keep their curved sides."""
    own = straight(mesh).restrict(elements)
    if not is_curved(mesh):
        return own
    made = type(mesh).from_mesh(replace(own, _boundaries=None, _subdomains=None))
    points = made.doflocs.copy()
    points[:, made.dofs.element_dofs] = mesh.doflocs[:, mesh.dofs.element_dofs[:, elements]]
    return replace(made, doflocs=points, _boundaries=own.boundaries)


def crosses(mesh: Any, side: Side) -> bool:
    """Whether an element lies on both sides of the plane."""
    height = side.height(mesh.p)[mesh.t]
    near = NEAR * float(np.ptp(mesh.p, axis=1).max())
    return bool(np.any((height.min(axis=0) < -near) & (height.max(axis=0) > near)))


def is_mirrored(mesh: Any, image: Any, plane: Plane) -> bool:
    """Whether the nodes and the elements of a mesh have those of another one as their mirror images."""
    if mesh.p.shape != image.p.shape or mesh.t.shape != image.t.shape:
        return False
    near = NEAR * float(np.ptp(mesh.p, axis=1).max())
    middles, others = (each.p[:, each.t].mean(axis=1) for each in (mesh, image))
    pairs = ((mesh.p, image.p), (middles, others))
    return all(bool(KDTree(there.T).query(plane.image(here).T)[0].max() < near) for here, there in pairs)


def _clipped(mesh: Any, side: Side, curve_of: Callable[[str], Any]) -> Any:
    """Triangles or tetrahedra of which none crosses the plane, with the named boundaries of the mesh."""
    old = simplices(mesh)
    points, cells = old.p.copy(), old.t
    near = NEAR * float(np.ptp(points, axis=1).max())
    points = _snapped(old, points, side)
    height = side.height(points)
    height[np.abs(height) < near] = 0.0
    points[side.axis, height == 0.0] = side.place
    places, marks = list(points.T), list(height)
    rows: list[tuple[int, ...]] = [tuple(cell) for cell in cells.T]
    whole = [row for row in rows if not _spread(row, marks)]
    middle: dict[tuple[int, int], int] = {}
    for row in (row for row in rows if _spread(row, marks)):
        whole += _divided(row, places, marks, middle)
    kind = skfem.MeshTri if len(points) == 2 else skfem.MeshTet
    made = kind(np.ascontiguousarray(np.array(places).T), np.ascontiguousarray(np.array(whole).T))
    new = named_like(replace(old, doflocs=points), made)
    return _on_curves(new, len(cells) and points.shape[1], side, curve_of)


def _spread(row: tuple[int, ...], marks: list[float]) -> bool:
    heights = [marks[i] for i in row]
    return min(heights) < 0 < max(heights)


def _divided(
    row: tuple[int, ...], places: list[np.ndarray], marks: list[float], middle: dict[tuple[int, int], int]
) -> list[tuple[int, ...]]:
    """The pieces of a simplex: its crossing edges are divided one after the other, in the order of their nodes' numbers.

    All simplices along an edge divide a common face in the same order, hence in the same way.
    """
    for i, j in sorted((min(i, j), max(i, j)) for n, i in enumerate(row) for j in row[n + 1 :]):
        if marks[i] * marks[j] < 0:
            if (i, j) not in middle:
                share = marks[i] / (marks[i] - marks[j])
                middle[i, j] = len(places)
                places.append(places[i] + share * (places[j] - places[i]))
                marks.append(0.0)
            new = middle[i, j]
            pieces = [tuple(new if node == old else node for node in row) for old in (i, j)]
            return [piece for half in pieces for piece in _divided(half, places, marks, middle)]
    return [row]


def _snapped(mesh: Any, points: np.ndarray, side: Side) -> np.ndarray:
    """The nodes with those near the plane moved onto it, unless that would move them out of the boundary."""
    height = side.height(points)
    edges = mesh.facets if len(points) == 2 else mesh.edges
    crossing = edges[:, height[edges[0]] * height[edges[1]] < 0]
    length = np.abs(height[crossing[0]] - height[crossing[1]])
    nearest = np.full(points.shape[1], np.inf)
    for end in crossing:
        np.minimum.at(nearest, end, length)
    moves = np.abs(height) < SNAP * np.where(np.isfinite(nearest), nearest, 0.0)
    facets = mesh.facets[:, mesh.boundary_facets()]
    steep = np.zeros(points.shape[1])
    for corner in facets:
        np.maximum.at(steep, corner, _steepness(points[:, facets], side.axis))
    moves &= steep * np.abs(height) <= OFF * np.where(np.isfinite(nearest), nearest, 0.0)
    moved = points.copy()
    moved[side.axis, moves] = side.place
    volumes = [np.linalg.det(np.moveaxis(x[:, mesh.t[1:]] - x[:, mesh.t[:1]], 2, 0)) for x in (points, moved)]
    spoilt = volumes[1] * np.sign(volumes[0]) < 0.1 * np.abs(volumes[0])
    back = np.unique(mesh.t[:, spoilt])
    moved[:, back] = points[:, back]
    return moved


def _steepness(corners: np.ndarray, axis: int) -> np.ndarray:
    """(m,) by how much facets with these corners (dim, dim, m) turn away from the direction of the axis: 0 if they contain it."""
    edges = corners[:, 1:] - corners[:, :1]
    across = np.stack([edges[1, 0], -edges[0, 0]]) if len(corners) == 2 else np.cross(edges[:, 0], edges[:, 1], axis=0)
    sine = np.abs(across[axis]) / np.linalg.norm(across, axis=0)
    return np.asarray(np.where(sine < 1e-9, 0.0, sine))


def _on_curves(mesh: Any, first: int, side: Side, curve_of: Callable[[str], Any]) -> Any:
    """The mesh with its new nodes, from number `first` on, on the curves of its contact boundaries."""
    points = mesh.p.copy()
    for name, facets in (mesh.boundaries or {}).items():
        curve = curve_of(name)
        nodes = np.unique(mesh.facets[:, facets])
        nodes = nodes[nodes >= first]
        if curve is not None and len(nodes):
            points[:, nodes] = curve(points[:, nodes])
            points[side.axis, nodes] = side.place
    return replace(mesh, doflocs=points)
