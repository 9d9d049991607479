"""Kinds of analysis: one file each, one row here."""

from importlib import import_module

from contactopt.scenes.kinds.kind import Constants, Kind

# name -> (module, class)
_KINDS = {
    "plane-strain": ("plane_strain", "PlaneStrain"),
    "plane-stress": ("plane_stress", "PlaneStress"),
    "axisymmetric": ("axisymmetric", "Axisymmetric"),
    "solid": ("solid", "Solid"),
}
KINDS: dict[str, Kind] = {
    name: getattr(import_module(f"{__name__}.{module}"), kind)()
    for name, (module, kind) in _KINDS.items()
}

__all__ = ["KINDS", "Constants", "Kind"]
