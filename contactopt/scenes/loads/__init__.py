"""Loads on bodies: one file each, one row here."""

from importlib import import_module

from contactopt.scenes.loads.load import Load

# name of its tables in a scene file -> (module, class)
LOADS = {
    "tractions": ("traction", "Traction"),
    "pressures": ("pressure", "Pressure"),
    "plates": ("plate", "Plate"),
    "body_force": ("body_force", "BodyForce"),
}


def load_classes() -> dict[str, type[Load]]:
    """The classes of LOADS by the names of their tables."""
    return {
        table: getattr(import_module(f"{__name__}.{module}"), name)
        for table, (module, name) in LOADS.items()
    }


__all__ = ["LOADS", "Load", "load_classes"]
