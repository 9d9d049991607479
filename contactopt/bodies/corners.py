"""Where a contact boundary has a corner, in the plane, or an edge, in space.

A contact has one normal and one area. At a corner a boundary has two normals, and a node there
needs two contacts: one for each side, with the normal and the area of this side alone. One contact
with the mean normal would couple the pressures of both sides. So the boundary is cut at its
corners: facets that meet there get copies of the node, which share its displacement.

The facets of a curve that is meshed coarsely meet at an angle too. They must stay together, because
two contacts at each node of a smooth curve would stop it from sliding. The turn between the normals
of two facets at their common node decides, those of curved elements being exact:

* A turn of more than `LARGEST` is a corner, and one of less than `KINK` is none.
* The next turns on both sides are compared, as far as they have the same sign. A curve turns at all
  its nodes. So a turn is a corner if both next turns are far smaller. Above `CORNER` it is one
  unless the next turns on both sides are like it.
* Where the curve of the boundary is given, its own turn must exceed `KINK`.
"""

from itertools import permutations
from typing import NamedTuple

import numpy as np
import skfem

from contactopt.bodies.elements import FACES, Faces, nodes_on
from contactopt.meshes.cells import joined, sides_of
from contactopt.meshes.curves import CORNER, KINK, LARGEST
from contactopt.meshes.given_curves import Curve

ALIKE = 0.45  # a tangent line before an arc halves the turn: more than this is the turn of a curve
PARALLEL = 0.7  # cosine of the angle between edges across which a surface turns in the same way
STEEP, EXACT = 0.5, 1e-9  # tilts that are never smooth, and that are rounding


class _Joints(NamedTuple):
    """The m places where two of f facets meet: nodes in the plane, edges in space.

    facets  (2, m);  sides  (2, m) which side of each facet it is;  turn  (m,) the angle between
    their normals [rad], negative where the boundary is concave
    """

    facets: np.ndarray
    sides: np.ndarray
    turn: np.ndarray


def copies(
    basis: skfem.CellBasis, degree: int, boundary: np.ndarray, mesh: skfem.Mesh, curve: Curve | None
) -> tuple[np.ndarray, np.ndarray]:
    """The nodes of a boundary with one copy for each side of a corner: (f, j) the numbers of the
    copies on each facet, corners first and cyclic, and (m,) the node of each copy.

    `mesh` has the facets of the basis, and may be curved where that is not.
    """
    boundary = np.asarray(boundary)
    nodes = nodes_on(basis, degree, boundary)
    ends = mesh.facets[:, boundary]
    joints = _joints(mesh, boundary, ends)
    cut = _is_corner(mesh.p, ends, joints)
    if curve is not None and curve.known and cut.any():
        cut[cut] = _bent(mesh.p, ends, joints, np.flatnonzero(cut), curve)
    if not cut.any():
        known, number = np.unique(nodes, return_inverse=True)
        return number.reshape(nodes.shape), known
    # the sides of a node: facets around it that hang together by smooth joints
    side = joined(_common(nodes, joints.facets[:, ~cut])[0], nodes.size)
    number = np.stack([nodes.ravel(), side])
    # at other nodes, and where more sides meet than there are directions, there is one copy
    at_corner = np.zeros(nodes.max() + 1, dtype=bool)
    at_corner[_common(nodes, joints.facets[:, cut])[1]] = True
    fans = np.unique(number, axis=1)[0]
    at_corner &= np.bincount(fans, minlength=len(at_corner)) <= len(mesh.p)
    number[1, ~at_corner[number[0]]] = 0
    known, number = np.unique(number, axis=1, return_inverse=True)
    return number.reshape(nodes.shape), known[0]


def _joints(mesh: skfem.Mesh, boundary: np.ndarray, ends: np.ndarray) -> _Joints:
    """Those of facets (f,) of the surface with corners `ends` (c, f)."""
    count, facets = ends.shape
    side = sides_of(ends)
    keys = np.sort(side, axis=0).reshape(len(side), -1)
    order = np.lexsort(keys)
    same = np.all(keys[:, order[1:]] == keys[:, order[:-1]], axis=0)
    pair = np.stack([order[:-1][same], order[1:][same]])
    places = FACES[mesh.refdom.__name__][2][:, :count]
    normals = Faces(mesh, boundary, places).normals  # (dim, f, c)
    corner, facet = np.arange(count), pair % facets
    at = np.stack([corner, np.roll(corner, -1)])[: len(side), pair // facets]  # (ends, 2, m)
    n = normals[:, facet, at].mean(axis=1)
    n = n / np.linalg.norm(n, axis=0)
    cosine = np.sum(n[:, 0] * n[:, 1], axis=0).clip(-1.0, 1.0)
    centre = mesh.p[:, ends].mean(axis=1)
    beyond = centre[:, facet[1]] - mesh.p[:, keys[0, pair[0]]]
    sign = np.where(np.sum(beyond * n[:, 0], axis=0) > 0, -1.0, 1.0)
    return _Joints(facet, pair // facets, sign * np.arccos(cosine))


def _is_corner(p: np.ndarray, ends: np.ndarray, joints: _Joints) -> np.ndarray:
    """Whether joints (m,) are corners, by their turns and the next ones on both sides."""
    turn = np.abs(joints.turn)
    found = turn > LARGEST
    tried = np.flatnonzero((turn > KINK[0]) & ~found)
    if not len(tried):
        return found
    own = turn[tried]
    beside = _beside(p, ends, joints, tried)
    alike = np.all(np.isnan(beside) | (beside >= ALIKE * own), axis=0)
    lone = ~np.all(np.isnan(beside), axis=0) & (own > KINK[1] * np.nan_to_num(beside).max(axis=0))
    found[tried] = lone | (~alike & (own > CORNER))
    return found


def _beside(p: np.ndarray, ends: np.ndarray, joints: _Joints, tried: np.ndarray) -> np.ndarray:
    """(2, t) the largest turn of the sign of a joint across the next sides of each of its facets;
    nan where the boundary ends there. In the plane the next side is the other node of the facet.
    In space it is the side of a quadrilateral or, behind a triangle, of the next triangle, that
    leads in the same direction from other nodes.
    """
    count, facets = ends.shape
    number = np.full((count, facets), -1)  # the joint at each side of each facet
    number[joints.sides, joints.facets] = np.arange(len(joints.turn))
    side = sides_of(ends)
    own = side[:, joints.sides[:, tried], joints.facets[:, tried]]  # (ends, 2, t)
    near = joints.facets[:, tried][None]  # the facets whose sides are looked at
    if count == 3:
        across = number[:, joints.facets[:, tried]]  # (c, 2, t)
        there = joints.facets[:, across].sum(axis=0) - joints.facets[:, tried]
        at_home = (across == tried) | (across < 0)
        near = np.concatenate([near, np.where(at_home, near, there)])
    # every side (s, 2, t) of these facets
    joint = number[:, near].reshape(-1, 2, len(tried))
    nodes = side[:, :, near].reshape(len(side), -1, 2, len(tried))
    fits = np.all(nodes[:, None] != own[None, :, None], axis=(0, 1))
    if len(side) == 2:
        along, lead = (p[:, x[1]] - p[:, x[0]] for x in (nodes, own))
        cosine = np.abs(np.einsum("dskt,dkt->skt", along, lead))
        fits &= cosine > PARALLEL * np.linalg.norm(along, axis=0) * np.linalg.norm(lead, axis=0)
    turn = joints.turn[joint] * np.sign(joints.turn[tried])
    known = fits & (joint >= 0)
    largest = np.where(known, turn.clip(0.0), 0.0).max(axis=0)
    return np.where(known.any(axis=0), largest, np.nan)


def _bent(
    p: np.ndarray, ends: np.ndarray, joints: _Joints, some: np.ndarray, curve: Curve
) -> np.ndarray:
    """Whether a given curve turns at some joints (t,): its directions into both facets differ."""
    side = sides_of(ends)[:, joints.sides[0, some], joints.facets[0, some]]
    x = p[:, side].mean(axis=1)
    directions = []
    for facet in joints.facets[:, some]:
        into = 1e-3 * (p[:, ends[:, facet]].mean(axis=1) - x)  # of a facet, along a given curve
        d = curve(x + 2 * into) - curve(x + into)
        if len(side) == 2:
            edge = p[:, side[1]] - p[:, side[0]]
            edge = edge / np.linalg.norm(edge, axis=0)
            d = d - np.sum(d * edge, axis=0) * edge
        directions.append(d / np.linalg.norm(d, axis=0))
    cosine = -np.sum(directions[0] * directions[1], axis=0)
    return np.asarray(np.arccos(cosine.clip(-1.0, 1.0)) > KINK[0])


def _common(nodes: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (2, n) in the nodes (f, j) that pairs (2, m) of facets share, and these nodes (n,)."""
    same = nodes[pairs[0]][:, :, None] == nodes[pairs[1]][:, None]
    pair, first, second = np.nonzero(same)
    j = nodes.shape[1]
    return np.stack([pairs[0, pair] * j + first, pairs[1, pair] * j + second]), nodes[
        pairs[0, pair], first
    ]


def turns(normals: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(k,) the largest difference of normals (dim, k) of contacts in one of the cells (v, c)."""
    turn = np.zeros(normals.shape[1])
    for corner, other in permutations(cells, 2):
        apart = np.linalg.norm(normals[:, corner] - normals[:, other], axis=0)
        np.maximum.at(turn, corner, apart)
    return turn


def smooth_tilts(normals: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(k,) how far off a plane the normals (dim, k) of facets may be where a surface crosses it
    smoothly, so that the mirror images of both are one surface without an edge.
    """
    next_to = turns(normals, cells)
    turn = next_to.copy()  # to the next facet: a straight one of second order has two cells
    for corner, other in permutations(cells, 2):
        np.maximum.at(turn, corner, next_to[other])
    return np.minimum(STEEP, EXACT + 4.0 * turn)  # twice what unequal facets need
