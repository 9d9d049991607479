"""Triangles and tetrahedra divided where they are marked, with named boundaries kept and curved boundaries kept curved.

scikit-fem divides the elements, by red, green and blue patterns in the plane and by bisection in space, but forgets the
named boundaries. Every new boundary facet lies in one old boundary facet, which gives it its names. New nodes then move to
the surface that the mesh stands for.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import skfem
from scipy.spatial import cKDTree

from contactopt.bodies.elements import is_curved, straight

log = logging.getLogger(__name__)
Curve = Callable[[np.ndarray], np.ndarray]
NEAREST = 16  # old facets among which the one that holds a new facet is looked for
FLAT = 0.1  # least share of its volume that an element keeps where its nodes move to a curved boundary
ROUND = 1e-5  # distance of nodes from a circle, over its radius, within which they lie on it: files round their numbers
BENT = 0.15  # sagitta of an edge over its length, beyond which the mesh is too coarse for its curve
CORNER = np.deg2rad(30)  # turn of a polygon between two edges from which on it is a corner of the body


def simplices(mesh: Any) -> Any:
    """Cut a mesh into straight triangles or tetrahedra.

    Parameters
    ----------
    mesh
        A scikit-fem mesh. Its quadrilaterals and hexahedra are cut, its curved edges become straight.

    Returns
    -------
    Mesh
        The mesh of simplices, with the names of the boundaries.
    """
    if is_curved(mesh):
        mesh = replace(straight(mesh), _boundaries=mesh.boundaries)
    if isinstance(mesh, skfem.MeshQuad):
        return named_like(mesh, replace(mesh.to_meshtri(), _boundaries=None))
    if isinstance(mesh, skfem.MeshHex):
        return named_like(mesh, replace(mesh.to_meshtet(), _boundaries=None))
    return mesh


def divide(mesh: Any, marked: np.ndarray, curves: Mapping[str, Curve]) -> Any:
    """The mesh with the marked elements divided, and others as far as it takes to stay conforming.

    Parameters
    ----------
    mesh : MeshTri or MeshTet of scikit-fem, with named boundaries
    marked : numbers of the elements to divide
    curves : for the names of curved boundaries, a function (dim, k) -> (dim, k) that puts new nodes on the true surface

    Returns
    -------
    A mesh of the same kind with the same named boundaries.
    """
    nameless = replace(mesh, _boundaries=None)  # scikit-fem would warn that it loses the names
    with _no_word_of_copies():
        fine = named_like(mesh, nameless.refined(np.asarray(marked)))
    new = np.arange(mesh.p.shape[1], fine.p.shape[1])
    points = fine.p.copy()
    for name, curve in curves.items():
        mine = np.intersect1d(new, np.unique(fine.facets[:, fine.boundaries[name]]))
        if len(mine):
            points[:, mine] = curve(points[:, mine])
    sizes, moved = _volumes(fine.p, fine.t), _volumes(points, fine.t)
    if np.any(moved * np.sign(sizes) < FLAT * np.abs(sizes)):
        log.warning(
            "new nodes stay on the edges of the mesh: on the curved boundary they would turn elements inside out"
        )
        return fine
    return replace(fine, doflocs=points)


def bent(mesh: Any, curves: Mapping[str, Curve]) -> Any:
    """Bend the edges of a plane mesh of straight triangles along its curved boundaries.

    Elements and named boundaries keep their numbers. An edge that would leave its chord by more than BENT of its length stays
    straight; so do solids, and meshes without a curved boundary.

    Parameters
    ----------
    mesh
        A scikit-fem mesh.
    curves
        By the name of a boundary the curve that moves points (2, m) onto it [length].

    Returns
    -------
    mesh
        A mesh of second order, or the same mesh where nothing is bent.
    """
    known = {name: curve for name, curve in curves.items() if len(mesh.boundaries[name])}
    if len(mesh.p) != 2 or not known:
        return mesh
    with _no_word_of_copies():
        made = skfem.MeshTri2.from_mesh(mesh)
    points = made.doflocs.copy()
    for name, curve in known.items():
        facets = mesh.boundaries[name]
        middle = made.dofs.facet_dofs[0, facets]
        start, end = mesh.p[:, mesh.facets[:, facets]].transpose(1, 0, 2)
        new = curve((start + end) / 2)
        near = np.linalg.norm(new - (start + end) / 2, axis=0) <= BENT * np.linalg.norm(end - start, axis=0)
        points[:, middle[near]] = new[:, near]
    return replace(made, doflocs=points, _boundaries=mesh.boundaries)


@contextmanager
def _no_word_of_copies() -> Iterator[None]:
    """scikit-fem says of large arrays that it copies them; no user can do anything about it."""
    skfem_log = logging.getLogger("skfem.mesh.mesh")

    def filtered(record: logging.LogRecord) -> bool:
        return "C_CONTIGUOUS" not in record.getMessage()

    skfem_log.addFilter(filtered)
    try:
        yield
    finally:
        skfem_log.removeFilter(filtered)


def _volumes(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(t,) signed volumes of simplices, times the factorial of the dimension."""
    edges = points[:, cells[1:]] - points[:, cells[:1]]
    return np.asarray(np.linalg.det(np.moveaxis(edges, 2, 0)))


def named_like(old: Any, new: Any) -> Any:
    """Give a mesh the named boundaries of another one, whose boundary facets hold its own.

    Parameters
    ----------
    old
        A scikit-fem mesh with named boundaries.
    new
        A mesh of simplices of the same body, or of a part of it.

    Returns
    -------
    mesh
        `new` with the boundaries of `old`.
    """
    if not old.boundaries:
        return new
    dim, facets, outer = len(old.p), old.boundary_facets(), new.boundary_facets()
    choices = list(combinations(range(len(old.facets)), dim))  # of quadrilaterals all triangles between their corners
    corners = np.concatenate([old.p[:, old.facets[list(choice)][:, facets]] for choice in choices], axis=2)
    facets = np.tile(facets, len(choices))
    centres = new.p[:, new.facets[:, outer]].mean(axis=1)
    count = min(NEAREST, len(facets))
    near = cKDTree(corners.mean(axis=1).T).query(centres.T, k=count)[1].reshape(len(outer), count)
    parent = facets[near[np.arange(len(outer)), np.argmin(_outside(corners[:, :, near], centres), axis=1)]]
    names = {name: outer[np.isin(parent, members)] for name, members in old.boundaries.items()}
    return replace(new, _boundaries={name: np.sort(members).astype(np.int32) for name, members in names.items()})


def _outside(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """How far points (dim, f) are from facets with corners (dim, dim, f, c), over the size of the facets: (f, c)."""
    origin, edges = corners[:, 0], corners[:, 1:] - corners[:, :1]
    offset = points[:, :, None] - origin
    gram = np.einsum("iafc,ibfc->fcab", edges, edges)
    weights = np.linalg.solve(gram, np.einsum("iafc,ifc->fca", edges, offset)[..., None])[..., 0]
    beyond = np.maximum(np.maximum(-weights, 0).max(axis=-1), np.maximum(weights.sum(axis=-1) - 1, 0))
    height = np.linalg.norm(offset - np.einsum("iafc,fca->ifc", edges, weights), axis=0)
    return np.asarray(beyond + height / np.sqrt(np.trace(gram, axis1=2, axis2=3)))


def boundary_curve(mesh: Any, name: str, arcs: bool = False) -> Curve | None:
    """Lay a smooth line through the nodes of a plane boundary, by arc length.

    Where the boundary turns by more than CORNER it has a corner, and the pieces between corners are smooth by
    themselves. A piece whose nodes lie on a circle is an arc of that circle.

    Parameters
    ----------
    mesh
        A scikit-fem mesh.
    name
        One of its boundaries.
    arcs
        Whether every piece has to be an arc or straight. Otherwise the boundary is taken for the polygon that it is.

    Returns
    -------
    callable or None
        A function that moves points (2, m) to their places on the line (2, m) [length]. None in space, for straight
        boundaries, and with `arcs` for a polygon.

    """
    if mesh.p.shape[0] != 2:
        return None
    facets, points = mesh.boundaries[name], mesh.p
    edges = mesh.facets[:, facets]
    if is_curved(mesh):
        points, middle = mesh.doflocs, mesh.dofs.facet_dofs[0, facets]
        edges = np.concatenate([[edges[0], middle], [middle, edges[1]]], axis=1)
    pieces = [_Piece(points[:, chain]) for chain in _chains(edges, points)]
    if all(piece.flat for piece in pieces) or (arcs and not all(piece.flat or piece.circle for piece in pieces)):
        return None

    def curve(points: np.ndarray) -> np.ndarray:
        found = [piece.place(points) for piece in pieces]
        closest = np.argmin([distance for _, distance in found], axis=0)
        return np.asarray(np.stack([place for place, _ in found])[closest, :, np.arange(points.shape[1])].T)

    return curve


class _Piece:
    """A chain of nodes (2, m) between two corners, and the line through them."""

    def __init__(self, nodes: np.ndarray) -> None:
        steps = np.linalg.norm(np.diff(nodes, axis=1), axis=0)
        self.nodes, self.arc = nodes, np.concatenate([[0.0], np.cumsum(steps)])
        turns = np.diff(np.unwrap(np.arctan2(*np.diff(nodes, axis=1)[::-1])))
        self.flat = nodes.shape[1] < 3 or bool(np.all(np.abs(turns) < 1e-9))
        closed = nodes.shape[1] > 3 and np.array_equal(nodes[:, 0], nodes[:, -1])
        from scipy.interpolate import CubicSpline  # a tenth of a second, for curved boundaries only

        self.line = CubicSpline(self.arc, nodes.T, bc_type="periodic" if closed else "not-a-knot")
        self.circle = None if self.flat else _circle(nodes)

    def place(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The places (2, k) on the line for points near it, and how far (k,) these are from the polygon."""
        a, edge = self.nodes[:, :-1], np.diff(self.nodes, axis=1)
        offset = points[:, :, None] - a[:, None]
        share = np.clip(np.sum(offset * edge[:, None], axis=0) / np.sum(edge**2, axis=0), 0, 1)
        distance = np.linalg.norm(offset - share * edge[:, None], axis=0)
        best = np.argmin(distance, axis=1)
        rows = np.arange(points.shape[1])
        if self.circle is not None:
            centre, radius = self.circle
            away = points - centre[:, None]
            return centre[:, None] + radius * away / np.linalg.norm(away, axis=0), distance[rows, best]
        at = self.arc[best] + share[rows, best] * np.diff(self.arc)[best]
        return np.asarray(self.line(at)).T, distance[rows, best]


def _circle(nodes: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Centre and radius of the circle on which at least four nodes (2, m) lie; None where they do not."""
    if nodes.shape[1] < 4:
        return None
    middle = nodes.mean(axis=1)
    offset = nodes - middle[:, None]
    terms = np.column_stack([2 * offset.T, np.ones(nodes.shape[1])])
    x, y, rest = np.linalg.lstsq(terms, np.sum(offset**2, axis=0), rcond=None)[0]
    radius = float(np.sqrt(max(rest + x**2 + y**2, 0.0)))
    off = np.abs(np.hypot(offset[0] - x, offset[1] - y) - radius)
    return (middle + np.array([x, y]), radius) if np.all(off < ROUND * radius) else None


def _chains(edges: np.ndarray, points: np.ndarray) -> list[np.ndarray]:
    """Edges (2, f) joined to chains of nodes that end at ends and at corners."""
    neighbours: dict[int, list[int]] = {}
    for a, b in edges.T.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    ends = {node for node, others in neighbours.items() if len(others) != 2 or _turns(points, node, others)}
    left = {tuple(sorted(edge)) for edge in edges.T.tolist()}
    chains = []
    while left:
        open_ends = [node for edge in left for node in edge if node in ends]
        chain = [open_ends[0] if open_ends else next(iter(left))[0]]
        while True:
            follow = [n for n in neighbours[chain[-1]] if tuple(sorted((chain[-1], n))) in left]
            if not follow or (len(chain) > 1 and chain[-1] in ends):
                break
            left.remove(tuple(sorted((chain[-1], follow[0]))))
            chain.append(follow[0])
        chains.append(np.array(chain))
    return chains


def _turns(points: np.ndarray, node: int, others: list[int]) -> bool:
    """Whether the boundary has a corner at a node between two others."""
    before, after = points[:, node] - points[:, others[0]], points[:, others[1]] - points[:, node]
    angle = np.arctan2(before[0] * after[1] - before[1] * after[0], before @ after)
    return bool(abs(angle) > CORNER)
