"""Where two surfaces that face each other overlap: pieces that lie on one face of each, with points
of integration.

In the plane, the ends of the other side's faces are projected on the own side along its field of
nodal normals, linear on every cell. The field is continuous, so that the pieces neither overlap nor
leave gaps. In space, both sides are projected on a plane through every own cell, normal to it,
polygons are cut there, and triangles made of them.

scikit-fem's supermeshing.intersect is not used: it takes meshes of one plane or line only, no
surfaces in space; it rounds coordinates to ten decimals, so that its answer depends on the unit of
length; it loops over all elements in Python and makes a new array for each; and it needs one more
package (shapely).

Sources: Yang, Laursen, Meng (2005), Two dimensional mortar contact methods for large deformation
frictional sliding, Int. J. Numer. Meth. Engng 62, 1183-1225 (normal field); Puso, Laursen (2004), A
mortar segment-to-segment contact method for large deformation solid mechanics, Comput. Methods
Appl. Mech. Engrg 193, 601-629 (planes); Sutherland, Hodgman (1974), Reentrant polygon clipping,
Commun. ACM 17, 32-42.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine, RefTri

from contactopt.bodies.elements import weight_at
from contactopt.coupling.faces import Faces, cross, face_normals, patches
from contactopt.coupling.facing import Facets, facing_pairs
from contactopt.errors import InputError

# cells that are covered by less than this fraction count as uncovered: the noise of coordinates
SMALLEST = 1e-8
WHOLE = 1e-9  # and those that are covered but for less than this count as covered
FACING = -0.1  # the cosine between normals of faces that face each other is below this
FOLD = 1.05  # a cell that is covered by more than this faces two layers of the other surface
# degrees added to the quadrature where a face is distorted, so that integrands are no polynomials:
# on flat interfaces, where
# uniform pressure is exact up to this error, and on curved ones, where it is not
FLAT, CURVED = 12, 4


@dataclass(frozen=True, eq=False)
class Overlap:
    """Points of integration on the overlap of two surfaces, g of them.

    cell    (g,) linear cell of the own side: face times cells of a face, plus its number on the
            face
    at      (dim - 1, g) reference coordinates on the own face
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
    face: np.ndarray
    there: np.ndarray
    axes: np.ndarray
    measure: np.ndarray
    window: np.ndarray


def overlap(own: Faces, other: Faces, normals: np.ndarray) -> Overlap:
    """Find where two surfaces overlap, with points of integration.

    Parameters
    ----------
    own : The side that carries the contacts, with n points.
    other : The other side.
    normals : (dim, n) normals of the own side at its points.

    Returns
    -------
    The points on both surfaces, in the order of the own cells.

    Raises
    ------
    InputError : If the other surface is folded, so that some cell faces two of its layers.
    """
    return _lines(own, other, normals) if own.dim == 2 else _polygons(own, other)


@dataclass(frozen=True, eq=False)
class _Polygons:
    """The p polygons, or lines, that a surface is cut into.

    vertices (dim, p, v);  at (dim - 1, p, v) their reference coordinates;  face (p,);  cell (p,)
    normal   (dim, p) outward unit normals;  centre (dim, p);  radius (p,) of a ball around each
    """

    vertices: np.ndarray
    at: np.ndarray
    face: np.ndarray
    cell: np.ndarray
    normal: np.ndarray
    centre: np.ndarray
    radius: np.ndarray


def _cut(surface: Faces, own: bool) -> _Polygons:
    local, cell = patches(surface, own)
    count = len(surface.faces)
    x = surface.points[:, surface.faces[:, local].reshape(-1, local.shape[1])]
    at = np.tile(surface.places[:, local], (1, count, 1))
    face = np.repeat(np.arange(count), len(local))
    centre = x.mean(axis=2)
    radius = np.linalg.norm(x - centre[:, :, None], axis=0).max(axis=1)
    normal = _polygon_normals(x) * surface.turn[face]
    return _Polygons(
        x, at, face, face * len(surface.cells) + np.tile(cell, count), normal, centre, radius
    )


def _facing(
    mine: _Polygons, theirs: _Polygons, spread: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of polygons that may face each other; own ones see within `spread` (p,) of their
    normals.
    """
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
    much of each own cell they cover.

    `pairs` are the own and the other polygon of each piece, `content` (q,) is its part of the own
    cell, `middle` (dim, q) a place within it, and `direction` (dim, q) the normal there.

    A line along the normal may meet the other surface more than once, and goes on behind the own
    one as well. Behind it counts what overlaps no deeper than about twice the distance of the
    nearest place of the other surface. Where a cell is covered more than once, layers count that
    are no further away than twice the nearest one. If these still cover the cell more than once,
    the surface is folded: an InputError.
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
        layer, away = (
            _layers(other, cell[several], theirs.face[second[several]]),
            np.abs(height[several]),
        )
        least, nearest = np.full(layer.max() + 1, np.inf), np.full(cells, np.inf)
        np.minimum.at(least, layer, away)
        np.minimum.at(nearest, cell[several], away)
        keep[several] = least[layer] <= 2 * nearest[cell[several]] + size[several]
        covered = np.bincount(cell[keep], content[keep], cells)
        _check_fold(other, mine, covered)
    return keep & (covered[cell] > SMALLEST), covered


def _layers(other: Faces, cell: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Numbers (q,) of the layers of faces (q,) seen from cells (q,): those of a layer hang
    together.
    """
    nodes = other.faces[face, : other.corners]
    known, hub = np.unique(cell[:, None] * other.points.shape[1] + nodes, return_inverse=True)
    q = len(face)
    ends = np.repeat(np.arange(q), nodes.shape[1]), q + hub.ravel()
    graph = sp.coo_matrix((np.ones(len(ends[0])), ends), (q + len(known),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1][:q])


def _polygon_normals(x: np.ndarray) -> np.ndarray:
    """Unit normals (dim, p) of polygons with vertices (dim, p, v), or of lines."""
    if len(x) == 2:
        normal = cross((x[:, :, 1] - x[:, :, 0])[:, None])
    else:
        # of a triangle: twice its area
        normal = np.cross(x[:, :, 2] - x[:, :, 0], x[:, :, -1] - x[:, :, 1], axis=0)
    return np.asarray(normal / np.linalg.norm(normal, axis=0))


def _lines(own: Faces, other: Faces, normals: np.ndarray) -> Overlap:
    mine, theirs = _cut(own, True), _cut(other, False)
    ends = own.faces[mine.face[:, None], own.cells[mine.cell % len(own.cells)]]  # (p, 2)
    turn = np.sum(mine.normal[:, :, None] * normals[:, ends], axis=0).clip(-1.0, 1.0)
    first, second = _facing(mine, theirs, np.arccos(turn.min(axis=1)))
    face = mine.face[first]
    start, width = mine.at[:, first, 0], mine.at[:, first, 1] - mine.at[:, first, 0]
    n0, n1 = normals[:, ends[first, 0]], normals[:, ends[first, 1]]
    turn = n1 - n0
    x = theirs.vertices[:, second]
    s = np.sort(
        [_project(own, face, start, width, n0, turn, x[:, :, i]) for i in (0, 1)], axis=0
    ).clip(0.0, 1.0)
    length, middle = s[1] - s[0], s.mean(axis=0)
    direction = n0 + turn * middle
    direction /= np.linalg.norm(direction, axis=0)
    x = own.locations(face, start + width * middle)[0]
    keep, covered = _nearest(other, mine, theirs, (first, second), length, x, direction)
    keep = np.flatnonzero(keep)
    window = _windows(own, mine.cell[first[keep]], s[:, None, keep].transpose(1, 2, 0), covered)
    points, share = get_quadrature(RefLine, 8 + CURVED * (own.curved or other.curved))
    local = s[0, keep, None] + length[keep, None] * points[0]
    m = len(share)
    pair = np.repeat(keep, m)
    here = start[:, pair] + width[:, pair] * local.ravel()
    n = n0[:, pair] + turn[:, pair] * local.ravel()
    axes = (np.stack([n[1], -n[0]]) / np.linalg.norm(n, axis=0)).T[:, None, :]
    x, tangents = own.locations(face[pair], here)
    there = other.locate(theirs.face[second[pair]], x, axes, np.array([[0.5]]))
    measure = (
        (share * length[keep, None]).ravel()
        * np.abs(width[0, pair])
        * np.linalg.norm(tangents[:, 0], axis=0)
    )
    measure *= weight_at(own.weight, x)
    return Overlap(
        mine.cell[first[pair]], here, theirs.face[second[pair]], there, axes, measure, window
    )


def _project(
    own: Faces,
    face: np.ndarray,
    start: np.ndarray,
    width: np.ndarray,
    n0: np.ndarray,
    turn: np.ndarray,
    x: np.ndarray,
) -> np.ndarray:
    """Place s on cells, from 0 to 1, whose normal n0 + s turn passes through the points x (2, m);
    clipped beyond.
    """
    s = np.full(len(face), 0.5)
    for _ in range(30):
        here, tangents = own.locations(face, start + width * s)
        apart, slope, n = x - here, -tangents[:, 0] * width, n0 + s * turn
        value = apart[0] * n[1] - apart[1] * n[0]
        rate = slope[0] * n[1] - slope[1] * n[0] + apart[0] * turn[1] - apart[1] * turn[0]
        flat = slope[0] * n[1] - slope[1] * n[0]
        rate = np.where(
            rate * flat > 0.1 * flat**2, rate, flat
        )  # beyond the centre of curvature: the chord's direction
        new = np.clip(s - value / rate, -0.5, 1.5)
        done = np.abs(new - s).max(initial=0.0) < 1e-15
        s = new
        if done:
            break
    return s


def _windows(own: Faces, cell: np.ndarray, corners: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """Begin and width (2, dim - 1, cells) of the smallest similar cell around the corners
    (dim - 1, q, v) of pieces on cells (q,); all of a cell where it is covered as a whole.
    """
    window = np.stack([np.zeros((own.dim - 1, len(covered))), np.ones((own.dim - 1, len(covered)))])
    low, high = np.ones(window[0].shape), np.zeros(window[0].shape)
    for d, x in enumerate(corners):
        np.minimum.at(low[d], cell, x.min(axis=1))
        np.maximum.at(high[d], cell, x.max(axis=1))
    if own.corners == 3:  # from the corner up to the parallel of the third side
        far = np.zeros(len(covered))
        np.maximum.at(far, cell, corners.sum(axis=0).max(axis=1))
        high = low + far - low.sum(axis=0)
    partial = (covered > SMALLEST) & (covered < 1 - WHOLE)
    low, high = low.clip(0.0, 1.0), high.clip(0.0, 1.0)
    window[:, :, partial] = np.stack([low, high - low])[:, :, partial]
    return window


def _check_fold(other: Faces, mine: _Polygons, covered: np.ndarray) -> None:
    if covered.max(initial=0.0) > FOLD:
        where = mine.centre[:, np.argmax(mine.cell == np.argmax(covered))]
        raise InputError(
            f"body '{other.name}': its contact boundary is folded, two layers of it face the same"
            f" place near ({', '.join(f'{c:.4g}' for c in where)}); name only the part of it that"
            " can touch."
        )


def _polygons(own: Faces, other: Faces) -> Overlap:
    mine, theirs = _cut(own, True), _cut(other, False)
    outward, origin = mine.normal, mine.centre
    first, second = _facing(mine, theirs, np.zeros(len(mine.face)))
    along = mine.vertices[:, :, 1] - mine.vertices[:, :, 0]
    along = along - np.sum(along * outward, axis=0) * outward
    along /= np.linalg.norm(along, axis=0)
    axes = np.stack([along, np.cross(outward, along, axis=0)]).transpose(2, 0, 1)  # (p, 2, 3)
    frame = np.einsum("pad,dpv->pva", axes, mine.vertices - origin[:, :, None])
    area = _areas(frame)
    frame = np.where((area < 0)[:, None, None], frame[:, ::-1], frame)  # counterclockwise
    size = np.sqrt(np.abs(area))
    subject = np.einsum(
        "pad,dpv->pva", axes[first], theirs.vertices[:, second] - origin[:, first, None]
    )
    low, high = frame.min(axis=1)[first], frame.max(axis=1)[first]
    near = np.flatnonzero(
        np.all((subject.max(axis=1) > low) & (subject.min(axis=1) < high), axis=1)
    )
    first, second = first[near], second[near]
    polygon = _clip(subject[near], frame[first], size[first])
    # a fan of triangles around the first vertex
    triangles = np.stack(
        [np.repeat(polygon[:, :1], polygon.shape[1] - 2, axis=1), polygon[:, 1:-1], polygon[:, 2:]],
        2,
    )
    content = np.abs(_areas(triangles.reshape(-1, 3, 2))).reshape(triangles.shape[:2])
    full = np.bincount(mine.cell, np.abs(area), len(own.faces) * len(own.cells))
    part = content.sum(axis=1) / full[mine.cell[first]]
    middle = origin[:, first] + np.einsum("pad,pa->dp", axes[first], polygon.mean(axis=1))
    keep, covered = _nearest(other, mine, theirs, (first, second), part, middle, outward[:, first])
    # the corners of pieces on cells that are covered in part only, in the coordinates of the cells
    part_of = np.flatnonzero(keep & (covered[mine.cell[first]] < 1 - WHOLE))
    v = polygon.shape[1]
    mine_at = np.repeat(first[part_of], v)
    x = origin[:, mine_at] + np.einsum("gad,ga->dg", axes[mine_at], polygon[part_of].reshape(-1, 2))
    here = own.locate(mine.face[mine_at], x, axes[mine_at], mine.at[:, mine_at].mean(axis=2))
    corners = own.local(mine.cell[mine_at] % len(own.cells), here).reshape(2, -1, v)
    window = _windows(own, mine.cell[first[part_of]], corners, covered)
    piece, fan = np.nonzero(keep[:, None] & (content > 1e-15 * np.abs(area)[first, None]))
    triangles, content = triangles[piece, fan], content[piece, fan]
    points, share = get_quadrature(RefTri, _order(own, other))
    corner = np.stack([1 - points[0] - points[1], points[0], points[1]])
    y = np.einsum("vq,tva->tqa", corner, triangles).reshape(-1, 2)
    piece = np.repeat(piece, len(share))
    content = (content[:, None] * share / share.sum()).ravel()
    mine_at, theirs_at = first[piece], second[piece]
    E = axes[mine_at]
    x = origin[:, mine_at] + np.einsum("gad,ga->dg", E, y)
    here = own.locate(mine.face[mine_at], x, E, mine.at[:, mine_at].mean(axis=2))
    there = other.locate(theirs.face[theirs_at], x, E, theirs.at[:, theirs_at].mean(axis=2))
    place, tangents = own.locations(mine.face[mine_at], here)
    seen = np.abs(np.linalg.det(np.einsum("gad,dcg->gac", E, tangents)))
    measure = (
        content * np.linalg.norm(cross(tangents), axis=0) / seen * weight_at(own.weight, place)
    )
    return Overlap(mine.cell[mine_at], here, theirs.face[theirs_at], there, E, measure, window)


def _order(own: Faces, other: Faces) -> int:
    """Degree of the quadrature on triangles: exact for products of hat functions and shape
    functions on affine faces.
    """

    def highest(surface: Faces) -> int:
        return surface.degree * (2 if surface.corners == 4 else 1)

    hats = 2 if own.corners == 4 else 1
    order = hats + max(hats, highest(own), highest(other))
    if not (own.distorted or other.distorted):
        return order
    normals = face_normals(own)
    flat = np.all(np.abs(normals - normals[:, :1]) < 1e-9) and not own.curved
    return order + (FLAT if flat else CURVED)


def _areas(polygons: np.ndarray) -> np.ndarray:
    """Signed areas (p,) of plane polygons (p, v, 2)."""
    x, y = polygons[..., 0], polygons[..., 1]
    return np.asarray(np.sum(x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1), axis=1) / 2)


def _clip(polygon: np.ndarray, window: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Parts (p, v', 2) of polygons (p, v, 2) inside convex counterclockwise windows (p, w, 2);
    `size` (p,) of the windows.

    Unused places at the end repeat the last vertex; a polygon without vertices is zero.
    """
    count = np.full(len(polygon), polygon.shape[1])
    for edge in range(window.shape[1]):
        a, b = window[:, edge], window[:, (edge + 1) % window.shape[1]]
        inward = np.stack([a[:, 1] - b[:, 1], b[:, 0] - a[:, 0]], axis=1)
        inward /= np.linalg.norm(inward, axis=1)[:, None]
        used = np.arange(polygon.shape[1]) < count[:, None]
        following = np.where(
            np.arange(polygon.shape[1]) == count[:, None] - 1, 0, np.arange(polygon.shape[1]) + 1
        )
        following = np.minimum(following, polygon.shape[1] - 1)
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
