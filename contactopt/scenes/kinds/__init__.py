"""Kinds of analysis: one file each, one row here."""

from contactopt.scenes.kinds.axisymmetric import Axisymmetric
from contactopt.scenes.kinds.kind import Kind
from contactopt.scenes.kinds.plane_strain import PlaneStrain
from contactopt.scenes.kinds.plane_stress import PlaneStress
from contactopt.scenes.kinds.solid import Solid

KINDS: dict[str, Kind] = {
    kind.name: kind for kind in (PlaneStrain(), PlaneStress(), Axisymmetric(), Solid())
}

__all__ = ["KINDS", "Kind"]
