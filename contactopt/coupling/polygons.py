"""Plane polygons: their areas, and their parts within convex windows.

Source of the cut: Sutherland, Hodgman (1974), Reentrant polygon clipping, Commun. ACM 17, 32-42.
"""

from __future__ import annotations

import numpy as np


def areas(polygons: np.ndarray) -> np.ndarray:
    """Signed areas (p,) of polygons (p, v, 2)."""
    x, y = polygons[..., 0], polygons[..., 1]
    return np.asarray(np.sum(x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1), axis=1) / 2)


def clip(polygon: np.ndarray, window: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Parts (p, v', 2) of polygons (p, v, 2) in convex counterclockwise windows (p, w, 2) of `size`
    (p,), padded by the last vertex; zero if empty.
    """
    count = np.full(len(polygon), polygon.shape[1])
    for edge in range(window.shape[1]):
        a, b = window[:, edge], window[:, (edge + 1) % window.shape[1]]
        inward = np.stack([a[:, 1] - b[:, 1], b[:, 0] - a[:, 0]], axis=1)
        inward /= np.linalg.norm(inward, axis=1)[:, None]
        place = np.arange(polygon.shape[1])
        used = place < count[:, None]
        following = np.where(place == count[:, None] - 1, 0, np.minimum(place + 1, place[-1]))
        inside = np.einsum("pva,pa->pv", polygon - a[:, None], inward)
        inside = np.where(np.abs(inside) < 1e-13 * size[:, None], 0.0, inside)
        then = np.take_along_axis(inside, following, 1)
        ahead = np.take_along_axis(polygon, following[..., None], 1)
        crossing = used & (inside * then < 0)
        share = inside / np.where(crossing, inside - then, 1.0)
        cut = polygon + share[..., None] * (ahead - polygon)
        candidates = np.stack([polygon, cut], axis=2).reshape(len(polygon), -1, 2)
        chosen = np.stack([used & (inside >= 0), crossing], axis=2).reshape(len(polygon), -1)
        count = chosen.sum(axis=1)
        order = np.argsort(~chosen, axis=1, kind="stable")[:, : max(count.max(initial=0), 3)]
        polygon = np.take_along_axis(candidates, order[..., None], 1)
        last = np.take_along_axis(polygon, np.maximum(count - 1, 0)[:, None, None], 1)
        polygon = np.where((np.arange(polygon.shape[1]) < count[:, None])[..., None], polygon, last)
        polygon[count == 0] = 0.0
    return polygon
