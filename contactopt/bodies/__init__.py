"""Bodies as matrices: contactopt.bodies.protocol says what the interface needs to know of them.

A new kind of body is one module and one line of the table BODIES.
"""

from importlib import import_module

from contactopt.bodies.assembled import AssembledBody
from contactopt.errors import InputError
from contactopt.scenes.matrix_part import AnyPart, MatrixPart
from contactopt.scenes.scene import HalfSpace, Part, Rigid, Scene

# class of the part of a scene -> (module, function (scene, part, elements, zone) -> AssembledBody,
# what it is)
ROOM = "contactopt.bodies"
BODIES: dict[type, tuple[str, str, str]] = {
    Part: (
        f"{ROOM}.assembled_elastic",
        "assemble_elastic",
        "finite elements with linear elasticity",
    ),
    MatrixPart: (f"{ROOM}.matrix_body", "assemble_matrices", "matrices of another code"),
    Rigid: (f"{ROOM}.rigid", "assemble_rigid", "a rigid body"),
    HalfSpace: (
        f"{ROOM}.half_space",
        "assemble_half_space",
        "a half-space on a regular grid, without a mesh",
    ),
}


def assemble(scene: Scene, part: AnyPart, elements: int, zone: float | None) -> AssembledBody:
    """The body that models one part of a scene, with `elements` across the half-width `zone`
    [length] of the contact; its linear system is not solved yet. InputError for a part that no kind
    of body models.
    """
    for kind in type(part).__mro__:  # the class itself before what it derives from
        if kind in BODIES:
            module, function, _ = BODIES[kind]
            made: AssembledBody = getattr(import_module(module), function)(
                scene, part, elements, zone
            )
            return made
    known = ", ".join(kind.__name__ for kind in BODIES)
    raise InputError(f"a body of a scene must be one of {known}; got {type(part).__name__}.")
