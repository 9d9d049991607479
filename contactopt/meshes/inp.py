"""Input files of CalculiX and Abaqus (.inp): nodes, elements, their sets and surfaces.

meshio keeps only the last of several *NODE blocks, so that the bodies of one file exchange their
nodes; it does not know plane and axisymmetric elements of second order, sets of sets, surfaces, and
parts. A keyword line `*NAME, KEY=VALUE` is followed by lines of data. Elements without an extent
(springs, masses, couplings) are passed over.

A part has numbers and sets of its own. An assembly holds instances of parts, each moved to its
place, and sets of instances. Here an instance is a set of elements, the body. A set of a part is
the union of those of its instances; which of them is meant is clear once a body has been chosen.

Sources: CalculiX CrunchiX user's manual, version 2.20, chapters "Element types" and "Input deck
format"; Abaqus user's manual, "Defining an assembly".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

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
KEYWORDS = ("node", "element", "nset", "elset", "surface")
DEEPEST = 10  # files that include each other


def read_inp(path: Path) -> Any:
    """The mesh of a file, with sets of elements and of nodes by name. A surface is a set of facets.

    ValueError, KeyError, IndexError or OSError where the file does not keep to the format.
    """
    import meshio

    read = _Reader()
    parts: dict[str, _Reader] = {}
    now = read  # what the blocks belong to: a part, an instance, or all else
    for keyword, options, rows in _blocks(path, 0):
        if keyword == "part":
            now = parts[options["name"].lower()] = _Reader()
        elif keyword == "instance":
            now = _instance(parts, options, rows)
        elif keyword == "end instance":
            read.add(now)
            now = read
        elif keyword == "end part":
            now = read
        elif keyword in KEYWORDS:
            getattr(now, keyword)(options, rows)
    if not read.blocks and (parts or read.passed):
        passed = f"; {', '.join(sorted(read.passed))} are passed over" if read.passed else ""
        raise ValueError(f"no element of a body is in it or in an instance of its parts{passed}")
    read.name_sets()
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


def _instance(parts: dict[str, _Reader], options: dict[str, str], rows: list[list[str]]) -> _Reader:
    """A copy of a part, moved along the first row, then turned about the axis of the second."""
    name, of = options["name"], options.get("part", "")
    if of.lower() not in parts:
        known = ", ".join(parts) or "none"
        raise ValueError(f"instance {name} is of part {of}, which is not there; parts: {known}")
    made = deepcopy(parts[of.lower()])
    made.name = name
    numbers = [[float(word or 0) for word in row] for row in rows]
    if numbers:
        made.shift[: len(numbers[0])] = numbers[0]
    if len(numbers) > 1:
        *ends, angle = numbers[1]
        first, last = np.reshape(ends, (2, 3))
        axis = (last - first) / np.linalg.norm(last - first)
        made.centre, made.turn = first, Rotation.from_rotvec(np.radians(angle) * axis)
    return made


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
    """What the blocks of a file, of a part or of an instance say.

    A method for each keyword that is read.
    """

    def __init__(self) -> None:
        self.nodes: dict[int, list[float]] = {}
        # kind, numbers of nodes, numbers of elements
        self.blocks: list[tuple[str, np.ndarray, np.ndarray]] = []
        self.node_sets: dict[str, set[int]] = {}
        self.element_sets: dict[str, set[int]] = {}
        self.surfaces: dict[str, list[tuple[set[int], str]]] = {}
        self.passed: set[str] = set()  # types of elements
        self.instances: dict[str, tuple[_Reader, int, int]] = {}  # with what numbers grow by
        self.name = ""
        self.shift, self.centre, self.turn = np.zeros(3), np.zeros(3), Rotation.identity()

    def add(self, own: _Reader) -> None:
        """Add an instance at its place, with new numbers of its nodes and elements."""
        nodes = 1 + max(self.nodes, default=0)
        elements = 1 + max((int(ids.max(initial=0)) for _, _, ids in self.blocks), default=0)
        self.instances[own.name.lower()] = own, nodes, elements
        places = np.array(list(own.nodes.values())).reshape(-1, 3) + own.shift
        places = own.turn.apply(places - own.centre) + own.centre
        self.nodes |= zip((tag + nodes for tag in own.nodes), places.tolist())
        self.passed |= own.passed
        for kind, rows, ids in own.blocks:
            self.blocks.append((kind, rows + nodes, ids + elements))
            _set(self.element_sets, own.name).update((ids + elements).tolist())

    def name_sets(self) -> None:
        """Unite the sets and surfaces of instances by their names. Where the assembly has one of
        that name itself, those of the instances are called INSTANCE.NAME.
        """
        taken = [{n.lower() for n in s} for s in (self.node_sets, self.element_sets, self.surfaces)]
        for own, nodes, elements in self.instances.values():

            def named(name: str, kind: int, own: _Reader = own) -> str:
                return f"{own.name}.{name}" if name.lower() in taken[kind] else name

            for name, found in own.node_sets.items():
                _set(self.node_sets, named(name, 0)).update(tag + nodes for tag in found)
            for name, found in own.element_sets.items():
                _set(self.element_sets, named(name, 1)).update(i + elements for i in found)
            for name, rows in own.surfaces.items():
                moved = [({i + elements for i in found}, face) for found, face in rows]
                self.surfaces.setdefault(named(name, 2), []).extend(moved)

    def node(self, options: dict[str, str], rows: list[list[str]]) -> None:
        for row in rows:
            place = [float(word or 0) for word in row[1:4]]
            self.nodes[int(row[0])] = place + [0.0] * (3 - len(place))
        if "nset" in options:
            _set(self.node_sets, options["nset"]).update(int(row[0]) for row in rows)

    def element(self, options: dict[str, str], rows: list[list[str]]) -> None:
        named = options["type"].upper()
        own = _set(self.element_sets, options["elset"]) if "elset" in options else set()
        fits = ((pattern.match(named), kinds) for pattern, kinds in FAMILIES)
        found, kinds = next((fit for fit in fits if fit[0]), (None, {}))
        if found is None:
            self.passed.add(named)
            return
        if found[1] not in kinds:
            raise ValueError(f"elements of type {named} are not known")
        kind, count = kinds[found[1]]
        words = np.array([word for row in rows for word in row], dtype=np.int64)
        words = words.reshape(-1, 1 + count)
        self.blocks.append((kind, words[:, 1:], words[:, 0]))
        if not set(words[:, 1:].ravel().tolist()) <= self.nodes.keys():
            raise ValueError(f"an element {options['type']} names a node that is not there")
        own.update(words[:, 0].tolist())

    def nset(self, options: dict[str, str], rows: list[list[str]]) -> None:
        mine = _set(self.node_sets, options["nset"])
        self._extend(mine, "node_sets", options, rows)
        if "elset" in options:
            of = self._numbers(options["elset"], "element_sets", "")
            for _, nodes, ids in self.blocks:
                mine.update(nodes[_places(ids, of)].ravel().tolist())

    def elset(self, options: dict[str, str], rows: list[list[str]]) -> None:
        self._extend(_set(self.element_sets, options["elset"]), "element_sets", options, rows)

    def surface(self, options: dict[str, str], rows: list[list[str]]) -> None:
        kind, name = options.get("type", "element").lower(), options["name"]
        if kind == "node":
            mine = _set(self.node_sets, name)
            self._extend(mine, "node_sets", {}, [row[:1] for row in rows])
        elif kind == "element":
            self.surfaces[name] = [
                (self._numbers(row[0], "element_sets", ""), row[1] if len(row) > 1 else "")
                for row in rows
            ]

    def _extend(
        self, mine: set[int], sets: str, options: dict[str, str], rows: list[list[str]]
    ) -> None:
        """Add to a set what rows name: numbers, ranges or other sets."""
        instance = options.get("instance", "")
        for row in rows:
            if "generate" in options:
                first, last, *step = (int(word) for word in row)
                words = [str(number) for number in range(first, last + 1, *step)]
            else:
                words = row
            for word in filter(None, words):
                mine.update(self._numbers(word, sets, instance))

    def _numbers(self, word: str, sets: str, instance: str) -> set[int]:
        """What a word stands for: a number or a set, of an instance if it is INSTANCE.WORD."""
        before, dot, after = word.partition(".")
        if not instance and dot and before.lower() in self.instances:
            instance, word = before, after
        if instance:
            if instance.lower() not in self.instances:
                raise ValueError(f"there is no instance {instance}")
            own, *grow = self.instances[instance.lower()]
            by = grow[sets == "element_sets"]
            return {number + by for number in own._numbers(word, sets, "")}
        if word.lstrip("-").isdigit():
            return {int(word)}
        known = getattr(self, sets)
        if all(name.lower() != word.lower() for name in known):
            raise ValueError(f"there is no set {word} of {sets.split('_')[0]}s")
        return _set(known, word)

    def facets(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Blocks of facets that stand for the surfaces, whose numbers are new.

        A surface of elements without the number of a face has all of them.
        """
        made = []
        new = 1 + max((int(ids.max(initial=0)) for _, _, ids in self.blocks), default=0)
        for name, rows in self.surfaces.items():
            for members, face in rows:
                for kind, nodes, ids in self.blocks:
                    faces = FACES.get(kind.rstrip("0123456789"), ())
                    chosen = faces if not face else ()
                    if face[1:].isdigit():
                        chosen = faces[int(face[1:]) - 1 : int(face[1:])]
                    own = nodes[_places(ids, members)]
                    for corners in (own[:, list(ends)] for ends in chosen if len(own)):
                        made.append((FACET[corners.shape[1]], corners, new + np.arange(len(own))))
                        _set(self.element_sets, name).update(made[-1][2].tolist())
                        new += len(own)
        return made


def _set(sets: dict[str, set[int]], name: str) -> set[int]:
    """The set of that name, whatever the case of its letters; a new one if there is none."""
    known = next((other for other in sets if other.lower() == name.lower()), name)
    return sets.setdefault(known, set())
