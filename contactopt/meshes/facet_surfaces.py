"""The surface that the facets of a solid stand for: planes, spheres, cylinders, curved patches.

Facets are cut into triangles. Where two of them meet at a large angle the body has an edge; between
the edges facets in one plane are flat, and the others form regions. The nodes of a region may lie
on a sphere or on a cylinder. Every other region is a patch of quadratic triangles,

    x = sum_i l_i x_i + 4 sum_ij l_i l_j d_ij        (l: barycentric coordinates, i < j),

where d_ij leads from the middle of an edge to the surface: to the node there, of elements of second
order; for others by the normals n at its ends, d = n ((n_j - n_i) . (x_j - x_i)) / 8, which a
quadratic fits to the nodes around a vertex, or which are those of a flat facet there. Points in the
plane of a flat facet at an edge of the body stay in it. The two terms of d are what each end tells;
where these differ, the smaller one gives the other shape that the surface may have.

Source: Nagata (2005), Simple local interpolation of surfaces using normal vectors, Computer Aided
Geometric Design 22.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree
from skfem import Mesh

from contactopt.defaults import EQUAL
from contactopt.meshes.barycentric import barycentric, frames_of
from contactopt.meshes.cells import (
    area_vectors,
    in_triangles,
    is_curved,
    joined,
    outer_corners,
    sides_of,
)
from contactopt.meshes.curves import CORNER, fitted_sphere, rounding, shares
from contactopt.meshes.given_curves import Curve

EDGE = np.deg2rad(60)  # turn of facets of second order from which on there is an edge of the body
FIT = 1e-7  # of its size: how near the nodes of a region lie to a sphere or cylinder, at least
FEWEST = 6  # any so many nodes may lie on a sphere or cylinder
SAMPLE = 1000  # nodes to which spheres and cylinders are fitted
NEAREST = 16  # triangles among which the one nearest to a point is looked for
ALTERNATE = 60  # projections on a surface and on a plane in turn
SAME = 1e-3  # relative difference of what two ends tell that rounding of files makes
TRIED = 4  # of these triangles on whose patches a point may lie
FOOTS = 6  # projections on the triangle below a point of its patch, which gain a digit each
STRETCHED = 10.0  # times the way to the surface that the way to it within a plane may be
PREFER = 1e-6  # by how much less a curved triangle may be near than a flat one
Shape = Callable[[np.ndarray], np.ndarray]


def space_curves(mesh: Mesh) -> dict[str, Curve | None]:
    """By the name of each boundary of a solid's mesh, '' for others, its surface, None if flat."""
    skin, found = _Skin(mesh), dict[str, Any]()
    for name, label, mine in shares(mesh, skin.owner):
        found[name] = None
        if np.any(skin.region[mine] >= 0):
            found[name] = Curve(_Patches(skin, mine, skin.off), skin.known, label)
            if np.any(skin.other[:, :, mine] != skin.off[:, :, mine]):
                found[name].other = _Patches(skin, mine, skin.other)
    return found


class _Skin:
    """The triangles of the surface of a mesh.

    nodes    (3, t) their corners;   owner  (t,) the facet of the mesh
    corners  (3, 3, t) places of the corners
    off      (3, 3, t) from the middles of edges 01, 12, 20 to the surface;   other  to its other
             shape
    planes   (3, 3, t) normals of flat triangles beyond these edges, nan where the body has no edge
    region   (t,) the number of the region, -1 of flat triangles
    shapes   of each region its sphere or cylinder, or None
    known    whether the mesh has curved edges
    near     how far nodes may be off by rounding [length]
    """

    def __init__(self, mesh: Mesh) -> None:
        facets = mesh.boundary_facets()
        self.nodes, middles = edge_middles(mesh, facets)
        self.owner = np.resize(facets, self.nodes.shape[1])
        self.corners = mesh.p[:, self.nodes]
        self.middles = middles
        self.off = middles - _between(self.corners)
        length = np.linalg.norm(_along(self.corners), axis=0)
        self.known = bool(np.any(np.linalg.norm(self.off, axis=0) > EQUAL * length))
        self.near = rounding(self.corners.reshape(3, -1))
        area = area_vectors(self.corners)
        self.normals = area / np.linalg.norm(area, axis=0)
        pairs, sides = _neighbours(self.nodes)
        cosine = np.sum(self.normals[:, pairs[0]] * self.normals[:, pairs[1]], axis=0)
        smooth = np.arccos(cosine.clip(-1, 1)) < (EDGE if self.known else CORNER)
        flat = self._flat(pairs, sides, smooth)
        self.planes = np.full_like(self.off, np.nan)
        for here, there in ((0, 1), (1, 0)):
            rim = ~smooth & flat[pairs[there]]
            self.planes[:, sides[here, rim], pairs[here, rim]] = self.normals[:, pairs[there, rim]]
        inner = smooth & ~flat[pairs[0]] & ~flat[pairs[1]]
        self.region = np.where(flat, -1, joined(pairs[:, inner], len(flat)))
        self.region[~flat] = np.unique(self.region[~flat], return_inverse=True)[1]
        self.shapes = [self._shape(region) for region in range(self.region.max(initial=-1) + 1)]
        free = np.array([shape is None for shape in self.shapes] + [False])[self.region]
        self.other = self.off.copy()
        if not self.known:
            given = np.full((3, self.nodes.max() + 1), np.nan)
            for here, there in ((0, 1), (1, 0)):  # a flat facet that a curved one continues
                rim = smooth & flat[pairs[here]] & ~flat[pairs[there]]
                plane = self.normals[:, pairs[here, rim]]
                for corner in (0, 1):
                    node = self.nodes[(sides[here, rim] + corner) % 3, pairs[here, rim]]
                    given[:, node] = plane
            self._guess(free, given)

    def _flat(self, pairs: np.ndarray, sides: np.ndarray, smooth: np.ndarray) -> np.ndarray:
        """Whether each triangle (t,) is flat, with its piece or with all others at a corner."""
        level = smooth.copy()
        for here, there in ((0, 1), (1, 0)):
            opposite = self.corners[:, (sides[there] + 2) % 3, pairs[there]]
            offset = opposite - self.corners[:, 0, pairs[here]]
            height = np.sum(offset * self.normals[:, pairs[here]], axis=0)
            level &= np.abs(height) < 2 * self.near
        count = len(self.owner)
        height = np.sum(self.off * self.normals[:, None], axis=0)
        straight = np.all(np.abs(height) < 2 * self.near, axis=0)
        piece = joined(pairs[:, smooth], count)
        bent = np.zeros(count, dtype=bool)
        bent[piece[pairs[0, smooth & ~level]]] = True
        bent[piece[~straight]] = True
        around = np.bincount(self.nodes.ravel())
        ends = np.stack([self.nodes[sides[0], pairs[0]], self.nodes[(sides[0] + 1) % 3, pairs[0]]])
        whole = np.bincount(ends[:, level].ravel(), minlength=len(around)) == around
        return np.asarray(straight & (~bent[piece] | whole[self.nodes].any(axis=0)))

    def _shape(self, region: int) -> Shape | None:
        mine = self.region == region
        points = self.corners
        if self.known:
            points = np.concatenate([points, self.middles], axis=1)
        places = np.unique(points[:, :, mine].reshape(3, -1), axis=1)
        near = max(self.near, FIT * np.ptp(places, axis=1).max())
        return _sphere(places, near) or _cylinder(places, self.normals[:, mine], near)

    def _guess(self, free: np.ndarray, given: np.ndarray) -> None:
        """Set the middles of edges in free regions by the normals at their ends, or nan."""
        places = np.empty_like(given)
        places[:, self.nodes] = self.corners
        for region in np.unique(self.region[free]):
            mine = np.flatnonzero(self.region == region)
            normals = _vertex_normals(places, self.nodes[:, mine], self.normals[:, mine], given)
            at = normals[:, self.nodes[:, mine]]
            mean = _between(at) / np.linalg.norm(_between(at), axis=0)
            along = _along(self.corners[:, :, mine])
            told = np.stack(
                [-np.sum(n * along, axis=0) / 4 for n in (at, -np.roll(at, -1, axis=1))]
            )
            self.off[:, :, mine] = mean * told.mean(axis=0)
            alike = np.ptp(told, axis=0) <= SAME * np.abs(told).max(axis=0)
            least = np.where(np.prod(told, axis=0) > 0, np.abs(told).min(axis=0), 0.0)
            least = np.where(alike, told.mean(axis=0), np.sign(told[0]) * least)
            self.other[:, :, mine] = mean * least


def _between(corners: np.ndarray) -> np.ndarray:
    """Means of values (dim, 3, t) at the ends of the edges 01, 12, 20."""
    return np.asarray((corners + np.roll(corners, -1, axis=1)) / 2)


def _along(corners: np.ndarray) -> np.ndarray:
    """Changes of values (dim, 3, t) along the edges 01, 12, 20."""
    return np.asarray(np.roll(corners, -1, axis=1) - corners)


def edge_middles(mesh: Mesh, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (v, f) of facets, quadrilaterals cut in two, and the middles (dim, 1 or 3, f) of
    their edges 01, 12, 20.
    """
    corners = outer_corners(mesh, facets)
    nodes = in_triangles(corners)
    ends = sides_of(nodes) if len(nodes) == 3 else nodes[:, None]
    middles = mesh.p[:, ends].mean(axis=1)
    if not is_curved(mesh):
        return nodes, middles
    if len(nodes) == 2:
        return nodes, mesh.doflocs[:, None, mesh.dofs.facet_dofs[0, facets]]
    size = mesh.nvertices
    both = mesh.edges.astype(np.int64), ends
    keys, wanted = (np.minimum(*each) * size + np.maximum(*each) for each in both)
    order = np.argsort(keys)
    place = order[np.searchsorted(keys[order], wanted).clip(max=len(keys) - 1)]
    there = keys[place] == wanted  # diagonals of quadrilaterals are no edges
    middles[:, there] = mesh.doflocs[:, mesh.dofs.edge_dofs[0, place[there]]]
    if len(corners) == 4:
        centres = mesh.doflocs[:, mesh.dofs.facet_dofs[0, facets]]
        middles[:, 2, : len(facets)] = middles[:, 0, len(facets) :] = centres
    return nodes, middles


def _neighbours(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (2, m) that share an edge, and which of the edges 01, 12, 20 it is of each."""
    count = nodes.shape[1]
    ends = np.sort(sides_of(nodes), axis=0).reshape(2, -1)
    order = np.lexsort(ends)
    same = np.all(ends[:, order[1:]] == ends[:, order[:-1]], axis=0)
    first, second = order[:-1][same], order[1:][same]
    return np.stack([first, second]) % count, np.stack([first, second]) // count


def _vertex_normals(
    places: np.ndarray, nodes: np.ndarray, normals: np.ndarray, given: np.ndarray
) -> np.ndarray:
    """Normals (3, n) at nodes of a region: those given, or of quadratics through nodes around."""
    size = places.shape[1]
    found = np.zeros((3, size))
    for row in nodes:
        np.add.at(found.T, row, normals.T)
    mine = np.unique(nodes)
    found[:, mine] /= np.linalg.norm(found[:, mine], axis=0)
    ends = nodes.ravel(), np.roll(nodes, -1, axis=0).ravel()
    near = csr_matrix((np.ones(nodes.size), ends), (size, size))
    near = near + near.T
    around = near + near @ near
    for node in mine.tolist():
        others = around.indices[around.indptr[node] : around.indptr[node + 1]]
        others = others[others != node]
        if not np.isnan(given[0, node]):
            found[:, node] = given[:, node]
        elif len(others) >= 5:
            # the normal and two directions along the surface
            axes = np.linalg.svd(found[:, [node]])[0]
            z, x, y = axes.T @ (places[:, others] - places[:, [node]])
            weight = 1 / (x**2 + y**2)
            terms = np.stack([x, y, x**2, x * y, y**2], axis=1)
            slope = np.linalg.lstsq(terms * weight[:, None], z * weight, rcond=None)[0]
            normal = axes @ np.array([1.0, -slope[0], -slope[1]])
            found[:, node] = np.sign(normal @ found[:, node]) * normal / np.linalg.norm(normal)
    return found


def _sphere(places: np.ndarray, near: float) -> Shape | None:
    """The projection on the sphere on which places (3, m) lie."""
    centre, radius = fitted_sphere(places)
    off = np.linalg.norm(places - centre, axis=0) - radius
    if places.shape[1] <= FEWEST or np.any(np.abs(off) > near):
        return None

    def project(points: np.ndarray) -> np.ndarray:
        away = points - centre
        return np.asarray(centre + radius * away / np.linalg.norm(away, axis=0))

    return project


def _cylinder(places: np.ndarray, normals: np.ndarray, near: float) -> Shape | None:
    """The projection on the cylinder on which places (3, m) lie; its facets are along its axis."""
    few = places[:, :: 1 + places.shape[1] // SAMPLE]
    frame = np.linalg.eigh(normals @ normals.T)[1]  # the first direction is the axis, about

    def section(tilt: np.ndarray) -> np.ndarray:
        axis = frame @ np.array([1.0, *tilt])
        axis = axis / np.linalg.norm(axis)
        return np.asarray(np.linalg.svd(axis[None])[2][1:])  # (2, 3) directions across the axis

    def off(tilt: np.ndarray, x: np.ndarray = few) -> np.ndarray:
        flat = section(tilt) @ x
        centre, radius = fitted_sphere(section(tilt) @ few)
        return np.asarray(np.linalg.norm(flat - centre, axis=0) - radius)

    from scipy.optimize import least_squares  # late, since it takes long to import

    size = np.ptp(places, axis=1).max()
    best = least_squares(
        lambda tilt: off(tilt) / size, np.zeros(2), x_scale=0.1, xtol=1e-15, ftol=1e-15, gtol=1e-15
    ).x
    if places.shape[1] <= FEWEST or np.any(np.abs(off(best, places)) > near):
        return None
    across = section(best)
    centre, radius = fitted_sphere(across @ few)

    def project(points: np.ndarray) -> np.ndarray:
        away = across @ points - centre
        return np.asarray(points + across.T @ (away * (radius / np.linalg.norm(away, axis=0) - 1)))

    return project


class _Patches:
    """The surface of some of the triangles."""

    def __init__(self, skin: _Skin, mine: np.ndarray, off: np.ndarray) -> None:
        self.corners, self.off = skin.corners[:, :, mine], off[:, :, mine]
        self.planes = skin.planes[:, :, mine]
        self.rims = _in_planes(self.off, self.planes)
        self.region, self.shapes, self.near = skin.region[mine], skin.shapes, skin.near
        self.frames = frames_of(self.corners)
        self.tree = cKDTree(self.corners.mean(axis=1).T)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """The places (3, m) of points near the triangles."""
        count = min(NEAREST, len(self.region))
        near = self.tree.query(points.T, k=count)[1].reshape(points.shape[1], count)
        outside = barycentric(self.frames, near, points)[1]
        outside = outside + PREFER * (self.region[near] < 0)
        best = near[np.arange(len(near)), np.argmin(outside, axis=1)]
        found, within = self._on(points, best)
        # a point of one patch may lie above the triangle of its neighbour
        left = np.flatnonzero(~within)
        order = np.argsort(outside[left], axis=1)[:, 1:TRIED]
        for others in np.take_along_axis(near[left], order, axis=1).T:
            mine = self.region[others] == self.region[best[left]]
            some, other = left[mine], others[mine]
            there = self._on(points[:, some], other)[0]
            away = [np.linalg.norm(x - points[:, some], axis=0) for x in (there, found[:, some])]
            nearer = away[0] < away[1]
            found[:, some[nearer]] = there[:, nearer]
        return found

    def _on(self, points: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The places of points on chosen triangles, those in a plane beyond an edge of the body in
        this plane; and whether no other triangle can be meant.
        """
        found, within = points.copy(), np.ones(len(chosen), dtype=bool)
        for region in np.unique(self.region[chosen]):
            some = np.flatnonzero(self.region[chosen] == region)
            if region >= 0 and self.shapes[region] is not None:
                found[:, some] = self.shapes[region](points[:, some])
            elif region >= 0:
                found[:, some], within[some] = self._on_patch(points[:, some], chosen[some])
        for edge in range(3):
            normal = self.planes[:, edge, chosen]
            height = np.sum(normal * (points - self.corners[:, edge, chosen]), axis=0)
            rim = (np.abs(height) < 2 * self.near) & (self.region[chosen] >= 0)
            within |= rim  # nothing where there is no plane
            for region in np.unique(self.region[chosen[rim]]):
                some = np.flatnonzero(rim & (self.region[chosen] == region))
                shape = self.shapes[region]
                if shape is None:
                    found[:, some] = self._on_rim(edge, points[:, some], chosen[some])
                else:
                    where = found[:, some], points[:, some], normal[:, some]
                    found[:, some] = _in_plane(*where, shape)
        return found, within

    def _on_patch(self, points: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The places of points on the patches of chosen triangles, and whether these have them."""
        off, bulge = self.off[:, :, chosen], np.zeros_like(points)
        for _ in range(FOOTS):
            weights = barycentric(self.frames, chosen, points - bulge)[0]
            share = np.clip(weights, 0, 1)
            share = share / share.sum(axis=0)
            bulge = 4 * np.sum(off * (share * np.roll(share, -1, axis=0)), axis=1)
        place = np.sum(self.corners[:, :, chosen] * share, axis=1)
        return place + bulge, np.all(weights >= 0, axis=0)

    def _on_rim(self, edge: int, points: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """Points in the plane beyond an edge of the chosen triangles, on the curve of that edge."""
        begin, end = self.corners[:, edge, chosen], self.corners[:, (edge + 1) % 3, chosen]
        along = end - begin
        t = np.sum((points - begin) * along, axis=0) / np.sum(along**2, axis=0)
        t = np.clip(t, 0, 1)
        return np.asarray(begin + t * along + 4 * t * (1 - t) * self.rims[:, edge, chosen])


def _in_planes(off: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Ways (3, 3, t) from the middles of edges to the surface, turned into the planes beyond these
    edges: no more than STRETCHED times as long, as where a surface ends in a plane at its tangent.
    """
    inside = off - normal * np.sum(off * normal, axis=0)
    size, square = np.sum(inside**2, axis=0), np.sum(off**2, axis=0)
    stretch = np.divide(square, size, out=np.ones_like(size), where=size > square / STRETCHED)
    return np.asarray(inside * stretch)


def _in_plane(
    found: np.ndarray, points: np.ndarray, normal: np.ndarray, shape: Shape
) -> np.ndarray:
    """Places (3, m) moved into the planes of the points, and along them to a sphere or cylinder."""
    for _ in range(ALTERNATE):
        found = shape(found - normal * np.sum((found - points) * normal, axis=0))
    return np.asarray(found - normal * np.sum((found - points) * normal, axis=0))
