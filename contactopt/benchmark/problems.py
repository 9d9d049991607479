"""Problems of an experiment file: scenes, FCLib files and generated families. These are imported
where they are built, so that a process that only runs methods starts sooner.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from inspect import signature
from pathlib import Path
from typing import Any

from contactopt.benchmark.sequences import Sequence
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem

KINDS = ("scene", "fclib", "family")


@dataclass(frozen=True)
class ProblemSpec:
    """kind: one of KINDS.

    path: of an FCLib file; not part of the label, which travels with the results.
    """

    kind: str
    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    path: str = ""

    @property
    def label(self) -> str:
        given = ", ".join(f"{key}={short_number(value)}" for key, value in self.parameters.items())
        return f"{self.name}({given})" if given else self.name

    def check(self, declared: Mapping[str, Callable[..., Any]]) -> None:
        """InputError if the name or a parameter is unknown or out of range."""
        from contactopt.benchmark.families import FAMILIES
        from contactopt.benchmark.families.of_scenes import scene

        if self.kind == "scene":
            scene(self.name, **self.parameters)
        elif self.kind == "family":
            families = FAMILIES | dict(declared)
            if self.name not in families:
                raise InputError(
                    f"unknown family {self.name!r}; choose from {', '.join(families)}."
                )
            try:
                signature(families[self.name]).bind(**self.parameters)
            except TypeError as error:
                raise InputError(f"family '{self.name}': {error}.") from error

    def build(self, declared: Mapping[str, Callable[..., Any]]) -> InterfaceProblem | Sequence:
        """The problem, or a sequence; InputError on parameters that make none."""
        from contactopt.benchmark.families import FAMILIES
        from contactopt.benchmark.families.of_scenes import reduced

        if self.kind == "scene":
            return reduced(self.name, **self.parameters)
        if self.kind == "fclib":
            from contactopt.fclib import read

            return read(self.path)
        problem = (FAMILIES | dict(declared))[self.name](**self.parameters)
        if not isinstance(problem, InterfaceProblem | Sequence):
            raise InputError(
                f"family '{self.name}' must return an InterfaceProblem; got"
                f" {type(problem).__name__}."
            )
        return problem


def short_number(value: object) -> str:
    """A float in the fewest characters that give it back, and anything else as text."""
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


def named(kind: str, name: str, parameters: Mapping[str, Any], folder: Path) -> list[ProblemSpec]:
    """The problems of one entry: one, or each file that an FCLib pattern in `folder` matches."""
    if kind != "fclib":
        return [ProblemSpec(kind, name, parameters)]
    pattern = Path(os.path.expandvars(os.path.expanduser(name)))
    if "$" in str(pattern):
        raise InputError(f"'{name}' needs an environment variable that is not set.")
    pattern = folder / pattern
    if pattern.is_dir():
        pattern = pattern / "*.*"
    files = sorted(file for file in pattern.parent.glob(pattern.name) if file.is_file())
    if not files:
        raise InputError(f"no FCLib file matches '{name}'.")
    return [ProblemSpec("fclib", file.stem, parameters, str(file.resolve())) for file in files]
