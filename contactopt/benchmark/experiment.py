"""Experiment files: TOML -> validated problems, methods and settings -> runs.

Errors name the file and the line.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.benchmark.catalogue import Catalogue, read_catalogue
from contactopt.benchmark.problems import FAMILIES, KINDS, ProblemSpec, named
from contactopt.benchmark.runs import SETTINGS, STARTS, MethodSpec, Run
from contactopt.checks import check_name, check_number, short
from contactopt.errors import InputError
from contactopt.files.toml_table import Table, read_table

MOST_RUNS = 200_000  # of one experiment
# s; GB: less than the least holds no NumPy and SciPy
BOUNDS = {"time_limit": (0.0, 1e6), "memory_limit": (0.2, 1e4)}
MOST_ALLOWED = {
    "repeats": MOST_RUNS,
    "max_iterations": 10**9,
    "seed": 2**32 - 1,
}  # NumPy's generator takes no larger seed
LARGEST_INTEGER = 2**63  # of whole numbers, as in TOML


class NothingToRun(InputError):
    """All problems or all methods of an experiment are optional and missing here."""


@dataclass(frozen=True)
class Experiment:
    """One experiment file.

    Its fields are the keys of the file; lists and ranges in problems and methods are expanded.

    plugins       files, relative to the experiment file
    settings      names of SETTINGS or bounds on the certificate
    starts        "cold", "warm": from the certified solution at nine tenths of the load and of the
                  friction
    time_limit    [s] wall clock of one run; memory_limit [GB] of data of its process
    seed          of NumPy's and Python's generators before each run
    diagnose      rank, condition and thresholds of friction with each problem (contactopt.diagnose)
    quick         keys that a quick version replaces
    figures       of the report, see contactopt.benchmark.reports; findings: file with a function
                  findings(table)
    """

    name: str
    problems: tuple[ProblemSpec, ...]
    methods: tuple[MethodSpec, ...]
    title: str = ""
    text: str = ""
    plugins: tuple[str, ...] = ()
    settings: tuple[str | float, ...] = ("default",)
    starts: tuple[str, ...] = ("cold",)
    repeats: int = 1
    time_limit: float = 60.0
    memory_limit: float = 4.0
    max_iterations: int = 100_000
    seed: int = 0
    diagnose: bool = False
    quick: Mapping[str, Any] = field(default_factory=dict)
    figures: tuple[Mapping[str, Any], ...] = ()
    findings: str = ""
    columns: tuple[str, ...] = ()
    path: Path = Path()
    skipped: tuple[str, ...] = ()

    def runs(self, filters: Sequence[str] = ()) -> list[Run]:
        """All runs, those of a problem together; filters: COLUMN=PATTERN, of which all must match."""
        chosen = [_filter(text) for text in filters]
        runs = [
            Run(
                problem,
                method,
                str(setting),
                SETTINGS.get(str(setting)) or float(setting),
                start,
                repeat,
            )
            for problem in self.problems
            for repeat, setting, start, method in product(
                range(self.repeats), self.settings, self.starts, self.methods
            )
        ]
        return [run for run in runs if all(match(run) for match in chosen)]


def _filter(text: str) -> Any:
    columns = ("problem", "method", "setting", "start", "repeat")
    column, sign, pattern = text.partition("=")
    if column not in columns or not sign:
        raise InputError(
            f"cannot filter by '{text}'; write COLUMN=PATTERN with a column of"
            f" {', '.join(columns)}."
        )

    def match(run: Run) -> bool:
        value = getattr(run, column)
        texts = (value.name, value.label) if column in ("problem", "method") else (str(value),)
        return any(fnmatchcase(text, pattern) for text in texts)

    return match


def read_experiment(path: str | Path, quick: bool = False) -> Experiment:
    """Read an experiment file.

    Parameters
    ----------
    path : The TOML file.
    quick : Whether the keys of its quick version replace the others.

    Returns
    -------
    The problems, methods and settings, checked.

    Raises
    ------
    InputError : On anything that cannot be run. The message names file and line.
    """
    path = Path(path)
    root = read_table(path, "experiment")
    own = root.data.get("quick", {}) if quick else {}
    if not isinstance(own, dict):
        raise root.fail("'quick' must be a table.", "quick")
    return _Reader(path, root, own).experiment(root.data | own)


class _Reader:
    """Checks one file's keys; every complaint goes through `located`, which finds the line.

    quick  the keys of the quick version that is read
    """

    def __init__(self, path: Path, root: Table, quick: Mapping[str, Any]):
        self.path, self.root, self.quick = path, root, quick

    def experiment(self, data: dict[str, Any]) -> Experiment:
        known = {f.name: f for f in fields(Experiment)}
        for key in data:
            if key not in known or key in ("path", "skipped"):
                raise self.located(f"unknown key {key!r}", key)
        for key in ("name", "problems", "methods"):
            if not data.get(key):
                raise self.located(f"an experiment needs '{key}'", key)
        data = {
            key: tuple(value) if isinstance(value, list) else value for key, value in data.items()
        }
        self.scalars(data)
        self.count(data)
        paths = tuple(
            str((self.path.parent / plugin).resolve()) for plugin in data.get("plugins", ())
        )
        catalogue = self.catalogue(paths, data["methods"])
        skipped: list[str] = []
        problems = [
            p
            for i, e in enumerate(data["problems"])
            for p in self.problems(i, e, catalogue, skipped)
        ]
        methods = [
            m for i, e in enumerate(data["methods"]) for m in self.methods(i, e, catalogue, skipped)
        ]
        for title, specs in (("problems", problems), ("methods", methods)):
            twice = [label for label, n in Counter(spec.label for spec in specs).items() if n > 1]
            if twice:
                raise self.located(f"two {title} are called {twice[0]!r}", title)
        if not problems or not methods:
            raise NothingToRun(f"'{self.path}': nothing is left to run; " + " ".join(skipped))
        return Experiment(
            **data
            | dict(problems=tuple(problems), methods=tuple(methods), plugins=paths, path=self.path)
            | dict(skipped=tuple(skipped))
        )

    def scalars(self, data: Mapping[str, Any]) -> None:
        for key, kind in (
            ("name", str),
            ("title", str),
            ("text", str),
            ("findings", str),
            ("quick", dict),
        ):
            if not isinstance(data.get(key, kind()), kind):
                raise self.located(f"'{key}' must be a {'table' if kind is dict else 'text'}", key)
        if not re.fullmatch(r"[\w.-]+", data["name"]):
            raise self.located(
                "'name' becomes a directory: letters, digits, '-', '_' and '.' only", "name"
            )
        self.guard("name", check_name, "'name'", data["name"])
        for key in ("plugins", "settings", "starts", "problems", "methods", "figures", "columns"):
            if not isinstance(data.get(key, ()), tuple):
                raise self.located(f"'{key}' must be a list", key)
        for key in ("plugins", "columns"):
            if not all(isinstance(value, str) for value in data.get(key, ())):
                raise self.located(f"'{key}' must be a list of texts", key)
        for key, most in MOST_ALLOWED.items():
            value, least = data.get(key, 1), int(key != "seed")
            if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
                raise self.located(
                    f"'{key}' must be a whole number from {least} to {most}; got {short(value)}",
                    key,
                )
        if not isinstance(data.get("diagnose", False), bool):
            raise self.located("'diagnose' must be true or false", "diagnose")
        for key, (low, high) in BOUNDS.items():
            self.guard(key, check_number, f"'{key}'", data.get(key, 1.0), low, high)
        for setting in data.get("settings", ()):
            if isinstance(setting, str) and setting not in SETTINGS:
                raise self.located(
                    f"unknown setting {setting!r}; choose from {', '.join(SETTINGS)} or a number",
                    "settings",
                )
            if not isinstance(setting, str):
                self.guard("settings", check_number, "a setting", setting, 0.0)
        for start in data.get("starts", ()):
            if start not in STARTS:
                raise self.located(
                    f"unknown start {start!r}; choose from {', '.join(STARTS)}", "starts"
                )
        for key in ("settings", "starts"):
            twice = [text for text, n in Counter(map(str, data.get(key, ()))).items() if n > 1]
            if twice:
                raise self.located(f"'{key}' holds {twice[0]} twice", key)

    def count(self, data: Mapping[str, Any]) -> None:
        """Refuse an experiment of too many runs by their number, before anything is expanded, built
        or run.
        """
        number = data.get("repeats", 1)
        for key in ("settings", "starts"):
            number *= len(data.get(key, ("default",)))
        for table in ("problems", "methods"):
            entries = [entry for entry in data[table] if isinstance(entry, dict)]
            number *= max(1, sum(math.prod(map(_size_of, entry.values())) for entry in entries))
        if number > MOST_RUNS:
            raise self.located(
                f"these are {number} runs, more than {MOST_RUNS} in one experiment; split it, or"
                " take fewer repeats or values",
                "repeats",
            )

    def catalogue(self, paths: tuple[str, ...], methods: Sequence[Any]) -> Catalogue:
        """What the plug-ins declare, and installed packages for the methods named."""
        given = [entry.get("method") for entry in methods if isinstance(entry, dict)]
        names = [
            name for names in given for name in (names if isinstance(names, list) else [names])
        ]
        try:
            found = read_catalogue(paths, [name for name in names if isinstance(name, str)])
        except InputError as error:
            raise self.located(str(error), "plugins") from error
        for name in found.problems:
            if name in FAMILIES:
                raise self.located(
                    f"plug-in problem {name!r} has the name of a family of contactopt; rename it",
                    "plugins",
                )
        return found

    def problems(
        self, index: int, entry: Any, catalogue: Catalogue, skipped: list[str]
    ) -> Iterator[ProblemSpec]:
        kinds = [kind for kind in KINDS if isinstance(entry, dict) and kind in entry]
        if len(kinds) != 1:
            raise self.located(f"a problem needs one of {', '.join(KINDS)}", "problems", index)
        for name, parameters in self.expand("problems", index, entry, kinds[0], skipped):
            try:
                found = named(kinds[0], name, parameters, self.path.parent)
                for spec in found:
                    spec.check(catalogue.problems)
            except (ValueError, TypeError, ArithmeticError) as error:  # InputError is a ValueError
                self.refuse(error, "problems", index, entry, kinds[0], skipped)
            else:
                yield from found

    def methods(
        self, index: int, entry: Any, catalogue: Catalogue, skipped: list[str]
    ) -> Iterator[MethodSpec]:
        if not isinstance(entry, dict) or "method" not in entry:
            raise self.located("a method needs the key 'method'", "methods", index)
        for name, settings in self.expand("methods", index, entry, "method", skipped):
            spec = MethodSpec(name, settings, catalogue.methods.get(name))
            try:
                spec.check()
            except (ValueError, TypeError, ArithmeticError) as error:
                self.refuse(error, "methods", index, entry, "method", skipped)
            else:
                yield spec

    def expand(
        self, table: str, index: int, entry: Mapping[str, Any], kind: str, skipped: list[str]
    ) -> Iterator[tuple[str, dict[str, Any]]]:
        """(name, parameters) of every combination of the entry's lists and ranges."""
        names = entry[kind] if isinstance(entry[kind], list) else [entry[kind]]
        rest = {key: value for key, value in entry.items() if key not in (kind, "optional")}
        choices = []
        for key, value in rest.items():
            try:
                choices.append(_values_of(key, value))
            except InputError as error:
                raise self.located(str(error), table, index, key) from error
        for name, *values in product(names, *choices):
            if not isinstance(name, str):
                raise self.located(f"'{kind}' must be a name", table, index, kind)
            yield name, dict(zip(rest, values))

    def refuse(
        self,
        error: Exception,
        table: str,
        index: int,
        entry: Mapping[str, Any],
        kind: str,
        skipped: list[str],
    ) -> None:
        if not entry.get("optional"):
            words = {
                key: [key, *(v for v in np.atleast_1d(value) if isinstance(v, str))]
                for key, value in entry.items()
            }
            found = {
                key: [
                    match.start()
                    for name in names
                    if (match := re.search(rf"\b{re.escape(name)}\b", str(error)))
                ]
                for key, names in words.items()
                if key != kind
            }
            blamed = {
                key: min(places) for key, places in found.items() if places
            }  # what a message names first is wrong
            culprit = min(blamed, key=blamed.__getitem__, default=kind)
            raise self.located(str(error), table, index, culprit) from error
        skipped.append(str(error))

    def guard(self, key: str, function: Any, *arguments: Any) -> None:
        try:
            function(*arguments)
        except InputError as error:
            raise self.located(str(error), key) from error

    def located(self, message: str, *place: str | int) -> InputError:
        """The error with the line of an entry: a top-level key, or a table with its number and a
        key of it.
        """
        above = ("quick",) if place[0] in self.quick else ()
        return self.root.fail(f"{message.rstrip('.')}.", *above, *place)


def _size_of(value: Any) -> int:
    """How many values a list or a range stands for, without making them."""
    if isinstance(value, dict):
        steps = value.get("steps")
        return steps if isinstance(steps, int) and steps > 0 else 1
    return len(value) if isinstance(value, list) else 1


def _values_of(name: str, value: Any) -> list[Any]:
    """One value, a list of them, or a range {from, to, steps, scale = "linear" or "log"}."""
    if isinstance(value, list) and not value:
        raise InputError(f"the list '{name}' is empty")
    if not isinstance(value, dict):
        values = value if isinstance(value, list) else [value]
        for one in values:
            if not isinstance(one, str | int | float) or (
                isinstance(one, int) and abs(one) >= LARGEST_INTEGER
            ):
                raise InputError(
                    f"a value of '{name}' must be a text, a number, true or false; got {short(one)}"
                )
        return values
    if not {"from", "to", "steps"} <= set(value) or set(value) - {"from", "to", "steps", "scale"}:
        raise InputError(f"the range '{name}' needs from, to, steps, and may have scale = \"log\"")
    scales: dict[str, Callable[..., np.ndarray]] = {"linear": np.linspace, "log": np.geomspace}
    spaced = scales.get(value.get("scale", "linear"))
    if spaced is None or not isinstance(value["steps"], int) or value["steps"] < 1:
        raise InputError(f'the range \'{name}\' needs whole steps >= 1 and scale "linear" or "log"')
    for key in ("from", "to"):
        check_number(f"'{key}' of the range '{name}'", value[key])
    if spaced is np.geomspace and not (value["from"] > 0 and value["to"] > 0):
        raise InputError(f"the logarithmic range '{name}' needs bounds above 0")
    numbers = [float(f"{x:.6g}") for x in spaced(value["from"], value["to"], value["steps"])]
    whole = isinstance(value["from"], int) and isinstance(value["to"], int)
    return list(dict.fromkeys(round(x) for x in numbers)) if whole else numbers
