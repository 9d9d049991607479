"""Experiment files: TOML -> validated problems, methods and settings -> runs.

Errors name the file and the line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from typing import Any

from contactopt.benchmark.entries import Entries, size_of, twice_in
from contactopt.benchmark.plugins import Registry
from contactopt.benchmark.problems import FAMILIES, KINDS, ProblemSpec, named
from contactopt.benchmark.runs import SETTINGS, STARTS, MethodSpec, Run, method_spec
from contactopt.benchmark.testset import of_set
from contactopt.checks import check_name, check_number, short
from contactopt.errors import InputError
from contactopt.files.toml_table import Table, read_table

MOST_RUNS = 200_000  # of one experiment
# key -> type of its value, and how a message names that
TYPES: dict[str, tuple[type, str]] = {
    **dict.fromkeys(("name", "title", "text", "findings"), (str, "a text")),
    **dict.fromkeys(
        ("plugins", "settings", "starts", "problems", "methods", "figures", "columns"),
        (list, "a list"),
    ),
    "quick": (dict, "a table"),
    "diagnose": (bool, "true or false"),
}
# s; GB: less than the least holds no NumPy and SciPy
BOUNDS = {"time_limit": (0.0, 1e6), "memory_limit": (0.2, 1e4)}
# key -> least and most; NumPy's generator takes no larger seed
WHOLE = {"repeats": (1, MOST_RUNS), "max_iterations": (1, 10**9), "seed": (0, 2**32 - 1)}
FILTERED = ("problem", "method", "setting", "start", "repeat")


class NothingToRun(InputError):
    """All problems or all methods of an experiment are optional and missing here."""


@dataclass(frozen=True)
class Experiment:
    """One experiment file.

    Its fields are the keys of the file, which `contactopt.benchmark.keys` describes. Lists and
    ranges in problems and methods are expanded, and plug-in files are named by their whole path.

    path     of the file
    skipped  why optional entries are left out
    absent   methods among them, and why
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
    absent: tuple[tuple[str, str], ...] = ()

    def runs(self, filters: Sequence[str] = ()) -> list[Run]:
        """All runs, those of a problem together; filters: COLUMN=PATTERN, all must match."""
        for text in filters:
            column, sign, _ = text.partition("=")
            if column not in FILTERED or not sign:
                raise InputError(
                    f"cannot filter by '{text}'; write COLUMN=PATTERN with a column of"
                    f" {', '.join(FILTERED)}."
                )
        tolerances = {
            str(setting): SETTINGS.get(str(setting)) or float(setting) for setting in self.settings
        }
        runs = [
            Run(problem, method, setting, tolerance, start, repeat)
            for problem in self.problems
            for repeat, (setting, tolerance), start, method in product(
                range(self.repeats), tolerances.items(), self.starts, self.methods
            )
        ]
        return [run for run in runs if all(_matches(run, text) for text in filters)]


def _matches(run: Run, text: str) -> bool:
    column, _, pattern = text.partition("=")
    value = getattr(run, column)
    names = (value.name, value.label) if column in ("problem", "method") else (str(value),)
    return any(fnmatchcase(name, pattern) for name in names)


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
    lines = {place: line for place, line in root.lines.items() if place[0] not in own}
    if own:
        lines |= {place[1:]: line for place, line in root.lines.items() if place[0] == "quick"}
    table = Table(root.file, lines, root.data | own)
    _check(table)
    return _Reader(table, path).experiment()


def _check(table: Table) -> None:
    """Refuse unknown keys, wrong values, and more runs than MOST_RUNS, before anything is built."""
    data, known = table.data, {f.name for f in fields(Experiment)} - {"path", "skipped", "absent"}
    for key in data:
        if key not in known:
            raise table.fail(f"unknown key {key!r}.", key)
    for key in ("name", "problems", "methods"):
        if not data.get(key):
            raise table.fail(f"an experiment needs '{key}'.", key)
    for key, (kind, what) in TYPES.items():
        table.take(key, kind, what=what)
    if not re.fullmatch(r"[\w.-]+", data["name"]):
        raise table.fail(
            "'name' becomes a directory: letters, digits, '-', '_' and '.' only.", "name"
        )
    with table.about("name"):
        check_name("'name'", data["name"])
    for key in ("plugins", "columns"):
        if not all(isinstance(value, str) for value in data.get(key, ())):
            raise table.fail(f"'{key}' must be a list of texts.", key)
    for key, (least, most) in WHOLE.items():
        value = table.take(key, int, 1, what=f"a whole number from {least} to {most}")
        if not least <= value <= most:
            raise table.fail(
                f"'{key}' must be a whole number from {least} to {most}; got {short(value)}.", key
            )
    for key, (low, high) in BOUNDS.items():
        table.take(key, float, low=low, high=high)
    for key, choices, more in (("settings", SETTINGS, " or a number"), ("starts", STARTS, "")):
        values = data.get(key, ())
        for value in values:
            if more and not isinstance(value, str):
                with table.about(key):
                    check_number("a setting", value, 0.0)
            elif value not in choices:
                raise table.fail(
                    f"unknown {key[:-1]} {value!r}; choose from {', '.join(choices)}{more}.", key
                )
        if twice := twice_in(map(str, values)):
            raise table.fail(f"'{key}' holds {twice} twice.", key)
    number = data.get("repeats", 1)
    for key in ("settings", "starts"):
        number *= len(data.get(key, ("default",)))
    for key in ("problems", "methods"):
        entries = [entry for entry in data[key] if isinstance(entry, dict)]
        number *= max(1, sum(math.prod(map(size_of, entry.values())) for entry in entries))
    if number > MOST_RUNS:
        raise table.fail(
            f"these are {number} runs, more than {MOST_RUNS} in one experiment; split it, or take"
            " fewer repeats or values.",
            "repeats",
        )


class _Reader(Entries):
    """Expands the problems and methods of one file whose other keys were checked."""

    def __init__(self, table: Table, path: Path):
        super().__init__(table)
        self.path = path

    def experiment(self) -> Experiment:
        data, folder = self.table.data, self.path.parent
        paths = tuple(str((folder / plugin).resolve()) for plugin in data.get("plugins", ()))
        registry = self.registry(paths)

        def problem(kind: str, name: str, parameters: dict[str, Any]) -> list[ProblemSpec]:
            if kind == "testset":
                return [found.spec for found in of_set(name, folder=folder, **parameters)]
            found = named(kind, name, parameters, folder)
            for spec in found:
                spec.check(registry.problems)
            return found

        def method(kind: str, name: str, settings: dict[str, Any]) -> list[MethodSpec]:
            return [method_spec(name, settings, registry)]

        problems = self.expanded("problems", (*KINDS, "testset"), problem)
        methods = self.expanded("methods", ("method",), method)
        if not problems or not methods:
            raise NothingToRun(f"'{self.path}': nothing is left to run; " + " ".join(self.skipped))
        values: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value for key, value in data.items()
        }
        values |= {"problems": tuple(problems), "methods": tuple(methods), "plugins": paths}
        absent = tuple(
            (MethodSpec(name, given).label, why)
            for key, name, given, why in self.absent
            if key == "methods"
        )
        return Experiment(**values, path=self.path, skipped=tuple(self.skipped), absent=absent)

    def registry(self, paths: tuple[str, ...]) -> Registry:
        """What the plug-ins declare."""
        found = Registry()
        with self.table.about("plugins"):
            found.load(paths)
        for name in found.problems:
            if name in FAMILIES:
                raise self.table.fail(
                    f"plug-in problem {name!r} has the name of a family of contactopt; rename it.",
                    "plugins",
                )
        return found
