"""The named scenes, in N, mm and MPa: the paper's three (section 6), and those with exact solutions.

The paper gives E = 5 MPa, nu = .3, mu = .5 and 100 N but no sizes; ours are the defaults of the functions below, and
only there. A load path is a tuple of scenes that differ in their loads alone; contactopt.follow() solves it.
"""

from __future__ import annotations

from collections.abc import Callable

from contactopt.errors import InputError
from contactopt.scenes.assemblies import arch, pin_in_bush, press_fit, stack
from contactopt.scenes.common import with_elements
from contactopt.scenes.flat import flat_punch, rigid_punch
from contactopt.scenes.round import cylinder, growing_indentation, indentation, sphere
from contactopt.scenes.scene import Scene
from contactopt.scenes.sliding import cattaneo, shear_cycle

__all__ = [
    "PATHS",
    "SCENES",
    "arch",
    "cattaneo",
    "cylinder",
    "flat_punch",
    "growing_indentation",
    "indentation",
    "make_path",
    "make_scene",
    "pin_in_bush",
    "press_fit",
    "rigid_punch",
    "shear_cycle",
    "sphere",
    "stack",
]

# name -> (function making the scene from keyword arguments, what it is)
SCENES: dict[str, tuple[Callable[..., Scene], str]] = {
    "punch-2d": (lambda **changes: flat_punch(2, **changes), "flat punch on a foundation, plane strain, half model"),
    "punch-3d": (lambda **changes: flat_punch(3, **changes), "square flat punch on a foundation, quarter model"),
    "sphere": (sphere, "half sphere on a foundation, axisymmetric, contact-zone loop"),
    "cylinder-2d": (cylinder, "half cylinder on a foundation, plane strain, contact-zone loop"),
    "pin-in-bush": (pin_in_bush, "pin in a bush with clearance, held by contact alone, plane strain, half model"),
    "press-fit": (press_fit, "hollow shaft in a hub that is too narrow for it, plane strain, quarter model"),
    "stack": (stack, "blocks that rest on each other, tilted, under their weight, plane strain"),
    "arch": (arch, "half circle of stones that rest on each other, under its weight, plane strain"),
    "rigid-punch-2d": (lambda **changes: rigid_punch("plane-strain", **changes), "rigid flat punch on a half-plane"),
    "rigid-punch-axisymmetric": (
        lambda **changes: rigid_punch("axisymmetric", **changes),
        "rigid flat disc on a half-space",
    ),
    "hertz-dissimilar": (indentation, "rigid sphere on a half-space, axisymmetric; path: growing force"),
    "cattaneo-2d": (lambda **changes: cattaneo(2, **changes), "two cylinders pressed and sheared; path: shear cycle"),
    "cattaneo-3d": (lambda **changes: cattaneo(3, **changes), "two spheres pressed and sheared; path: shear cycle"),
}
# the scenes whose answer depends on how the load is applied: name -> function making the states in their order
PATHS: dict[str, Callable[..., tuple[Scene, ...]]] = {
    "hertz-dissimilar": growing_indentation,
    "cattaneo-2d": lambda **changes: shear_cycle(2, **changes),
    "cattaneo-3d": lambda **changes: shear_cycle(3, **changes),
}


def make_scene(name: str, *, degree: int | None = None, simplices: bool = False, **changes: object) -> Scene:
    """Make a named scene.

    Parameters
    ----------
    name : a key of SCENES
    degree : of the displacement in every element, 1 or 2; None: the scene's own
    simplices : whether the meshes have triangles or tetrahedra instead of quadrilaterals or hexahedra
    changes : other values of the arguments of the function that makes the scene

    Returns
    -------
    Scene

    Raises
    ------
    InputError : for an unknown name or argument, and for values that the scene refuses
    """
    if name not in SCENES:
        raise InputError(f"unknown scene {name!r}; choose from {', '.join(SCENES)}.")
    return with_elements(_made(name, SCENES[name][0], changes), degree, simplices)


def make_path(name: str, *, degree: int | None = None, simplices: bool = False, **changes: object) -> tuple[Scene, ...]:
    """Make the load path of a named scene.

    Parameters
    ----------
    name : a key of PATHS
    degree, simplices, changes : as in make_scene()

    Returns
    -------
    The states of the scene, in their order.

    Raises
    ------
    InputError : for a scene without a load path, and as make_scene()
    """
    if name not in PATHS:
        raise InputError(f"scene {name!r} has no load path; choose from {', '.join(PATHS)}.")
    return tuple(with_elements(scene, degree, simplices) for scene in _made(name, PATHS[name], changes))


def _made(name: str, make: Callable, changes: dict[str, object]):  # type: ignore[no-untyped-def]
    try:
        return make(**changes)
    except TypeError as error:
        raise InputError(f"scene '{name}': {error}.") from error
