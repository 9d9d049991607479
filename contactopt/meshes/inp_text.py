"""The text of input files of CalculiX and Abaqus: keyword lines, their options and rows of data.

A keyword line `*NAME, KEY=VALUE, FLAG` is followed by rows of data. It goes on in the next line if
it ends with a comma and an option follows. Lines that begin with ** are comments. Case and blanks
do not matter in keywords and options; names in quotation marks may hold blanks and commas. Every
keyword that is not in READ and not in inp_keywords.txt is refused, as is every option that READ
does not list: the mesh may depend on it.

Sources: CalculiX CrunchiX user's manual, version 2.22, chapter "Input deck format"; Abaqus
user's manual, "Input syntax rules".
"""

import logging
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from contactopt.checks import LARGEST as FAR
from contactopt.errors import Damaged, InputError

log = logging.getLogger("contactopt.meshes.inp")
# keywords that are read -> their options, without blanks
READ = {
    "node": "nset system input",
    "element": "type elset input",
    "nset": "nset elset generate instance internal unsorted",
    "elset": "elset generate instance internal unsorted",
    "surface": "name type internal regiontype nooffset filletradius maxratio trim",
    "ngen": "line nset system",
    "nfill": "nset",
    "ncopy": "changenumber oldset newset shift reflect multiple",
    "elgen": "elset allnodes",
    "elcopy": "elementshift oldset shiftnodes newset",
    "system": "", "include": "input",
    "part": "name", "assembly": "name", "instance": "name part",
    "endpart": "", "endassembly": "", "endinstance": "",
}  # fmt: skip
# keywords that give elements a stiffness, with any options
THICK = {"membranesection", "shellsection", "solidsection"}  # the first number below is a thickness
SECTIONS = THICK | {"beamsection", "beamgeneralsection", "framesection", "shellgeneralsection"}
# keywords of what elements do not show, foundations and links between nodes
STIFFENING = {"foundation", "rebar", "rebarlayer", "equation", "mpc", "coupling", "rigidbody"}
STIFFENING |= {"kinematiccoupling", "distributingcoupling", "embeddedelement"}
DEEPEST = 10  # files that include each other
LARGEST = 2**31  # numbers of nodes, elements and lines are smaller
OPEN = "a quotation mark is not closed"
COMMA = re.compile(r',(?=(?:[^"]*"[^"]*")*[^"]*$)')  # not within quotation marks
Row = tuple[int, list[str]]  # place of the line in Source, and words


class Later(InputError):
    """What a block needs is not there, but may stand below: the order of the data is free."""


@dataclass
class Source:
    """The files of a deck: number i * LARGEST + n stands for line n of file i."""

    files: list[Path]
    depths: list[int]  # how many files include each
    told: set[str] = field(default_factory=set)  # keywords of which a warning was given

    def open(self, path: Path, depth: int) -> list[tuple[int, str]]:
        """The lines of another file, the last one first, by their numbers."""
        self.files.append(path)
        self.depths.append(depth)
        first = (len(self.files) - 1) * LARGEST
        return [(first + number, text) for number, text in _lines(path)]

    def named(self, place: int) -> tuple[Path, int]:
        return self.files[place // LARGEST], place % LARGEST


@dataclass
class Block:
    """A keyword line with its data.

    source   the files of the deck;  place  of the keyword in it
    keyword  in lower case, without blanks;  options  value by name
    rows     the rows of data, each with its place;  title  the keyword as messages name it
    """

    source: Source
    place: int
    keyword: str
    options: dict[str, str]
    rows: list[Row] = field(default_factory=list)
    title: str = ""

    def fail(
        self, message: str, place: int | None = None, error: type[InputError] = InputError
    ) -> InputError:
        """The error about the keyword, or about a row of its data."""
        path, line = self.source.named(self.place if place is None else place)
        return error(f"mesh file '{path}', line {line}: {message}.")

    def warn(self, message: str, *values: object) -> None:
        """Warn of the keyword."""
        path, line = self.source.named(self.place)
        log.warning(f"%s, line %d: {message}", path, line, *values)

    def need(self, option: str) -> str:
        """The value of an option that must be there."""
        if not self.options.get(option):
            raise self.fail(f"*{self.title} lacks the option {option.upper()}=")
        return self.options[option]

    def whole(self, place: int, word: str) -> int:
        """The number of a node or element, or a step between numbers."""
        if len(word) < 10 and word.isascii() and word.isdigit():
            return int(word)
        if re.fullmatch(r"[+-]?\d{1,10}", word, re.ASCII) and abs(int(word)) < LARGEST:
            return int(word)
        wrong = f"{word[:40]!r} is no whole number below {LARGEST}"
        raise self.fail(wrong if word else "a number is missing", place)

    def real(self, place: int, word: str) -> float:
        """A number; an exponent may be written with D, and an empty word is zero."""
        try:
            value = float(word.translate(_EXPONENT) or 0)
        except ValueError:
            value = math.nan
        if not abs(value) < FAR:
            why = "is no number" if math.isnan(value) else f"is not below {FAR:g}"
            raise self.fail(f"{word[:40]!r} {why}", place)
        return value

    def thickness(self) -> float:
        """The number below a section of elements in the plane or of shells, 1 without one."""
        plain = self.keyword in THICK and "composite" not in self.options
        first = [(line, words[0]) for line, words in self.rows if plain and words[0]]
        return self.real(*first[0]) if first else 1.0


Named = dict[int, tuple[Block, int] | None]  # numbers, each with where it is named if it must exist
_EXPONENT = str.maketrans({"d": "e", "D": "e", "_": "?"})


def blocks(path: Path) -> Iterator[Block]:
    """The blocks of a file that are read, included files in the place of the lines that name them.

    Damaged for what is no such file; InputError with its line for what is not known.
    """
    source = Source([], [])
    lines = source.open(path, 0)
    block: Block | None = None
    stepping = False
    while lines:
        place, text = lines.pop()
        if not text.startswith("*"):
            if block is None:
                raise Damaged("it does not begin with a keyword")
            block.rows.append((place, _words(text)))
            continue
        while text.endswith(",") and lines and _goes_on(text, lines[-1][1]):
            text += lines.pop()[1]
        if text.count('"') % 2:
            raise Block(source, place, "", {}).fail(OPEN)
        first, *words = _words(text[1:])
        pairs = (word.partition("=") for word in words if word)
        options = {bare(key): value.strip().strip('"').strip() for key, _, value in pairs}
        found = Block(source, place, bare(first), options, title=first.upper())
        if found.keyword == "include":  # its data may be those of the block before
            lines += _other(found)
            continue
        if block is not None:
            yield from _known(block, stepping)
            stepping = block.keyword == "step" or (stepping and block.keyword != "endstep")
        block = found
    if block is None:
        raise Damaged("it holds no keyword")
    yield from _known(block, stepping)


def _other(block: Block) -> list[tuple[int, str]]:
    """The lines of the file that a keyword names, the last one first."""
    _check_options(block)
    name, source = block.need("input").replace("\\", "/"), block.source
    path, depth = source.named(block.place)[0], source.depths[block.place // LARGEST] + 1
    if depth > DEEPEST:
        raise block.fail("files include each other without end")
    for folder in (path.parent, source.files[0].parent):  # programs look beside the first file
        if (folder / name).is_file():
            return source.open(folder / name, depth)
    raise block.fail(f"there is no file '{name}' beside this one")


def _goes_on(text: str, after: str) -> bool:
    """Whether the line after a keyword line that ends with a comma holds more of its options."""
    keyword, option = bare(text[1:].split(",")[0]), bare(after.split(",")[0].partition("=")[0])
    return not after.startswith("*") and option in READ.get(keyword, option).split()


def _known(block: Block, stepping: bool) -> Iterator[Block]:
    """A block that is read, with the data of other files, or nothing for one without effect."""
    if block.keyword in SECTIONS:
        yield block
        return
    if block.keyword in STIFFENING and block.keyword not in block.source.told:
        block.source.told.add(block.keyword)
        block.warn("the stiffness of *%s is left out", block.title)
    if block.keyword == "modelchange" and block.options.get("type", "element").lower() == "element":
        raise block.fail("*MODEL CHANGE of elements is not read; write the mesh that is meant")
    if block.keyword not in READ:
        if not stepping and block.keyword not in harmless():
            raise block.fail(
                f"the keyword *{block.title} is not known here, and the mesh may"
                " depend on it; write the mesh without it"
            )
        return
    _check_options(block)
    if "input" in block.options:
        block.rows += [(place, _words(text)) for place, text in reversed(_other(block))]
    for place, words in block.rows:
        if any(word.count('"') % 2 for word in words):
            raise block.fail(OPEN, place)
    yield block


def _check_options(block: Block) -> None:
    for option in block.options:
        if option not in READ[block.keyword].split():
            raise block.fail(
                f"the option {option.upper()} of *{block.title} is not known here; write"
                " the mesh without it"
            )


@cache
def harmless() -> frozenset[str]:
    """Keywords of materials, loads, contacts, steps and results, on which no mesh depends."""
    text = (Path(__file__).parent / "inp_keywords.txt").read_text()
    return frozenset(bare(line) for line in text.splitlines())


def _lines(path: Path) -> list[tuple[int, str]]:
    """Number and text of the lines that are neither empty nor comments, the last one first."""
    text = text_of(path).rstrip("\x1a")  # the end of a file in DOS
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    found = ((number, line.strip()) for number, line in enumerate(lines, 1))
    return [(n, line) for n, line in found if line and not line.startswith("**")][::-1]


def text_of(path: Path) -> str:
    """The text of a file in UTF-8 or, where it is not that, in Latin-1."""
    data = path.read_bytes()
    if b"\0" in data:
        raise Damaged("it is no text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _words(text: str) -> list[str]:
    """The words between commas; what follows the last comma does not count if it is empty."""
    words = COMMA.split(text) if '"' in text else text.split(",")
    words = [word.strip() for word in words]
    return words[:-1] if len(words) > 1 and not words[-1] else words


def bare(name: str) -> str:
    """A name as it is compared: case, blanks and quotation marks do not matter."""
    return "".join(name.replace('"', "").split()).lower()


def set_of(sets: dict[str, Named], name: str) -> Named:
    """The set of that name, whatever the case of its letters; a new one if there is none."""
    name = name.replace('"', "")
    known = next((other for other in sets if bare(other) == bare(name)), name)
    return sets.setdefault(known, {})
