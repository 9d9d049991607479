"""The named scenes, in N, mm and MPa: the paper's three (section 6), and those with exact
solutions.

The paper gives E = 5 MPa, nu = .3, mu = .5 and 100 N but no sizes; ours are the defaults of the
functions below, and only there. A load path is a tuple of scenes that differ in their loads alone;
contactopt.follow() solves it.
"""

from collections.abc import Callable
from importlib import import_module
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Any

from contactopt.checks import meant
from contactopt.errors import InputError
from contactopt.run_options import OPTIONS
from contactopt.scenes.common import with_elements
from contactopt.scenes.scene import Scene

if TYPE_CHECKING:
    from contactopt.scenes.assemblies import arch, pin_in_bush, press_fit, stack
    from contactopt.scenes.flat import flat_punch, rigid_punch
    from contactopt.scenes.half_spaces import (
        cattaneo_half_space,
        hertz_half_space,
        rough,
        rough_sliding,
    )
    from contactopt.scenes.round import cylinder, growing_indentation, indentation, sphere
    from contactopt.scenes.sliding import cattaneo, shear_cycle

# name -> (module, function that makes the scene from keyword arguments, what it is[, arguments that
# the name fixes])
SCENES: dict[str, tuple[Any, ...]] = {
    "punch-2d": ("flat", "flat_punch", "flat punch on a foundation, plane strain", {"dim": 2}),
    "punch-3d": ("flat", "flat_punch", "square flat punch on a foundation", {"dim": 3}),
    "sphere": ("round", "sphere", "half sphere on a foundation, axisymmetric"),
    "cylinder-2d": ("round", "cylinder", "half cylinder on a foundation, plane strain"),
    "pin-in-bush": ("assemblies", "pin_in_bush", "pin in a bush, held by contact alone"),
    "press-fit": ("assemblies", "press_fit", "hollow shaft in a hub that is too narrow for it"),
    "stack": ("assemblies", "stack", "tilted blocks that rest on each other under their weight"),
    "arch": ("assemblies", "arch", "half circle of stones that rest on each other"),
    "rigid-punch-2d": (
        "flat",
        "rigid_punch",
        "rigid flat punch on a half-plane",
        {"kind": "plane-strain"},
    ),
    "rigid-punch-axisymmetric": (
        "flat",
        "rigid_punch",
        "rigid flat disc on a half-space",
        {"kind": "axisymmetric"},
    ),
    "hertz-dissimilar": ("round", "indentation", "rigid sphere on a half-space; growing force"),
    "cattaneo-2d": ("sliding", "cattaneo", "two cylinders pressed; cycle of shear", {"dim": 2}),
    "cattaneo-3d": ("sliding", "cattaneo", "two spheres pressed; cycle of shear", {"dim": 3}),
    "hertz-half-space": ("half_spaces", "hertz_half_space", "as sphere, rigid and without a mesh"),
    "cattaneo-half-space": ("half_spaces", "cattaneo_half_space", "as cattaneo-3d, without a mesh"),
    "rough": ("half_spaces", "rough", "rigid rough surface on a half-space; shear to sliding"),
}
# the scenes whose answer depends on how the load is applied: name -> (module, function that makes
# the states in their order[, arguments that the name fixes])
PATHS: dict[str, tuple[Any, ...]] = {
    "hertz-dissimilar": ("round", "growing_indentation"),
    "cattaneo-2d": ("sliding", "shear_cycle", {"dim": 2}),
    "cattaneo-3d": ("sliding", "shear_cycle", {"dim": 3}),
    "rough": ("half_spaces", "rough_sliding"),
}
_MODULES = {entry[1]: entry[0] for entry in (*SCENES.values(), *PATHS.values())}

__all__ = ["PATHS", "SCENES", "make_path", "make_scene", *sorted(_MODULES)]


def __getattr__(name: str) -> Any:
    """The functions of the tables, whose modules are imported when one of them is asked for."""
    if name in _MODULES:
        return _maker((_MODULES[name], name))
    raise AttributeError(f"module 'contactopt.scenes' has no attribute {name!r}")


def make_scene(
    name: str, *, degree: int | None = None, simplices: bool = False, **changes: object
) -> Scene:
    """Make a named scene.

    Parameters
    ----------
    name : a key of SCENES
    degree : of the displacement in every element, 1 or 2; None: the scene's own
    simplices : whether the meshes have triangles or tetrahedra instead of quadrilaterals or
        hexahedra
    changes : other values of the arguments of the function that makes the scene

    Returns
    -------
    Scene

    Raises
    ------
    InputError : for an unknown name or argument, and for values that the scene refuses
    """
    if name not in SCENES:
        known = ", ".join(SCENES)
        raise InputError(f"unknown scene {name!r}; choose from {known}{meant(name, SCENES)}")
    return with_elements(_made(name, SCENES, changes), degree, simplices)


def make_path(
    name: str, *, degree: int | None = None, simplices: bool = False, **changes: object
) -> tuple[Scene, ...]:
    """Make the load path of a named scene.

    Parameters
    ----------
    name : a key of PATHS
    degree, simplices, changes : as in make_scene()

    Returns
    -------
    tuple of Scene : the states of the scene, in their order

    Raises
    ------
    InputError : for a scene without a load path, and as make_scene()
    """
    if name not in PATHS:
        raise InputError(f"scene {name!r} has no load path; choose from {', '.join(PATHS)}.")
    return tuple(with_elements(scene, degree, simplices) for scene in _made(name, PATHS, changes))


def _made(name: str, table: dict[str, tuple[Any, ...]], changes: dict[str, object]) -> Any:
    """What the function of a table's entry makes; InputError for arguments that it does not take.

    A function of a load path hands what it does not know on to that of the scene.
    """
    make = _maker(table[name])
    fixed = table[name][-1] if isinstance(table[name][-1], dict) else {}
    taken = {**signature(make).parameters, **signature(_maker(SCENES[name])).parameters}
    named = [one.name for one in taken.values() if one.kind is not Parameter.VAR_KEYWORD]
    known = [argument for argument in named if argument not in fixed]
    for argument in changes:
        if argument not in known:
            near = meant(argument, [*known, "degree", "simplices", *OPTIONS])
            raise InputError(
                f"scene '{name}' has no argument {argument!r}; its arguments are"
                f" {', '.join(known)}, and degree and simplices of every scene{near}"
            )
    try:
        return make(**fixed, **changes)
    except TypeError as error:
        raise InputError(f"scene '{name}': {error}.") from error


def _maker(entry: tuple[Any, ...]) -> Callable[..., Any]:
    """The function of a table's entry."""
    make: Callable[..., Any] = getattr(import_module(f"contactopt.scenes.{entry[0]}"), entry[1])
    return make
