"""Which facets of two surfaces may face each other: the pairs that a line along a normal of the
first meets.

An own facet sees along a cone of directions: its normals. Both surfaces are halved again and again
into clusters of near facets. A cluster is enclosed in a ball, and its directions in a cone. Pairs
of clusters that no line joins are left out with all facets in them. What remains lies in the tubes
over the own facets, however long these are. So cost and memory grow with the number of pairs that
do face each other, and not with the gap.

**No pair is missed.** Let a line from the point p of a facet, along its normal n, meet another
facet at q = p + t n. Let these facets lie in the balls of their clusters, with centres a and b, and
let R be the sum of the radii. Then v = b - a differs from t n by at most R. So either |v| <= R, or
v is off the line of n by an angle of at most arcsin(R / |v|), and off the axis of the cluster's
cone by at most this angle and the half-angle of the cone. Both conditions are tested.

Source of halving both sets at once: Gottschalk, Lin, Manocha (1996), OBBTree: a hierarchical
structure for rapid interference detection, Proc. SIGGRAPH 96, 171-180.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contactopt.defaults import CLOSE


@dataclass(frozen=True, eq=False)
class Facets:
    """n facets, or clusters of facets.

    centre  (dim, n) and
    radius  (n,) of a ball around each [length]
    axis    (dim, n) unit vector and
    angle   (n,) half-angle of a cone that holds the normals of each
    """

    centre: np.ndarray
    radius: np.ndarray
    axis: np.ndarray
    angle: np.ndarray

    def take(self, some: np.ndarray) -> Facets:
        """The facets with the numbers `some`."""
        return Facets(self.centre[:, some], self.radius[some], self.axis[:, some], self.angle[some])

    def spread(self, places: np.ndarray, count: int) -> Facets:
        """The facets at some places among `count`; at all other places there is none."""
        number = np.full(count, -1)
        number[places] = np.arange(len(places))
        made = self.take(number)
        made.radius[number < 0] = np.nan
        return made


def facing_pairs(own: Facets, other: Facets, facing: float) -> tuple[np.ndarray, np.ndarray]:
    """All pairs of facets of which the first may see the second along its normals, on either side:
    numbers (j,) sorted by the own one. Facets face each other with a cosine below `facing` <= 0.
    """
    trees = [_tree(facets) for facets in (own, other)]
    first, second = np.zeros(1, dtype=int), np.zeros(1, dtype=int)
    depths = [len(levels) for levels, _ in trees]
    for level in range(max(depths)):
        # Each pair gives way to those of the halves, as long as there are any.
        k, m = (2 if 0 < level < depth else 1 for depth in depths)
        first = np.repeat(k * first[:, None] + np.arange(k), m, axis=1).ravel()
        second = np.tile(m * second[:, None] + np.arange(m), k).ravel()
        near, far = (levels[min(level, len(levels) - 1)] for levels, _ in trees)
        seen = _seen(near.take(first), far.take(second), facing)
        first, second = first[seen], second[seen]
    first, second = trees[0][1][first], trees[1][1][second]
    order = np.lexsort((second, first))
    return first[order], second[order]


def _seen(own: Facets, other: Facets, facing: float) -> np.ndarray:
    """Whether (n,) some line along a direction of each own cluster may meet its partner."""
    v, reach = other.centre - own.centre, own.radius + other.radius
    along = np.sum(v * own.axis, axis=0)
    distance = np.linalg.norm(v, axis=0)
    off = np.arctan2(np.linalg.norm(v - along * own.axis, axis=0), np.abs(along))
    spread = np.arcsin(np.minimum(reach / np.maximum(distance, 1e-300), 1.0))
    met = (distance <= reach) | (off <= own.angle + spread + CLOSE)
    turned = np.arccos(np.clip(-np.sum(own.axis * other.axis, axis=0), -1.0, 1.0))
    return np.asarray(met & (turned <= own.angle + other.angle + np.arccos(-facing) + CLOSE))


def _tree(facets: Facets) -> tuple[list[Facets], np.ndarray]:
    """Clusters of every level, from one to as many as there are facets, and the facets of the last.
    Cluster c is halved, across its longest side, into 2 c and 2 c + 1 of the next level; those that
    stay empty have the radius nan, so that they are never seen.
    """
    n = len(facets.radius)
    order, levels = np.arange(n), []
    for level in range(int(np.ceil(np.log2(n))) + 1):
        bounds = np.arange(2**level + 1) * n // 2**level
        used = np.flatnonzero(np.diff(bounds))
        start, cluster = bounds[used], np.repeat(np.arange(len(used)), np.diff(bounds)[used])
        x = facets.centre[:, order]
        low, high = np.minimum.reduceat(x, start, axis=1), np.maximum.reduceat(x, start, axis=1)
        made = _clusters(facets.take(order), (low + high) / 2, start, cluster)
        levels.append(made.spread(used, 2**level))
        widest = x[np.argmax(high - low, axis=0)[cluster], np.arange(n)]
        if level < np.log2(n):
            order = order[np.lexsort((widest, cluster))]
    last = np.zeros(len(bounds) - 1, dtype=int)
    last[used] = order
    return levels, last


def _clusters(facets: Facets, centre: np.ndarray, start: np.ndarray, cluster: np.ndarray) -> Facets:
    """Balls and cones of clusters: each begins at `start`; `cluster` is that of each facet."""
    axis = np.add.reduceat(facets.axis, start, axis=1)
    length = np.linalg.norm(axis, axis=0)
    axis = np.where(length > 0, axis, facets.axis[:, start]) / np.where(length > 0, length, 1.0)
    away = np.linalg.norm(facets.centre - centre[:, cluster], axis=0) + facets.radius
    turn = np.sum(facets.axis * axis[:, cluster], axis=0).clip(-1.0, 1.0)
    angle = np.maximum.reduceat(np.arccos(turn) + facets.angle, start)
    return Facets(centre, np.maximum.reduceat(away, start), axis, angle)
