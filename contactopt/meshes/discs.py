"""Half discs and bodies that rise from them: rings of any radii around a core of squares."""

from itertools import pairwise

import numpy as np
from skfem import MeshHex


def half_disc(radii: np.ndarray, sectors: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (2, n) [length] and quadrilaterals (4, m) of the half disc y >= 0, with rings of nodes
    at the ascending radii from 0 up and as many elements as `sectors` along an eighth of the
    circle.

    The innermost rings are squares; those from number 2 sectors on are circles, with a gradual
    change between. The first 2 sectors + 1 radii are evenly spaced.
    """
    i, j = (np.indices((2 * sectors + 1, sectors + 1)) - [[[sectors]], [[0]]]).reshape(2, -1)
    ring = np.maximum(np.abs(i), j)
    # along the ring, from y = 0
    place = np.where(i == ring, j, np.where(j == ring, 2 * ring - i, 4 * ring - j))
    parts = np.maximum(ring, 1)
    core = _on_ring(ring, place, np.stack([i, j]) / parts, parts, radii, sectors)
    rim = np.flatnonzero(ring == sectors)
    rim = rim[np.argsort(place[rim])]
    square, parts = np.stack([i, j])[:, rim] / sectors, parts[rim]
    outer = [
        _on_ring(0 * rim + k, place[rim], square, parts, radii, sectors)
        for k in range(sectors + 1, len(radii))
    ]
    p = np.concatenate([core, *outer], axis=1)
    index = np.arange(len(i)).reshape(2 * sectors + 1, sectors + 1)
    cells = [
        np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]]).reshape(4, -1)
    ]
    rings = [rim, *(len(i) + len(rim) * np.arange(len(outer))[:, None] + np.arange(len(rim)))]
    cells += [np.stack([a[:-1], b[:-1], b[1:], a[1:]]) for a, b in pairwise(rings)]
    return p, np.concatenate(cells, axis=1)


def _on_ring(
    ring: np.ndarray,
    place: np.ndarray,
    square: np.ndarray,
    count: np.ndarray,
    radii: np.ndarray,
    sectors: int,
) -> np.ndarray:
    """Points of rings divided into 4 count parts, between the square and the circle."""
    angle = np.pi * place / (4 * count)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    circle[1, place == 4 * count] = 0.0
    share = np.minimum(1.0, ring / (2 * sectors))
    return np.asarray(radii[ring] * ((1 - share) * square + share * circle))


def extrude(p: np.ndarray, t: np.ndarray, z: np.ndarray) -> MeshHex:
    """Stack bricks over a plane mesh of quadrilaterals (4, m), between heights z [length]."""
    n, levels = p.shape[1], len(z)
    points = np.concatenate([np.tile(p, levels), np.repeat(z, n)[None]])
    a, b, c, d = (corner + n * np.arange(levels - 1)[:, None] for corner in t)
    up = n
    bricks = np.stack([a, a + up, d, b, d + up, b + up, c, c + up]).reshape(8, -1)
    return MeshHex(points, bricks)
