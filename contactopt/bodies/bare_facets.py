"""The contact surface of a body whose facets are known and whose elements are not.

Each facet gets an element of its own behind it, which lends its shape functions, its normals and
its quadrature to the trace of the displacement (contactopt.bodies.elements). Its other nodes belong
to nobody and have no weight. Facets of three nodes in the plane are those of quadrilaterals where
the stiffness says so, else of triangles.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
import skfem

from contactopt.bodies.corners import copies
from contactopt.bodies.elements import (
    Trace,
    Weight,
    contact_trace,
    make_basis,
    mean_normals,
    node_unknowns,
)
from contactopt.checks import place_words
from contactopt.defaults import CLOSE, EQUAL
from contactopt.errors import InputError
from contactopt.meshes.cells import CURVED, SHAPES, facets_at

# (dimension, nodes of a facet) -> element behind it, corners of the facet
KINDS = {
    (2, 2): ("RefTri", 2), (2, 3): ("RefTri", 2), (3, 3): ("RefTet", 3), (3, 4): ("RefHex", 4),
    (3, 6): ("RefTet", 3), (3, 8): ("RefHex", 4), (3, 9): ("RefHex", 4),
}  # fmt: skip
BESIDE = 0.25  # of an edge: how far a node in the middle may lie from it


class BareSurface(NamedTuple):
    """The trace on the facets of a body.

    nodes  (nodes of the elements behind the facets,) the point of the body at each; -1 for none
    kind   their reference element;   outward  (dim, f) mean normals
    """

    trace: Trace
    nodes: np.ndarray
    kind: str
    degree: int
    outward: np.ndarray


def ordered(points: np.ndarray, facets: np.ndarray, what: str) -> np.ndarray:
    """The facets (f, j): corners cyclic, then middles of edges from (0, 1) on, then centres."""
    (dim, _), count = points.shape, facets.shape[1]
    corners, facets = KINDS[dim, count][1], facets.copy()
    if (dim, count) == (2, 3):  # the middle may be named second
        x = points[:, facets]
        off = np.linalg.norm(2 * x - np.roll(x, 1, axis=2) - np.roll(x, 2, axis=2), axis=0)
        turn = np.array([[1, 2, 0], [2, 0, 1], [0, 1, 2]])[np.argmin(off, axis=1)]
        facets = np.take_along_axis(facets, turn, axis=1)
    if corners == 4:  # crossed diagonals span the largest area
        ways = np.array([[0, 1, 2, 3], [0, 1, 3, 2], [0, 2, 1, 3]])
        x = points[:, facets[:, ways]]  # (dim, f, way, 4)
        areas = np.cross(x[..., 2] - x[..., 0], x[..., 3] - x[..., 1], axis=0)
        best = ways[np.argmax(np.linalg.norm(areas, axis=0), axis=1)]
        facets[:, :4] = np.take_along_axis(facets, best, axis=1)
    if count == corners:
        return facets
    ends = points[:, facets[:, :corners]]
    after = np.roll(ends, -1, axis=2)
    sides = corners if dim == 3 else 1
    middles = ((ends + after) / 2)[..., :sides]
    edges = np.linalg.norm(after - ends, axis=0)[:, :sides]
    own = slice(corners, corners + sides)
    given = points[:, facets[:, own]]
    apart = np.linalg.norm(middles[..., :, None] - given[..., None, :], axis=0)  # (f, side, node)
    nearest = np.argmin(apart, axis=2)
    wrong = np.take_along_axis(apart, nearest[..., None], 2)[..., 0] > BESIDE * edges
    wrong |= np.sort(nearest, axis=1) != np.arange(sides)
    if wrong.any():
        place = place_words(ends.mean(axis=2)[:, np.flatnonzero(wrong.any(axis=1))[0]])
        raise InputError(
            f"{what}: the nodes in the middle of the edges of the facet at ({place}) are not there;"
            " name its corners first, then these, or give its corners alone if it is linear."
        )
    facets[:, own] = np.take_along_axis(facets[:, own], nearest, axis=1)
    return facets


def turned_outwards(
    points: np.ndarray, facets: np.ndarray, coupled: sp.csr_matrix | None, what: str
) -> np.ndarray:
    """(dim, f) outward unit normals of facets whose corners come first. Nodes that are `coupled`
    (N, N) to all nodes of a facet lie beneath it; without any, the order of the corners decides:
    the body is on the left in the plane, and in space they go round against the clock, seen from
    outside. InputError for a facet without an area or with nodes on both sides.
    """
    corners = KINDS[len(points), facets.shape[1]][1]
    x = points[:, facets[:, :corners]]
    middle = x.mean(axis=2)
    longest = np.linalg.norm(x - np.roll(x, 1, axis=2), axis=0).max(axis=1)
    if len(points) == 2:
        d = x[..., 1] - x[..., 0]
        normal = np.stack([d[1], -d[0]])
    else:
        normal = np.cross(x[..., 1] - x[..., -1], x[..., 2] - x[..., 0], axis=0)
    length = np.linalg.norm(normal, axis=0)
    flat = length <= EQUAL * longest ** (len(points) - 1)
    if flat.any():
        place = place_words(middle[:, np.flatnonzero(flat)[0]])
        raise InputError(f"{what}: the facet at ({place}) has no area; its corners lie on a line.")
    normal = normal / length
    if coupled is None:
        return np.asarray(normal)
    rows = np.repeat(np.arange(len(facets)), facets.shape[1])
    shape = len(facets), points.shape[1]
    member = sp.csr_matrix((np.ones(facets.size), (rows, facets.ravel())), shape)
    beneath = sp.coo_matrix(member @ coupled)
    apart = points[:, beneath.col] - middle[:, beneath.row]
    height = np.sum(apart * normal[:, beneath.row], axis=0) / longest[beneath.row]
    chosen = (beneath.data > facets.shape[1] - 0.5) & (np.abs(height) > CLOSE)
    low, high = np.zeros(len(facets)), np.zeros(len(facets))
    np.minimum.at(low, beneath.row[chosen], height[chosen])
    np.maximum.at(high, beneath.row[chosen], height[chosen])
    both = np.minimum(-low, high) > np.maximum(-low, high) / 2
    if both.mean() > 0.5:  # more than at concave edges
        place = place_words(middle[:, np.flatnonzero(both)[0]])
        raise InputError(
            f"{what}: the facet at ({place}) lies inside the body, which K couples on both of its"
            " sides; name facets of the surface."
        )
    return np.where(high > -low, -normal, normal)


def bare_surface(
    points: np.ndarray,
    facets: np.ndarray,
    outward: np.ndarray,
    weight: Weight,
    every: bool,
    coupled: sp.csr_matrix | None,
) -> BareSurface:
    """The trace on facets (f, j) with normals (dim, f); arguments as in contact_trace."""
    dim, (kind, corners) = len(points), KINDS[len(points), facets.shape[1]]
    if (dim, facets.shape[1]) == (2, 3) and coupled is not None:
        many = np.median(np.diff(coupled.indptr)[facets[:, 2]]) > 6  # nodes of a triangle
        kind = "RefQuad" if many else kind
    degree = 1 if facets.shape[1] == corners else 2
    known, ends = np.unique(facets[:, :corners], return_inverse=True)
    ends = ends.reshape(len(facets), corners)
    x, count = points[:, known], len(known)
    at = x[:, ends]
    depth = 0.5 * np.linalg.norm(at[..., 1] - at[..., 0], axis=0) * outward  # of the facet's size
    if kind in ("RefHex", "RefQuad"):
        behind = (at - depth[..., None]).reshape(dim, -1)
        added = count + np.arange(behind.shape[1]).reshape(len(facets), corners)
        # skfem's order: cyclic; or a corner, its three neighbours, those opposite them, the last
        order = [0, 1, 3, 2] if kind == "RefQuad" else [0, 1, 3, 4, 2, 5, 7, 6]
        t = np.concatenate([ends, added], axis=1)[:, order].T
    else:
        behind = at.mean(axis=2) - depth
        t = np.concatenate([ends, count + np.arange(len(facets))[:, None]], axis=1).T
    plain = SHAPES[kind][0](np.concatenate([x, behind], axis=1), np.ascontiguousarray(t))
    mesh = plain if degree == 1 else _curved(plain, kind, points, facets, corners)
    boundary = facets_at(plain, ends.T)
    basis = make_basis(mesh, degree, weight[1])
    copied = copies(basis, degree, boundary, mesh, None)
    trace = contact_trace(basis, degree, boundary, weight, every, copied)
    nodes: np.ndarray = np.full(basis.N // dim, -1)
    own = trace.copies[trace.faces]  # (f, j) nodes of the basis on each facet
    places = basis.doflocs[:, node_unknowns(basis)[0]][:, own]
    apart = np.linalg.norm(places[..., None] - points[:, facets][:, :, None], axis=0)
    nodes[own] = np.take_along_axis(facets, np.argmin(apart, axis=2), axis=1)
    return BareSurface(trace, nodes, kind, degree, mean_normals(basis, degree, boundary))


def _curved(
    plain: skfem.Mesh, kind: str, points: np.ndarray, facets: np.ndarray, corners: int
) -> skfem.Mesh:
    """The elements of second order whose nodes on the facets are those of the body."""
    mesh = CURVED[kind].from_mesh(plain)
    doflocs, dofs = np.array(mesh.doflocs), mesh.dofs.element_dofs  # (nodes, f)
    ends = points[:, facets[:, :corners]]
    middles = (ends + np.roll(ends, -1, axis=2)) / 2
    for place in range(corners, facets.shape[1]):
        there = ends.mean(axis=2) if place == 2 * corners else middles[..., place - corners]
        apart = np.linalg.norm(mesh.doflocs[:, dofs] - there[:, None], axis=0)
        own = dofs[np.argmin(apart, axis=0), np.arange(len(facets))]
        doflocs[:, own] = points[:, facets[:, place]]
    return CURVED[kind](doflocs, mesh.t)
