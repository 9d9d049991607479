"""Plane strain: a section of bodies that are long across it, and do not strain that way."""

from contactopt.scenes.kinds.kind import Kind


class PlaneStrain(Kind):
    """A section of long bodies."""

    name = "plane-strain"
    deck = "CPE"
