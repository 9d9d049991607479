"""Where two surfaces overlap: pieces on one face of each, with points of integration.

In the plane, the ends of the other side's faces are projected on the own side along its field of
nodal normals, linear on every cell. The field is continuous, so that the pieces neither overlap nor
leave gaps. In space, both sides are projected on a plane through every own cell, normal to it,
polygons are cut there, and triangles made of them. scikit-fem's supermeshing.intersect is not used:
it knows no surfaces in space, and rounds coordinates to ten decimals, so that its answer depends on
the unit of length.

Sources: Yang, Laursen, Meng (2005), Two dimensional mortar contact methods for large deformation
frictional sliding, Int. J. Numer. Meth. Engng 62, 1183-1225 (normal field); Puso, Laursen (2004), A
mortar segment-to-segment contact method for large deformation solid mechanics, Comput. Methods
Appl. Mech. Engrg 193, 601-629 (planes); Sutherland, Hodgman (1974), Reentrant polygon clipping,
Commun. ACM 17, 32-42 (cut).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine, RefTri

from contactopt.bodies.elements import weight_at
from contactopt.checks import place_words
from contactopt.coupling.faces import Faces, face_normals, patches
from contactopt.coupling.facing import Facets, facing_pairs
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.meshes.cells import area_vectors

# cells that are covered by less than this fraction count as uncovered: the noise of coordinates
SMALLEST = 1e-8
FACING = -0.1  # the cosine between normals of faces that face each other is below this
FOLD = 1.05  # a cell that is covered by more than this faces two layers of the other surface
# degrees added to the quadrature where a face is distorted, so that integrands are no polynomials:
# on flat interfaces, where uniform pressure is exact up to this error, and on curved ones
FLAT, CURVED = 12, 4


@dataclass(frozen=True, eq=False)
class Overlap:
    """Points of integration on the overlap of two surfaces, g of them.

    cell    (g,) linear cell of the own side: face times cells of a face, plus its number on the
            face
    at      (dim - 1, g) reference coordinates on the own face
    place   (dim, g) points of the own face there
    normal  (dim, g) its outward unit normals
    face    (g,) face of the other side
    there   (dim - 1, g) reference coordinates on it
    axes    (g, dim - 1, dim) directions across which both places coincide: the line between them is
            normal to these
    measure (g,) area that every point stands for, with the weight of the integrals
    window  (2, dim - 1, own cells) begin and width, from 0 to 1, of the smallest similar cell
            around the covered part
    """

    cell: np.ndarray
    at: np.ndarray
    place: np.ndarray
    normal: np.ndarray
    face: np.ndarray
    there: np.ndarray
    axes: np.ndarray
    measure: np.ndarray
    window: np.ndarray


class Pieces(NamedTuple):
    """Own cells (q,) and other faces (q,) with points of integration, and what makes these."""

    cell: np.ndarray
    face: np.ndarray
    points: Callable[[], Overlap]


def overlap(own: Faces, other: Faces, normals: np.ndarray) -> Pieces:
    """Find where two surfaces overlap, with points of integration in the order of the own cells,
    whose normals `normals` (dim, n) are given at its points. InputError if the other is folded.
    """
    return _lines(own, other, normals) if own.dim == 2 else _polygons(own, other)


@dataclass(frozen=True, eq=False)
class _Polygons:
    """The p polygons, or lines, that a surface is cut into.

    vertices (dim, p, v);  at (dim - 1, p, v) their reference coordinates;  face (p,);  cell (p,)
    normal   (dim, p) outward unit normals;  centre (dim, p);  radius (p,) of a ball around each
    middle   (dim - 1, p) reference coordinates of the centre
    """

    vertices: np.ndarray
    at: np.ndarray
    face: np.ndarray
    cell: np.ndarray
    normal: np.ndarray
    centre: np.ndarray
    radius: np.ndarray

    @property
    def middle(self) -> np.ndarray:
        return np.asarray(self.at.mean(axis=2))


def _cut(surface: Faces, own: bool) -> _Polygons:
    local, cell = patches(surface, own)
    count = len(surface.faces)
    x = surface.points[:, surface.faces[:, local].reshape(-1, local.shape[1])]
    at = np.tile(surface.places[:, local], (1, count, 1))
    face = np.repeat(np.arange(count), len(local))
    centre = x.mean(axis=2)
    radius = np.linalg.norm(x - centre[:, :, None], axis=0).max(axis=1)
    normal = area_vectors(x.swapaxes(1, 2))
    normal = normal / np.linalg.norm(normal, axis=0) * surface.turn[face]
    number = face * len(surface.cells) + np.tile(cell, count)
    return _Polygons(x, at, face, number, normal, centre, radius)


def _facing(
    mine: _Polygons, theirs: _Polygons, spread: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of polygons that may face each other; own ones see within `spread` (p,)."""
    none = np.zeros(0, dtype=int)
    if not len(mine.face) or not len(theirs.face):
        return none, none
    own = Facets(mine.centre, mine.radius, mine.normal, spread)
    other = Facets(theirs.centre, theirs.radius, theirs.normal, np.zeros(len(theirs.face)))
    first, second = facing_pairs(own, other, FACING)
    facing = np.sum(mine.normal[:, first] * theirs.normal[:, second], axis=0) < FACING
    return first[facing], second[facing]


def _nearest(
    other: Faces,
    mine: _Polygons,
    theirs: _Polygons,
    pairs: tuple[np.ndarray, np.ndarray],
    content: np.ndarray,
    middle: np.ndarray,
    direction: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Mask (q,) of the pieces on that layer of the other surface which the own one faces, and how
    much of each own cell they cover, from the polygons of each piece, its part of the own cell, a
    place within it and the normal there (dim, q).

    A line along the normal may meet the other surface more than once. Behind the own one counts
    what overlaps no deeper than about twice the distance of the nearest place. Where a cell is
    covered more than once, layers count that are no further than twice the nearest one; if these
    still do, the surface is folded: an InputError.
    """
    first, second = pairs
    m, cell = theirs.normal[:, second], mine.cell[first]
    height = np.sum((theirs.centre[:, second] - middle) * m, axis=0) / np.sum(direction * m, axis=0)
    size = mine.radius[first] + theirs.radius[second]
    keep = content > 0
    deep = np.flatnonzero(keep & (height < -size))
    if len(deep):
        nearest = KDTree(theirs.centre.T).query(mine.centre[:, first[deep]].T)[0]
        keep[deep] = -height[deep] <= 2 * nearest + size[deep]
    cells = mine.cell.max() + 1
    covered = np.bincount(cell[keep], content[keep], cells)
    several = np.flatnonzero(keep & (covered[cell] > FOLD))
    if len(several):
        layer = _layers(other, cell[several], theirs.face[second[several]])
        away = np.abs(height[several])
        least, nearest = np.full(layer.max() + 1, np.inf), np.full(cells, np.inf)
        np.minimum.at(least, layer, away)
        np.minimum.at(nearest, cell[several], away)
        keep[several] = least[layer] <= 2 * nearest[cell[several]] + size[several]
        covered = np.bincount(cell[keep], content[keep], cells)
        if covered.max() > FOLD:
            where = mine.centre[:, np.argmax(mine.cell == np.argmax(covered))]
            raise InputError(
                f"body '{other.name}': its contact boundary is folded, two layers of it face the"
                f" same place near ({place_words(where)}); name only the part of"
                " it that can touch."
            )
    return keep & (covered[cell] > SMALLEST), covered


def _layers(other: Faces, cell: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Numbers (q,) of the layers of faces (q,) seen from cells (q,); a layer hangs together."""
    nodes = other.faces[face, : other.corners]
    known, hub = np.unique(cell[:, None] * other.points.shape[1] + nodes, return_inverse=True)
    q = len(face)
    ends = np.repeat(np.arange(q), nodes.shape[1]), q + hub.ravel()
    graph = sp.coo_matrix((np.ones(len(ends[0])), ends), (q + len(known),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1][:q])


def _lines(own: Faces, other: Faces, normals: np.ndarray) -> Pieces:
    mine, theirs = _cut(own, True), _cut(other, False)
    ends = own.faces[mine.face[:, None], own.cells[mine.cell % len(own.cells)]]  # (p, 2)
    turn = np.sum(mine.normal[:, :, None] * normals[:, ends], axis=0).clip(-1.0, 1.0)
    first, second = _facing(mine, theirs, np.arccos(turn.min(axis=1)))
    seen = _Seen(own, mine, first, normals[:, ends[first]])
    s = np.sort([seen.project(theirs.vertices[:, second, i]) for i in (0, 1)], axis=0)
    s = s.clip(0.0, 1.0)
    length, middle = s[1] - s[0], s.mean(axis=0)
    direction, x = seen.normal(middle), seen.locations(middle)[0]
    keep, covered = _nearest(other, mine, theirs, (first, second), length, x, direction)
    keep = np.flatnonzero(keep)
    window = _windows(own, mine.cell[first[keep]], s[:, None, keep].transpose(1, 2, 0), covered)
    points, share = get_quadrature(RefLine, 8 + CURVED * (own.curved or other.curved))
    local = (s[0, keep, None] + length[keep, None] * points[0]).ravel()
    pair = np.repeat(keep, len(share))
    seen, cell, face = seen.take(pair), mine.cell[first[pair]], theirs.face[second[pair]]
    n = seen.normal(local)
    axes = np.stack([n[1], -n[0]]).T[:, None, :]
    x, tangents = seen.locations(local)
    there = other.locate(face, x, axes, np.array([[0.5]]))
    normal, stretch = own.stretched(cell // len(own.cells), tangents)
    measure = (share * length[keep, None]).ravel() * np.abs(seen.width[0])
    measure *= stretch * weight_at(own.weight, x)
    at = seen.start + seen.width * local
    made = Overlap(cell, at, x, normal, face, there, axes, measure, window)
    return Pieces(cell, face, lambda: made)


class _Seen:
    """Places s, 0 to 1, on m own lines, whose normals are linear from ends (2, m, 2)."""

    def __init__(self, own: Faces, mine: _Polygons, lines: np.ndarray, ends: np.ndarray) -> None:
        self.own, self.mine, self.lines, self.ends = own, mine, lines, ends
        self.start = mine.at[:, lines, 0]
        self.width = mine.at[:, lines, 1] - self.start
        self.first, self.turn = ends[:, :, 0], ends[:, :, 1] - ends[:, :, 0]

    def take(self, some: np.ndarray) -> _Seen:
        return _Seen(self.own, self.mine, self.lines[some], self.ends[:, some])

    def normal(self, s: np.ndarray) -> np.ndarray:
        """(2, m) unit normals."""
        n = self.first + self.turn * s
        return np.asarray(n / np.linalg.norm(n, axis=0))

    def locations(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (2, m) and tangents (2, 1, m), by the reference coordinate of the face."""
        return self.own.locations(self.mine.face[self.lines], self.start + self.width * s)

    def project(self, x: np.ndarray) -> np.ndarray:
        """The places whose normals pass through the points x (2, m); clipped beyond."""
        s, turn = np.full(len(self.lines), 0.5), self.turn
        for _ in range(30):
            here, tangents = self.locations(s)
            apart, slope, n = x - here, -tangents[:, 0] * self.width, self.first + turn * s
            value = apart[0] * n[1] - apart[1] * n[0]
            flat = slope[0] * n[1] - slope[1] * n[0]
            rate = flat + apart[0] * turn[1] - apart[1] * turn[0]
            # beyond the centre of curvature: the chord's direction
            rate = np.where(rate * flat > 0.1 * flat**2, rate, flat)
            new = np.clip(s - value / rate, -0.5, 1.5)
            done = np.abs(new - s).max(initial=0.0) < 1e-15
            s = new
            if done:
                break
        return s


def _windows(own: Faces, cell: np.ndarray, corners: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """Begin and width (2, dim - 1, cells) of the least similar cells around corners of pieces."""
    low, high = np.ones((own.dim - 1, len(covered))), np.zeros((own.dim - 1, len(covered)))
    for d, x in enumerate(corners):
        np.minimum.at(low[d], cell, x.min(axis=1))
        np.maximum.at(high[d], cell, x.max(axis=1))
    if own.corners == 3:  # from the corner up to the parallel of the third side
        far = np.zeros(len(covered))
        np.maximum.at(far, cell, corners.sum(axis=0).max(axis=1))
        high = low + far - low.sum(axis=0)
    partial = (covered > SMALLEST) & (covered < 1 - EQUAL)
    low, high = (
        np.where(partial, low.clip(0.0, 1.0), 0.0),
        np.where(partial, high.clip(0.0, 1.0), 1.0),
    )
    return np.stack([low, high - low])


def _polygons(own: Faces, other: Faces) -> Pieces:
    mine, theirs = _cut(own, True), _cut(other, False)
    first, second = _facing(mine, theirs, np.zeros(len(mine.face)))
    axes = _axes(mine)
    frame = _in_plane(axes, mine.vertices - mine.centre[:, :, None])
    area = areas(frame)
    frame = np.where((area < 0)[:, None, None], frame[:, ::-1], frame)  # counterclockwise
    size = np.sqrt(np.abs(area))
    subject = _in_plane(axes[first], theirs.vertices[:, second] - mine.centre[:, first, None])
    low, high = frame.min(axis=1)[first], frame.max(axis=1)[first]
    meets = np.all((subject.max(axis=1) > low) & (subject.min(axis=1) < high), axis=1)
    first, second = first[meets], second[meets]
    polygon = clip(subject[meets], frame[first], size[first])
    # a fan of triangles around the first vertex
    hub = np.repeat(polygon[:, :1], polygon.shape[1] - 2, axis=1)
    triangles = np.stack([hub, polygon[:, 1:-1], polygon[:, 2:]], 2)
    content = np.abs(areas(triangles.reshape(-1, 3, 2))).reshape(triangles.shape[:2])
    full = np.bincount(mine.cell, np.abs(area), len(own.faces) * len(own.cells))
    part = content.sum(axis=1) / full[mine.cell[first]]
    middle = _in_space(mine, axes, first, polygon.mean(axis=1))
    normal = mine.normal[:, first]
    keep, covered = _nearest(other, mine, theirs, (first, second), part, middle, normal)
    piece, fan = np.nonzero(keep[:, None] & (content > 1e-15 * np.abs(area)[first, None]))

    def points() -> Overlap:
        # corners of pieces on cells that are covered in part only, in the coordinates of the cells
        part_of = np.flatnonzero(keep & (covered[mine.cell[first]] < 1 - EQUAL))
        cut = np.repeat(first[part_of], polygon.shape[1])
        x = _in_space(mine, axes, cut, polygon[part_of].reshape(-1, 2))
        here = own.locate(mine.face[cut], x, axes[cut], mine.middle[:, cut])
        corners = own.local(mine.cell[cut] % len(own.cells), here).reshape(2, -1, polygon.shape[1])
        window = _windows(own, mine.cell[first[part_of]], corners, covered)
        at, share = get_quadrature(RefTri, _order(own, other))
        corner = np.stack([1 - at[0] - at[1], at[0], at[1]])
        y = np.einsum("vq,tva->tqa", corner, triangles[piece, fan]).reshape(-1, 2)
        measure = (content[piece, fan, None] * share / share.sum()).ravel()
        one, facing = (np.repeat(numbers[piece], len(share)) for numbers in (first, second))
        E, face = axes[one], theirs.face[facing]
        x = _in_space(mine, axes, one, y)
        here = own.locate(mine.face[one], x, E, mine.middle[:, one])
        there = other.locate(face, x, E, theirs.middle[:, facing])
        place, tangents = own.locations(mine.face[one], here)
        normal, stretch = own.stretched(mine.face[one], tangents)
        measure *= stretch / np.abs(np.linalg.det(np.einsum("gad,dcg->gac", E, tangents)))
        measure *= weight_at(own.weight, place)
        return Overlap(mine.cell[one], here, place, normal, face, there, E, measure, window)

    return Pieces(mine.cell[first[piece]], theirs.face[second[piece]], points)


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


def _axes(mine: _Polygons) -> np.ndarray:
    """(p, 2, 3) two directions in the plane of each polygon."""
    along = mine.vertices[:, :, 1] - mine.vertices[:, :, 0]
    along = along - np.sum(along * mine.normal, axis=0) * mine.normal
    along /= np.linalg.norm(along, axis=0)
    return np.stack([along, np.cross(mine.normal, along, axis=0)]).transpose(2, 0, 1)


def _in_plane(axes: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Coordinates (p, v, 2) of points x (3, p, v) along the axes (p, 2, 3)."""
    return np.asarray(np.einsum("pad,dpv->pva", axes, x))


def _in_space(mine: _Polygons, axes: np.ndarray, number: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Points (3, g) at coordinates y (g, 2) in the planes of the polygons `number` (g,)."""
    return np.asarray(mine.centre[:, number] + np.einsum("gad,ga->dg", axes[number], y))


def _order(own: Faces, other: Faces) -> int:
    """Degree of the quadrature on triangles, exact on affine faces."""
    hats, theirs = (2 if side.corners == 4 else 1 for side in (own, other))
    order = hats + max(hats, own.degree * hats, other.degree * theirs)
    if not (own.distorted or other.distorted):
        return order
    normals = face_normals(own)
    flat = np.all(np.abs(normals - normals[:, :1]) < 1e-9) and not own.curved
    return order + (FLAT if flat else CURVED)
