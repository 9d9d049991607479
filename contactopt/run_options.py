"""The options of a run, declared once.

contactopt.run takes them as keywords, `contactopt run` as options of the same names, and the table
[solve] of a scene file as keys, which contactopt.scenes.scene_files reads and checks.
"""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields
from typing import Any, TypeVar

from contactopt.errors import InputError
from contactopt.methods.driver import TOL

TOGETHER = "accuracy and quantity belong together: the bound, and the name of what it bounds."
F = TypeVar("F", bound=Callable[..., Any])


def _option(kind: type, value: str, what: str, default: Any = None, in_file: bool = True) -> Any:
    """An option: its type, its value in help, what it is, whether a scene file may hold it."""
    told = {"kind": kind, "value": value, "what": what, "in_file": in_file}
    return field(default=default, metadata=told)


@dataclass(frozen=True)
class RunOptions:
    """How a scene is solved, and what is drawn of it. None stands for what is usual.

    Each is a keyword of contactopt.run and an option of `contactopt run`, where `max_unknowns` is
    written --max-unknowns. Those that the table [solve] of a scene file may hold are marked.
    """

    method: str | None = _option(
        str, "NAME", "the method (default: auto; alternating if a backend is named)"
    )
    normal: str | None = _option(str, "BACKEND", "QP backend that finds the normal forces")
    tangential: str | None = _option(
        str,
        "BACKEND",
        "backend that finds the friction forces: QP (2D, axisymmetric) or conic (3D)",
    )
    preconditioner: str | None = _option(
        str,
        "NAME",
        "an approximate inverse of Q, of methods that take"
        " products with Q; it implies the implicit form",
    )
    Q: str = _option(
        str, "FORM", "Q as an array (explicit), or known by its products only (implicit)", "auto"
    )
    solver: str = _option(str, "NAME", "solver of the bodies' linear systems", "auto")
    tol: float = _option(
        float, "T", f"largest natural-map residual that counts as solved (default: {TOL:g})", TOL
    )
    accuracy: float | None = _option(
        float,
        "X",
        "refine the mesh until the estimated relative error of a quantity is below X, or a sentence"
        " says why not; `elements` only scales the first mesh",
    )
    quantity: str | None = _option(
        str, "NAME", "the quantity of the accuracy; NAME:PAIR is that of one pair of surfaces"
    )
    read: tuple[str, ...] = _option(
        tuple,
        "NAME",
        "quantities that are read from the solution, such as von_mises:BODY:BOUNDARY, each with the"
        " error that its one mesh lets expect",
        (),
        in_file=False,
    )
    adaptive: bool = _option(
        bool,
        "",
        "for the accuracy, refine the mesh only where the quantity needs it, each body by itself;"
        " quadrilaterals become triangles",
        False,
    )
    max_unknowns: int | None = _option(
        int, "N", "for the accuracy: no mesh has more displacement unknowns"
    )
    time_limit: float | None = _option(
        float,
        "S",
        "the solution, or the search for the accuracy, ends after so many seconds; what was found"
        " is written, and `resume` goes on",
    )
    max_memory: float | None = _option(
        float, "GB", "for the accuracy: the search takes no more memory (default: 2)"
    )
    simplest: bool = _option(
        bool,
        "",
        "first leave out all that makes no error, proved by a certificate of the whole;"
        " `contactopt simplify SCENE` says what this is",
        False,
        in_file=False,
    )
    resume: bool = _option(
        bool,
        "",
        "go on where a run into the same folder was stopped by time, memory or a person",
        False,
        in_file=False,
    )
    start: str | None = _option(
        str,
        "DIR",
        "start from the forces in the folder of another run, of this scene or of one with other"
        " numbers or meshes",
        in_file=False,
    )
    figures: tuple[str, ...] = _option(
        tuple,
        "FORMAT",
        "formats of the figures (default: png); none are drawn if there are none, which saves half"
        " of the time of a small scene",
        ("png",),
        in_file=False,
    )
    html: bool = _option(
        bool,
        "",
        "also write view.html, the result as a page to"
        " explore (needs: pip install 'contactopt[view]')",
        False,
        in_file=False,
    )

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
        if self.resume and self.start is not None:
            raise InputError("resume and start exclude each other: give one of them.")
        if self.accuracy is None and set(self.bounds) - {"time_limit"}:
            raise InputError(
                "bounds on unknowns and memory end the search for an accuracy: give an"
                " accuracy and a quantity."
            )

    @property
    def settings(self) -> dict[str, str]:
        """Those that are settings of the method."""
        return self._given("normal", "tangential", "preconditioner")

    @property
    def bounds(self) -> dict[str, Any]:
        """Those that end the search for an accuracy."""
        return self._given("max_unknowns", "time_limit", "max_memory")

    def _given(self, *names: str) -> dict[str, Any]:
        return {name: value for name in names if (value := getattr(self, name)) is not None}


OPTIONS: dict[str, Field[Any]] = {one.name: one for one in fields(RunOptions)}
IN_FILES = tuple(name for name, one in OPTIONS.items() if one.metadata["in_file"])


def choose(
    keywords: Mapping[str, Any], in_file: Mapping[str, Any]
) -> tuple[RunOptions, dict[str, Any]]:
    """Divide the keywords of contactopt.run into the options of a run, and all others. An option
    that is None was not given; then that of the scene file counts.
    """
    given = {name: value for name in OPTIONS if (value := keywords.get(name)) is not None}
    others = {name: value for name, value in keywords.items() if name not in OPTIONS}
    return RunOptions(**{**in_file, **given}), others


def explained(only: str = "") -> str:
    """The options as lines of a docstring, with `only` added to those of a scene file."""
    return "\n".join(
        textwrap.fill(
            f"{name} : {one.metadata['what']}{only if name in IN_FILES else ''}",
            96,
            subsequent_indent="    ",
        )
        for name, one in OPTIONS.items()
    )


def takes_options(function: F) -> F:
    """Write the options into the signature of a function that takes them as keywords, and into its
    docstring, instead of the line OPTIONS.
    """
    signature = inspect.signature(function, eval_str=False)
    *own, keywords = signature.parameters.values()
    options = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=one.type
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
