"""Pictures of solid bodies in a parallel projection, with a depth buffer: what is nearer hides what
is behind it, in every pixel.

Matplotlib has no depth buffer. It sorts whole faces, which cannot be right for large faces beside
small ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable

LINE = 0.7  # half of the width of a mesh line [pixels]
DARK, DIM = 0.65, 0.82  # brightness of mesh lines and of faces seen along their plane
EDGE = 1e-6  # pixels by which triangles are enlarged, so that nothing shows between them
BLOCK = 1_000_000  # pixels of triangles that are looked at together


def seen_from(elevation: float, azimuth: float) -> np.ndarray:
    """The axes of a picture in columns (3, 3): right, up, towards the eye; angles in degrees."""
    e, a = np.radians(elevation), np.radians(azimuth)
    eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.stack([right, np.cross(eye, right), eye], axis=1)


def picture(
    corners: np.ndarray, values: np.ndarray, lined: np.ndarray, colours: ScalarMappable, pixels: int
) -> tuple[np.ndarray, tuple[float, float, float, float]]:
    """Triangles (m, 3, 3), as they are seen, as an image (h, w, 4), its first row below, and its
    extent. `values` (m, 3) at the corners get `colours`; edges opposite to a corner that are
    `lined` (m, 3) get a line; `pixels` are of the longer side.
    """
    low, high = corners[..., :2].min(axis=(0, 1)), corners[..., :2].max(axis=(0, 1))
    scale = (pixels - 2) / float((high - low).max())
    width, height = np.ceil((high - low) * scale).astype(int) + 2
    placed = corners.copy()
    placed[..., :2] = (corners[..., :2] - low) * scale + 1.0
    owner = nearest(placed, (int(height), int(width)))
    image = np.zeros((height, width, 4))
    rows, columns = np.nonzero(owner >= 0)
    own = owner[rows, columns]
    share = _shares(placed[..., :2], own, columns + 0.5, rows + 0.5)
    shown = np.asarray(colours(np.einsum("pi,pi->p", share, values[own])))
    tall = _heights(placed[..., :2])
    near = np.where(lined & (tall.min(axis=1) > 6.0)[:, None], tall, np.inf)  # pixels of height
    # share of a corner up to which a pixel is near the edge opposite to it; nothing is near no edge
    near = LINE / near
    line = np.any(share < near[own], axis=1)
    shown[:, :3] *= np.where(line, DARK, _light(placed * [1 / scale, 1 / scale, 1])[own])[:, None]
    image[rows, columns] = shown
    left, bottom = low - 1.0 / scale
    return image, (left, left + width / scale, bottom, bottom + height / scale)


def nearest(corners: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """The triangle nearest to the eye at every pixel or -1; `corners` (m, 3, 3) in pixels."""
    depth = np.full(shape[0] * shape[1], -np.inf)
    owner = np.full(shape[0] * shape[1], -1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    left = np.flatnonzero(normals[:, 2] != 0)
    # pixels and rows, about
    sizes = np.abs(normals[left, 2]) / 2 + np.ptp(corners[left, :, 1], axis=1) + 1
    for some in np.split(left, np.flatnonzero(np.diff(np.cumsum(sizes) // BLOCK)) + 1):
        triangle, row, column = _pixels(corners[some, :, :2], shape)
        chosen = some[triangle]
        apart = np.stack([column, row], axis=1) + 0.5 - corners[chosen, 0, :2]
        distance = (
            corners[chosen, 0, 2] - np.sum(normals[chosen, :2] * apart, axis=1) / normals[chosen, 2]
        )
        where = row * shape[1] + column
        np.maximum.at(depth, where, distance)
        first = distance == depth[where]
        owner[where[first]] = chosen[first]
    return owner.reshape(shape)


def _pixels(
    corners: np.ndarray, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangle, row and column of all pixels whose middles lie in triangles (m, 3, 2)."""
    first = np.maximum(np.ceil(corners[..., 1].min(axis=1) - 0.5 - EDGE).astype(int), 0)
    last = np.minimum(np.floor(corners[..., 1].max(axis=1) - 0.5 + EDGE).astype(int), shape[0] - 1)
    triangle, row = _ranges(first, last)
    height, ends = row + 0.5, []
    for i in range(3):
        (x, y), (other_x, other_y) = corners[triangle, i].T, corners[triangle, i - 1].T
        with np.errstate(all="ignore"):
            share = (height - y) / (other_y - y)
            within = (share >= -EDGE) & (share <= 1 + EDGE)
            ends.append(np.where(within, x + share * (other_x - x), np.nan))
    left = np.fmin(np.fmin(ends[0], ends[1]), ends[2])
    right = np.fmax(np.fmax(ends[0], ends[1]), ends[2])
    met = np.isfinite(left)
    triangle, row = triangle[met], row[met]
    first = np.maximum(np.ceil(left[met] - 0.5 - EDGE).astype(int), 0)
    last = np.minimum(np.floor(right[met] - 0.5 + EDGE).astype(int), shape[1] - 1)
    span, column = _ranges(first, last)
    return triangle[span], row[span], column


def _ranges(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The whole numbers from first to last of each pair, and before them the number of the pair."""
    count = np.maximum(last - first + 1, 0)
    pair = np.repeat(np.arange(len(first)), count)
    return pair, first[pair] + np.arange(len(pair)) - (np.cumsum(count) - count)[pair]


def _shares(corners: np.ndarray, own: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (p, 3) of places (x, y) in the triangles `own` (p,) of (m, 3, 2)."""
    after, before = np.roll(corners, -1, axis=1), np.roll(corners, 1, axis=1)
    normals = np.stack([after[..., 1] - before[..., 1], before[..., 0] - after[..., 0]])
    with np.errstate(all="ignore"):  # triangles seen from the side own no pixel
        slopes = normals / _twice_area(corners)[:, None]
    across, up = slopes[:, own]
    foot = after[own]  # on the edge opposite to each corner
    return np.asarray(across * (x[:, None] - foot[..., 0]) + up * (y[:, None] - foot[..., 1]))


def _twice_area(corners: np.ndarray) -> np.ndarray:
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _heights(corners: np.ndarray) -> np.ndarray:
    """Heights (m, 3) of the corners of triangles over the opposite edges."""
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1), axis=2)
    return np.abs(_twice_area(corners))[:, None] / np.maximum(edges, 1e-300)


def _light(corners: np.ndarray) -> np.ndarray:
    """Brightness (m,): one for faces seen from the front."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    return np.asarray(DIM + (1 - DIM) * np.abs(normals[:, 2]) / size)


def draw_frame(
    ax: Axes, view: np.ndarray, low: np.ndarray, high: np.ndarray, labels: Sequence[str]
) -> None:
    """Three edges of the box from `low` to `high`, free of the bodies, as axes with ticks."""
    from matplotlib.ticker import MaxNLocator

    letters = ax.xaxis.label.get_size()
    left = np.array([low[0], high[1], low[2]])  # the foot of the upright edge furthest to the left
    places = ((low, (5, -6), "left"), (low, (-5, -6), "right"), (left, (-5, 0), "right"))
    line = {"color": "black", "zorder": 3}
    lengths = (high - low) * np.linalg.norm(view[:, :2], axis=1)  # as drawn
    ticks = np.maximum(1, np.round(6 * lengths / lengths.max())).astype(int)  # of an axis, at most
    for axis, (foot, shift, align) in enumerate(places):
        end = foot.copy()
        end[axis] = high[axis]
        ends = np.stack([foot, end]) @ view
        ax.plot(ends[:, 0], ends[:, 1], lw=0.6, **line)
        options = {"textcoords": "offset points", "ha": align, "va": "center"}
        mark = {"marker": "_" if axis == 2 else "|", "ms": 4, "mew": 0.6}
        for value in MaxNLocator(ticks[axis], steps=[1, 2, 5, 10]).tick_values(
            low[axis], high[axis]
        ):
            if low[axis] <= value <= high[axis]:
                place = foot.copy()
                place[axis] = value
                x, y, _ = place @ view
                ax.plot([x], [y], **mark, **line)
                ax.annotate(f"{value:.6g}", (x, y), shift, fontsize=0.85 * letters, **options)
        middle = ends[:, :2].mean(axis=0)
        ax.annotate(
            labels[axis], middle, (4 * shift[0], 2.5 * shift[1]), fontsize=letters, **options
        )
