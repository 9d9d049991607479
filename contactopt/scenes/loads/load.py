"""What a load on a body is, from its table in a scene file to its forces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np

from contactopt.checks import check_size, short
from contactopt.errors import InputError
from contactopt.scenes.kinds import KINDS

if TYPE_CHECKING:
    from contactopt.files.toml_table import Table
    from contactopt.scenes.file_bodies import FileContext


class Given(NamedTuple):
    """A load in a scene file: its table, its boundary, and what reads numbers of components."""

    table: Table
    boundary: str
    reading: FileContext


class Face(NamedTuple):
    """The face of a mesh on which a load acts.

    normal      (dim,) the mean of the outward normals, of length 1
    area        of the whole body [length^2]
    centre      (dim,) of the area
    components  of a displacement
    held        components of which supports hold a node of the face, or revolution all
    """

    normal: np.ndarray
    area: float
    centre: np.ndarray
    components: tuple[str, ...]
    held: frozenset[str]


class Load(ABC):
    """A load on a body: a frozen dataclass.

    what      it is, in messages
    form      of the names of its values (contactopt.scenes.parameters)
    boundary  where it acts; empty: inside the whole body
    level     whether it keeps its boundary level, as a Plate, whose fields it then has. Any other
              load is known by its density
    total     whether its values are total forces, those of all mirror images together
    shared    whether it is one of the two ends of a load of the scene
    single    whether a scene file has one table of it for a body, and not an array of tables
    """

    what: ClassVar[str]
    form: ClassVar[str]
    level: ClassVar[bool] = False
    total: ClassVar[bool] = False
    shared: ClassVar[bool] = False
    single: ClassVar[bool] = False
    boundary: str
    force: Mapping[str, float]
    glued: bool

    @abstractmethod
    def values(self, components: tuple[str, ...]) -> dict[str, float]:
        """Its numbers by component; by "" the one that has no direction, such as a pressure."""

    @abstractmethod
    def with_values(self, values: Mapping[str, float]) -> Self:
        """The load with other numbers; of a section, those of its components."""

    @abstractmethod
    def check(self, body: str, kind: str) -> None:
        """InputError for values that do not fit the kind of the scene."""

    @classmethod
    def read(cls, given: Given) -> Self:
        """The load that the table of a body in a scene file gives."""
        raise NotImplementedError

    def address(self, body: str) -> tuple[str, ...]:
        """What is between the kind and the component in the names of its values."""
        return tuple(filter(None, (body, self.boundary)))

    def on(self, face: Face) -> Load:
        """The load that it is on a face of a mesh."""
        return self

    def resultant(self, components: tuple[str, ...], n: np.ndarray) -> np.ndarray:
        """The total force (dim,), of a load that gives it, on a face of the mean normal n."""
        values = self.values(components)
        return np.array([values.get(c, 0.0) for c in components])

    def density(self, x: np.ndarray, n: np.ndarray) -> np.ndarray:
        """The force per area or volume at places x, where n points outwards, all (dim, ...)."""
        return np.zeros_like(x)

    def words(self, components: tuple[str, ...]) -> str:
        """One line that describes it."""
        place = f" on '{self.boundary}'" if self.boundary else ""
        return f"{self.what}{place}: {number_words(self.values(components))}"


class Uniform(Load):
    """A load with one `value` for each component."""

    value: tuple[float, ...]

    def values(self, components: tuple[str, ...]) -> dict[str, float]:
        return dict(zip(components, self.value))

    def with_values(self, values: Mapping[str, float]) -> Self:
        own: Any = self
        return replace(own, value=tuple(values.values()))

    def check(self, body: str, kind: str) -> None:
        what, components, value = type(self).__name__, KINDS[kind].components, self.value
        listed = isinstance(value, (tuple, list, np.ndarray)) and np.iterable(value)
        if not listed or len(value) != len(components):
            raise InputError(
                f"body '{body}': a {what} needs a tuple of {len(components)} values"
                f" ({', '.join(components)}); got {short(value)}."
            )
        for one in value:
            check_size(f"every {what} value of body '{body}'", one)

    def density(self, x: np.ndarray, n: np.ndarray) -> np.ndarray:
        value = np.asarray(self.value, dtype=float)
        return np.broadcast_to(value.reshape(-1, *np.ones(x.ndim - 1, dtype=int)), x.shape)


def number_words(values: Mapping[str, float]) -> str:
    """'x = 1, y = -2'; a number without a direction by itself."""
    return ", ".join(
        f"{name} = {value:g}" if name else f"{value:g}" for name, value in values.items()
    )


def check_components(body: str, values: Mapping[str, float], kind: str) -> None:
    """Raise InputError unless values are given by names of the components of a kind of scene."""
    components = KINDS[kind].components
    if not isinstance(values, Mapping):
        raise InputError(
            f"body '{body}': a value is given for each component by its name, as in"
            f" {{{components[-1]!r}: 0.0}}; got {short(values)}."
        )
    for component, value in values.items():
        if component not in components:
            others = [other for other, own in KINDS.items() if component in own.components]
            remedy = f", or give the scene kind={others[-1]!r}" if others else ""
            raise InputError(
                f"body '{body}': there is no component {component!r}; use {', '.join(components)},"
                f" which are those of kind {kind!r}{remedy}."
            )
        check_size(f"the {component} value of body '{body}'", value)
