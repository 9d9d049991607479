"""A given stress on a boundary."""

from __future__ import annotations

from dataclasses import dataclass

from contactopt.scenes.loads.load import Given, Uniform


@dataclass(frozen=True)
class Traction(Uniform):
    """Surface force per area on a named boundary, eq (4): one value [stress] per component."""

    what = "traction"
    form = "traction:BODY:BOUNDARY:COMPONENT"
    boundary: str
    value: tuple[float, ...]

    @classmethod
    def read(cls, given: Given) -> Traction:
        values = given.reading.numbers(given.table)
        if not values:
            names = ", ".join(given.reading.components)
            raise given.table.fail(f"a traction needs a value for at least one of {names}.")
        return cls(given.boundary, given.reading.vector(values))
