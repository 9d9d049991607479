"""A weight."""

from __future__ import annotations

from dataclasses import dataclass

from contactopt.scenes.loads.load import Given, Uniform


@dataclass(frozen=True)
class BodyForce(Uniform):
    """Force per volume: one value [force / length^3] per component."""

    what = "force per volume"
    form = "weight:BODY:COMPONENT"
    single = True
    boundary = ""
    value: tuple[float, ...]

    @classmethod
    def read(cls, given: Given) -> BodyForce:
        return cls(given.reading.vector(given.reading.numbers(given.table)))
