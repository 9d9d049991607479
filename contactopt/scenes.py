"""The named scenes: the paper's three (section 6), in newton, millimetre and megapascal.

The paper gives E = 5 MPa, nu = .3, mu = .5 and 100 N but no sizes; ours are the defaults of the functions below, and
only there.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from contactopt.analytic import contact_modulus, flat_punch_line, hertz_point
from contactopt.errors import InputError
from contactopt.scene import Material, Part, Plate, Rigid, Scene, Support, check_number

RUBBER = Material(E=5.0, nu=0.3)  # MPa, the material of all the paper's bodies
UNITS = ("mm", "MPa")
GROWTH = {2: 1.2, 3: 1.3}  # ratio of neighbouring elements away from the contact, by dimension
MARGIN = 1.25  # candidate contact zone of the sphere, over the half-width its mesh resolves


def flat_punch(
    dim: int = 2,
    *,
    width: float = 40.0,
    height: float = 40.0,
    foundation_width: float = 160.0,
    foundation_height: float = 80.0,
    depth: float = 40.0,
    upper: Material = RUBBER,
    lower: Material = RUBBER,
    mu: float = 0.5,
    force: float = 100.0,
    elements: int = 16,
    rigid: str | None = None,
    bilateral: bool = False,
) -> Scene:
    """A block pressed on a foundation by a rigid plate glued to its top; the foundation is clamped below.

    dim        2: plane strain, half model, `depth` thick.  3: square block on a square foundation, quarter model
    rigid      None, 'punch' or 'foundation': that body is rigid
    sizes in mm, force in N on the whole block; elements across the contact half-width
    """
    if dim not in (2, 3):
        raise InputError(f"dim must be 2 or 3; got {dim!r}.")
    if rigid not in (None, "punch", "foundation"):
        raise InputError(f"rigid must be None, 'punch' or 'foundation'; got {rigid!r}.")
    sizes = dict(
        width=width, height=height, foundation_width=foundation_width, foundation_height=foundation_height, depth=depth
    )
    for name, value in sizes.items():
        check_number(name, value, low=0.0)
    check_number("force", force, low=0.0)
    if foundation_width < width:
        raise InputError(
            f"the foundation ({foundation_width:g} wide) must be at least as wide as the punch ({width:g})."
        )
    a, up, growth = width / 2, "xyz"[dim - 1], GROWTH[dim]

    def punch_mesh(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        from contactopt.mesh import contact_grid, graded, rename, tensor_mesh

        rise = graded(height, a / elements, growth)
        across = contact_grid(a, elements, a, growth)
        mesh = tensor_mesh(*[across] * (dim - 1), rise)
        return rename(mesh, contact=f"{up}-", top=f"{up}+", **{f"symmetry {c}": f"{c}-" for c in "xy"[: dim - 1]})

    def foundation_mesh(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        from contactopt.mesh import contact_grid, graded, patch, rename, tensor_mesh

        depth_grid = -graded(foundation_height, a / elements, growth)[::-1]
        across = contact_grid(a, elements, foundation_width / 2, growth)
        mesh = tensor_mesh(*[across] * (dim - 1), depth_grid)
        mesh = rename(mesh, top=f"{up}+", bottom=f"{up}-", **{f"symmetry {c}": f"{c}-" for c in "xy"[: dim - 1]})
        return patch(mesh, "top", "contact", [a] * (dim - 1))

    symmetry = tuple(Support(f"symmetry {c}", {c: 0.0}) for c in "xy"[: dim - 1])
    load = {up: -force}
    top: Part | Rigid = Rigid("punch", force=load)
    if rigid != "punch":
        top = Part("punch", punch_mesh, upper, symmetry, (Plate("top", load),))
    bottom: Part | Rigid = Rigid("foundation")
    if rigid != "foundation":
        bottom = Part("foundation", foundation_mesh, lower, (*symmetry, Support("bottom")))
    return Scene(
        f"punch-{dim}d",
        top,
        bottom,
        mu,
        kind="plane-strain" if dim == 2 else "solid",
        thickness=depth if dim == 2 else 1.0,
        copies=2 ** (dim - 1),
        bilateral=bilateral,
        elements=elements,
        units=UNITS,
        reference=flat_punch_line(force / depth, a) if dim == 2 and rigid == "punch" else None,
    )


def sphere(
    *,
    radius: float = 400.0,
    foundation_radius: float = 800.0,
    foundation_height: float = 800.0,
    upper: Material = RUBBER,
    lower: Material = RUBBER,
    mu: float = 0.5,
    force: float = 100.0,
    elements: int = 32,
    rigid: str | None = None,
    bilateral: bool = False,
) -> Scene:
    """A half sphere pressed on a foundation by a rigid plate glued to its flat face; axisymmetric.

    rigid  None, 'sphere' or 'foundation': that body is rigid
    Sizes in mm, force in N; elements across the contact half-width. The zone loop starts wider than Hertz.
    """
    if rigid not in (None, "sphere", "foundation"):
        raise InputError(f"rigid must be None, 'sphere' or 'foundation'; got {rigid!r}.")
    sizes = dict(radius=radius, foundation_radius=foundation_radius, foundation_height=foundation_height, force=force)
    for name, value in sizes.items():
        check_number(name, value, low=0.0)
    bodies = (None if rigid == "sphere" else upper, None if rigid == "foundation" else lower)
    hertz = hertz_point(force, radius, contact_modulus(*bodies))
    widest = min(0.9 * radius / sqrt(2), foundation_radius) / MARGIN
    if hertz.half_width >= widest:
        raise InputError(
            f"the contact radius would be about {hertz.half_width:.3g}, too much for a sphere of radius {radius:g} on "
            f"a foundation of radius {foundation_radius:g}; lower the force or take stiffer or larger bodies."
        )

    def candidates(elements: int, zone: float | None) -> np.ndarray:
        """Radii of the candidate contact nodes: even spacing, one node at the zone's edge, a margin beyond it."""
        spacing = min(zone or hertz.half_width, widest) / elements
        return spacing * np.arange(elements + int(np.ceil((MARGIN - 1) * elements)) + 1)

    def beyond(grid: np.ndarray, length: float) -> np.ndarray:
        from contactopt.mesh import graded

        return np.concatenate([grid, grid[-1] + graded(length - grid[-1], grid[1] * GROWTH[2], GROWTH[2])[1:]])

    def sphere_mesh(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        from contactopt.mesh import graded, half_sphere_section, patch

        contact = candidates(elements, zone)
        grid = beyond(contact, radius / sqrt(2))
        mesh = half_sphere_section(radius, grid, graded(radius, grid[1], GROWTH[2]) / radius)
        return patch(mesh, "arc", "contact", [contact[-1]])

    def foundation_mesh(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        from contactopt.mesh import graded, patch, rename, tensor_mesh

        contact = candidates(elements, zone)
        depth = graded(foundation_height, contact[1], GROWTH[2])
        mesh = tensor_mesh(beyond(contact, foundation_radius), -depth[::-1])
        return patch(rename(mesh, axis="x-", bottom="y-", top="y+"), "top", "contact", [contact[-1]])

    axis = Support("axis", {"r": 0.0})
    load = {"z": -force}

    def gap(x: np.ndarray) -> np.ndarray:
        return radius - np.sqrt(radius**2 - np.minimum(x[0], radius) ** 2)

    top: Part | Rigid = Rigid("sphere", gap=gap, force=load)
    if rigid != "sphere":
        top = Part("sphere", sphere_mesh, upper, (axis,), (Plate("top", load),))
    bottom: Part | Rigid = Rigid("foundation", normal=(0.0, 1.0), gap=lambda x: x[1])
    if rigid != "foundation":
        bottom = Part("foundation", foundation_mesh, lower, (axis, Support("bottom")))
    return Scene(
        "sphere",
        top,
        bottom,
        mu,
        kind="axisymmetric",
        bilateral=bilateral,
        elements=elements,
        zone=MARGIN * hertz.half_width,
        units=UNITS,
        reference=hertz,
    )


# name -> (function making the scene from keyword arguments, what it is)
SCENES: dict[str, tuple[Callable[..., Scene], str]] = {
    "punch-2d": (lambda **changes: flat_punch(2, **changes), "flat punch on a foundation, plane strain, half model"),
    "punch-3d": (lambda **changes: flat_punch(3, **changes), "square flat punch on a foundation, quarter model"),
    "sphere": (sphere, "half sphere on a foundation, axisymmetric, contact-zone loop"),
}


def make_scene(name: str, **changes: object) -> Scene:
    """The named scene with some of its arguments changed; InputError for an unknown name or argument."""
    if name not in SCENES:
        raise InputError(f"unknown scene {name!r}; choose from {', '.join(SCENES)}.")
    try:
        return SCENES[name][0](**changes)
    except TypeError as error:
        raise InputError(f"scene '{name}': {error}.") from error
