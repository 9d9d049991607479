"""What several named scenes share: material, units, grading, and the words for their arguments."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from contactopt.checks import check_number
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.scenes.scene import Part, Rigid, Scene

if TYPE_CHECKING:
    from contactopt.scenes.matrix_part import AnyPart

RUBBER = Material(E=5.0, nu=0.3)  # MPa, the material of all the paper's bodies
UNITS = ("mm", "MPa")
KINDS = {2: "plane-strain", 3: "solid"}  # by dimension
GROWTH = {2: 1.2, 3: 1.3}  # ratio of neighbouring elements away from the contact, by dimension
MARGIN = 1.25  # candidate contact zone of round bodies, over the half-width its mesh resolves
# what arguments of many scenes are
WORDS = {
    "depth": "length of the bodies along the direction without strain [mm]",
    "upper": "material of the upper body",
    "lower": "material of the lower body",
    "material": "of all elastic bodies",
    "mu": "friction coefficient",
    "force": "total normal force, positive in compression [N]",
    "elements": "number of elements across the contact half-width",
    "rigid": "the name of a body that is rigid; None: both are elastic",
    "bilateral": "whether contact cannot open",
}
REFUSED = "InputError : if a size is not positive, or bodies of these sizes cannot make the scene"
Make = TypeVar("Make", bound=Callable[..., Any])


def explained(make: Make) -> Make:
    """Write into the docstring of a function that makes a scene, with the sections Parameters and
    Returns, what it does not say: the arguments that many scenes have, and when it raises
    InputError.
    """
    if make.__doc__ is None:  # Python was told to leave docstrings out
        return make
    head, title, rest = inspect.cleandoc(make.__doc__).partition("\n\nReturns\n")
    told = re.findall(r"^(\w+(?:, \w+)*) : ", head, re.MULTILINE)
    known = {name for names in told for name in names.split(", ")}
    missing = [name for name in inspect.signature(make).parameters if name not in known]
    lines = [head, *(f"{name} : {WORDS[name]}" for name in missing)]
    make.__doc__ = "\n".join(lines) + f"{title}{rest}\n\nRaises\n------\n{REFUSED}\n"
    return make


def check_choice(name: str, value: object, *valid: object) -> None:
    """Raise InputError unless an argument has one of its values."""
    if value not in valid:
        *first, last = map(repr, valid)
        raise InputError(f"{name} must be {', '.join(first)} or {last}; got {value!r}.")


def check_shear(shear: float, mu: float, force: float) -> None:
    """Raise InputError where friction cannot hold a shear force."""
    check_number("shear", shear)
    if shear != 0 and abs(shear) >= mu * force:
        raise InputError(
            f"the shear {shear:g} is at least mu times the"
            f" force, {mu * force:g}: the bodies slide off."
        )


def model(
    kind: str, depth: float = 1.0, copies: int = 1, bilateral: bool = False
) -> dict[str, Any]:
    """The fields of a scene that say what its bodies stand for, and whether contact can open."""
    return {
        "kind": kind,
        "thickness": depth if kind == "plane-strain" else 1.0,
        "copies": copies,
        "law": "bilateral" if bilateral else "coulomb",
        "units": UNITS,
    }


def one_of(rigid: str | None, stiff: Rigid, elastic: Part) -> Part | Rigid:
    """The rigid form of a body if its name is asked for, or else the elastic one."""
    return stiff if rigid == stiff.name else elastic


def upper_of(scene: Scene, **changes: object) -> Scene:
    """The scene with other fields of its upper body."""
    upper: Any = scene.upper
    return replace(scene, upper=replace(upper, **changes))


def circle(radius: float) -> Callable[[np.ndarray], np.ndarray]:
    """The curve of a contact boundary on a circle around the origin."""
    return lambda x: radius * x / np.linalg.norm(x, axis=0)


def with_elements(scene: Scene, degree: int | None = None, simplices: bool = False) -> Scene:
    """The scene with displacements of another degree, 1 or 2, unless that is None. With `simplices`
    its quadrilaterals and hexahedra are cut into triangles and tetrahedra.
    """

    def cut(part: AnyPart) -> AnyPart:
        if not simplices or not part.meshed:
            return part

        def mesh(elements: int, zone: float | None) -> Any:
            from contactopt.meshes.structured import simplices

            return simplices(part.build_mesh(elements, zone))

        return replace(part, mesh=mesh)

    return replace(scene.with_parts(cut), degree=scene.degree if degree is None else degree)
