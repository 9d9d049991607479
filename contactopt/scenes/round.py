"""Round bodies: sphere and cylinder on a foundation, a rigid sphere on a half-space under growing
load.
"""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np

from contactopt.analytic import (
    Reference,
    contact_modulus,
    dundurs,
    hertz_line,
    hertz_point,
    hertz_point_friction,
)
from contactopt.checks import check_count, check_positive
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.scenes.common import GROWTH, MARGIN, RUBBER, UNITS
from contactopt.scenes.scene import Part, Plate, Rigid, Scene, Support

LARGE = 400.0  # half-space: size of the foundation over the contact radius


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

    Lengths are in mm, forces in N and Young's moduli in MPa. The first contact zone is wider than
    that of Hertz, and the zone loop (contactopt.solving.zone) finds its edge.

    Parameters
    ----------
    radius : Of the sphere.
    foundation_radius, foundation_height : Of the cylinder on which it is pressed, which is clamped
        below.
    upper, lower : Materials of the sphere and of the foundation.
    mu : Friction coefficient.
    force : Total force on the plate, positive in compression.
    elements : Number of elements across the contact radius.
    rigid : None, 'sphere' or 'foundation': that body is rigid.
    bilateral : Whether contact cannot open.

    Returns
    -------
    Named 'sphere', with Hertz's solution for half-spaces.

    Raises
    ------
    InputError : If a size is not positive, the contact would be too wide for the bodies, or `rigid`
        names no body.
    """
    check_positive(
        radius=radius,
        foundation_radius=foundation_radius,
        foundation_height=foundation_height,
        force=force,
    )
    hertz = hertz_point(force, radius, _modulus("sphere", rigid, upper, lower))
    size = radius, foundation_radius, foundation_height
    top, bottom = _round_bodies("sphere", rigid, ("r", "z"), hertz, size, upper, lower, force)
    return Scene(
        "sphere",
        top,
        bottom,
        mu,
        kind="axisymmetric",
        law="bilateral" if bilateral else "coulomb",
        elements=elements,
        zone=MARGIN * hertz.half_width,
        units=UNITS,
        reference=hertz,
    )


def cylinder(
    *,
    radius: float = 400.0,
    foundation_width: float = 1600.0,
    foundation_height: float = 800.0,
    depth: float = 400.0,
    upper: Material = RUBBER,
    lower: Material = RUBBER,
    mu: float = 0.5,
    force: float = 100.0,
    elements: int = 32,
    rigid: str | None = None,
    bilateral: bool = False,
) -> Scene:
    """A half cylinder pressed on a foundation by a rigid plate glued to its flat face; plane
    strain, of which half is
    modelled.

    Lengths are in mm, forces in N and Young's moduli in MPa. The first contact zone is wider than
    that of Hertz, and the zone loop (contactopt.solving.zone) finds its edge.

    Parameters
    ----------
    radius : Of the cylinder.
    foundation_width, foundation_height : Of the foundation, which is clamped below.
    depth : Length of the cylinder along its axis.
    upper, lower : Materials of the cylinder and of the foundation.
    mu : Friction coefficient.
    force : Total force on the plate, positive in compression.
    elements : Number of elements across the contact half-width.
    rigid : None, 'cylinder' or 'foundation': that body is rigid.
    bilateral : Whether contact cannot open.

    Returns
    -------
    Named 'cylinder-2d', with Hertz's solution for half-planes.

    Raises
    ------
    InputError : If a size is not positive, the contact would be too wide for the bodies, or `rigid`
        names no body.
    """
    check_positive(
        radius=radius,
        foundation_width=foundation_width,
        foundation_height=foundation_height,
        depth=depth,
        force=force,
    )
    hertz = hertz_line(force / depth, radius, _modulus("cylinder", rigid, upper, lower))
    size = radius, foundation_width / 2, foundation_height
    top, bottom = _round_bodies("cylinder", rigid, ("x", "y"), hertz, size, upper, lower, force)
    return Scene(
        "cylinder-2d",
        top,
        bottom,
        mu,
        thickness=depth,
        copies=2,
        law="bilateral" if bilateral else "coulomb",
        elements=elements,
        zone=MARGIN * hertz.half_width,
        units=UNITS,
        reference=hertz,
    )


def indentation(
    *,
    radius: float = 400.0,
    foundation: float | None = None,
    lower: Material = RUBBER,
    mu: float = 0.3,
    force: float = 100.0,
    elements: int = 100,
) -> Scene:
    """A rigid sphere pressed on a half-space, the most dissimilar pair of bodies; axisymmetric.

    With friction the answer depends on the path, because points that come into contact stick with
    the slip that they brought along. One step from zero is wrong then; growing_indentation() makes
    the path. The sphere is the paraboloid of its curvature, and the half-space is a block that is
    clamped below. Lengths are in mm, forces in N and Young's moduli in MPa.

    Parameters
    ----------
    radius : Of the sphere.
    foundation : Height of the block and its width from the axis. By default 400 contact radii,
        which makes the approach .4 % too small.
    lower : Material of the half-space.
    mu : Friction coefficient.
    force : Total force on the sphere, positive in compression.
    elements : Number of elements across the contact radius.

    Returns
    -------
    Named 'hertz-dissimilar', with the exact solution of the whole path.

    Raises
    ------
    InputError : If a size is not positive.
    """
    check_positive(radius=radius, force=force)
    hertz = hertz_point_friction(force, radius, contact_modulus(lower), mu, dundurs(None, lower)[1])
    size = LARGE * hertz.half_width if foundation is None else foundation
    check_positive(foundation=size)
    if size < 2 * hertz.half_width:
        raise InputError(
            f"the foundation ({size:g}) must be at least two contact radii,"
            f" {2 * hertz.half_width:g}."
        )

    def mesh(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        return _foundation_mesh(_candidates(elements, zone or hertz.half_width), size, size)

    axis = Support("axis", {"r": 0.0})
    return Scene(
        "hertz-dissimilar",
        Rigid(
            "sphere", normal=(0.0, 1.0), gap=lambda x: x[0] ** 2 / (2 * radius), force={"z": -force}
        ),
        Part("foundation", mesh, lower, (axis, Support("bottom"))),
        mu,
        kind="axisymmetric",
        elements=elements,
        zone=hertz.half_width,
        units=UNITS,
        reference=hertz,
    )


def growing_indentation(*, steps: int = 100, **changes: object) -> tuple[Scene, ...]:
    """The states of indentation() while its force grows from zero so that the contact radius grows
    evenly.

    All states share the mesh of the last one, with elements / steps elements of further contact in
    each. One element for each step serves best; with more of them the tractions are as uneven as
    the steps. The stick ratio c/a comes out too small by less than 1 / steps, because implicit
    Euler stops the slip of a point up to a step early.

    Parameters
    ----------
    steps : Number of states.
    changes : Arguments of indentation(), for the last state.

    Returns
    -------
    The states in their order.
    """
    check_count("steps", steps)
    last = indentation(**changes)  # type: ignore[arg-type]
    assert isinstance(last.upper, Rigid) and last.upper.force is not None
    load = last.upper.force["z"]
    forces = load * (np.arange(1, steps + 1) / steps) ** 3  # a ~ P^(1/3)
    return tuple(replace(last, upper=replace(last.upper, force={"z": float(f)})) for f in forces)


def _modulus(name: str, rigid: str | None, upper: Material, lower: Material) -> float:
    if rigid not in (None, name, "foundation"):
        raise InputError(f"rigid must be None, '{name}' or 'foundation'; got {rigid!r}.")
    return contact_modulus(
        None if rigid == name else upper, None if rigid == "foundation" else lower
    )


def _round_bodies(
    name: str,
    rigid: str | None,
    axes: tuple[str, str],
    hertz: Reference,
    size: tuple[float, float, float],
    upper: Material,
    lower: Material,
    force: float,
) -> tuple[Part | Rigid, Part | Rigid]:
    """Half disc of a radius and the foundation, half as wide and high as given; x = 0 is an axis of
    symmetry.
    """
    radius, width, height = size
    widest = min(0.9 * radius / sqrt(2), width) / MARGIN
    if hertz.half_width >= widest:
        raise InputError(
            f"the contact half-width would be about {hertz.half_width:.3g}, too much for a {name}"
            f" of radius {radius:g} on a foundation {width:g} wide from the axis; lower the force"
            " or take stiffer or larger bodies."
        )

    def candidates(elements: int, zone: float | None) -> np.ndarray:
        return _candidates(elements, min(zone or hertz.half_width, widest))

    def upper_mesh(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        from contactopt.meshes.structured import graded, half_sphere_section, patch

        contact = candidates(elements, zone)
        grid = _beyond(contact, radius / sqrt(2))
        mesh = half_sphere_section(radius, grid, graded(radius, grid[1], GROWTH[2]) / radius)
        return patch(mesh, "arc", "contact", [contact[-1]])

    def lower_mesh(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        return _foundation_mesh(candidates(elements, zone), width, height)

    def gap(x: np.ndarray) -> np.ndarray:
        return radius - np.sqrt(radius**2 - np.minimum(x[0], radius) ** 2)

    def arc(x: np.ndarray) -> np.ndarray:
        return np.stack([x[0], gap(x)])

    axis, load = Support("axis", {axes[0]: 0.0}), {axes[1]: -force}
    top: Part | Rigid = Rigid(name, gap=gap, force=load)
    if rigid != name:
        top = Part(name, upper_mesh, upper, (axis,), (Plate("top", load),), curve=arc)
    bottom: Part | Rigid = Rigid("foundation", normal=(0.0, 1.0), gap=lambda x: x[1])
    if rigid != "foundation":
        bottom = Part("foundation", lower_mesh, lower, (axis, Support("bottom")))
    return top, bottom


def _candidates(elements: int, zone: float) -> np.ndarray:
    """Positions of the candidate contact nodes: even spacing, one node at the zone's edge, a margin
    beyond it.
    """
    return zone / elements * np.arange(elements + int(np.ceil((MARGIN - 1) * elements)) + 1)


def _beyond(grid: np.ndarray, length: float) -> np.ndarray:
    from contactopt.meshes.structured import graded

    return np.concatenate(
        [grid, grid[-1] + graded(length - grid[-1], grid[1] * GROWTH[2], GROWTH[2])[1:]]
    )


def _foundation_mesh(contact: np.ndarray, width: float, height: float):  # type: ignore[no-untyped-def]
    """Half of a foundation, the contact nodes at the given positions on its top."""
    from contactopt.meshes.structured import graded, patch, rename, tensor_mesh

    mesh = tensor_mesh(_beyond(contact, width), -graded(height, contact[1], GROWTH[2])[::-1])
    return patch(rename(mesh, axis="x-", bottom="y-", top="y+"), "top", "contact", [contact[-1]])
