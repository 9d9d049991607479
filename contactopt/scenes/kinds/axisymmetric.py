"""Bodies of revolution, without twist: the half section at r >= 0 stands for them."""

from math import pi, sqrt

from contactopt.scenes.kinds.kind import Kind


class Axisymmetric(Kind):
    """Bodies of revolution, with coordinates r and z."""

    name = "axisymmetric"
    components = ("r", "z")
    stresses = ("rr", "zz", "tt", "rz")
    revolved = True
    deck = "CAX"

    def measure(self, thickness: float) -> float:
        return 2 * pi

    def half_width(self, area: float, thickness: float) -> float:
        return sqrt(area / pi)

    def area(self, half_width: float, thickness: float) -> float:
        return pi * half_width**2
