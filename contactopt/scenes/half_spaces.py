"""Scenes without a mesh: Hertz's contact and Cattaneo's on half-spaces, and a rough surface pressed
and sheared.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from contactopt.analytic import (
    contact_modulus,
    hertz_point,
    hertz_point_tangential,
    tangential_modulus,
)
from contactopt.checks import check_count, check_number, check_positive
from contactopt.material import Material
from contactopt.scenes.common import RUBBER, UNITS, check_shear, explained, upper_of
from contactopt.scenes.rough_surfaces import self_affine
from contactopt.scenes.scene import HalfSpace, Rigid, Scene

WIDE = 1.25  # half side of the square of points, over the contact radius of Hertz


@explained
def hertz_half_space(
    *,
    radius: float = 400.0,
    material: Material = RUBBER,
    mu: float = 0.0,
    force: float = 100.0,
    elements: int = 48,
) -> Scene:
    """A rigid sphere, in Hertz's approximation a paraboloid, pressed on a half-space without a
    mesh.

    Parameters
    ----------
    radius : of the sphere [mm]
    elements : number of points across the contact radius

    Returns
    -------
    Scene : 'hertz-half-space', with Hertz's solution, which is exact for mu = 0
    """
    check_positive(radius=radius, force=force)
    hertz = hertz_point(force, radius, contact_modulus(material))
    points = _square(WIDE * hertz.half_width, hertz.half_width)
    return Scene(
        "hertz-half-space",
        Rigid("sphere", gap=_paraboloid(radius), force={"z": -force}),
        HalfSpace("half-space", material, points),
        mu,
        kind="solid",
        law="coulomb" if mu else "frictionless",
        elements=elements,
        units=UNITS,
        reference=hertz if mu == 0 else None,
    )


@explained
def cattaneo_half_space(
    *,
    radius: float = 400.0,
    material: Material = RUBBER,
    mu: float = 0.5,
    force: float = 100.0,
    shear: float = 25.0,
    elements: int = 32,
) -> Scene:
    """A sphere pressed on a flat body of the same material, both half-spaces without a mesh, then
    pushed sideways.

    Normal and tangential tractions do not disturb each other because the materials are the same.
    Put on at once, the loads give the same answer as one after the other.

    Parameters
    ----------
    radius : of the sphere [mm]
    material : of both bodies. With nu = 0 the solution of Cattaneo and Mindlin is exact; otherwise
        slip is not everywhere along the shear
    shear : total tangential force [N]
    elements : number of points across the contact radius

    Returns
    -------
    Scene : 'cattaneo-half-space', with the solution of Cattaneo and Mindlin
    """
    check_positive(radius=radius, force=force)
    check_number("shear", shear)
    check_shear(shear, mu, force)
    modulus = contact_modulus(material, material)
    hertz = hertz_point(force, radius, modulus)
    points = _square(WIDE * hertz.half_width, hertz.half_width)
    paraboloid, reference = _paraboloid(radius), hertz
    if shear:
        along = tangential_modulus(material, material)
        reference = hertz_point_tangential(force, radius, modulus, along, mu, [shear])
    return Scene(
        "cattaneo-half-space",
        HalfSpace(
            "sphere",
            material,
            points,
            height=lambda x: -paraboloid(x),
            force={"x": shear, "z": -force},
        ),
        HalfSpace("flat", material, points),
        mu,
        kind="solid",
        elements=elements,
        units=UNITS,
        reference=reference,
    )


@explained
def rough(
    *,
    points: int = 128,
    length: float = 10.0,
    hurst: float = 0.8,
    shortest: float | None = None,
    slope: float = 0.1,
    seed: int = 0,
    material: Material = RUBBER,
    mu: float = 0.3,
    pressure: float = 0.02,
    shift: float = 0.0,
    periodic: bool = True,
) -> Scene:
    """A rigid self-affine rough surface pressed on a half-space by a mean pressure, then displaced
    along x: 'rough'.

    rough_sliding() makes the path on which the shift grows until all contacts slip.

    Parameters
    ----------
    points : number of points along each side of the square
    length : of each side [mm]
    hurst, shortest, slope, seed : as for contactopt.scenes.rough_surfaces.self_affine(); by default
        `shortest` is a sixteenth of the length
    pressure : mean pressure on the square [MPa]
    shift : displacement of the rough surface along x [mm]
    periodic : whether surface and tractions repeat themselves beyond the square

    Returns
    -------
    Scene : on a square grid of points
    """
    check_count("points", points)
    check_positive(length=length, pressure=pressure)
    check_number("shift", shift)
    shortest = length / 16 if shortest is None else shortest
    heights = self_affine(
        (points, points), (length, length), hurst=hurst, shortest=shortest, slope=slope, seed=seed
    )
    ticks = (np.arange(points) + 0.5) * (length / points) - length / 2
    force = {"z": -pressure * length**2}
    return Scene(
        "rough",
        Rigid("rough surface", None, heights.max() - heights, force, {"x": shift}),
        HalfSpace("half-space", material, (ticks, ticks), periodic=periodic),
        mu,
        kind="solid",
        law="coulomb" if mu else "frictionless",
        units=UNITS,
    )


def rough_sliding(
    *, steps: int = 6, shift: float | None = None, **changes: object
) -> tuple[Scene, ...]:
    """The states of rough(): pressed, then displaced along x in equal steps.

    Parameters
    ----------
    steps : number of states after the first one
    shift : of the last state. By default 1.5 times the shift at which contacts slip everywhere if
        the highest summit is flattened to the mean height: tangential and normal displacements at
        full sliding are about as mu (2 - nu) to 2 (1 - nu) (Ciavarella 1998, Jaeger 1998)
    changes : arguments of rough()

    Returns
    -------
    tuple of Scene : the states in their order
    """
    check_count("steps", steps)
    first = rough(**changes)  # type: ignore[arg-type]
    if shift is None:
        given: Any = first.mu
        surface: Any = first.upper
        half_space: Any = first.lower
        mu, nu = 0.0 if callable(given) else float(np.max(given)), half_space.material.nu
        shift = 1.5 * mu * (2 - nu) / (2 - 2 * nu) * float(np.mean(surface.gap))
    at = np.linspace(0.0, shift, steps + 1)
    return tuple(upper_of(first, displacement={"x": float(x)}) for x in at)


def _paraboloid(radius: float) -> Callable[[np.ndarray], np.ndarray]:
    """The height of a sphere's surface over its lowest point, at points (dim, k)."""
    return lambda x: np.sum(x[:2] ** 2, axis=0) / (2 * radius)


def _square(
    reach: float, radius: float
) -> Callable[[int, float | None], tuple[np.ndarray, np.ndarray]]:
    """Points on a square |x|, |y| < reach about the origin, `elements` across the radius."""

    def points(elements: int, zone: float | None) -> tuple[np.ndarray, np.ndarray]:
        half = max(2, int(np.ceil(reach / radius * elements)))
        ticks = (np.arange(-half, half) + 0.5) * (radius / elements)
        return ticks, ticks

    return points
