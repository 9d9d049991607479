"""Stresses of degree k on a triangle that its centroid cuts into three parts.

They are symmetric, on each part a polynomial of degree k, and have continuous tractions. Tractions
on the outer edges may be any polynomials of degree k, also with a jump at a vertex, and so may be
the divergence of degree k - 1 on each part, as long as forces and moments balance.

Source: Johnson, Mercier (1978), Some equilibrium finite element methods for two-dimensional
elasticity problems, Numer. Math. 30, for k = 1; Gopalakrishnan, Guzman, Lee (2024), The
Johnson-Mercier elasticity element in any dimensions, for others.
"""

from dataclasses import dataclass
from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from contactopt.defaults import EQUAL

QUADRATURE = {1: 4, 2: 6}  # degree of the rule on each part by that of the stress
OTHERS = ((1, 2), (0, 2), (0, 1))  # vertices of the edge opposite each vertex
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
PAIRS = ((0, 0), (1, 1), (0, 1))  # components of a symmetric matrix


class SplitTriangle(NamedTuple):
    """The n stresses of degree k on the triangle with the vertices (0, 0), (1, 0) and (0, 1).

    shares      (3, 3, s) at s points of each part those of the vertices of the triangle
    weights     (s,) of an integral over the area of a part
    stress      (3, s, 3, n) components 00, 11 and 01 at these points
    divergence  (3, s, 2, n) there
    nodes       (3, d, 2, n) divergence at d points of each part that determine it
    lever       (3, 3, d) shares of the vertices of the triangle at these
    tractions   (3, k + 1, 2, n) on the edge opposite each vertex, times its length, at points from
                its first end to its second
    """

    shares: np.ndarray
    weights: np.ndarray
    stress: np.ndarray
    divergence: np.ndarray
    nodes: np.ndarray
    lever: np.ndarray
    tractions: np.ndarray


@cache
def split_triangle(k: int, free: int | None = None) -> SplitTriangle:
    """The stresses of degree k; those without tractions on the edge opposite a given vertex."""
    parts, line = [_part(number, k) for number in range(3)], np.linspace(0, 1, k + 1)
    forwards = np.stack([1 - line, line, 0 * line])
    conditions = []
    for v in range(
        3
    ):  # on the line from a vertex to the centroid the tractions of both parts agree
        tractions: list[np.ndarray] = []
        for part, (ends, own) in enumerate(zip(OTHERS, parts)):
            if part != v:
                place = ends.index(v)
                values = own.values(np.roll(forwards if place else forwards[:, ::-1], 2 - place, 0))
                tractions.append(_traction(values, own.normals[2 - place]))
        conditions.append(np.sum(tractions, axis=0))
    if free is not None:  # t' S t on this edge with the direction t
        t = CORNERS[OTHERS[free][1]] - CORNERS[OTHERS[free][0]]
        along = np.einsum("scn,c->sn", _traction(parts[free].values(forwards), t), t)
        conditions.append(along[:, None])
    basis = null_space(
        np.concatenate([own.reshape(-1, own.shape[-1]) for own in conditions]), EQUAL
    )
    x, w = get_quadrature(RefTri, QUADRATURE[k])
    points = np.concatenate([1 - x.sum(axis=0, keepdims=True), x])
    centre = np.full((3, 1), 1 / 3) if k == 1 else np.eye(3)
    outer = [_traction(own.values(forwards), own.normals[0]) for own in parts]
    return SplitTriangle(
        shares=np.stack([own.shares(points) for own in parts]),
        weights=w / w.sum(),
        stress=np.stack([own.values(points) for own in parts]) @ basis,
        divergence=np.stack([own.divergence(points) for own in parts]) @ basis,
        nodes=np.stack([own.divergence(centre) for own in parts]) @ basis,
        lever=np.stack([own.shares(centre) for own in parts]),
        tractions=np.stack(outer) @ basis,
    )


@dataclass(frozen=True)
class _Part:
    """A part of the triangle, whose third vertex is the centroid, with a stress of degree k.

    corners  (3, 2);   normals  (3, 2) outward, times the lengths, of the edges from each corner to
             the next one
    """

    number: int
    k: int
    corners: np.ndarray
    normals: np.ndarray

    def shares(self, at: np.ndarray) -> np.ndarray:
        """Those of the vertices of the triangle (3, s) by those of the corners."""
        out = np.repeat(at[2:] / 3, 3, axis=0)
        out[list(OTHERS[self.number])] += at[:2]
        return out

    def values(self, at: np.ndarray) -> np.ndarray:
        """Components (s, 3, n) of the stress by those at the nodes of all parts."""
        own = np.einsum("qs,cd->scqd", _shapes(at, self.k), np.eye(3))
        return self._placed(own.reshape(*own.shape[:2], -1))

    def divergence(self, at: np.ndarray) -> np.ndarray:
        """The same of its divergence (s, 2, n)."""
        G = np.linalg.inv(np.column_stack([np.ones(3), self.corners]))[1:]  # (2, 3)
        slopes = np.einsum("ia,aqs->isq", G, _slopes(at, self.k))
        out = np.zeros((at.shape[1], 2, slopes.shape[2], 3))
        for c, (i, j) in enumerate(PAIRS):
            out[:, i, :, c] = slopes[j]
            out[:, j, :, c] = slopes[i]
        return self._placed(out.reshape(len(out), 2, -1))

    def _placed(self, own: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [own if part == self.number else np.zeros(own.shape) for part in range(3)], axis=2
        )


def _part(number: int, k: int) -> _Part:
    corners = np.vstack([CORNERS[list(OTHERS[number])], CORNERS.mean(axis=0)])
    d = np.roll(corners, -1, axis=0) - corners
    turn = np.sign(d[0, 0] * d[1, 1] - d[0, 1] * d[1, 0])  # positive around the part
    return _Part(number, k, corners, turn * np.column_stack([d[:, 1], -d[:, 0]]))


def _shapes(at: np.ndarray, k: int) -> np.ndarray:
    """Shape functions (q, s) of degree k at shares (3, s)."""
    if k == 1:
        return at
    middles = [4 * at[i] * at[j] for i, j in combinations(range(3), 2)]
    return np.concatenate([at * (2 * at - 1), middles])


def _slopes(at: np.ndarray, k: int) -> np.ndarray:
    """Their derivatives (3, q, s) by the shares."""
    if k == 1:
        return np.broadcast_to(np.eye(3)[..., None], (3, 3, at.shape[1]))
    out = np.zeros((3, 6, at.shape[1]))
    for i in range(3):
        out[i, i] = 4 * at[i] - 1
    for place, (i, j) in enumerate(combinations(range(3), 2), 3):
        out[i, place], out[j, place] = 4 * at[j], 4 * at[i]
    return out


def _traction(values: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Tractions (s, 2, n) of stresses (s, 3, n)."""
    return np.stack(
        [values[:, 0] * n[0] + values[:, 2] * n[1], values[:, 2] * n[0] + values[:, 1] * n[1]],
        axis=1,
    )
