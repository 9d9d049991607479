"""The options of a run, declared once.

contactopt.run takes them as keywords, `contactopt run` as options of the same names, and the table
[solve] of a scene file as keys, which contactopt.scenes.scene_files reads and checks.
"""

from __future__ import annotations

import inspect
import re
import textwrap
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from importlib.resources import files
from typing import Any, NamedTuple, TypeVar

from contactopt.defaults import TOL
from contactopt.errors import InputError

TOGETHER = "accuracy and quantity belong together: the bound, and the name of what it bounds."
F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class RunOptions:
    """How a scene is solved, and what is drawn of it. None means the default.

    Each is a keyword of contactopt.run and an option of `contactopt run`, where `max_unknowns` is
    written --max-unknowns. Those that the table [solve] of a scene file may hold are marked.
    run_options.toml says what each of them is.
    """

    method: str | None = None
    normal: str | None = None
    tangential: str | None = None
    preconditioner: str | None = None
    Q: str = "auto"
    solver: str = "auto"
    tol: float = TOL
    accuracy: float | None = None
    quantity: str | None = None
    read: tuple[str, ...] = ()
    adaptive: bool = False
    bound: bool = False
    max_unknowns: int | None = None
    time_limit: float | None = None
    max_memory: float | None = None
    simplest: bool = False
    resume: bool = False
    start: str | None = None
    figures: tuple[str, ...] = ("png",)
    html: bool = False

    def __post_init__(self) -> None:
        if self.preconditioner is not None and self.Q == "explicit":
            raise InputError(
                "a preconditioner serves products with Q, but Q"
                " = 'explicit' was asked for; drop one of them."
            )
        if (self.accuracy is None) != (self.quantity is None):
            raise InputError(TOGETHER)
        if self.accuracy is None and self.adaptive:
            raise InputError("adaptive refinement needs an aim: give an accuracy and a quantity.")
        if self.accuracy is None and self.bound:
            raise InputError("a guaranteed bound ends a search: give an accuracy and a quantity.")
        if self.resume and self.start is not None:
            raise InputError("resume and start exclude each other: give one of them.")
        if self.accuracy is None and set(self.limits) - {"time_limit"}:
            raise InputError(
                "bounds on unknowns and memory end the search for an accuracy: give an"
                " accuracy and a quantity."
            )

    @property
    def settings(self) -> dict[str, str]:
        """Those that are settings of the method."""
        return self._given("normal", "tangential", "preconditioner")

    @property
    def limits(self) -> dict[str, Any]:
        """Those that end the search for an accuracy."""
        return self._given("max_unknowns", "time_limit", "max_memory")

    def _given(self, *names: str) -> dict[str, Any]:
        return {name: value for name in names if (value := getattr(self, name)) is not None}


class Option(NamedTuple):
    """An option: annotation, type and usual value, the word for its value, and what it is."""

    annotation: object
    kind: type
    default: object
    value: str
    what: str


def _options() -> dict[str, Option]:
    made = {}
    for one in fields(RunOptions):
        kind = KINDS[re.split(r"\W", str(one.type))[0]]
        value, what = (_TEXTS["in_scene_files"] | _TEXTS["elsewhere"])[one.name]
        made[one.name] = Option(one.type, kind, one.default, value, what.format(one.default))
    return made


KINDS: dict[str, type] = {kind.__name__: kind for kind in (str, float, int, bool, tuple)}
_TEXTS = tomllib.loads(files("contactopt").joinpath("run_options.toml").read_text("utf-8"))
OPTIONS = _options()
IN_FILES = tuple(name for name in OPTIONS if name in _TEXTS["in_scene_files"])


def choose(
    keywords: Mapping[str, Any], in_file: Mapping[str, Any]
) -> tuple[RunOptions, dict[str, Any]]:
    """Divide the keywords of contactopt.run into options of a run that are given, and others."""
    given = {name: value for name in OPTIONS if (value := keywords.get(name)) is not None}
    others = {name: value for name, value in keywords.items() if name not in OPTIONS}
    return RunOptions(**{**in_file, **given}), others


def explained(only: str = "") -> str:
    """The options as lines of a docstring, with `only` added to those of a scene file."""
    return "\n".join(
        textwrap.fill(
            f"{name} : {one.what}{only if name in IN_FILES else ''}", 96, subsequent_indent="    "
        )
        for name, one in OPTIONS.items()
    )


def takes_options(function: F) -> F:
    """Write the options into the signature and the docstring (line OPTIONS) of a function."""
    signature = inspect.signature(function, eval_str=False)
    *own, keywords = signature.parameters.values()
    options = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=one.annotation
        )
        for name, one in OPTIONS.items()
    ]
    made: Any = function
    made.__signature__ = signature.replace(parameters=[*own, *options, keywords])
    if function.__doc__:
        lines = textwrap.indent(explained(), "    ")
        made.__doc__ = function.__doc__.replace("    OPTIONS", lines)
    return made


RunOptions.__doc__ = (
    f"{inspect.cleandoc(RunOptions.__doc__ or '')}\n\nAttributes\n----------\n"
    f"{explained(' (also in [solve])')}\n"
)
