"""Where two surfaces that face each other overlap: pieces that lie on one face of each, with points of integration.

In the plane, the ends of the other side's faces are projected on the own side along its field of nodal normals, linear on
every cell. The field is continuous, so that the pieces neither overlap nor leave gaps. In space, both sides are projected
on a plane through every own cell, normal to it, polygons are cut there, and triangles made of them.

scikit-fem's supermeshing.intersect is not used: it takes meshes of one plane or line only, no surfaces in space; it
rounds coordinates to ten decimals, so that its answer depends on the unit of length; it loops over all elements in Python
and makes a new array for each; and it needs one more package (shapely).

Sources: Yang, Laursen, Meng (2005), Two dimensional mortar contact methods for large deformation frictional sliding, Int.
J. Numer. Meth. Engng 62, 1183-1225 (normal field); Puso, Laursen (2004), A mortar segment-to-segment contact method for
large deformation solid mechanics, Comput. Methods Appl. Mech. Engrg 193, 601-629 (planes); Sutherland, Hodgman (1974),
Reentrant polygon clipping, Commun. ACM 17, 32-42.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine, RefTri

from contactopt.bodies.elements import weight_at
from contactopt.errors import InputError
from contactopt.interface.faces import Faces, cross, face_normals, patches

SMALLEST = 1e-8  # cells that are covered by less than this fraction count as uncovered: the noise of coordinates
FACING = -0.1  # the cosine between normals of faces that face each other is below this
FOLD = 1.05  # a cell that is covered by more than this faces two layers of the other surface
# degrees added to the quadrature where a face is distorted, so that integrands are no polynomials: on flat interfaces, where
# uniform pressure is exact up to this error, and on curved ones, where it is not
FLAT, CURVED = 12, 4


@dataclass(frozen=True, eq=False)
class Overlap:
    """Points of integration on the overlap of two surfaces, g of them.

    cell    (g,) linear cell of the own side: face times cells of a face, plus its number on the face
    at      (dim - 1, g) reference coordinates on the own face
    face    (g,) face of the other side
    there   (dim - 1, g) reference coordinates on it
    axes    (g, dim - 1, dim) directions across which both places coincide: the line between them is normal to these
    measure (g,) area that every point stands for, with the weight of the integrals
    """

    cell: np.ndarray
    at: np.ndarray
    face: np.ndarray
    there: np.ndarray
    axes: np.ndarray
    measure: np.ndarray


def overlap(own: Faces, other: Faces, normals: np.ndarray) -> Overlap:
    """Find where two surfaces overlap, with points of integration.

    Parameters
    ----------
    own
        The side that carries the contacts, with n points.
    other
        The other side.
    normals
        (dim, n) normals of the own side at its points.

    Returns
    -------
    Overlap
        The points on both surfaces, in the order of the own cells.

    Raises
    ------
    InputError
        If the other surface is folded, so that some cell faces two of its layers.
    """
    return _lines(own, other, normals) if own.dim == 2 else _polygons(own, other)


def neighbours(a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Find the pairs of balls of two sets that may face each other.

    Balls are apart by at most twice the distance of the nearest ones, so that surfaces with a gap find each other.
    Those of b are searched by size, each octave in a tree of its own: graded meshes need no more pairs than even ones.

    Parameters
    ----------
    a, b
        Centres (dim, n) and radii (n,) of the balls of each set [length].

    Returns
    -------
    tuple
        The numbers (j,) of the balls of a and of b in each pair.
    """
    (x, r), (y, s) = a, b
    octave = np.floor(np.log2(s / s.max()))
    trees = []
    for level in np.unique(octave):
        chosen = np.flatnonzero(octave == level)
        trees.append((chosen, KDTree(y[:, chosen].T), s[chosen].max()))
    nearest = [(chosen, *tree.query(x.T)) for chosen, tree, _ in trees]
    apart = np.min([distance - s[chosen[which]] - r for chosen, distance, which in nearest], axis=0)
    reach = r + 2 * np.maximum(apart, 0.0)
    pairs = []
    for chosen, tree, radius in trees:
        hits = tree.query_ball_point(x.T, reach + radius)
        count = np.array([len(hit) for hit in hits])
        if count.any():
            flat = np.concatenate([np.asarray(hit, dtype=int) for hit in hits])
            pairs.append((np.repeat(np.arange(len(count)), count), chosen[flat]))
    first, second = (np.concatenate([p[i] for p in pairs]) for i in (0, 1))
    order = np.lexsort((second, first))
    return first[order], second[order]


def _pieces(surface: Faces, own: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Polygons of a surface: vertices (dim, p, v), reference coordinates (dim - 1, p, v), faces (p,), cells (p,)."""
    local, cell = patches(surface, own)
    count = len(surface.faces)
    vertices = surface.points[:, surface.faces[:, local].reshape(-1, local.shape[1])]
    at = np.tile(surface.places[:, local], (1, count, 1))
    face = np.repeat(np.arange(count), len(local))
    return vertices, at, face, face * len(surface.cells) + np.tile(cell, count)


def _facing(own: Faces, other: Faces) -> tuple[np.ndarray, ...]:
    """Pairs of polygons that may face each other, the polygons of both sides, and the outward normals of the own ones."""
    sides = [_pieces(own, True), _pieces(other, False)]
    centres = [x.mean(axis=2) for x, *_ in sides]
    radii = [np.linalg.norm(x - c[:, :, None], axis=0).max(axis=1) for (x, *_), c in zip(sides, centres)]
    normals = [_polygon_normals(x) * surface.turn[face] for (x, _, face, _), surface in zip(sides, (own, other))]
    if not len(own.faces) or not len(other.faces):
        empty = np.zeros(0, dtype=int)
        return empty, empty, *sides, normals[0]
    first, second = neighbours((centres[0], radii[0]), (centres[1], radii[1]))
    facing = np.sum(normals[0][:, first] * normals[1][:, second], axis=0) < FACING
    return first[facing], second[facing], *sides, normals[0]


def _polygon_normals(x: np.ndarray) -> np.ndarray:
    """Unit normals (dim, p) of polygons with vertices (dim, p, v), or of lines."""
    if len(x) == 2:
        normal = cross((x[:, :, 1] - x[:, :, 0])[:, None])
    else:
        normal = np.cross(x[:, :, 2] - x[:, :, 0], x[:, :, -1] - x[:, :, 1], axis=0)  # of a triangle: twice its area
    return np.asarray(normal / np.linalg.norm(normal, axis=0))


def _lines(own: Faces, other: Faces, normals: np.ndarray) -> Overlap:
    first, second, mine, theirs, _ = _facing(own, other)
    vertices, at, face, cell = mine
    start, width = at[:, first, 0], at[:, first, 1] - at[:, first, 0]
    ends = own.faces[face[first][:, None], own.cells[cell[first] % len(own.cells)]]
    n0, turn = normals[:, ends[:, 0]], normals[:, ends[:, 1]] - normals[:, ends[:, 0]]
    s = np.sort(
        [_project(own, face[first], start, width, n0, turn, theirs[0][:, second, i]) for i in (0, 1)], axis=0
    ).clip(0.0, 1.0)
    length = s[1] - s[0]
    covered = np.bincount(cell[first], length, len(own.faces) * len(own.cells))
    _check_fold(other, vertices, cell, covered)
    keep = np.flatnonzero((length > 0) & (covered[cell[first]] > SMALLEST))
    points, share = get_quadrature(RefLine, 8 + CURVED * (own.curved or other.curved))
    local = s[0, keep, None] + length[keep, None] * points[0]
    m = len(share)
    pair = np.repeat(keep, m)
    here = start[:, pair] + width[:, pair] * local.ravel()
    n = n0[:, pair] + turn[:, pair] * local.ravel()
    axes = (np.stack([n[1], -n[0]]) / np.linalg.norm(n, axis=0)).T[:, None, :]
    x, tangents = own.locations(face[first[pair]], here)
    there = other.locate(theirs[2][second[pair]], x, axes, np.array([[0.5]]))
    measure = (share * length[keep, None]).ravel() * np.abs(width[0, pair]) * np.linalg.norm(tangents[:, 0], axis=0)
    return Overlap(cell[first[pair]], here, theirs[2][second[pair]], there, axes, measure * weight_at(own.weight, x))


def _project(
    own: Faces,
    face: np.ndarray,
    start: np.ndarray,
    width: np.ndarray,
    n0: np.ndarray,
    turn: np.ndarray,
    x: np.ndarray,
) -> np.ndarray:
    """Place s on cells, from 0 to 1, whose normal n0 + s turn passes through the points x (2, m); clipped beyond."""
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


def _check_fold(other: Faces, vertices: np.ndarray, cell: np.ndarray, covered: np.ndarray) -> None:
    if covered.max(initial=0.0) > FOLD:
        where = vertices[:, np.argmax(cell == np.argmax(covered))].mean(axis=1)
        raise InputError(
            f"body '{other.name}': its contact boundary is folded, two layers of it face the same place near "
            f"({', '.join(f'{c:.4g}' for c in where)}); name only the part of it that can touch."
        )


def _polygons(own: Faces, other: Faces) -> Overlap:
    first, second, mine, theirs, outward = _facing(own, other)
    vertices, at, face, cell = mine
    origin = vertices.mean(axis=2)
    along = vertices[:, :, 1] - vertices[:, :, 0]
    along = along - np.sum(along * outward, axis=0) * outward
    along /= np.linalg.norm(along, axis=0)
    axes = np.stack([along, np.cross(outward, along, axis=0)]).transpose(2, 0, 1)  # (p, 2, 3)
    frame = np.einsum("pad,dpv->pva", axes, vertices - origin[:, :, None])
    area = _areas(frame)
    frame = np.where((area < 0)[:, None, None], frame[:, ::-1], frame)  # counterclockwise
    size = np.sqrt(np.abs(area))
    subject = np.einsum("pad,dpv->pva", axes[first], theirs[0][:, second] - origin[:, first, None])
    low, high = frame.min(axis=1)[first], frame.max(axis=1)[first]
    near = np.flatnonzero(np.all((subject.max(axis=1) > low) & (subject.min(axis=1) < high), axis=1))
    first, second = first[near], second[near]
    polygon = _clip(subject[near], frame[first], size[first])
    # a fan of triangles around the first vertex
    triangles = np.stack([np.repeat(polygon[:, :1], polygon.shape[1] - 2, axis=1), polygon[:, 1:-1], polygon[:, 2:]], 2)
    pair = np.repeat(np.arange(len(first)), triangles.shape[1])
    triangles = triangles.reshape(-1, 3, 2)
    content = np.abs(_areas(triangles))
    full = np.bincount(cell, np.abs(area), len(own.faces) * len(own.cells))
    covered = np.bincount(cell[first[pair]], content, len(full)) / np.where(full > 0, full, 1.0)
    _check_fold(other, vertices, cell, covered)
    keep = (content > 1e-15 * np.abs(area)[first[pair]]) & (covered[cell[first[pair]]] > SMALLEST)
    pair, triangles, content = pair[keep], triangles[keep], content[keep]
    points, share = get_quadrature(RefTri, _order(own, other))
    corner = np.stack([1 - points[0] - points[1], points[0], points[1]])
    y = np.einsum("vq,tva->tqa", corner, triangles).reshape(-1, 2)
    pair = np.repeat(pair, len(share))
    content = (content[:, None] * share / share.sum()).ravel()
    mine_at, theirs_at = first[pair], second[pair]
    E = axes[mine_at]
    x = origin[:, mine_at] + np.einsum("gad,ga->dg", E, y)
    here = own.locate(face[mine_at], x, E, at[:, mine_at].mean(axis=2))
    there = other.locate(theirs[2][theirs_at], x, E, theirs[1][:, theirs_at].mean(axis=2))
    place, tangents = own.locations(face[mine_at], here)
    seen = np.abs(np.linalg.det(np.einsum("gad,dcg->gac", E, tangents)))
    measure = content * np.linalg.norm(cross(tangents), axis=0) / seen * weight_at(own.weight, place)
    return Overlap(cell[mine_at], here, theirs[2][theirs_at], there, E, measure)


def _order(own: Faces, other: Faces) -> int:
    """Degree of the quadrature on triangles: exact for products of hat functions and shape functions on affine faces."""

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
    """Parts (p, v', 2) of polygons (p, v, 2) inside convex counterclockwise windows (p, w, 2); `size` (p,) of the windows.

    Unused places at the end repeat the last vertex; a polygon without vertices is zero.
    """
    count = np.full(len(polygon), polygon.shape[1])
    for edge in range(window.shape[1]):
        a, b = window[:, edge], window[:, (edge + 1) % window.shape[1]]
        inward = np.stack([a[:, 1] - b[:, 1], b[:, 0] - a[:, 0]], axis=1)
        inward /= np.linalg.norm(inward, axis=1)[:, None]
        used = np.arange(polygon.shape[1]) < count[:, None]
        following = np.where(np.arange(polygon.shape[1]) == count[:, None] - 1, 0, np.arange(polygon.shape[1]) + 1)
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
