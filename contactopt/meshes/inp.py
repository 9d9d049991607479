"""Input files of CalculiX and Abaqus (.inp): nodes, elements, their sets and surfaces.

contactopt.meshes.inp_text reads the keywords, contactopt.meshes.inp_generation makes nodes and
elements from others. Elements without an extent (springs, masses, couplings) are passed over. What
a set, a surface or an element names must be there; where it is not, its line is named.

A part has numbers and sets of its own. An assembly holds instances of parts, each moved to its
place, and sets of instances. Here an instance is a set of elements, the body. A set of a part is
the union of those of its instances; which of them is meant is clear once a body has been chosen.

Sources: CalculiX CrunchiX user's manual, version 2.22, chapters "Element types" and "Input deck
format"; Abaqus user's manual, "Defining an assembly", "Element-based surface definition".
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from contactopt.cards import count
from contactopt.checks import place_words
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.meshes import inp_generation
from contactopt.meshes.inp_elements import CORNERS, dimension, facets, kind_of, words_of
from contactopt.meshes.inp_text import LARGEST, SECTIONS, Block, Later, Named, bare, blocks, set_of
from contactopt.meshes.mesh_repair import in_order

log = logging.getLogger(__name__)


def read_inp(path: Path) -> Any:
    """The mesh of a file, with sets of elements and of nodes by name. A surface is a set of facets.

    InputError with the line of what cannot be read; ValueError for what is no such file.
    """
    import meshio

    whole, parts = Scope(), dict[str, Scope]()
    now, opened = whole, dict[str, Block]()
    for block in blocks(path):
        verb, what = ("end", block.keyword[3:]) if block.keyword[:3] == "end" else ("", "")
        if block.keyword == "part":
            if bare(block.need("name")) in parts:
                raise block.fail(f"there are two parts {block.need('name')}")
            now = parts[bare(block.need("name"))] = Scope()
        elif block.keyword == "instance":
            now = _instance(parts, block)
            if bare(now.name) in whole.instances:
                raise block.fail(f"there are two instances {now.name}")
        elif what == "instance" and "instance" in opened:
            whole.add(now)
            now = whole
        elif what == "part":
            now = whole
        elif not verb and block.keyword != "assembly":
            now.read(block)
        if verb and opened.pop(what, None) is None:
            raise block.fail(f"there is no *{what.upper()} that it ends")
        if block.keyword in ("part", "assembly", "instance"):
            opened[block.keyword] = block
    for keyword, block in opened.items():
        raise block.fail(f"the file ends before *END {keyword.upper()}")
    for scope in (*parts.values(), whole):
        scope.check()
    if not any(kind for kind, _, _, _ in whole.blocks):
        passed = f"; {', '.join(sorted(whole.passed))} are passed over" if whole.passed else ""
        raise InputError(
            f"mesh file '{path}': no element of a body is in it or in an instance of its"
            f" parts{passed}."
        )
    whole.name_sets()
    if whole.passed:
        log.warning("%s: elements without extent are left out: %s", path, ", ".join(whole.passed))
    whole.tell_sections()
    cells = [(kind, nodes, ids) for kind, nodes, ids, _ in whole.blocks if kind] + facets(whole)
    tags = np.array(sorted(whole.nodes), dtype=np.int64)
    points = np.array([whole.nodes[tag] for tag in tags.tolist()]).reshape(-1, 3)
    of_cells = {
        name: [_places(ids, found) for _, _, ids in cells]
        for name, found in whole.element_sets.items()
    }
    of_points = {n: np.searchsorted(tags, sorted(f)) for n, f in whole.node_sets.items()}
    rows = [(kind, np.searchsorted(tags, nodes)) for kind, nodes, _ in cells]
    rows = [(k, in_order(points, n) if k == "hexahedron27" else n) for k, n in rows]
    sets = {"cell_sets": of_cells, "point_sets": of_points}
    return meshio.Mesh(points, rows, **sets, info=words_of(whole))


def _places(ids: np.ndarray, found: Iterable[int]) -> np.ndarray:
    return np.flatnonzero(np.isin(ids, np.fromiter(found, np.int64)))


def _instance(parts: dict[str, Scope], block: Block) -> Scope:
    """A copy of a part, moved along the first row, then turned about the axis of the second."""
    name, of = block.need("name"), block.need("part")
    if bare(of) not in parts:
        known = ", ".join(parts) or "none"
        raise block.fail(f"instance {name} is of part {of}, which is not above; parts: {known}")
    made = parts[bare(of)].copy()
    made.name, made.move = name, inp_generation.motion(block, block.rows)
    return made


class Scope:
    """What the blocks of a file, of a part or of an instance say.

    A method for each keyword that is read.
    """

    ngen, nfill, ncopy = inp_generation.ngen, inp_generation.nfill, inp_generation.ncopy
    elgen, elcopy = inp_generation.elgen, inp_generation.elcopy
    system, places = inp_generation.system, inp_generation.places

    def __init__(self) -> None:
        self.nodes: dict[int, tuple[float, ...]] = {}
        # kind ('' of those that are passed over), numbers of nodes, of elements, where each is
        self.blocks: list[tuple[str, np.ndarray, np.ndarray, list[tuple[Block, int]]]] = []
        self.types: dict[int, str] = {}  # type of each block
        self.elements: set[int] = set()
        self.node_sets: dict[str, Named] = {}
        self.element_sets: dict[str, Named] = {}
        self.unsorted: set[str] = set()
        self.surfaces: dict[str, list[tuple[Iterable[int], str, Block, int]]] = {}
        self.passed: dict[str, int] = {}  # types of elements
        self.sections: list[tuple[Scope, int, Block]] = []  # where their sets are, as for instances
        self.instances: dict[str, tuple[Scope, int]] = {}  # with what numbers grow by
        self.name = ""
        self.later: list[Block] = []  # that wait for what stands below them
        self.frame = np.zeros(3), Rotation.identity()  # of *SYSTEM: origin, directions
        self.move: Any = None  # of an instance

    def read(self, block: Block) -> None:
        """Do what a block says, now or, where what it names is not there yet, in settle()."""
        try:
            if block.keyword in SECTIONS:
                self.sections.append((self, 0, block))
                return
            getattr(self, block.keyword)(block)
            block.rows = []
        except Later:
            self.later.append(block)

    def settle(self) -> None:
        """Read the blocks that had to wait. Later names the line of what the file never defines."""
        left = [None] * (1 + len(self.later))
        while len(self.later) < len(left):
            left, self.later = self.later, []  # type: ignore[assignment]
            for block in left:
                self.read(block)  # type: ignore[arg-type]
        for block in reversed(self.later):
            getattr(self, block.keyword)(block)

    def copy(self) -> Scope:
        """A scope of the same contents, to which others can be added."""
        made = copy(self)
        for key, value in vars(self).items():
            if isinstance(value, dict | list | set):
                setattr(made, key, copy(value))
        every: Any = (made.node_sets, made.element_sets, made.surfaces)
        for sets in every:
            sets.update({name: copy(own) for name, own in sets.items()})
        return made

    def add(self, own: Scope) -> None:
        """Add an instance at its place, with new numbers of its nodes and elements."""
        own.check()
        by = (len(self.instances) + 1) * LARGEST
        self.instances[bare(own.name)] = own, by
        places = own.move(np.array(list(own.nodes.values())).reshape(-1, 3))
        self.nodes |= zip((tag + by for tag in own.nodes), map(tuple, places.tolist()))
        self.elements.update(i + by for i in own.elements)
        self.sections += [(own, by, block) for _, _, block in own.sections]
        for name, number in own.passed.items():
            self.passed[name] = self.passed.get(name, 0) + number
        for number, (kind, nodes, ids, where) in enumerate(own.blocks):
            self.types[len(self.blocks)] = own.types[number]
            self.blocks.append((kind, np.where(nodes > 0, nodes + by, 0), ids + by, where))
            set_of(self.element_sets, own.name).update(dict.fromkeys((ids + by).tolist()))

    def name_sets(self) -> None:
        """Take over the sets and surfaces of the instances. Those of one name are united; where the
        assembly has a set of that name itself, they are called INSTANCE.NAME.
        """
        taken = [{bare(n) for n in s} for s in (self.node_sets, self.element_sets, self.surfaces)]
        for own, by in self.instances.values():

            def named(name: str, kind: int, own: Scope = own) -> str:
                return f"{own.name}.{name}" if bare(name) in taken[kind] else name

            for name, found in own.node_sets.items():
                set_of(self.node_sets, named(name, 0)).update(dict.fromkeys(n + by for n in found))
            for name, found in own.element_sets.items():
                set_of(self.element_sets, named(name, 1)).update(
                    dict.fromkeys(n + by for n in found)
                )
            for name, rows in own.surfaces.items():
                moved = [([i + by for i in found], *rest) for found, *rest in rows]
                self.surfaces.setdefault(named(name, 2), []).extend(moved)  # type: ignore[arg-type]

    def check(self) -> None:
        """Raise InputError for a missing node or element; ranges may have gaps."""
        self.settle()
        known = np.fromiter(self.nodes, np.int64)
        for kind, nodes, _, where in self.blocks:
            lost = np.argwhere(~np.isin(nodes, known) & (nodes > 0 if not kind else True))
            if len(lost):
                block, line = where[lost[0, 0]]
                said = f"an element {block.options.get('type', '')} names a node that is not there,"
                raise block.fail(f"{said} {nodes[tuple(lost[0])]}", line)
        both: Any = ((self.node_sets, self.nodes, "node"), (self.element_sets, self.elements, ""))
        for sets, there, what in both:
            for name, found in sets.items():
                for number in [number for number in found if number not in there]:
                    if found[number] is not None:
                        block, line = found[number]
                        word = f"{what or 'element'} {number % LARGEST}"
                        raise block.fail(f"'{name}' names {word}, which is not there", line)
                    del found[number]

    def tell_sections(self) -> None:
        """Warn of shells and lines beside solids, or lines beside plane elements, that have a
        section: they may name boundaries, but stiffen no body. Warn of the thickness of plane
        elements, which a scene gives.
        """
        most = max(dimension(named) for named in self.types.values())
        for own, by, block in self.sections:
            sets = {bare(name): found for name, found in own.element_sets.items()}
            members = sets.get(bare(block.options.get("elset", "")), ())
            for place, (_, _, ids, _) in enumerate(self.blocks):
                many = len(_places(ids - by, members))
                if many and 0 < dimension(self.types[place]) < most:
                    said = "the stiffness of %s %s is left out"
                    block.warn(said, count(many, "element"), self.types[place])
                elif many and most == 2 and (depth := block.thickness()) != 1:
                    said = "the thickness %g of %s %s is not read, that of the scene counts"
                    block.warn(said, depth, count(many, "element"), self.types[place])

    def node(self, block: Block) -> None:
        tags, rows = list[int](), list[list[float]]()
        for line, words in block.rows:
            if len(words) > 7:
                raise block.fail("a node has a number and up to three coordinates", line)
            tags.append(block.whole(line, words[0]))
            rows.append([block.real(line, word) for word in (*words[1:4], "", "", "")[:3]])
            if tags[-1] < 1:
                raise block.fail("numbers of nodes begin with 1", line)
        self.put(block, tags, self.places(block, rows), block.options.get("nset", ""))

    def put(self, block: Block, tags: list[int], places: np.ndarray, name: str) -> None:
        """Add nodes, and put them into a set if it has a name. A node that is given twice has its
        last place.
        """
        size = EQUAL * np.abs(places).max(initial=0.0)
        for tag, place in zip(tags, map(tuple, places.tolist())):
            before = self.nodes.setdefault(tag, place)
            if before != place and max(abs(a - b) for a, b in zip(before, place)) > size:
                said = "node %d is there twice; it moves from (%s) to (%s)"
                block.warn(said, tag, place_words(before), place_words(place))
            self.nodes[tag] = place
        if name:
            set_of(self.node_sets, name).update(dict.fromkeys(tags))

    def element(self, block: Block) -> None:
        named = block.need("type").upper()
        try:
            kind, nodes = kind_of(named)
        except ValueError as error:
            raise block.fail(str(error)) from None
        rows, where = list[list[int]](), list[tuple[Block, int]]()
        for line, words in block.rows:
            if not rows or not kind or len(rows[-1]) == 1 + nodes:
                rows.append([])
                where.append((block, line))
            if named[0] == "B" and len(words) == 2 + nodes:  # the last directs the section
                words = words[:-1]
            rows[-1] += [block.whole(line, word) for word in words]
            if kind and len(rows[-1]) > 1 + nodes:
                raise block.fail(f"an element {named} has a number and {nodes} nodes", line)
        if kind and rows and len(rows[-1]) < 1 + nodes:
            raise block.fail(f"an element {named} lacks some of its {nodes} nodes", where[-1][1])
        width = max((len(row) for row in rows), default=1 + nodes)
        table = np.array([row + [0] * (width - len(row)) for row in rows], dtype=np.int64)
        table = table.reshape(-1, width)
        if kind == "line3":  # the middle is in the middle here, and at the end in meshio
            table = table[:, [0, 1, 3, 2]]
        if kind in CORNERS:
            table = table[:, : 1 + CORNERS[kind]]
        if not kind:
            self.passed[named] = self.passed.get(named, 0) + len(rows)
        self.append(named, table[:, 1:], table[:, 0], where)
        if "elset" in block.options:
            own = set_of(self.element_sets, block.need("elset"))
            own.update(dict.fromkeys(table[:, 0].tolist()))

    def append(
        self, named: str, nodes: np.ndarray, ids: np.ndarray, where: list[tuple[Block, int]]
    ) -> None:
        """Add elements of a type, whose numbers must be new."""
        for number, (block, line) in zip(ids.tolist(), where):
            if number < 1 or number in self.elements:
                fault = "is there twice" if number > 0 else "has a number below 1"
                raise block.fail(f"element {number} {fault}", line)
            self.elements.add(number)
        self.types[len(self.blocks)] = named
        self.blocks.append((kind_of(named)[0], nodes, ids, where))

    def nset(self, block: Block) -> None:
        name, mine = block.need("nset"), Named()
        if "elset" in block.options:
            of = self.there(block.need("elset"), block)
            for _, nodes, ids, _ in self.blocks:
                own = nodes[_places(ids, of)].ravel().tolist()
                mine.update(dict.fromkeys(node for node in own if node))
        else:
            mine = self._named("node_sets", block)
        set_of(self.node_sets, name).update(mine)
        if "unsorted" in block.options:
            self.unsorted.add(bare(name))

    def elset(self, block: Block) -> None:
        name, mine = block.need("elset"), self._named("element_sets", block)
        set_of(self.element_sets, name).update(mine)

    def surface(self, block: Block) -> None:
        kind, name = block.options.get("type", "element").lower(), block.need("name")
        if kind == "node":
            block.rows = [(line, words[:1]) for line, words in block.rows]
            mine = self._named("node_sets", block)
            set_of(self.node_sets, name).update(mine)
        elif kind == "element":
            shown = next((own for own in self.surfaces if bare(own) == bare(name)), name)
            rows = []
            for line, words in block.rows:
                label = words[1].upper() if len(words) > 1 else ""
                found = self.numbers(words[0], "element_sets", block, line)
                rows.append((list(found), label, block, line))
            self.surfaces.setdefault(shown, []).extend(rows)
        else:
            log.info("surface %s of type %s is no part of a mesh", name, kind)

    def _named(self, sets: str, block: Block) -> Named:
        """What rows name: numbers, ranges or other sets."""
        mine = Named()
        for line, words in block.rows:
            if "generate" not in block.options:
                for word in filter(None, words):
                    mine.update(self.numbers(word, sets, block, line))
                continue
            row = [block.whole(line, word) for word in words if word]
            first, last, step = (*row, 1)[:3] if len(row) in (2, 3) else (1, 0, 1)
            if last < first or step < 1:
                raise block.fail("a range needs its first and last number and a step", line)
            by = self._of_instance(block, line)[1]
            own = range(first + by, last + by + 1, step)
            mine.update(dict.fromkeys(own))
            mine.update(dict.fromkeys((own[0], own[-1]), (block, line)))
        return mine

    def _of_instance(self, block: Block, line: int | None) -> tuple[Scope, int]:
        name = block.options.get("instance", "")
        if name and bare(name) not in self.instances:
            raise block.fail(f"there is no instance {name}", line, Later)
        return self.instances[bare(name)] if name else (self, 0)

    def numbers(self, word: str, sets: str, block: Block, line: int | None = None) -> Named:
        """What a word stands for: a number or a set, of an instance if it is INSTANCE.WORD."""
        own, by = self._of_instance(block, line)
        before, dot, after = word.partition(".")
        if own is self and dot and bare(before) in self.instances:
            own, by = self.instances[bare(before)]
            word = after
        if word.isdigit():
            place = block.place if line is None else line
            return {block.whole(place, word) + by: (block, place)}
        known = {bare(name): found for name, found in getattr(own, sets).items()}
        if bare(word) not in known:
            raise block.fail(f"there is no set {word} of {sets.split('_')[0]}s", line, Later)
        return {number + by: where for number, where in known[bare(word)].items()}

    def there(self, word: str, block: Block) -> Named:
        """The elements that a word stands for. All must exist, but a range may have gaps."""
        found = self.numbers(word, "element_sets", block)
        for number, where in found.items():
            if where is not None and number not in self.elements:
                raise block.fail(f"element {number % LARGEST} is not there", error=Later)
        return found
