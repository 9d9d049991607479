"""Bodies in space."""

from math import sqrt

from contactopt.scenes.kinds.kind import Kind


class Solid(Kind):
    """Bodies with three coordinates."""

    name = "solid"
    components = ("x", "y", "z")
    stresses = ("xx", "yy", "zz", "xy", "yz", "xz")
    deck = "C3D"

    def measure(self, thickness: float) -> float:
        return 1.0

    def half_width(self, area: float, thickness: float) -> float:
        return sqrt(area) / 2

    def area(self, half_width: float, thickness: float) -> float:
        return 4 * half_width**2
