"""A rigid plate under a total force."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from contactopt.scenes.loads.load import Given, Load, check_components


@dataclass(frozen=True)
class Plate(Load):
    """A rigid plate on a named boundary, loaded by a total force.

    `force` maps each component in which the plate may move to the total force [force] on the whole
    body (all mirror images, the whole ring). The plate never tilts; its unknown displacement is the
    multiplier of the force balance. In the other components the body is held if the plate is glued
    to it, and slides freely if not.
    """

    what = "plate"
    form = "force:BODY:COMPONENT"
    level = True
    total = True
    boundary: str
    force: Mapping[str, float]
    glued: bool = True

    def values(self, components: tuple[str, ...]) -> dict[str, float]:
        return dict(self.force)

    def words(self, components: tuple[str, ...]) -> str:
        held = ", ".join(c for c in components if self.glued and c not in self.force)
        return super().words(components) + (f"; glued, it holds {held}" if held else "")

    def with_values(self, values: Mapping[str, float]) -> Plate:
        return replace(self, force=dict(values))

    def check(self, body: str, kind: str) -> None:
        check_components(body, self.force, kind)

    @classmethod
    def read(cls, given: Given) -> Plate:
        force, reading = given.table.table("force"), given.reading
        if force is None:
            raise given.table.fail(
                f"a plate needs force = {{ {reading.components[-1]} = ... }}: the total force on"
                " the whole body."
            )
        glued = given.table.take("glued", bool, True)
        return cls(given.boundary, reading.numbers(force, whole=True), glued)
