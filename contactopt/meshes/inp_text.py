"""The text of input files of CalculiX and Abaqus: keyword lines, their options and rows of data.

A keyword line `*NAME, KEY=VALUE, FLAG` is followed by rows of data. It goes on in the next line if
it ends with a comma and an option follows. Lines that begin with ** are comments. Case and blanks
do not matter in keywords and options; names in quotation marks may hold blanks and commas. Every
keyword that is not in READ and not in inp_keywords.txt is refused, as is every option that READ
does not list: the mesh may depend on it.

Sources: CalculiX CrunchiX user's manual, version 2.22, chapter "Input deck format"; Abaqus
user's manual, "Input syntax rules".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

from contactopt.errors import InputError

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
SECTIONS = {
    *("beamsection", "beamgeneralsection", "framesection", "membranesection"),
    *("shellsection", "shellgeneralsection", "solidsection"),
}
DEEPEST = 10  # files that include each other
LARGEST = 2**31  # numbers of nodes and elements are smaller
COMMA = re.compile(r',(?=(?:[^"]*"[^"]*")*[^"]*$)')  # not within quotation marks
Row = tuple[int, list[str]]  # line and words


@dataclass
class Block:
    """A keyword line with its data.

    keyword  in lower case, without blanks;  options  value by name
    rows     the rows of data, each with its line in `data`, the file that holds them
    line     of the keyword in `path`
    """

    path: Path
    line: int
    keyword: str
    options: dict[str, str]
    rows: list[Row] = field(default_factory=list)
    data: Path = Path()

    def fail(self, message: str, line: int | None = None) -> InputError:
        """The error about the keyword, or about a line of its data."""
        path, number = (self.path, self.line) if line is None else (self.data, line)
        return InputError(f"mesh file '{path}', line {number}: {message}.")

    def need(self, option: str) -> str:
        """The value of an option that must be there."""
        if not self.options.get(option):
            raise self.fail(f"*{self.keyword.upper()} lacks the option {option.upper()}=")
        return self.options[option]

    def whole(self, line: int, word: str) -> int:
        """The number of a node or element, or a step between numbers."""
        if len(word) < 10 and word.isascii() and word.isdigit():
            return int(word)
        if re.fullmatch(r"[+-]?\d{1,10}", word, re.ASCII) and abs(int(word)) < LARGEST:
            return int(word)
        raise self.fail(f"{word[:40]!r} is no whole number below {LARGEST}", line)

    def real(self, line: int, word: str) -> float:
        """A number; an exponent may be written with D, and an empty word is zero."""
        try:
            return float(word.translate(_EXPONENT) or 0)
        except ValueError:
            raise self.fail(f"{word[:40]!r} is no number", line) from None


Named = dict[int, tuple[Block, int] | None]  # numbers, each with where it is named if it must exist
_EXPONENT = str.maketrans({"d": "e", "D": "e", "_": "?"})


def blocks(path: Path, depth: int = 0) -> Iterator[Block]:
    """The blocks of a file that are read, included files in their place.

    ValueError for what is no such file; InputError with its line for what is not known.
    """
    lines = _lines(path)
    block: Block | None = None
    stepping = False
    while lines:
        number, text = lines.pop()
        if not text.startswith("*"):
            if block is None:
                raise ValueError("it does not begin with a keyword")
            block.rows.append((number, _words(text)))
            continue
        if block is not None:
            yield from _known(block, stepping, depth)
            stepping = block.keyword == "step" or (stepping and block.keyword != "endstep")
        while text.endswith(",") and lines and _goes_on(text, lines[-1][1]):
            text += lines.pop()[1]
        first, *words = _words(text[1:])
        pairs = (word.partition("=") for word in words if word)
        options = {bare(key): value.strip().strip('"').strip() for key, _, value in pairs}
        block = Block(path, number, bare(first), options, data=path)
    if block is None:
        raise ValueError("it holds no keyword")
    yield from _known(block, stepping, depth)


def _goes_on(text: str, after: str) -> bool:
    """Whether the line after a keyword line that ends with a comma holds more of its options."""
    keyword, option = bare(text[1:].split(",")[0]), bare(after.split(",")[0].partition("=")[0])
    return not after.startswith("*") and option in READ.get(keyword, option).split()


def _known(block: Block, stepping: bool, depth: int) -> Iterator[Block]:
    """A block that is read, with the data of other files, or nothing for one without effect."""
    if block.keyword in SECTIONS:
        yield block
        return
    if block.keyword not in READ:
        if not stepping and block.keyword not in harmless():
            raise block.fail(
                f"the keyword *{block.keyword.upper()} is not known here, and the mesh may"
                " depend on it; write the mesh without it"
            )
        return
    for option in block.options:
        if option not in READ[block.keyword].split():
            raise block.fail(
                f"the option {option.upper()} of *{block.keyword.upper()} is not known here; write"
                " the mesh without it"
            )
    if block.keyword == "include" or "input" in block.options:
        name = block.need("input").replace("\\", "/")
        other = block.path.parent / name
        if depth >= DEEPEST:
            raise block.fail("files include each other without end")
        if not other.is_file():
            raise block.fail(f"there is no file '{name}' beside this one")
        if block.keyword == "include":
            yield from blocks(other, depth + 1)
            return
        rows = [(number, _words(text)) for number, text in reversed(_lines(other))]
        block = replace(block, rows=rows, data=other)
    yield block


@cache
def harmless() -> frozenset[str]:
    """Keywords of materials, loads, contacts, steps and results, on which no mesh depends."""
    text = (Path(__file__).parent / "inp_keywords.txt").read_text()
    return frozenset(bare(line) for line in text.splitlines())


def _lines(path: Path) -> list[tuple[int, str]]:
    """Number and text of the lines that are neither empty nor comments, the last one first."""
    data = path.read_bytes()
    if b"\0" in data:
        raise ValueError("it is no text")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    found = ((number, line.strip()) for number, line in enumerate(lines, 1))
    return [(n, line) for n, line in found if line and not line.startswith("**")][::-1]


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
