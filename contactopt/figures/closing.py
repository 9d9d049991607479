"""Gaps and overlaps that bodies have before they are loaded, drawn as large as displacements.

Displacements are drawn s times as large, as X + s u. Where surfaces with an initial gap g along n
touch, n . (u_upper - u_lower) = -g, so that X + s u would draw them (s - 1) g apart. A field d on
the bodies with n . (d_upper - d_lower) = g on their surfaces closes them: X + s u + (s - 1) d draws
s times the gap that there is, and none where they touch.
"""

from collections.abc import Iterable

import numpy as np
from scipy.spatial import KDTree


def closing(
    points: np.ndarray,
    surfaces: Iterable[tuple[np.ndarray, np.ndarray]],
    mirrors: Iterable[tuple[int, float]] = (),
) -> np.ndarray:
    """The field d (n, dim) on the nodes `points` (n, dim) of a body.

    On the surface of an upper body d = g n, of a lower one 0. Elsewhere it is the mean of d at the
    nearest contacts of `surfaces` (places (k, dim) and d there), weighted by 1 / distance^2, and
    goes to zero across the planes `mirrors`, (axis, place) each.
    """
    weights, found = np.zeros(len(points)), np.zeros(points.shape)
    for places, values in surfaces:
        distance, nearest = KDTree(places).query(points)
        weight = 1.0 / np.maximum(distance, 1e-9 * (1e-300 + np.ptp(points))) ** 2
        weights, found = weights + weight, found + weight[:, None] * values[nearest]
    d = np.divide(found, weights[:, None], out=found, where=weights[:, None] > 0)
    for axis, place in mirrors:
        away = np.abs(points[:, axis] - place)
        far = np.divide(1.0, np.sqrt(weights), out=np.zeros(len(d)), where=weights > 0)
        d[:, axis] *= np.divide(away, away + far, out=np.ones(len(d)), where=away + far > 0)
    return d


def gap_vectors(gap: np.ndarray, normals: np.ndarray, upper: bool) -> np.ndarray:
    """d (k, dim) on one surface of a pair, from the initial gap (k,) along normals (k, dim)."""
    return gap[:, None] * normals * upper
