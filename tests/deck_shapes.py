"""Blocks of elements for input files: nodes and elements on a lattice, and their numbered sides as
the manual of CalculiX lists them. The block of nx x ny (x nz) cells of unit size begins at 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

# corners of the sides of CalculiX, 1 to 8, side after side
SIDES = {
    "tri": "12 23 31", "quad": "12 23 34 41", "tet": "123 142 243 341",
    "hex": "1234 5876 1562 2673 3784 4851",
}  # fmt: skip
# the nodes within edges in the order of the manual, each between two corners
EDGES = {
    "tri": "12 23 31", "quad": "12 23 34 41", "tet": "12 23 31 14 24 34",
    "hex": "12 23 34 41 56 67 78 85 15 26 37 48",
}  # fmt: skip
HEX = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
# tetrahedra around the diagonal of a cube, and triangles around that of a square
TETS = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
CELLS = {"hex": [range(8)], "tet": TETS, "quad": [range(4)], "tri": [(0, 1, 2), (0, 2, 3)]}


@dataclass
class Shape:
    """nodes number -> place;  elements number -> numbers of nodes;  kind of the sides"""

    nodes: dict[int, tuple[float, ...]]
    elements: dict[int, list[int]]
    kind: str
    size: tuple[int, ...]

    @property
    def corners(self) -> int:
        return len({node for own in self.elements.values() for node in own[: self.width]})

    @property
    def width(self) -> int:
        return {"tri": 3, "quad": 4, "tet": 4, "hex": 8}[self.kind]

    def side(self, axis: int, value: float) -> list[tuple[int, int]]:
        """Elements with the numbers of those sides of theirs that lie in a plane."""
        found = []
        for number, own in self.elements.items():
            for label, ends in enumerate(SIDES[self.kind].split(), 1):
                places = [self.nodes[own[int(end) - 1]][axis] for end in ends]
                if np.allclose(places, value, atol=1e-12):
                    found.append((number, label))
        return found

    def facets(self, axis: int, value: float) -> list[list[int]]:
        """Corners of the sides in a plane, each with the node within it if it is a curved line."""
        made = []
        for number, label in self.side(axis, value):
            own, ends = self.elements[number], SIDES[self.kind].split()[label - 1]
            corners = [own[int(end) - 1] for end in ends]
            if len(corners) == 2 and len(own) > self.width:
                corners.insert(1, own[self.width + EDGES[self.kind].split().index(ends)])
            made.append(corners)
        return made

    def on(self, axis: int, value: float) -> list[int]:
        return [n for n, place in self.nodes.items() if abs(place[axis] - value) < 1e-12]


def block(kind: str, order: int, size=(3, 2, 2), first=1, step=1, at=(0.0, 0.0, 0.0)) -> Shape:
    """The lattice, numbered from `first` on in steps."""
    dim = 2 if kind in ("tri", "quad") else 3
    size = size[:dim]
    corners = [point[:dim] for point in HEX[: 2**dim]]
    numbers: dict[tuple[float, ...], int] = {}
    elements = {}
    for base in product(*(range(n) for n in size)):
        for cell in CELLS[kind]:
            ends = [tuple(float(b + c) for b, c in zip(base, corners[i])) for i in cell]
            places = list(ends)
            if order == 2:
                for edge in EDGES[kind].split():
                    a, b = (ends[int(e) - 1] for e in edge)
                    places.append(tuple((p + q) / 2 for p, q in zip(a, b)))
            own = [numbers.setdefault(place, first + step * len(numbers)) for place in places]
            elements[first + step * len(elements)] = own
    nodes = {
        number: tuple(x + a for x, a in zip(place, at)) + (0.0,) * (3 - dim)
        for place, number in numbers.items()
    }
    return Shape(nodes, elements, kind, size)


def node_rows(shape: Shape, form="{:d}, {:.9g}, {:.9g}, {:.9g}") -> str:
    return "\n".join(form.format(number, *place) for number, place in shape.nodes.items())


def element_rows(rows, first=None, width=16) -> str:
    """Rows of elements, by their numbers or from `first` on, with continuation lines."""
    if first is not None:
        rows = {first + i: row for i, row in enumerate(rows)}
    made = []
    for number, own in rows.items():
        words = [str(word) for word in (number, *own)]
        lines = [", ".join(words[i : i + width]) for i in range(0, len(words), width)]
        made.append(",\n".join(lines))
    return "\n".join(made)


def bulk_data(shape: Shape, order: int, form: str) -> str:
    """The block as bulk data of Nastran in small or large fields or with commas: the body has the
    property 7, its lower side 8.
    """
    card = {"tri": "CTRIA", "quad": "CQUAD", "tet": "CTETRA", "hex": "CHEXA"}[shape.kind]
    plane = len(shape.size) == 2
    card += str(shape.width * order) if plane else ""
    cards = [("GRID", n, "", *place) for n, place in shape.nodes.items()]
    for number, own in shape.elements.items():
        if shape.kind == "hex" and order == 2:  # the edges along z come before those above
            own = [*own[:12], *own[16:], *own[12:16]]
        cards.append((card, number, 7, *own))
    skin = {2: "CBAR", 3: "CTRIA3", 4: "CQUAD4"}
    for i, facet in enumerate(shape.facets(len(shape.size) - 1, 0)):
        ends = [facet[0], facet[-1]] if plane else facet
        cards.append((skin[len(ends)], 5000 + i, 8, *ends, *(["0.", "0.", "1."] * plane)))
    return "\n".join(_card(own, form) for own in cards) + "\nENDDATA\n"


def _card(words, form: str) -> str:
    words = [f"{word:.6f}"[:8] if isinstance(word, float) else str(word) for word in words]
    name, rest = words[0], words[1:]
    width, count, mark = (16, 4, "*") if "large" in form else (8, 8, "+")
    lines = [rest[i : i + count] for i in range(0, len(rest), count)]
    first = name + ("*" if "large" in form else "")
    if "commas" in form:
        mark = mark if "large" in form else ""
        return "\n".join(",".join([mark if i else first, *own]) for i, own in enumerate(lines))
    return "\n".join(
        f"{mark if i else first:8}" + "".join(f"{word:{width}}" for word in own)
        for i, own in enumerate(lines)
    )


def scattered(text: str, form: str) -> str:
    """Bulk data whose lines that go on a card stand at the end, in turned order, with marks."""
    sign, (*lines, last) = "*" if "large" in form else "+", text.splitlines()
    goes_on = [line[0] in "+*," for line in lines] + [False]
    count = 4 if "large" in form else 8
    for i, line in enumerate(lines):
        if "commas" in form:
            words = line.split(",")
            words[0] = f"{sign}{i}" if goes_on[i] else words[0]
            words += [""] * (1 + count - len(words)) + [f"{sign}{i + 1}" * goes_on[i + 1]]
            lines[i] = ",".join(words)
        else:
            begin = f"{sign}{i:<7}" if goes_on[i] else line[:8]
            lines[i] = f"{begin}{line[8:]:64}" + f"{sign}{i + 1}" * goes_on[i + 1]
    cards = [line for line, more in zip(lines, goes_on) if not more]
    return "\n".join([*cards, *(m for m, more in zip(lines[::-1], goes_on[-2::-1]) if more), last])
