"""Sets of problems: a TOML file of rows, and what was computed of them in a JSON file beside it."""

import json
import operator
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from contactopt.benchmark.entries import Entries
from contactopt.benchmark.problems import KINDS, ProblemSpec, named
from contactopt.benchmark.sequences import Sequence
from contactopt.benchmark.testset.tags import TAGS, tags_of
from contactopt.checks import check_count
from contactopt.errors import InputError
from contactopt.files.toml_table import read_table
from contactopt.problem import InterfaceProblem

TIERS = ("small", "medium", "large")
SETS = ("1", "2")
NEWEST = SETS[-1]
HERE = Path(__file__).parent
COMPARE = {"<": operator.lt, ">": operator.gt, "=": operator.eq}
WORDS = {"true": True, "false": False}


@dataclass(frozen=True, eq=False)
class Problem:
    """A problem of a set.

    spec   how it is made
    tier   one of TIERS
    known  what the set's JSON file says of it: "tags", "reference"; empty if it says nothing
    """

    spec: ProblemSpec
    tier: str
    known: Mapping[str, Any]

    @property
    def name(self) -> str:
        """The family and its arguments, by which tables of results call the problem."""
        return self.spec.label

    @cached_property
    def tags(self) -> dict[str, Any]:
        """What the problem is like; computed, where the set's file does not say it."""
        return {"states": 1} | dict(self.known.get("tags") or tags_of(self.load()))

    @property
    def reference(self) -> dict[str, Any] | None:
        """Small numbers of the reference answer; None if there is none."""
        return self.known.get("reference")

    def load(self) -> InterfaceProblem | Sequence:
        """Generate the problem, or read it from its file; InputError where that makes none."""
        return self.spec.build({})


def problems(
    tier: str = "", tags: Iterable[str] = (), testset: str = NEWEST, folder: Path = Path()
) -> list[Problem]:
    """The problems of a test set, in its order: of one of TIERS or of all, and with `tags` that all
    hold, such as "dim=3", "contacts<100" or "symmetric=false". InputError for an unknown set, tier
    or tag, and for rows of a file that make no problem.

    `testset` is the number of a set of contactopt, a TOML file, or a folder of files of FCLib or
    Siconos, whose problems are all in the tier "small". The name of a file counts from `folder`.
    """
    if tier and tier not in TIERS:
        raise InputError(f"unknown tier {tier!r}; choose from {', '.join(TIERS)}.")
    path = HERE / f"set_{testset}.toml"
    path = path if path.exists() else folder / testset
    conditions = [_condition(text) for text in tags]
    found = [one for one in read_set(path) if tier in ("", one.tier)]
    return [one for one in found if all(_holds(one, *each) for each in conditions)]


def of_set(
    testset: str, folder: Path, tier: str = "", tags: str = "", every: int = 1
) -> list[Problem]:
    """The problems that an entry `testset = ...` of an experiment file means; InputError if there
    are none. `tags` are conditions with commas between them. For a quick look `every` = n takes
    only every n-th problem.
    """
    check_count("every", every)
    found = problems(tier, [text for text in tags.split(",") if text.strip()], testset, folder)
    found = found[::every]
    if not found:
        raise InputError(
            f"no problem of the test set '{testset}' has tier '{tier}', tags '{tags}'."
        )
    return found


@lru_cache(maxsize=8)
def read_set(path: Path) -> tuple[Problem, ...]:
    """The problems of a file or of a folder, read once."""
    if path.is_dir():
        return tuple(Problem(spec, "small", {}) for spec in named("fclib", str(path), {}, Path()))
    table = read_table(path, "test set")
    stored = path.with_suffix(".json")
    known = json.loads(stored.read_text("utf-8")) if stored.exists() else {}

    def make(kind: str, name: str, parameters: dict[str, Any]) -> list[Problem]:
        tier = parameters.pop("tier", "small")
        if tier not in TIERS:
            raise InputError(f"unknown tier {tier!r}; choose from {', '.join(TIERS)}.")
        specs = named(kind, name, parameters, path.parent)
        for spec in specs:
            if spec.label not in known:  # what is known of a problem was found by building it
                spec.check({})
        return [Problem(spec, tier, known.get(spec.label, {})) for spec in specs]

    return tuple(Entries(table).expanded("problems", KINDS, make))


def _condition(text: str) -> tuple[str, str, Any]:
    match = re.fullmatch(r"\s*(\w+)\s*([<>=])\s*(\S+)\s*", text)
    if not match:
        raise InputError(f"cannot choose by '{text}'; write TAG=VALUE, TAG<VALUE or TAG>VALUE.")
    name, sign, value = match.groups()
    try:
        return name, sign, WORDS[value] if value in WORDS else float(value)
    except ValueError:
        return name, sign, value


def _holds(problem: Problem, name: str, sign: str, value: Any) -> bool:
    if name not in TAGS:
        raise InputError(f"there is no tag {name!r}; the tags are {', '.join(TAGS)}.")
    own = problem.tags[name]
    try:
        return own is not None and bool(COMPARE[sign](own, value))
    except TypeError as error:
        raise InputError(f"the tag {name!r} is {own!r}, which has no order.") from error
