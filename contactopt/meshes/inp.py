"""Input files of CalculiX and Abaqus (.inp): nodes, elements, their sets and surfaces.

meshio keeps only the last of several *NODE blocks, so that the bodies of one file exchange their
nodes; it does not know plane and axisymmetric elements of second order, sets of sets, and surfaces.
A keyword line `*NAME, KEY=VALUE` is followed by lines of data. Elements without an extent (springs,
masses, couplings) are passed over.

Source: CalculiX CrunchiX user's manual, version 2.20, chapters "Element types" and "Input deck
format".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

PLANE = {
    "3": ("triangle", 3), "6": ("triangle6", 6),
    "4": ("quad", 4), "8": ("quad8", 8), "9": ("quad9", 9),
}  # fmt: skip
SOLID = {
    "4": ("tetra", 4), "10": ("tetra10", 10), "8": ("hexahedron", 8), "20": ("hexahedron20", 20),
    "27": ("hexahedron27", 27), "6": ("wedge", 6), "15": ("wedge15", 15), "5": ("pyramid", 5),
}  # fmt: skip
LINE = {"2": ("line", 2), "1": ("line", 2), "3": ("line3", 3)}
FAMILIES = (
    (re.compile(r"D?C3D(\d+)"), SOLID),
    (re.compile(r"(?:CPEG|CPE|CPS|CGAX|CAX|DC2D|M3D|R3D|STRI|S)(\d)"), PLANE),
    (re.compile(r"T[23]D(\d)"), LINE),
    (re.compile(r"B[23]([12])"), {"1": LINE["2"], "2": LINE["3"]}),
)
# corners of the numbered faces, by the kind of the element up to its order
FACES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "hexahedron": (
        *((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1)),
        *((1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    ),
}
FACET = {2: "line", 3: "triangle", 4: "quad"}
DEEPEST = 10  # files that include each other


def read_inp(path: Path) -> Any:
    """The mesh of a file, with sets of elements and of nodes by name. A surface is a set of facets.

    ValueError, KeyError, IndexError or OSError where the file does not keep to the format.
    """
    import meshio

    read = _Reader()
    for keyword, options, rows in _blocks(path, 0):
        if hasattr(read, keyword):
            getattr(read, keyword)(options, rows)
    blocks = read.blocks + read.facets()
    tags = sorted(read.nodes)
    points = np.array([read.nodes[tag] for tag in tags]).reshape(-1, 3)
    cells = [(kind, np.searchsorted(tags, nodes)) for kind, nodes, _ in blocks]
    of_cells = {
        name: [_places(ids, found) for _, _, ids in blocks]
        for name, found in read.element_sets.items()
    }
    of_points = {
        name: np.searchsorted(tags, sorted(found & read.nodes.keys()))
        for name, found in read.node_sets.items()
    }
    return meshio.Mesh(points, cells, cell_sets=of_cells, point_sets=of_points)


def _places(ids: np.ndarray, found: set[int]) -> np.ndarray:
    return np.flatnonzero(np.isin(ids, np.fromiter(found, int, len(found))))


def _blocks(path: Path, depth: int) -> Iterator[tuple[str, dict[str, str], list[list[str]]]]:
    """Keyword in lower case, options, rows of data of each block; included files in their place."""
    keyword, rows, options = "", list[list[str]](), dict[str, str]()
    if depth > DEEPEST:
        raise ValueError("files include each other without end")
    with path.open(errors="replace") as file:
        for line in file:
            if line.startswith("**") or not line.strip():
                continue
            if not line.startswith("*"):
                rows.append([word.strip() for word in line.strip().rstrip(",").split(",")])
                continue
            yield keyword, options, rows
            first, *words = line[1:].split(",")
            keyword, rows = first.strip().lower(), []
            pairs = (word.partition("=") for word in words)
            options = {key.strip().lower(): value.strip().strip('"') for key, _, value in pairs}
            if keyword == "include":
                yield from _blocks(path.parent / options["input"], depth + 1)
    yield keyword, options, rows


class _Reader:
    """What the blocks of a file say. A method for each keyword that is read."""

    def __init__(self) -> None:
        self.nodes: dict[int, list[float]] = {}
        # kind, numbers of nodes, numbers of elements
        self.blocks: list[tuple[str, np.ndarray, np.ndarray]] = []
        self.node_sets: dict[str, set[int]] = {}
        self.element_sets: dict[str, set[int]] = {}
        self.surfaces: dict[str, list[list[str]]] = {}
        self.parts = 0

    def part(self, options: dict[str, str], rows: list[list[str]]) -> None:
        self.parts += 1
        if self.parts > 1:
            raise ValueError(
                "it has several parts, each with its own numbers of nodes; write it without parts"
            )

    def node(self, options: dict[str, str], rows: list[list[str]]) -> None:
        for row in rows:
            place = [float(word or 0) for word in row[1:4]]
            self.nodes[int(row[0])] = place + [0.0] * (3 - len(place))
        if "nset" in options:
            _set(self.node_sets, options["nset"]).update(int(row[0]) for row in rows)

    def element(self, options: dict[str, str], rows: list[list[str]]) -> None:
        for pattern, kinds in FAMILIES:
            if found := pattern.match(options["type"].upper()):
                kind, count = kinds[found[1]]
                words = np.array([word for row in rows for word in row], dtype=np.int64)
                words = words.reshape(-1, 1 + count)
                self.blocks.append((kind, words[:, 1:], words[:, 0]))
                if not set(words[:, 1:].ravel().tolist()) <= self.nodes.keys():
                    raise ValueError(f"an element {options['type']} names a node that is not there")
                if "elset" in options:
                    _set(self.element_sets, options["elset"]).update(words[:, 0].tolist())
                return

    def nset(self, options: dict[str, str], rows: list[list[str]]) -> None:
        _extend(self.node_sets, options["nset"], options, rows)

    def elset(self, options: dict[str, str], rows: list[list[str]]) -> None:
        _extend(self.element_sets, options["elset"], options, rows)

    def surface(self, options: dict[str, str], rows: list[list[str]]) -> None:
        if options.get("type", "").lower() == "node":
            _extend(self.node_sets, options["name"], {}, [row[:1] for row in rows])
        else:
            self.surfaces[options["name"]] = [row for row in rows if len(row) > 1]

    def facets(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Blocks of facets that stand for the surfaces, whose numbers are new."""
        made = []
        new = 1 + max((int(ids.max()) for _, _, ids in self.blocks if len(ids)), default=0)
        for name, rows in self.surfaces.items():
            for what, face in rows:
                members = {int(what)} if what.isdigit() else _set(self.element_sets, what)
                for kind, nodes, ids in self.blocks:
                    faces = FACES.get(kind.rstrip("0123456789"), ())
                    number = int(face[1:]) - 1 if face[1:].isdigit() else len(faces)
                    own = _places(ids, members)
                    if number < len(faces) and len(own):
                        corners = nodes[own][:, list(faces[number])]
                        made.append((FACET[corners.shape[1]], corners, new + np.arange(len(own))))
                        _set(self.element_sets, name).update(made[-1][2].tolist())
                        new += len(own)
        return made


def _set(sets: dict[str, set[int]], name: str) -> set[int]:
    """The set of that name, whatever the case of its letters; a new one if there is none."""
    known = next((other for other in sets if other.lower() == name.lower()), name)
    return sets.setdefault(known, set())


def _extend(
    sets: dict[str, set[int]], name: str, options: dict[str, str], rows: list[list[str]]
) -> None:
    """Add to a set what rows name: numbers, ranges or other sets."""
    mine = _set(sets, name)
    for row in rows:
        if "generate" in options:
            first, last, *step = (int(word) for word in row)
            mine.update(range(first, last + 1, *step))
        else:
            for word in row:
                mine.update({int(word)} if word.lstrip("-").isdigit() else _set(sets, word))
