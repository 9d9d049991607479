"""A pressure on a boundary of any shape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from contactopt.checks import check_size
from contactopt.scenes.loads.load import Given, Load


@dataclass(frozen=True)
class Pressure(Load):
    """A pressure [stress] that pushes on a named boundary along its normals, into the body.

    The normals are those of the mesh that is not deformed: strains are small, and the load keeps
    its direction as the body moves.
    """

    what = "pressure"
    form = "pressure:BODY:BOUNDARY"
    boundary: str
    pressure: float

    def values(self, components: tuple[str, ...]) -> dict[str, float]:
        return {"": self.pressure}

    def with_values(self, values: Mapping[str, float]) -> Pressure:
        return replace(self, pressure=values[""])

    def check(self, body: str, kind: str) -> None:
        what = f"the pressure on {self.boundary!r} of body '{body}'"
        check_size(what, self.pressure)

    @classmethod
    def read(cls, given: Given) -> Pressure:
        values = given.reading.numbers(given.table, keys=("pressure",))
        if not values:
            raise given.table.fail("a pressure needs its value, as in pressure = 2.0.")
        return cls(given.boundary, values["pressure"])

    def density(self, x: np.ndarray, n: np.ndarray) -> np.ndarray:
        return -self.pressure * np.asarray(n)
