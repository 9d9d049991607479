"""Experiment files: TOML -> validated problems, methods and settings -> runs.

Errors name the file and the line.
"""

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.benchmark.entries import Entries, size_of, twice_in
from contactopt.benchmark.families import FAMILIES
from contactopt.benchmark.keys import EXPERIMENT
from contactopt.benchmark.keys import KINDS as FIGURE_KINDS
from contactopt.benchmark.plugins import Registry, source_of
from contactopt.benchmark.problems import KINDS, ProblemSpec, named
from contactopt.benchmark.process import Ended, Process
from contactopt.benchmark.runs import SETTINGS, MethodSpec, Run, method_spec
from contactopt.benchmark.testset.problem_set import of_set
from contactopt.checks import check_name, check_number, short
from contactopt.errors import InputError
from contactopt.files.toml_table import Table, read_table
from contactopt.methods import METHODS

MOST_RUNS = 200_000  # of one experiment
READ_LIMIT = 600.0  # s to load plug-ins and to find their external solvers
# key -> the limits of its value, closed; s; GB: less holds no NumPy and SciPy; NumPy's generator
# takes no larger seed
LIMITS = {
    "repeats": (1, MOST_RUNS), "max_iterations": (1, 10**9), "seed": (0, 2**32 - 1),
    "time_limit": (1e-9, 1e6), "memory_limit": (0.2, 1e4),
}  # fmt: skip
FILTERED = ("problem", "method", "setting", "repeat")


class NothingToRun(InputError):
    """All problems or all methods of an experiment are optional and missing here."""


@dataclass(frozen=True)
class Experiment:
    """One experiment file, or what it says of its report, without problems and methods.

    Its fields are the keys of the file, which `contactopt.benchmark.keys` describes. Lists and
    ranges in problems and methods are expanded, and plug-in files are named by their whole path.

    path     of the file
    skipped  why optional entries are left out
    absent   methods among them, and why
    sources  of each plug-in method and family, a digest of its file
    """

    name: str
    problems: tuple[ProblemSpec, ...] = ()
    methods: tuple[MethodSpec, ...] = ()
    title: str = ""
    text: str = ""
    plugins: tuple[str, ...] = ()
    settings: tuple[str | float, ...] = ("default",)
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
    sources: Mapping[str, str] = field(default_factory=dict)

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
            Run(problem, method, setting, tolerance, repeat, self._source(problem, method))
            for problem in self.problems
            for repeat, (setting, tolerance), method in product(
                range(self.repeats), tolerances.items(), self.methods
            )
        ]
        return [run for run in runs if all(_matches(run, text) for text in filters)]

    def _source(self, problem: ProblemSpec, method: MethodSpec) -> str:
        return "".join(self.sources.get(name, "") for name in (problem.name, method.name))


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
    InputError : On anything that cannot be run. The message names file and line. NothingToRun, one
        of these, where what it names is missing here.
    """
    table, path = _checked(Path(path), quick), Path(path)
    _check_number_of_runs(table)
    reader, folder = Entries(table), path.parent
    paths = tuple(str((folder / plugin).resolve()) for plugin in table.data.get("plugins", ()))
    registry = _registry(table, paths)

    def problem(kind: str, name: str, parameters: dict[str, Any]) -> list[ProblemSpec]:
        if kind == "testset":
            return [found.spec for found in of_set(name, folder=folder, **parameters)]
        found = named(kind, name, parameters, folder)
        for spec in found:
            spec.check(registry.problems)
        return found

    def method(kind: str, name: str, settings: dict[str, Any]) -> list[MethodSpec]:
        return [method_spec(name, settings, registry)]

    problems = reader.expanded("problems", (*KINDS, "testset"), problem)
    methods = reader.expanded("methods", ("method",), method)
    skipped = tuple(why for *_, why in reader.absent)
    declared = {name: plugin.make for name, plugin in registry.methods.items()}
    declared |= registry.problems
    if not problems or not methods:
        raise NothingToRun(f"'{path}': nothing is left to run; " + " ".join(skipped))
    return replace(
        _without_runs(table, path),
        problems=tuple(problems),
        methods=tuple(methods),
        plugins=paths,
        skipped=skipped,
        absent=tuple(
            (MethodSpec(name, given).label, why)
            for key, name, given, why in reader.absent
            if key == "methods"
        ),
        sources={name: source_of(make) for name, make in declared.items()},
    )


def read_apart(path: str | Path, quick: bool = False) -> Experiment:
    """The same as `read_experiment`. Plug-ins are loaded in a process that ends, since what their
    files do to the library while they are loaded must not reach the process that judges answers.
    """
    data = _checked(Path(path), quick).data
    entries = [entry for entry in data.get("methods", ()) if isinstance(entry, dict)]
    names = {str(name) for entry in entries for name in np.atleast_1d(entry.get("method", ""))}
    if not data.get("plugins") and names <= {*METHODS}:
        return read_experiment(path, quick)
    reader = Process()
    try:
        found = reader.ask(READ_LIMIT, "read", _read, path, quick)
    except (Ended, RuntimeError) as error:
        status = f"{error.status}: " if isinstance(error, Ended) else ""
        raise InputError(f"'{path}': its plug-ins cannot be loaded: {status}{error}.") from error
    finally:
        reader.kill()
    if isinstance(found, Experiment):
        return found
    nothing, message = found
    raise NothingToRun(message) if nothing else InputError(message)


def _read(path: str | Path, quick: bool) -> Experiment | tuple[bool, str]:
    """An experiment, or its error: whether nothing is left to run, and the message."""
    try:
        return read_experiment(path, quick)
    except InputError as error:
        return isinstance(error, NothingToRun), str(error)


def read_layout(path: str | Path) -> Experiment:
    """What an experiment file says of its report; its problems and methods may be missing here."""
    return _without_runs(_checked(Path(path)), Path(path))


def _without_runs(table: Table, path: Path) -> Experiment:
    values: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in table.data.items()
        if key not in ("problems", "methods")
    }
    return Experiment(**{"title": values["name"]} | values, path=path)


def _checked(path: Path, quick: bool = False) -> Table:
    """The table of a file without unknown keys and wrong values; nothing is built yet."""
    root = read_table(path, "experiment")
    own = root.take("quick", dict, {}) if quick else {}
    lines = {place: line for place, line in root.lines.items() if place[0] not in own}
    if own:
        lines |= {place[1:]: line for place, line in root.lines.items() if place[0] == "quick"}
    table = Table(root.file, lines, root.data | own)
    for key in table.data:
        if key not in EXPERIMENT:
            raise table.fail(f"unknown key {key!r}.", key)
    for key, (_, example) in EXPERIMENT.items():
        kind = type(tomllib.loads(f"x = {example}")["x"])
        value = table.take(key, kind)
        if key in LIMITS and value is not None:
            low, high = LIMITS[key]
            if not low <= value <= high:
                whole = "a whole number" if kind is int else "a number"
                must = f"{key!r} must be {whole} from {low:g} to {high:g}"
                raise table.fail(f"{must}; got {short(value)}.", key)
    _check_texts(table)
    return table


def _check_texts(table: Table) -> None:
    """Refuse names of folders, settings, columns and figures that cannot be used."""
    name = table.take("name", str, needed=True)
    if not re.fullmatch(r"[\w.-]+", name):
        raise table.fail(
            "'name' becomes a directory: letters, digits, '-', '_' and '.' only.", "name"
        )
    with table.about("name"):
        check_name("'name'", name)
    for key in ("plugins", "columns"):
        if not all(isinstance(value, str) for value in table.data.get(key, ())):
            raise table.fail(f"'{key}' must be a list of texts.", key)
    settings = table.data.get("settings", ())
    for value in settings:
        if not isinstance(value, str):
            with table.about("settings"):
                check_number("a setting", value, 0.0)
        elif value not in SETTINGS:
            known = f"choose from {', '.join(SETTINGS)} or a number"
            raise table.fail(f"unknown setting {value!r}; {known}.", "settings")
    if twice := twice_in(map(str, settings)):
        raise table.fail(f"'settings' holds {twice} twice.", "settings")
    for number, entry in enumerate(table.tables("figures"), 1):
        kind, caption, where = (entry.data.get(key) for key in ("kind", "caption", "where"))
        if not isinstance(kind, str) or kind not in FIGURE_KINDS:
            known = f"unknown kind {kind!r}; choose from {', '.join(FIGURE_KINDS)}."
            raise entry.fail(f"figure {number}: {known}", "kind")
        if not caption or not isinstance(caption, str):
            raise entry.fail(f"figure {number}: it needs a caption.", "caption")
        if not isinstance(where, dict | None):
            must = "'where' must be a table of columns and values."
            raise entry.fail(f"figure {number}: {must}", "where")


def _check_number_of_runs(table: Table) -> None:
    data = table.data
    for key in ("problems", "methods"):
        if not data.get(key):
            raise table.fail(f"an experiment needs '{key}'.", key)
    number = data.get("repeats", 1) * len(data.get("settings", ("default",)))
    for key in ("problems", "methods"):
        entries = [entry for entry in data[key] if isinstance(entry, dict)]
        number *= max(1, sum(math.prod(map(size_of, entry.values())) for entry in entries))
    if number > MOST_RUNS:
        raise table.fail(
            f"these are {number} runs, more than {MOST_RUNS} in one experiment; split it, or take"
            " fewer repeats or values.",
            "repeats",
        )


def _registry(table: Table, paths: tuple[str, ...]) -> Registry:
    """What the plug-ins declare."""
    found = Registry()
    with table.about("plugins"):
        found.load(paths)
    for name in found.problems:
        if name in FAMILIES:
            raise table.fail(
                f"plug-in problem {name!r} has the name of a family of contactopt; rename it.",
                "plugins",
            )
    return found
