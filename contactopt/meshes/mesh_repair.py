"""Faults of meshes from files: each is repaired, with a line in the log, or refused in a sentence
that names the element.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import skfem
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from contactopt.errors import InputError

SAME = 1e-6  # places this fraction of a size apart are one place
ONE, APART = (
    1e-4,
    1e-3,
)  # nodes are one, or two, if they are less, or more, than this fraction of the shortest edge apart
FLAT = 1e-10  # an element of less volume, over that of a cube of its size, is degenerate
CLOSED = 1e-9  # what the normals of a closed surface may sum up to, over its area
CORNERS = {
    **{"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4, "tetra": 4, "tetra10": 4},
    **{"hexahedron": 8, "hexahedron20": 8, "hexahedron27": 8},
}
# places in an element of the same element numbered the other way round; the order of nodes is that
# of meshio
_HEXAHEDRON = (4, 5, 6, 7, 0, 1, 2, 3)
MIRRORED = {
    "triangle": (0, 2, 1),
    "triangle6": (0, 2, 1, 5, 4, 3),
    "quad": (0, 3, 2, 1),
    "quad9": (0, 3, 2, 1, 7, 6, 5, 4, 8),
    "tetra": (0, 2, 1, 3),
    "tetra10": (0, 2, 1, 3, 6, 5, 4, 7, 9, 8),
    "hexahedron": _HEXAHEDRON,
    "hexahedron27": (
        *_HEXAHEDRON,
        12,
        13,
        14,
        15,
        8,
        9,
        10,
        11,
        16,
        17,
        18,
        19,
        20,
        21,
        22,
        23,
        25,
        24,
        26,
    ),
}
# the sides of serendipity elements that have no node in the middle: their corners and the nodes of
# their edges
_SIDES = {
    "quad8": (((0, 1, 2, 3), (4, 5, 6, 7)),),
    "hexahedron20": (
        ((0, 3, 4, 7), (11, 15, 16, 19)),
        ((1, 2, 5, 6), (9, 13, 17, 18)),
        ((0, 1, 4, 5), (8, 12, 16, 17)),
        ((2, 3, 6, 7), (10, 14, 18, 19)),
        ((0, 1, 2, 3), (8, 9, 10, 11)),
        ((4, 5, 6, 7), (12, 13, 14, 15)),
    ),
}
COMPLETE = {"quad8": "quad9", "hexahedron20": "hexahedron27"}

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Cells:
    """Elements of one type and their nodes.

    path     of the file
    kind     type of the elements in meshio
    points   (dim, n) places of the nodes
    nodes    (v, e) nodes of every element, the corners first
    numbers  (e,) where it stands among the elements of its type in the file, from 0
    """

    path: Path
    kind: str
    points: np.ndarray
    nodes: np.ndarray
    numbers: np.ndarray

    @property
    def corners(self) -> np.ndarray:
        return self.nodes[: CORNERS[self.kind]]

    def name(self, element: int) -> str:
        """What a message calls an element: its type, number and place."""
        middle = self.points[:, self.corners[:, element]].mean(axis=1)
        return f"{self.kind} number {self.numbers[element] + 1} of the file, at ({text(middle)})"


def text(x: np.ndarray) -> str:
    """Write coordinates for a message, with six digits each."""
    return ", ".join(f"{value:.6g}" for value in x)


def complete(cells: Cells) -> Cells:
    """Give serendipity elements the nodes that they lack, at the places that their own shape
    functions give.

    Parameters
    ----------
    cells : The elements of a file.

    Returns
    -------
    Quadrilaterals of nine and hexahedra of 27 nodes in place of those of eight and twenty; others
    as they are.
    """
    if cells.kind not in COMPLETE:
        return cells
    c = cells.points[:, cells.nodes]
    new = [
        c[:, list(b)].sum(axis=1) / 2 - c[:, list(a)].sum(axis=1) / 4 for a, b in _SIDES[cells.kind]
    ]
    if cells.kind == "hexahedron20":
        new.append(c[:, 8:].sum(axis=1) / 4 - c[:, :8].sum(axis=1) / 4)
    extra = cells.points.shape[1] + np.arange(len(new) * c.shape[2]).reshape(len(new), -1)
    points, nodes = (
        np.concatenate([cells.points, *new], axis=1),
        np.concatenate([cells.nodes, extra]),
    )
    made = replace(cells, kind=COMPLETE[cells.kind], points=points, nodes=nodes)
    # neighbours share the middle of their side
    return replace(made, nodes=representatives(made, repair=False)[nodes])


def representatives(cells: Cells, repair: bool = True) -> np.ndarray:
    """Find for every node the one that stands for it and for all others at its place.

    Parameters
    ----------
    cells : The elements of a file, with n nodes.
    repair : Whether nodes at one place are a fault of the file, which is told in a line of the log.

    Returns
    -------
    (n,) numbers of nodes: of each group at one place the first.

    Raises
    ------
    InputError : If two nodes are so near each other that they may be one or two.
    """
    own = np.arange(cells.points.shape[1])
    used = np.unique(cells.nodes)
    pairs, distance, edge = _near_pairs(cells, used)
    same = distance <= ONE * edge
    unclear = np.flatnonzero(~same & (distance <= APART * edge))
    if len(unclear):
        i, j = pairs[unclear[0]]
        raise InputError(
            f"mesh file '{cells.path}': nodes {i + 1} and {j + 1}, at ({text(cells.points[:, i])}),"
            f" are {distance[unclear[0]]:.3g} apart, too far for one node and too near for two;"
            " merge such nodes in the file."
        )
    if not same.any():
        return own
    pairs = pairs[same]
    if repair:
        log.warning(
            "%s: nodes that lie on others are merged with them, the first at (%s); %d pairs, "
            "at most %.3g apart",
            cells.path,
            text(cells.points[:, pairs[0, 0]]),
            len(pairs),
            distance[same].max(),
        )
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), (len(own), len(own)))
    label = connected_components(graph, directed=False)[1]
    first = np.full(label.max() + 1, len(own))
    np.minimum.at(first, label, own)
    return np.asarray(first[label])


def _near_pairs(cells: Cells, used: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs (m, 2) of nodes nearer than APART of the shortest edge there, how far apart, and that
    edge.
    """
    corners = cells.points[:, cells.corners].transpose(1, 0, 2)
    edge = np.min([np.linalg.norm(a - b, axis=0) for a, b in combinations(corners, 2)], axis=0)
    shortest = np.full(cells.points.shape[1], np.inf)
    for row in cells.nodes:
        np.minimum.at(shortest, row, edge)
    tree = KDTree(cells.points[:, used].T)
    crowded = np.flatnonzero(
        tree.query_ball_point(tree.data, APART * shortest[used], return_length=True) > 1
    )
    near = tree.query_ball_point(tree.data[crowded], APART * shortest[used[crowded]])
    found = {
        (min(i, j), max(i, j))
        for i, others in zip(crowded.tolist(), near)
        for j in others
        if i != j
    }
    pairs = used[np.array(sorted(found), dtype=int).reshape(-1, 2)]
    distance = np.linalg.norm(cells.points[:, pairs[:, 0]] - cells.points[:, pairs[:, 1]], axis=0)
    return pairs, distance, shortest[pairs].min(axis=1)


def repaired(cells: Cells, merged: np.ndarray) -> Cells:
    """Put the elements on the merged nodes, each once, with their corners numbered the right way
    round.

    Parameters
    ----------
    cells : The elements of a file, with n nodes.
    merged : (n,) for every node the one that stands for it, from `representatives`.

    Returns
    -------
    The repaired elements. What was repaired is told in the log.

    Raises
    ------
    InputError : If two corners of an element coincide.
    """
    sets = np.sort(merged[cells.corners], axis=0)
    flat = np.flatnonzero(np.any(np.diff(sets, axis=0) == 0, axis=0))
    if len(flat):
        raise InputError(
            f"mesh file '{cells.path}': two corners coincide in {cells.name(flat[0])}; mesh this"
            " place anew."
        )
    once = np.sort(np.unique(sets, axis=1, return_index=True)[1])
    if len(once) < sets.shape[1]:
        log.warning(
            "%s: %d elements are there twice and are dropped", cells.path, sets.shape[1] - len(once)
        )
    cells = replace(cells, nodes=merged[cells.nodes[:, once]], numbers=cells.numbers[once])
    wrong = _volumes(cells.points, cells.corners) < 0
    if wrong.any():
        log.warning(
            "%s: %d elements number their corners the wrong way round and are turned, the first is %s",
            cells.path, wrong.sum(), cells.name(int(np.argmax(wrong))),
        )  # fmt: skip
        nodes = cells.nodes.copy()
        nodes[:, wrong] = nodes[list(MIRRORED[cells.kind])][:, wrong]
        cells = replace(cells, nodes=nodes)
    return cells


def pieces(cells: Cells) -> int:
    """Count the pieces into which the elements fall that share no node.

    Parameters
    ----------
    cells : The elements of a file.

    Returns
    -------
    The number of pieces.
    """
    first = np.broadcast_to(cells.corners[0], cells.corners.shape)
    size = cells.points.shape[1]
    graph = coo_matrix((np.ones(first.size), (first.ravel(), cells.corners.ravel())), (size, size))
    label = connected_components(graph, directed=False)[1]
    return len(np.unique(label[cells.corners[0]]))


def check_elements(cells: Cells, mesh: skfem.Mesh) -> None:
    """Check that all elements have volume and nowhere fold over, and that no facet belongs to more
    than two.

    Parameters
    ----------
    cells : The elements of the file, whose names are told.
    mesh : The mesh that was made of them.

    Raises
    ------
    InputError : With the name of the first element that is wrong.
    """
    nodes = (
        mesh.doflocs[:, mesh.dofs.element_dofs]
        if len(cells.nodes) > len(cells.corners)
        else mesh.p[:, mesh.t]
    )
    apart = np.abs(nodes.sum(axis=1) - cells.points[:, cells.nodes].sum(axis=1)).max(axis=0)
    wrong = np.flatnonzero(apart > SAME * np.ptp(nodes, axis=1).max(axis=0))
    if len(wrong):
        raise InputError(
            f"mesh file '{cells.path}': {cells.name(wrong[0])} does not share the nodes within its"
            " edges and faces with its neighbours; mesh this place anew."
        )
    volume = volumes(mesh)
    size = np.linalg.norm(np.ptp(mesh.p[:, mesh.t], axis=1), axis=0) ** len(mesh.p)
    bad = np.flatnonzero((volume * np.sign(volume[:, -1:])).min(axis=1) <= FLAT * size)
    if len(bad):
        how = (
            "has no volume" if np.abs(volume[bad[0]]).max() <= FLAT * size[bad[0]] else "folds over"
        )
        raise InputError(
            f"mesh file '{cells.path}': {cells.name(bad[0])} {how}; mesh this place anew."
        )
    shared = np.bincount(mesh.t2f.ravel())
    if shared.max() > 2:
        element = int(np.argmax(np.any(mesh.t2f == np.argmax(shared), axis=0)))
        raise InputError(
            f"mesh file '{cells.path}': more than two elements share a facet, one of them is"
            f" {cells.name(element)}; elements must not overlap."
        )


def volumes(mesh: skfem.Mesh) -> np.ndarray:
    """Compute the ratio of volumes between elements and their reference.

    Parameters
    ----------
    mesh : A scikit-fem mesh with e elements.

    Returns
    -------
    (e, n + 1) ratios with their signs, at the n nodes of each element and at its centre.
    """
    places = np.asarray(mesh.elem().doflocs).T
    places = np.concatenate([places, places.mean(axis=1, keepdims=True)], axis=1)
    return np.asarray(np.linalg.det(np.asarray(mesh._mapping().DF(places)).transpose(2, 3, 0, 1)))


def check_surface(path: Path, mesh: skfem.Mesh) -> None:
    """Check that the outward normals of a body's surface integrate to zero, as those of a closed
    surface do.

    Parameters
    ----------
    path : The mesh file, for the message.
    mesh : The mesh that was made of it.

    Raises
    ------
    InputError : If they do not, because elements overlap.
    """
    facets = mesh.boundary_facets()
    areas = _area_vectors(mesh.p[:, outer_corners(mesh, facets)])
    total = np.abs(areas.sum(axis=1)).max()
    if total > CLOSED * np.linalg.norm(areas, axis=0).sum():
        raise InputError(
            f"mesh file '{path}': the surface of the body is not closed, its normals sum up to"
            f" {total:.3g}; elements overlap."
        )


def outer_corners(mesh: skfem.Mesh, facets: np.ndarray) -> np.ndarray:
    """Order the corners of facets of the surface such that their normals point outwards.

    Parameters
    ----------
    mesh : A scikit-fem mesh.
    facets : (f,) numbers of facets of its surface.

    Returns
    -------
    (c, f) numbers of the corners in their order around each facet; in the plane the body is on
    their left.
    """
    cell = mesh.f2t[0, facets]
    local = np.argmax(mesh.t2f[:, cell] == facets, axis=0)
    nodes = mesh.t[np.array(mesh.refdom.facets)[local].T, cell]
    corners = mesh.p[:, nodes]
    outwards = corners.mean(axis=1) - mesh.p[:, mesh.t[:, cell]].mean(axis=1)
    wrong = np.sum(_area_vectors(corners) * outwards, axis=0) < 0
    nodes[:, wrong] = nodes[::-1, wrong]
    return np.asarray(nodes)


def _area_vectors(corners: np.ndarray) -> np.ndarray:
    """Area times normal (dim, f) of facets with corners (dim, c, f); on the right of edges."""
    if len(corners) == 2:
        x, y = corners[:, 1] - corners[:, 0]
        return np.stack([y, -x])
    first, second = corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1]
    if corners.shape[1] == 3:
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(np.cross(first, second, axis=0) / 2)


def _volumes(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Signed volume (up to a factor) of each element, from the mean directions along its axes."""
    c = points[:, corners]
    simplex = len(corners) == len(points) + 1
    if simplex:
        axes = [c[:, i] - c[:, 0] for i in range(1, len(corners))]
    else:
        ends: list[tuple[tuple[int, ...], tuple[int, ...]]] = [((1, 2), (0, 3)), ((2, 3), (0, 1))]
        if len(points) == 3:
            ends = [
                ((1, 2, 5, 6), (0, 3, 4, 7)),
                ((2, 3, 6, 7), (0, 1, 4, 5)),
                ((4, 5, 6, 7), (0, 1, 2, 3)),
            ]
        axes = [c[:, list(b)].sum(axis=1) - c[:, list(a)].sum(axis=1) for b, a in ends]
    return np.asarray(np.linalg.det(np.stack(axes).transpose(2, 0, 1)))
