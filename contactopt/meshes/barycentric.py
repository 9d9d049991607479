"""Where points are beside straight facets: edges in the plane, triangles in space."""

from typing import NamedTuple

import numpy as np

from contactopt.meshes.cells import area_vectors


class Frames(NamedTuple):
    """Edges in the plane or triangles in space, prepared for `barycentric`.

    origin  (dim, f) their first corners
    dual    (dim - 1, dim, f) slopes of the barycentric coordinates of the other corners
    normal  (dim, f) unit normals over the sizes of the facets
    """

    origin: np.ndarray
    dual: np.ndarray
    normal: np.ndarray


def frames_of(corners: np.ndarray) -> Frames:
    """Those of facets with corners (dim, dim, f)."""
    edges = corners[:, 1:] - corners[:, :1]
    normal, size = area_vectors(corners), np.sqrt(np.sum(edges**2, axis=(0, 1)))
    normal = normal / np.linalg.norm(normal, axis=0)
    if len(corners) == 2:
        dual = edges / size**2
    else:
        first, second = edges[:, 0], edges[:, 1]
        across = np.cross(second, normal, axis=0), np.cross(normal, first, axis=0)
        content = np.sum(normal * np.cross(first, second, axis=0), axis=0)
        dual = np.stack(across, axis=1) / content
    return Frames(corners[:, 0], dual.swapaxes(0, 1), normal / size)


def barycentric(
    frames: Frames, which: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where points (dim, m) are beside the facets `which` (m,) or (m, c).

    Returns barycentric coordinates (dim, m) or (dim, m, c) of the nearest points of the lines or
    planes, and distances (m,) or (m, c) over the sizes of the facets.
    """
    x = points.reshape(*points.shape, *[1] * (which.ndim - 1))
    offset = [own - first[which] for own, first in zip(x, frames.origin)]

    def along(rows: np.ndarray) -> np.ndarray:
        return np.asarray(sum(row[which] * own for row, own in zip(rows, offset)))

    others = [along(rows) for rows in frames.dual]
    every = np.stack([1 - sum(others), *others])
    return every, np.maximum(-every.min(axis=0), 0) + np.abs(along(frames.normal))
