"""Round bodies: sphere and cylinder on a foundation, a rigid sphere on a half-space under growing
load.
"""

from math import sqrt
from typing import Any

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
from contactopt.meshes.structured import graded, half_sphere_section, patch, rename, tensor_mesh
from contactopt.scenes.common import (
    GROWTH,
    MARGIN,
    RUBBER,
    check_choice,
    explained,
    model,
    one_of,
    upper_of,
)
from contactopt.scenes.scene import Part, Plate, Rigid, Scene, Support

LARGE = 400.0  # half-space: size of the foundation over the contact radius


@explained
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

    The first contact zone is wider than that of Hertz, and the zone loop (contactopt.solving.zone)
    finds its edge.

    Parameters
    ----------
    radius : of the sphere [mm]
    foundation_radius, foundation_height : of the cylinder on which it is pressed, which is clamped
        below [mm]
    elements : number of elements across the contact radius
    rigid : None, 'sphere' or 'foundation': that body is rigid

    Returns
    -------
    Scene : 'sphere', with Hertz's solution for half-spaces
    """
    check_positive(radius=radius, force=force)
    check_positive(foundation_radius=foundation_radius, foundation_height=foundation_height)
    hertz = hertz_point(force, radius, _modulus("sphere", rigid, upper, lower))
    size = radius, foundation_radius, foundation_height
    load = Plate("top", {"z": -force})
    return Scene(
        "sphere",
        *_round_bodies("sphere", rigid, hertz, size, (upper, lower), load),
        mu,
        elements=elements,
        zone=MARGIN * hertz.half_width,
        **model("axisymmetric", bilateral=bilateral),
        reference=hertz,
    )


@explained
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
    strain, of which half is modelled.

    The first contact zone is found as for the sphere.

    Parameters
    ----------
    radius : of the cylinder [mm]
    foundation_width, foundation_height : of the foundation, which is clamped below [mm]
    rigid : None, 'cylinder' or 'foundation': that body is rigid

    Returns
    -------
    Scene : 'cylinder-2d', with Hertz's solution for half-planes
    """
    check_positive(radius=radius, depth=depth, force=force)
    check_positive(foundation_width=foundation_width, foundation_height=foundation_height)
    hertz = hertz_line(force / depth, radius, _modulus("cylinder", rigid, upper, lower))
    size = radius, foundation_width / 2, foundation_height
    load = Plate("top", {"y": -force})
    return Scene(
        "cylinder-2d",
        *_round_bodies("cylinder", rigid, hertz, size, (upper, lower), load),
        mu,
        elements=elements,
        zone=MARGIN * hertz.half_width,
        **model("plane-strain", depth, 2, bilateral),
        reference=hertz,
    )


@explained
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
    clamped below.

    Parameters
    ----------
    radius : of the sphere [mm]
    foundation : height of the block and its width from the axis. By default 400 contact radii,
        which makes the approach .4 % too small
    elements : number of elements across the contact radius

    Returns
    -------
    Scene : 'hertz-dissimilar', with the exact solution of the whole path
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

    def mesh(elements: int, zone: float | None) -> Any:
        return _foundation_mesh(_candidates(elements, zone or hertz.half_width), size, size)

    axis = Support("axis", {"r": 0.0})
    return Scene(
        "hertz-dissimilar",
        Rigid("sphere", (0.0, 1.0), lambda x: x[0] ** 2 / (2 * radius), {"z": -force}),
        Part("foundation", mesh, lower, (axis, Support("bottom"))),
        mu,
        elements=elements,
        zone=hertz.half_width,
        **model("axisymmetric"),
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
    steps : number of states
    changes : arguments of indentation(), for the last state

    Returns
    -------
    tuple of Scene : the states in their order
    """
    check_count("steps", steps)
    last = indentation(**changes)  # type: ignore[arg-type]
    sphere: Any = last.upper
    forces = sphere.force["z"] * (np.arange(1, steps + 1) / steps) ** 3  # a ~ P^(1/3)
    return tuple(upper_of(last, force={"z": float(force)}) for force in forces)


def _modulus(name: str, rigid: str | None, upper: Material, lower: Material) -> float:
    check_choice("rigid", rigid, None, name, "foundation")
    above, below = rigid != name, rigid != "foundation"
    return contact_modulus(upper if above else None, lower if below else None)


def _round_bodies(
    name: str,
    rigid: str | None,
    hertz: Reference,
    size: tuple[float, float, float],
    materials: tuple[Material, Material],
    load: Plate,
) -> tuple[Part | Rigid, Part | Rigid]:
    """Half disc and foundation, half as wide and high as given, and the load from above."""
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

    def upper_mesh(elements: int, zone: float | None) -> Any:
        contact = candidates(elements, zone)
        grid = _beyond(contact, radius / sqrt(2))
        mesh = half_sphere_section(radius, grid, graded(radius, grid[1], GROWTH[2]) / radius)
        return patch(mesh, "arc", "contact", [contact[-1]])

    def lower_mesh(elements: int, zone: float | None) -> Any:
        return _foundation_mesh(candidates(elements, zone), width, height)

    def gap(x: np.ndarray) -> np.ndarray:
        return radius - np.sqrt(radius**2 - np.minimum(x[0], radius) ** 2)

    def arc(x: np.ndarray) -> np.ndarray:
        return np.stack([x[0], gap(x)])

    axis = Support("axis", {"r" if "z" in load.force else "x": 0.0})
    top = Part(name, upper_mesh, materials[0], (axis,), (load,), curve=arc)
    bottom = Part("foundation", lower_mesh, materials[1], (axis, Support("bottom")))
    return (
        one_of(rigid, Rigid(name, gap=gap, force=load.force), top),
        one_of(rigid, Rigid("foundation", normal=(0.0, 1.0), gap=lambda x: x[1]), bottom),
    )


def _candidates(elements: int, zone: float) -> np.ndarray:
    """Even places of the candidate contact nodes: one at the zone's edge, and a margin beyond."""
    return zone / elements * np.arange(elements + int(np.ceil((MARGIN - 1) * elements)) + 1)


def _beyond(grid: np.ndarray, length: float) -> np.ndarray:
    first = grid[1] * GROWTH[2]
    return np.concatenate([grid, grid[-1] + graded(length - grid[-1], first, GROWTH[2])[1:]])


def _foundation_mesh(contact: np.ndarray, width: float, height: float) -> Any:
    """Half of a foundation, the contact nodes at the given positions on its top."""
    mesh = tensor_mesh(_beyond(contact, width), -graded(height, contact[1], GROWTH[2])[::-1])
    return patch(rename(mesh, axis="x-", bottom="y-", top="y+"), "top", "contact", [contact[-1]])
