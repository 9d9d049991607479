"""Bulk data of Nastran (.bdf, .nas, .fem): nodes, elements, and their properties as groups.

meshio reads no file without BEGIN BULK, such as those of Gmsh, nor elements in large fields, and
passes over cards and coordinate systems that it does not know. A card has fields between commas, or
of 8 or 16 characters (a name with *); it goes on in lines that begin with +, * or an empty field,
which may stand elsewhere if they begin with the mark at its end.
Elements and links without an extent are passed over. A card of an element that is not known is
refused, as is a node in a coordinate system of its own. The number of its property names the group
of an element.

Source: MSC Nastran, Quick Reference Guide, "Bulk data entries".
"""

import logging
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.cards import count
from contactopt.errors import Damaged, InputError
from contactopt.meshes.exodus import HEXAHEDRON
from contactopt.meshes.inp_elements import CORNERS
from contactopt.meshes.inp_text import text_of

# card -> shape by its number of nodes
_SHAPES = (
    ("CTRIA3 CTRIAR CPLSTN3 CPLSTS3", {3: "triangle"}),
    ("CTRIA6 CPLSTN6 CPLSTS6", {6: "triangle6"}),
    ("CQUAD4 CQUADR CSHEAR CPLSTN4 CPLSTS4", {4: "quad"}),
    ("CQUAD8 CPLSTN8 CPLSTS8", {8: "quad8"}),
    ("CQUAD", {4: "quad", 8: "quad8", 9: "quad9"}),
    ("CQUAD9", {9: "quad9"}),
    ("CTETRA", {4: "tetra", 10: "tetra10"}),
    ("CHEXA", {8: "hexahedron", 20: "hexahedron20"}),
    ("CPENTA", {6: "wedge", 15: "wedge"}),
    ("CPYRAM", {5: "pyramid", 13: "pyramid"}),
    ("CROD CBAR CBEAM CBEND CTUBE CONROD PLOTEL", {2: "line"}),
)
ELEMENTS = {card: shapes for cards, shapes in _SHAPES for card in cards.split()}
SOLIDS = ("CTETRA", "CHEXA", "CPENTA", "CPYRAM")  # whose cards end with their nodes
# the first node of a card: these have no property
FIRST = {"PLOTEL": 2, "CONROD": 2}
POINTS = re.compile(
    "CELAS|CDAMP|CMASS|CBUSH|CGAP|CVISC|CONM[12]|CFAST|CWELD|CBEAR|CSEAM|CHBDY|CMBUSH|MPC$"
    "|RBE[123]|RBAR|RROD|RTRPLT|RSPLINE|RSSCON|RJOINT"
)
# cards with such a first letter that are no elements
HARMLESS = re.compile(
    "CORD|CREEP|CY|CSUP|CSET|COUPLE|CAERO|CLOAD|CONV|CBARAO|CSSCHD|CAMPBLL|CONTACT|CONTPRM|CNTSTB"
    "|CONCTL|CONTRLT"
)
# cards that are not read though they make nodes or elements, those with a slip in the name, and
# those that repeat the card above (=)
UNKNOWN = re.compile("C|E?GRID|HEX|INCLUDE|PENTA|PLOT|PYR|QUAD|TETRA|TRIA|(?![A-Z][A-Z0-9]*$)")
# properties that give shells and lines a stiffness
SECTIONS = re.compile("P(BAR|BEAM|COMP|ROD|SHEAR|SHELL|TUBE)")
Card = tuple[int, list[str]]  # line and fields
log = logging.getLogger(__name__)


def is_bulk_data(path: Path) -> bool:
    """Whether a file begins its bulk data, or lists nodes as bulk data do."""
    return re.search(rb"^\s*(BEGIN\s+BULK|GRID[ \t*,])", path.read_bytes(), re.M | re.I) is not None


def read_bulk_data(path: Path) -> Any:
    """The mesh of a file, with properties as groups; InputError names a line, else Damaged."""
    import meshio

    reader = _Reader(path)
    for line, card in _cards(path):
        reader.take(line, card)
    if reader.passed:
        said = "%s: elements and links without extent are left out: %s"
        log.warning(said, path, ", ".join(sorted(reader.passed)))
    tags = np.array(sorted(reader.nodes), dtype=np.int64)
    if not len(tags) or not reader.elements:
        raise Damaged("it holds no nodes or no elements")
    reader.tell_sections()
    points = np.array([reader.nodes[tag] for tag in tags.tolist()])
    cells, groups = [], []
    for kind, rows in reader.elements.items():
        nodes = np.array([row for _, _, row in rows], dtype=np.int64)
        lost = np.argwhere(~np.isin(nodes, tags))
        if len(lost):
            number = nodes[tuple(lost[0])]
            said = f"an element names node {number}, which is not there"
            raise reader.fail(rows[lost[0, 0]][0], said)
        if kind == "hexahedron20":
            nodes = nodes[:, HEXAHEDRON[:20]]
        cells.append((kind, np.searchsorted(tags, nodes[:, : CORNERS.get(kind)])))
        groups.append(np.array([group for _, group, _ in rows], dtype=np.int64))
    return meshio.Mesh(points, cells, cell_data={"nastran:ref": groups}, info=reader.words)


class _Reader:
    """nodes: number -> place;  elements: shape -> line, group and nodes of each;  passed: cards
    words: shape -> card and line of the first element
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.nodes: dict[int, list[float]] = {}
        self.elements: dict[str, list[tuple[int, int, list[int]]]] = {}
        self.numbers: set[int] = set()
        self.passed: set[str] = set()
        self.sections: dict[int, float] = {}  # thickness by property
        self.words: dict[str, str] = {}

    def fail(self, line: int, message: str) -> InputError:
        return InputError(f"mesh file '{self.path}', line {line}: {message}.")

    def whole(self, line: int, word: str) -> int:
        if not re.fullmatch(r"[+-]?\d{1,10}", word, re.ASCII):
            raise self.fail(line, f"{word[:40]!r} is no whole number")
        return int(word)

    def real(self, line: int, word: str) -> float:
        """A number, whose exponent may lack its letter: 1.5-3."""
        text = re.sub(r"(?<=[\d.])([+-]\d+)$", r"e\1", word.upper().replace("D", "E"))
        try:
            return float(text or 0)
        except ValueError:
            raise self.fail(line, f"{word[:40]!r} is no number") from None

    def take(self, line: int, card: list[str]) -> None:
        name = card[0]
        if name == "GRID":
            number, system, *place = [*card[1:], *[""] * 5][:5]
            if system not in ("", "0"):
                raise self.fail(line, f"the node is in coordinate system {system}; write it in 0")
            known = self.whole(line, number)
            if known in self.nodes:
                raise self.fail(line, f"node {known} is there twice")
            self.nodes[known] = [self.real(line, word) for word in place]
        elif name == "GRDSET" and "".join(card[2:3]) not in ("", "0"):
            raise self.fail(line, "nodes are in a coordinate system of their own; write them in 0")
        elif name in ELEMENTS:
            self._element(line, card)
        elif SECTIONS.match(name):
            depth = self.real(line, card[3]) if name == "PSHELL" else 0.0
            self.sections[self.whole(line, card[1])] = depth or 1.0
        elif POINTS.match(name):
            self.passed.add(name)
        elif UNKNOWN.match(name) and not HARMLESS.match(name):
            raise self.fail(line, f"the card {name} is not known here; write the mesh without it")

    def tell_sections(self) -> None:
        """Warn of elements thinner than a body that have a property: they stiffen no body. Warn of
        the thickness of elements in the plane, which a scene gives.
        """
        thin: tuple[str, ...] = "line", "tri", "quad"
        if all(kind.startswith(thin) for kind in self.elements):
            thin = ("line",)
        for kind, rows in self.elements.items():
            own = [(line, self.sections[prop]) for line, prop, _ in rows if prop in self.sections]
            if kind.startswith(thin) and own:
                said = "%s, line %d: the stiffness of %s of type %s is left out"
                log.warning(said, self.path, own[0][0], count(len(own), "element"), kind)
            for depth in {depth for _, depth in own} - {1.0} if thin == ("line",) else ():
                lines = [line for line, value in own if value == depth]
                said = "%s, line %d: the thickness %g of %s is not read, that of the scene counts"
                log.warning(said, self.path, lines[0], depth, count(len(lines), "element"))

    def _element(self, line: int, card: list[str]) -> None:
        name, first = card[0], FIRST.get(card[0], 3)
        shapes = ELEMENTS[name]
        words = ["" if word == "0" else word for word in card[first : first + max(shapes)]]
        count = next(n for n in sorted(shapes) if not any(words[n:]))
        if len(words) < count or not all(words[:count]):
            raise self.fail(line, f"the element {name} lacks some of its nodes")
        nodes = [self.whole(line, word) for word in words[:count]]
        if name in SOLIDS and any(word.strip("0") for word in card[first + count :]):
            raise self.fail(line, f"the element {name} has more than {count} nodes")
        number = self.whole(line, card[1])
        if number in self.numbers:
            raise self.fail(line, f"element {number} is there twice")
        self.numbers.add(number)
        group = self.whole(line, card[2]) if first == 3 and card[2] else 0
        self.words.setdefault(shapes[count], f"{name} (line {line})")
        self.elements.setdefault(shapes[count], []).append((line, group, nodes))


def _cards(path: Path) -> Iterator[Card]:
    """Line and fields of each card of the bulk data, with the lines in which it goes on: those
    below it and, by their marks, those that stand elsewhere.
    """
    lines = list(_lines(path))
    ends = {mark for _, _, mark in lines if mark}
    cards: list[Card] = []
    waits: list[str] = []  # the mark with which each card goes on
    others: dict[str, list[tuple[int, list[str], str]]] = {}
    for number, fields, end in lines:
        mark = fields[0].lstrip("+*")
        if fields[0] and fields[0][0] not in "+*":
            cards.append((number, fields))
            waits.append(end)
        elif mark and mark not in waits[-1:] and (mark in ends or waits[-1:] != [""]):
            others.setdefault(mark, []).append((number, fields[1:], end))
        elif not cards:
            raise Damaged("it begins within a card")
        else:
            cards[-1][1].extend(fields[1:])
            waits[-1] = end
    for (_, fields), mark in zip(cards, waits) if others else ():
        while len(others.get(mark, ())) == 1:
            _, more, mark = others.pop(mark)[0]
            fields.extend(more)
    for (number, _, _), *_ in others.values():
        said = f"line {number}: it goes on no card, or one that goes on twice"
        raise InputError(f"mesh file '{path}', {said}; put it below its card.")
    yield from cards


def _lines(path: Path) -> Iterator[tuple[int, list[str], str]]:
    """Number and fields of each line of the bulk data, and the mark at its end."""
    lines = text_of(path).splitlines()
    begin = [n for n, line in enumerate(lines) if re.match(r"\s*BEGIN\b", line, re.IGNORECASE)]
    if len(begin) > 1:
        raise InputError(f"mesh file '{path}', line {begin[1] + 1}: it holds more than one BEGIN.")
    first = begin[0] + 1 if begin else 0
    for number, line in enumerate(lines[first:], first + 1):
        line = line.split("$")[0].rstrip().expandtabs(8)
        fields, end = _fields(line) if line else ([], "")
        if fields[:1] == ["ENDDATA"]:
            return
        if line:
            yield number, fields, end
    said = "it ends before ENDDATA; add this line if nothing is missing"
    raise InputError(f"mesh file '{path}', line {len(lines)}: {said}.")


def _fields(line: str) -> tuple[list[str], str]:
    """The name, and the eight fields of a line, four if they are large; the last field, without its
    sign, says with what the line begins in which the card goes on.
    """
    if "," in line:
        fields = [word.strip() for word in line.upper().split(",")]
        count = 4 if "*" in fields[0] else 8
        fields += [""] * (2 + count - len(fields))
        if len(fields) > 10:  # a long line
            count = len(fields)
    else:
        wide, count = (16, 4) if "*" in line[:8] else (8, 8)
        text = line.upper().ljust(80)
        ends = range(8, 8 + wide * count, wide)
        fields = [
            text[:8].strip(),
            *(text[i : i + wide].strip() for i in ends),
            text[72:80].strip(),
        ]
    goes_on = "".join(fields[1 + count :]).lstrip("+*")
    return [fields[0].rstrip("*").strip(), *fields[1 : 1 + count]], goes_on
