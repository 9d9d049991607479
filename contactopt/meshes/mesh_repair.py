"""Faults of meshes from files are repaired, with a line in the log, or refused in a sentence."""

import logging
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import skfem
from scipy.spatial import KDTree

from contactopt.cards import count
from contactopt.checks import place_words
from contactopt.defaults import CLOSE, EQUAL
from contactopt.errors import Damaged, InputError
from contactopt.meshes.cells import (
    area_vectors,
    joined,
    mirrored,
    outer_corners,
    overlapping,
    volumes,
)

# nodes are one, or two, if they are less, or more, than this fraction of the shortest edge apart
ONE, APART = 1e-4, 1e-3
FLAT = 1e-10  # an element of less volume, over that of a cube of its size, is degenerate
CORNERS = {  # of the elements that can be used
    **{"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4, "tetra": 4, "tetra10": 4},
    **{"hexahedron": 8, "hexahedron20": 8, "hexahedron27": 8},
}
# the sides of serendipity elements that have no node in the middle: their corners and the nodes of
# their edges
_SIDES = {
    "quad8": (((0, 1, 2, 3), (4, 5, 6, 7)),),
    "hexahedron20": (
        ((0, 3, 4, 7), (11, 15, 16, 19)), ((1, 2, 5, 6), (9, 13, 17, 18)),
        ((0, 1, 4, 5), (8, 12, 16, 17)), ((2, 3, 6, 7), (10, 14, 18, 19)),
        ((0, 1, 2, 3), (8, 9, 10, 11)), ((4, 5, 6, 7), (12, 13, 14, 15)),
    ),
}  # fmt: skip
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
        number, place = self.numbers[element] + 1, place_words(middle)
        return f"{self.kind} number {number} of the file, at ({place})"

    def refused(self, element: int, fault: str) -> InputError:
        """The error that names an element where `fault` has {}."""
        return InputError(f"mesh file '{self.path}': {fault.format(self.name(element))}")


def complete(cells: Cells) -> Cells:
    """Quadrilaterals of nine and hexahedra of 27 nodes in place of those of eight and twenty, whose
    own shape functions place the new nodes; other elements as they are.
    """
    if cells.kind not in COMPLETE:
        return cells
    c = cells.points[:, cells.nodes]
    new = middles(cells.kind, c)
    extra = cells.points.shape[1] + np.arange(len(new) * c.shape[2]).reshape(len(new), -1)
    points = np.concatenate([cells.points, *new], axis=1)
    nodes = np.concatenate([cells.nodes, extra])
    made = replace(cells, kind=COMPLETE[cells.kind], points=points, nodes=nodes)
    # neighbours share the middle of their side
    return replace(made, nodes=representatives(made, repair=False)[nodes])


def middles(kind: str, places: np.ndarray) -> list[np.ndarray]:
    """Where the nodes (dim, v, e) of serendipity elements put the middles (dim, e) of their sides,
    and of a hexahedron its own, in the order of meshio.
    """
    new = [
        places[:, list(b)].sum(axis=1) / 2 - places[:, list(a)].sum(axis=1) / 4
        for a, b in _SIDES[kind]
    ]
    if kind == "hexahedron20":
        new.append(places[:, 8:20].sum(axis=1) / 4 - places[:, :8].sum(axis=1) / 4)
    return new


def in_order(points: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """The nodes (e, 27) of hexahedra whose last seven come in an order that formats do not agree
    about, in that of meshio: each lies nearest to the middle that it is. Damaged if one is not.
    """
    places = points[nodes].transpose(2, 1, 0)
    wanted = np.stack(middles("hexahedron20", places), axis=1)
    apart = np.linalg.norm(wanted[:, :, None] - places[:, None, 20:], axis=0)  # (7, 7, e)
    nearest = np.argmin(apart, axis=1).T
    if np.any(np.sort(nearest, axis=1) != np.arange(7)):
        raise Damaged("the nodes in the faces of a hexahedron of 27 nodes lie at wrong places")
    return np.concatenate([nodes[:, :20], np.take_along_axis(nodes[:, 20:], nearest, 1)], axis=1)


def representatives(cells: Cells, repair: bool = True) -> np.ndarray:
    """For every node (n,) the one that stands for it and for all others at its place, the first.

    With `repair` nodes at one place are a fault of the file, which is told in a line of the log.
    InputError if two nodes are so near each other that they may be one or two.
    """
    own = np.arange(cells.points.shape[1])
    pairs, distance, edge = _near_pairs(cells, np.unique(cells.nodes))
    same = distance <= ONE * edge
    unclear = np.flatnonzero(~same & (distance <= APART * edge))
    if len(unclear):
        i, j = pairs[unclear[0]]
        raise InputError(
            f"mesh file '{cells.path}': nodes {i + 1} and {j + 1},"
            f" at ({place_words(cells.points[:, i])}), are {distance[unclear[0]]:.3g} apart, too"
            " far for one node and too near for two; merge such nodes in the file."
        )
    if not same.any():
        return own
    pairs = pairs[same]
    if repair:
        log.warning(
            "%s: nodes that lie on others are merged with them,"
            " the first at (%s); %s, at most %.3g apart",
            cells.path, place_words(cells.points[:, pairs[0, 0]]), count(len(pairs), "pair"),
            distance[same].max(),
        )  # fmt: skip
    label = joined(pairs.T, len(own))
    return np.asarray(np.unique(label, return_index=True)[1][label])


def _near_pairs(cells: Cells, used: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs (m, 2) of nodes nearer than APART of the shortest edge, their distance, that edge."""
    corners = cells.points[:, cells.corners].transpose(1, 0, 2)
    edge = np.min([np.linalg.norm(a - b, axis=0) for a, b in combinations(corners, 2)], axis=0)
    shortest = np.full(cells.points.shape[1], np.inf)
    for row in cells.nodes:
        np.minimum.at(shortest, row, edge)
    tree, reach = KDTree(cells.points[:, used].T), APART * shortest[used]
    crowded = np.flatnonzero(tree.query_ball_point(tree.data, reach, return_length=True) > 1)
    near = tree.query_ball_point(tree.data[crowded], reach[crowded])
    both = ((i, j) for i, others in zip(crowded.tolist(), near) for j in others if i != j)
    found = {(min(pair), max(pair)) for pair in both}
    pairs = used[np.array(sorted(found), dtype=int).reshape(-1, 2)]
    distance = np.linalg.norm(cells.points[:, pairs[:, 0]] - cells.points[:, pairs[:, 1]], axis=0)
    return pairs, distance, shortest[pairs].min(axis=1)


def repaired(cells: Cells, merged: np.ndarray) -> Cells:
    """Put the elements on the merged nodes, each once, with their corners numbered the right way
    round. What was repaired is told in the log. `merged` (n,) is from `representatives`.
    """
    sets = np.sort(merged[cells.corners], axis=0)
    flat = np.flatnonzero(np.any(np.diff(sets, axis=0) == 0, axis=0))
    if len(flat):
        raise cells.refused(flat[0], "two corners coincide in {}; mesh this place again.")
    once = np.sort(np.unique(sets, axis=1, return_index=True)[1])
    if len(once) < sets.shape[1]:
        words = count(sets.shape[1] - len(once), "element is", "elements are")
        log.warning("%s: %s there twice and dropped", cells.path, words)
    cells = replace(cells, nodes=merged[cells.nodes[:, once]], numbers=cells.numbers[once])
    wrong = _volumes(cells.points, cells.corners) < 0
    if wrong.any():
        log.warning(
            "%s: %s with corners in the wrong order, which is turned round; the first is %s",
            cells.path, count(int(wrong.sum()), "element"), cells.name(int(np.argmax(wrong))),
        )  # fmt: skip
        nodes = cells.nodes.copy()
        nodes[:, wrong] = mirrored(cells.kind, nodes[:, wrong])
        cells = replace(cells, nodes=nodes)
    return cells


def check_connected(cells: Cells, hint: str) -> None:
    """Raise InputError, with a hint, if the elements fall into pieces that share no node."""
    first = np.broadcast_to(cells.corners[0], cells.corners.shape)
    label = joined(np.stack([first, cells.corners]).reshape(2, -1), cells.points.shape[1])
    pieces = len(np.unique(label[cells.corners[0]]))
    if pieces > 1:
        raise InputError(
            f"mesh file '{cells.path}': the body falls into"
            f" {pieces} pieces that share no node; {hint}."
        )


def check_elements(cells: Cells, mesh: skfem.Mesh) -> None:
    """Raise InputError, with the name of the first wrong element, unless all elements of the mesh
    that was made of the cells share their nodes, have volume and nowhere fold over, no facet
    belongs to more than two, and the surface is closed.
    """
    curved = len(cells.nodes) > len(cells.corners)
    nodes = mesh.doflocs[:, mesh.dofs.element_dofs] if curved else mesh.p[:, mesh.t]
    apart = np.abs(nodes.sum(axis=1) - cells.points[:, cells.nodes].sum(axis=1)).max(axis=0)
    wrong = np.flatnonzero(apart > CLOSE * np.ptp(nodes, axis=1).max(axis=0))
    if len(wrong):
        raise cells.refused(
            wrong[0],
            "{} does not share the nodes within its edges and"
            " faces with its neighbours; mesh this place again.",
        )
    volume = volumes(mesh)
    size = np.linalg.norm(np.ptp(mesh.p[:, mesh.t], axis=1), axis=0) ** len(mesh.p)
    bad = np.flatnonzero((volume * np.sign(volume[:, -1:])).min(axis=1) <= FLAT * size)
    if len(bad):
        flat = np.abs(volume[bad[0]]).max() <= FLAT * size[bad[0]]
        how = "has no volume" if flat else "folds over"
        raise cells.refused(bad[0], f"{{}} {how}; mesh this place again.")
    shared = np.bincount(mesh.t2f.ravel())
    if shared.max() > 2:
        raise cells.refused(
            int(np.argmax(np.any(mesh.t2f == np.argmax(shared), axis=0))),
            "more than two elements share a facet, one of them is {}; elements must not overlap.",
        )
    if (over := overlapping(mesh)) is not None:
        raise cells.refused(over, "{} lies over its neighbour; mesh this place again.")
    # the outward normals of a closed surface integrate to zero
    areas = area_vectors(mesh.p[:, outer_corners(mesh, mesh.boundary_facets())])
    total = np.abs(areas.sum(axis=1)).max()
    if total > EQUAL * np.linalg.norm(areas, axis=0).sum():
        raise InputError(
            f"mesh file '{cells.path}': the surface of the body is not closed, its normals sum up"
            f" to {total:.3g}; elements overlap."
        )


def _volumes(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Signed volume (up to a factor) of each element, from the mean directions along its axes."""
    c = points[:, corners]
    if len(corners) == len(points) + 1:
        axes = [c[:, i] - c[:, 0] for i in range(1, len(corners))]
    else:  # from the corners of one side to those of the side across; in the plane half of them
        dim, half = len(points), len(corners) // 2
        ends = [([1, 2, 5, 6], [0, 3, 4, 7]), ([2, 3, 6, 7], [0, 1, 4, 5])]
        ends += [([4, 5, 6, 7], [0, 1, 2, 3])]
        sides = [(c[:, b[:half]], c[:, a[:half]]) for b, a in ends[:dim]]
        axes = [far.sum(axis=1) - near.sum(axis=1) for far, near in sides]
    return np.asarray(np.linalg.det(np.stack(axes).transpose(2, 0, 1)))
