"""Tables of a TOML file that know where they stand, so that every message about them names the
line.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections import deque
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from pathlib import Path
from typing import Any

from contactopt.checks import check_number, meant, short
from contactopt.errors import InputError

# what tomllib says of an entry or a table that is there twice
TWICE = re.compile(r"Cannot (?:overwrite|declare|mutate|expand|redefine)|Duplicate")
MOST_BYTES = 1_000_000  # bytes of a file that people write
TOKEN = re.compile(
    r"""(?P<space>[ \t\r\n]+|\#[^\n]*)
    |(?P<text>\"{3}(?:\\[\s\S]|(?!\"{3})[^\\])*\"{3,5}
        |'{3}(?:(?!'{3})[\s\S])*'{3,5}
        |"(?:\\.|[^"\\\n])*"|'[^'\n]*')
    |(?P<mark>[\[\]{}=,])|(?P<bare>[^\s\#"'\[\]{}=,]+)""",
    re.VERBOSE,
)
# type of an entry -> the types of its value, and how a message names them
KINDS: dict[type, tuple[tuple[type, ...], str]] = {
    str: ((str,), "a text in quotation marks"),
    float: ((int, float), "a number"),
    int: ((int,), "a whole number"),
    bool: ((bool,), "true or false"),
    dict: ((dict,), "a table, { name = value, ... }"),
    list: ((list,), "an array"),
}
Place = tuple[str | int, ...]


class Table:
    """A table of the file, whose entries are taken by name and type; close() refuses the others.

    file   name of the file, for messages
    lines  place of every entry -> line, or the change that was made there
    """

    def __init__(
        self, file: str, lines: Mapping[Place, int | str], data: dict[str, Any], place: Place = ()
    ):
        self.file, self.lines, self.data, self.place = file, lines, data, place
        self.known: list[str] = []

    def fail(self, message: str, *below: str | int) -> InputError:
        """Make the error to raise about this table, or about the entry `below` it, to which keys
        and numbers lead. It names the file and the line before the message.
        """
        place: Place = (*self.place, *below)
        while place and place not in self.lines:
            place = place[:-1]
        where = self.lines[place] if place else ""
        return InputError(f"{self.file}{at_line(where)}: {message}")

    @contextmanager
    def about(self, *below: str | int) -> Iterator[None]:
        """Within this block errors are about this table, or about an entry of it, as for fail()."""
        try:
            yield
        except InputError as error:
            if str(error).startswith((f"{self.file}, line", f"{self.file}, --set")):
                raise
            raise self.fail(str(error), *below) from error

    def has(self, key: str, *kinds: type) -> bool:
        """Say whether an entry of any of these KINDS is there, known to close() from now on."""
        self.known.append(key)
        return key in self.data

    def take(
        self,
        key: str,
        kind: type,
        default: Any = None,
        needed: bool = False,
        what: str = "",
        among: Collection[str] = (),
        **limits: Any,
    ) -> Any:
        """Take an entry, which must be of a type of KINDS, and, if they are given, one of the names
        `among` which it is chosen.

        Where there is none, `default` is returned, or that is an error if it is `needed`. A message
        calls the type `what`. The limits of a number are those of contactopt.checks.check_number.
        """
        types, usual = KINDS[kind]
        what = what or usual
        self.known.append(key)
        if key not in self.data:
            if needed:
                raise self.fail(f"{key!r} is missing{self._here()}; it is {what}.")
            return default
        value: Any = self.data[key]
        if not isinstance(value, types) or isinstance(value, bool) != (kind is bool):
            raise self.fail(f"{key!r} must be {what}; got {short(value)}.", key)
        if kind is float:
            with self.about(key):
                check_number(key, self.data[key], **limits)
        if among and value not in among:
            known = f"there is no {key} {short(value)}; choose from {', '.join(among)}"
            raise self.fail(known + meant(str(value), among), key)
        return value

    def numbers(self, key: str, count: int | None, what: str) -> list[float]:
        """Take an array of `count` finite numbers, or any; a message calls them `what`."""
        values = self.take(key, list, needed=True, what=what)
        if count is not None and len(values) != count:
            raise self.fail(f"{key!r} must be {what}; got {short(values)}.", key)
        for i, value in enumerate(values):
            with self.about(key, i):
                check_number(f"every value of {key}", value)
        return values

    def names(self, key: str) -> tuple[str, ...]:
        """Take an array of names, which must be there."""
        values = self.take(key, list, needed=True, what="an array of names")
        if not all(isinstance(value, str) for value in values):
            raise self.fail(f"{key!r} must be an array of names; got {short(values)}.", key)
        return tuple(values)

    def table(self, key: str) -> Any:
        """Take the table below an entry; None if there is no such entry."""
        data = self.take(key, dict)
        return None if data is None else self._below(data, key)

    def _below(self, data: dict[str, Any], *place: str | int) -> Table:
        below = copy(self)
        below.data, below.place, below.known = data, (*self.place, *place), []
        return below

    def tables(self, key: str) -> list[Table]:
        """Take an array of tables, none if it is not there."""
        found = self.take(key, list, [], what="an array of tables, [{ name = value, ... }, ...]")
        for i, data in enumerate(found):
            if not isinstance(data, dict):
                must = f"every entry of {key!r} must be {KINDS[dict][1]}"
                raise self.fail(f"{must}; got {short(data)}.", key, i)
        return [self._below(data, key, i) for i, data in enumerate(found)]

    def close(self, others: Collection[str] = ()) -> None:
        """Refuse entries that nothing has asked for; one of `others` may be meant by them, too."""
        for key in self.data:
            if key not in self.known:
                valid = ", ".join(dict.fromkeys(self.known)) + meant(key, [*self.known, *others])
                raise self.fail(f"there is no {key!r}{self._here()}; valid names are {valid}", key)

    def _here(self) -> str:
        names = [str(part) if isinstance(part, str) else f"[{part + 1}]" for part in self.place]
        return " in " + ".".join(names).replace(".[", "[") if names else ""


def at_line(where: int | str) -> str:
    """What follows the name of a file in a message: a line of it, or a change that was made."""
    return f", line {where}" if isinstance(where, int) else f", {where}" if where else ""


def read_table(path: Path, what: str = "scene file") -> Table:
    """Read the whole of a TOML file; every entry of the table knows its line.

    InputError, which calls the file `what`, if there is none, if it is too long, or, with the line,
    if it is not TOML.
    """
    if not os.path.isfile(path):  # unlike Path.is_file, it answers for names that no file can have
        why = "does not exist" if not os.path.exists(path) else "is no file that can be read"
        raise InputError(f"{what} '{path}' {'is a folder' if os.path.isdir(path) else why}.")
    if path.stat().st_size > MOST_BYTES:
        raise InputError(
            f"{what} '{path}' has more than {MOST_BYTES}"
            " bytes; meshes belong into files of their own."
        )
    try:
        text = path.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
        data = parse(text)
        return Table(path.name, lines_of(text), data)
    except UnicodeDecodeError as error:
        raise InputError(f"{what} '{path}' is no text in UTF-8.") from error
    except tomllib.TOMLDecodeError as error:
        found = re.search(r" \(at line (\d+), column \d+\)", str(error))
        line = int(found[1]) if found else text.count("\n") + 1
        said = re.sub(r" \(at .*\)", "", str(error))
        if TWICE.match(said):
            said = f"{_again(said, text, line)} is there twice; keep one of them"
        raise InputError(f"{path.name}, line {line}: {said[:1].lower()}{said[1:]}.") from error
    except (RecursionError, OSError) as error:
        why = str(getattr(error, "strerror", "its tables and lists are nested too deeply"))
        raise InputError(f"{what} '{path}' cannot be read: {why}.") from error


def _again(said: str, text: str, line: int) -> str:
    """The entry or table that is there a second time, by tomllib's words or its line."""
    name = ".".join(re.findall(r"'([^']*)'", said))
    if said.startswith("Duplicate"):
        return repr(name)
    words = (text + "\n").split("\n")[line - 1].split("=")[0].strip()
    name = f"[{name}]" if name else words
    return name if name.startswith("[") else repr(name)


def parse(text: str) -> dict[str, Any]:
    """The data of a text in TOML. tomllib.TOMLDecodeError where it is none, and where a whole
    number is larger than a number with a point can be.
    """
    try:
        data = tomllib.loads(text)
        large = [value for value in _values(data) if type(value) is int and abs(value) > 10**300]
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # Python reads no number of more than 4300 digits
        large = [0]
    if large:
        digits = re.search(r"[0-9A-Fa-f_]{250}", text)
        line = text.count("\n", 0, digits.start() if digits else 0) + 1
        raise tomllib.TOMLDecodeError(f"A number is too large (at line {line}, column 1)")
    return data


def _values(data: Any) -> Iterator[Any]:
    """All values in tables and arrays."""
    if isinstance(data, dict | list):
        for value in data.values() if isinstance(data, dict) else data:
            yield from _values(value)
    else:
        yield data


def change(table: Table, changes: Mapping[str, Any]) -> Table:
    """The whole table of a file with other values of entries, by names such as
    'bodies.block.plates.1.force.y': the names of tables with dots between them, and the numbers of
    entries of arrays, from 1 on. InputError for a name that leads nowhere.
    """
    lines: dict[Place, int | str] = dict(table.lines)
    for name, value in changes.items():
        told = f"--set {name}={value}"[:80]
        place: Place = ()
        at: Any = table.data
        *parents, last = _keys(name)
        for key in parents:
            step = _step(table, told, place, key, at)
            if step not in (range(len(at)) if isinstance(at, list) else at):
                raise _lost(table, told, place, step, at)
            place, at = (*place, step), at[step]
        step = _step(table, told, place, last, at)
        if isinstance(at, list) and step not in range(len(at)):
            raise _lost(table, told, place, step, at)
        at[step] = value
        lines[(*place, step)] = told
    return Table(table.file, lines, table.data, table.place)


def _keys(name: str) -> list[str]:
    """The keys of a dotted name, written as in TOML."""
    try:
        data, keys = tomllib.loads(f"{name} = 0"), []
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            f"{name!r} is no name of an entry; quote keys with other signs."
        ) from error
    while isinstance(data, dict):
        ((key, data),) = data.items()
        keys.append(key)
    return keys


def _step(table: Table, told: str, place: Place, key: str, at: Any) -> str | int:
    """A key of what stands at a place, of an array as a number from 0 on."""
    if not isinstance(at, dict | list):
        raise table.fail(f"{told}: {place[-1]!r} holds {short(at)}, and nothing in it.")
    number = int(key) if isinstance(at, list) and re.fullmatch("[0-9]{1,9}", key) else 0
    return number - 1 if number > 0 else key


def _lost(table: Table, told: str, parents: Place, key: str | int, at: Any) -> InputError:
    """What to raise where a key leads nowhere."""
    where = ".".join(str(part + 1) if isinstance(part, int) else part for part in parents)
    if isinstance(at, list):
        shown = key + 1 if isinstance(key, int) else key
        return table.fail(f"{told}: {where} has the entries 1 to {len(at)}; got {shown}.")
    holds = f"it holds {', '.join(at)}{meant(str(key), at)}"
    return table.fail(f"{told}: there is no {key!r}{where and f' in {where}'}; {holds}")


def lines_of(text: str) -> dict[Place, int]:
    """The line, from 1, of the place of every entry of a valid TOML text."""
    tokens, line = deque[tuple[str, str | None, int]](), 1
    for match in TOKEN.finditer(text):
        if match.lastgroup != "space":
            tokens.append((match.group(), match.lastgroup, line))
        line += match.group().count("\n")
    found: dict[Place, int] = {}
    counts: dict[Place, int] = {}  # of the tables of an array

    def parts() -> Iterator[str]:
        """The parts of the dotted key that is next."""
        while tokens[0][1] != "mark":
            token, kind, _ = tokens.popleft()
            quoted = [tomllib.loads(f"x = {token}")["x"]] if kind == "text" else token.split(".")
            yield from (part for part in quoted if part or kind == "text")

    def entry(place: Place) -> None:
        line = tokens[0][2]
        for part in parts():
            place = (*place, part)
            found.setdefault(place, line)
        tokens.popleft()  # the equals sign
        value(place)

    def value(place: Place) -> None:
        opens, kind, line = tokens.popleft()
        found.setdefault(place, line)
        count = 0
        while kind == "mark" and tokens[0][0] not in "]}":
            if tokens[0][0] == ",":
                tokens.popleft()
            elif opens == "{":
                entry(place)
            else:
                value((*place, count))
                count += 1
        if kind == "mark":
            tokens.popleft()

    place: Place = ()
    while tokens:
        if tokens[0][0] != "[":
            entry(place)
            continue
        line, array = tokens.popleft()[2], tokens[0][0] == "["
        if array:
            tokens.popleft()
        place = ()
        for part in parts():
            # a table within the last one of an array
            place = (*place, counts[place] - 1, part) if place in counts else (*place, part)
        for _ in range(1 + array):
            tokens.popleft()
        found.setdefault(place, line)
        if array:
            counts[place] = counts.get(place, 0) + 1
            place = (*place, counts[place] - 1)
            found.setdefault(place, line)
    return found
