"""Problems of an experiment file: scenes, FCLib files and generated families."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from inspect import signature
from pathlib import Path
from typing import Any

from contactopt.benchmark.families.half_planes import half_plane
from contactopt.benchmark.families.meshed_blocks import meshed_blocks
from contactopt.benchmark.families.of_scenes import (
    by_products,
    held,
    in_units,
    reduced,
    redundant,
    scene,
    skewed,
    tangential,
)
from contactopt.benchmark.families.packings import packing, rigid_bodies
from contactopt.benchmark.families.rigid_blocks import rigid_blocks
from contactopt.benchmark.families.sequences import growing_friction, load_path, settling
from contactopt.benchmark.families.springs import springs
from contactopt.benchmark.families.unsolvable import dragged, squeezed, toppled
from contactopt.benchmark.sequences import Sequence
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem

KINDS = ("scene", "fclib", "family")


# families by name, one line for each file of contactopt.benchmark.families
_RIGID = (rigid_bodies, packing, rigid_blocks)
_ELASTIC = (half_plane, meshed_blocks, springs)
_OF_SCENES = (by_products, held, tangential, redundant, in_units, skewed)
_SEQUENCES = (load_path, growing_friction, settling)
_UNSOLVABLE = (dragged, toppled, squeezed)
FAMILIES: dict[str, Callable[..., Any]] = {
    make.__name__: make for make in (*_RIGID, *_ELASTIC, *_OF_SCENES, *_SEQUENCES, *_UNSOLVABLE)
}


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
