"""Pieces of the boundary of a body as sets of points, compared by where they lie and never by how they are meshed.

A region is covered by segments or triangles. Region A lies on region B if a few points inside every facet of A are no farther
from B than a tolerance. Where a boundary is curved, a mesh knows it only up to the height of the arc above its chord, about
an eighth of the length of a facet times the turn to its neighbours; both meshes may miss the curve by so much.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import KDTree

NEAR = 1e-8  # what counts as zero beside the size of the scene
CORNER = np.deg2rad(30)  # turn between neighbouring facets from which on the edge between them is a corner, not a curve
ARC = 0.25  # height of an arc above its chord over length times turn: an eighth, and a margin for uneven facets
MOST = 32  # points at which a slender facet is looked for
CLOSEST = 4, 48  # points of each size among which the closest facet is looked for, first and where that did not help
INSIDE = {2: np.array([[0.5, 0.9, 0.1]]), 3: np.array([[1, 0.8, 0.1, 0.1], [1, 0.1, 0.8, 0.1]]) / [[3, 1, 1, 1]]}


@dataclass(frozen=True, eq=False)
class Region:
    """Boundary facets as simplices: corners (dim, dim, m), the second index counts the corners; neighbours know `slack` (m,).

    slack  how far a curved boundary may be from each facet [length]; zero where the boundary is flat
    """

    corners: np.ndarray
    slack: np.ndarray

    @cached_property
    def edges(self) -> np.ndarray:
        """(dim, dim - 1, m) from the first corner to the others."""
        return np.asarray(self.corners[:, 1:] - self.corners[:, :1])

    @cached_property
    def normals(self) -> np.ndarray:
        """(dim, m) unit normals, of either sense."""
        return _normals(self.corners)[0]

    @cached_property
    def areas(self) -> np.ndarray:
        """(m,) lengths or areas."""
        return _normals(self.corners)[1]

    @cached_property
    def samples(self) -> tuple[np.ndarray, np.ndarray]:
        """Points inside the facets (dim, s) and the facet of each (s,); the centres come first."""
        dim, m = len(self.corners), self.corners.shape[2]
        weights = INSIDE[dim]
        points = self.corners[:, :1] + np.einsum("daf,as->dsf", self.edges, weights)
        return points.reshape(dim, -1), np.tile(np.arange(m), weights.shape[1])

    @cached_property
    def _classes(self) -> list[tuple[KDTree, np.ndarray]]:
        """Points on the facets, in classes of facets of about equal height, with the facet of each point."""
        anchors, facet, height = _anchors(self.corners)
        number = np.floor(np.log2(height / height.min())).astype(int)
        return [
            (KDTree(anchors[:, own].T), facet[own]) for own in (np.flatnonzero(number == c) for c in np.unique(number))
        ]

    def distance(self, points: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
        """How far points (dim, s) are from the region (s,), and the closest facet of each (s,), among `most` of each size."""
        near = []
        for tree, own in self._classes:
            count = min(most, len(own))
            near.append(own[np.asarray(tree.query(points.T, k=count)[1]).reshape(-1, count)])
        facets = np.concatenate(near, axis=1)  # (s, candidates)
        edges, offset = self.edges[:, :, facets], points[:, :, None] - self.corners[:, 0][:, facets]
        gram = np.einsum("iasc,ibsc->scab", edges, edges)
        weights = np.linalg.solve(gram, np.einsum("iasc,isc->sca", edges, offset)[..., None])[..., 0]
        weights = np.maximum(weights, 0.0)
        weights /= np.maximum(weights.sum(axis=-1, keepdims=True), 1.0)
        apart = np.linalg.norm(offset - np.einsum("iasc,sca->isc", edges, weights), axis=0)
        best = np.argmin(apart, axis=1)
        rows = np.arange(len(best))
        return apart[rows, best], facets[rows, best]


def _anchors(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (dim, s) at half the height of each facet, as many along its longest side as it is slender; facet, height (s,).

    The place of a slender facet is not known from its centre alone.
    """
    dim, m = len(corners), corners.shape[2]
    if dim == 2:
        return corners.mean(axis=1), np.arange(m), np.linalg.norm(corners[:, 1] - corners[:, 0], axis=0)
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=0)  # (3, m), from corner i to corner i + 1
    first, every = np.argmax(sides, axis=0), np.arange(m)
    P, Q, R = (corners[:, (first + turn) % 3, every] for turn in range(3))
    long = Q - P
    foot = np.sum(long * (R - P), axis=0) / np.sum(long**2, axis=0)
    up = R - P - foot * long
    height = np.linalg.norm(up, axis=0)
    count = np.clip(np.ceil(sides[first, every] / height / 2), 1, MOST).astype(int)
    facet = np.repeat(every, count)
    t = (np.arange(len(facet)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[facet]
    rise = np.minimum(t / np.maximum(foot[facet], 1e-12), (1 - t) / np.maximum(1 - foot[facet], 1e-12)).clip(0, 1) / 2
    return P[:, facet] + t * long[:, facet] + rise * up[:, facet], facet, height[facet]


def region(mesh: Any, facets: np.ndarray) -> Region:
    """The region of some boundary facets of a mesh (contactopt.scenes.scene.Part)."""
    points, numbers = mesh.p, mesh.facets[:, np.asarray(facets)]
    slack = _slack(points, numbers)
    if len(numbers) == 4:  # the sides of hexahedra, as two triangles each
        numbers = np.concatenate([numbers[[0, 1, 2]], numbers[[0, 2, 3]]], axis=1)
        slack = np.tile(slack, 2)
    return Region(points[:, numbers], slack)


def _slack(points: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """(m,) ARC times the size of each facet times its turn to those neighbours between which there is no corner."""
    corners, dim = points[:, numbers], len(points)
    normals = _normals(corners[:, :dim])[0]
    m = numbers.shape[1]
    if dim == 2:
        keys, facet = numbers.ravel(), np.tile(np.arange(m), 2)
    else:
        rims = np.stack([np.sort(numbers[[i, i - 1]], axis=0) for i in range(len(numbers))])  # (edges, 2, m)
        keys = (rims[:, 0].astype(np.int64) * (points.shape[1] + 1) + rims[:, 1]).ravel()
        facet = np.tile(np.arange(m), len(numbers))
    order = np.argsort(keys, kind="stable")
    keys, facet = keys[order], facet[order]
    pairs = np.flatnonzero(keys[1:] == keys[:-1])
    one, other = facet[pairs], facet[pairs + 1]
    cosine = np.abs(np.sum(normals[:, one] * normals[:, other], axis=0)).clip(0.0, 1.0)
    turn = np.arccos(cosine)
    turn[(turn > CORNER) | (turn < 1e-6)] = 0.0
    most = np.zeros(m)
    np.maximum.at(most, one, turn)
    np.maximum.at(most, other, turn)
    size = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=0).max(axis=0)
    return np.asarray(ARC * size * most)


def _normals(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    edges = corners[:, 1:] - corners[:, :1]
    if len(corners) == 2:
        across, half = np.stack([edges[1, 0], -edges[0, 0]]), 1.0
    else:
        across, half = np.cross(edges[:, 0], edges[:, 1], axis=0), 0.5
    length = np.linalg.norm(across, axis=0)
    return across / np.maximum(length, 1e-300), half * length


def same(one: Region, other: Region, move: Any, back: Any, size: float) -> float | None:
    """How far two regions are apart once `move` has put the first on the second, and `back` the second on the first.

    Parameters
    ----------
    one, other : the regions
    move, back : functions (dim, s) -> (dim, s)
    size : of the scene [length], beside which rounding is small

    Returns
    -------
    The largest distance of the sampled points [length], or None if one of them is farther away than it may be.
    """
    there, back_again = _farthest(one, other, move, size), None
    if there is not None:
        back_again = _farthest(other, one, back, size)
    return None if there is None or back_again is None else max(there, back_again)


def inside(one: Region, other: Region, move: Any, size: float) -> bool:
    """Whether `move` puts all of the first region on the second."""
    return _farthest(one, other, move, size) is not None


def _farthest(one: Region, other: Region, move: Any, size: float) -> float | None:
    """The largest distance of moved samples of a region from another one; None if one is farther away than it may be."""
    worst = 0.0
    for points, facet in _portions(one):
        moved, apart, beyond = move(points), np.zeros(len(facet)), np.ones(len(facet), dtype=bool)
        for most in CLOSEST:
            apart[beyond], there = other.distance(moved[:, beyond], most)
            allowed = NEAR * size + one.slack[facet[beyond]] + other.slack[there]
            beyond[beyond] = apart[beyond] > allowed
            if not beyond.any():
                break
        if beyond.any():
            return None
        worst = max(worst, float(apart.max(initial=0.0)))
    return worst


def _portions(one: Region) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """The samples of a region: a few of them first, so that what does not fit is soon known."""
    points, facet = one.samples
    few = np.arange(0, len(facet), max(1, len(facet) // 100))
    yield points[:, few], facet[few]
    if len(facet) > len(few):
        yield points, facet
