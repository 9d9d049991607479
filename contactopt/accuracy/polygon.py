"""What is not known of a boundary that a mesh gives by straight edges alone.

The smooth line through the nodes of a polygon is a guess. At every node the circle through it and
its neighbours has a curvature. Where the two ends of an edge have the same one, the line between
them is well known; where they differ, as where a straight flank meets a fillet, the curvature of
the edge may be that of either end. An edge of length c whose curvature is uncertain by dk leaves
its place open by

    dk c^2 / 8 * 4 t (1 - t)    at the share t of its length,    dk half of what the ends differ.

The quantity is read once more from the other shape, in which every edge has the smaller curvature
of its two ends. What it changes is the error of the geometry, which no refinement removes.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.spatial import cKDTree
from skfem import Mesh

from contactopt.meshes.facet_surfaces import SAME

# begin, end (2, f) and sagitta in doubt (f,) [length]
Chords = tuple[np.ndarray, np.ndarray, np.ndarray]
NEAREST = 8  # edges among which that of a point is looked for


def other_polygon(mesh: Mesh, facets: np.ndarray) -> Callable[[np.ndarray], np.ndarray] | None:
    """The other shape of a plane boundary, by points on the smooth line; None without doubt."""
    chords = chords_of(mesh, facets)
    return partial(flatter, chords=chords) if np.any(chords[2] > 0) else None


def chords_of(mesh: Mesh, facets: np.ndarray) -> Chords:
    """Begin and end of a plane boundary's straight edges, and the doubt about their middles."""
    edges, points = mesh.facets[:, facets], mesh.p
    count = points.shape[1]
    curvature = np.full(count, np.nan)
    order = np.argsort(edges.ravel(), kind="stable")
    nodes, first, each = np.unique(edges.ravel()[order], return_index=True, return_counts=True)
    other = np.roll(edges, 1, axis=0).ravel()[order]
    inner = each == 2
    a, b = points[:, other[first[inner]]], points[:, nodes[inner]]
    c = points[:, other[first[inner] + 1]]
    u, v = b - a, c - b
    area = u[0] * v[1] - u[1] * v[0]
    product = np.prod([np.linalg.norm(side, axis=0) for side in (u, v, c - a)], axis=0)
    curvature[nodes[inner]] = np.abs(2 * area) / product  # that of the circle through three nodes
    begin, end = points[:, edges[0]], points[:, edges[1]]
    ends = curvature[edges]
    apart = np.ptp(ends, axis=0) / 2
    apart[apart <= SAME * ends.max(axis=0)] = 0.0
    return begin, end, np.nan_to_num(apart) * np.sum((end - begin) ** 2, axis=0) / 8


def flatter(points: np.ndarray, chords: Chords) -> np.ndarray:
    """Move points (2, m) on the smooth line towards the polygon by what is in doubt."""
    begin, end, doubt = chords
    count = min(NEAREST, begin.shape[1])
    near = cKDTree(((begin + end) / 2).T).query(points.T, k=count)[1].reshape(-1, count)
    along = end[:, near] - begin[:, near]
    share = np.sum((points[:, :, None] - begin[:, near]) * along, axis=0) / np.sum(along**2, axis=0)
    share = np.clip(share, 0, 1)
    foot = begin[:, near] + share * along
    distance = np.linalg.norm(points[:, :, None] - foot, axis=0)
    best = np.argmin(distance, axis=1)
    rows = np.arange(len(best))
    t, size = share[rows, best], distance[rows, best]
    moved = np.minimum(doubt[near[rows, best]] * 4 * t * (1 - t), size)
    way = foot[:, rows, best] - points
    return np.asarray(
        points + way * np.divide(moved, size, out=np.zeros_like(size), where=size > 0)
    )
