"""Scenes without a mesh: Hertz's contact and Cattaneo's on half-spaces, and a rough surface pressed
and sheared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from contactopt.analytic import (
    contact_modulus,
    hertz_point,
    hertz_point_tangential,
    tangential_modulus,
)
from contactopt.checks import check_count, check_number, check_positive
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.scenes.common import RUBBER, UNITS
from contactopt.scenes.rough_surfaces import self_affine
from contactopt.scenes.scene import HalfSpace, Rigid, Scene

WIDE = 1.25  # half side of the square of points, over the contact radius of Hertz


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

    Lengths are in mm, forces in N and stresses in MPa.

    Parameters
    ----------
    radius : Of the sphere.
    material : Of the half-space.
    mu : Friction coefficient.
    force : Total force on the sphere, positive in compression.
    elements : Number of points across the contact radius.

    Returns
    -------
    With Hertz's solution, which is exact for mu = 0.

    Raises
    ------
    InputError : If a size is not positive.
    """
    check_positive(radius=radius, force=force)
    hertz = hertz_point(force, radius, contact_modulus(material))
    return Scene(
        "hertz-half-space",
        Rigid(
            "sphere", gap=lambda x: np.sum(x[:2] ** 2, axis=0) / (2 * radius), force={"z": -force}
        ),
        HalfSpace("half-space", material, _square(WIDE * hertz.half_width, hertz.half_width)),
        mu,
        kind="solid",
        law="coulomb" if mu else "frictionless",
        elements=elements,
        units=UNITS,
        reference=hertz if mu == 0 else None,
    )


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
    Put on at once, the loads give the same answer as one after the other. Lengths are in mm, forces
    in N and stresses in MPa.

    Parameters
    ----------
    radius : Of the sphere.
    material : Of both bodies. With nu = 0 the solution of Cattaneo and Mindlin is exact; otherwise
        slip is not everywhere along the shear.
    mu : Friction coefficient.
    force : Total normal force, positive in compression.
    shear : Total tangential force.
    elements : Number of points across the contact radius.

    Returns
    -------
    With the solution of Cattaneo and Mindlin.

    Raises
    ------
    InputError : If a size is not positive, or the shear is beyond the friction bound.
    """
    check_positive(radius=radius, force=force)
    check_number("shear", shear)
    if abs(shear) >= mu * force:
        raise InputError(
            f"the shear {shear:g} is at least mu times the force, {mu * force:g}: the bodies slide"
            " off."
        )
    modulus = contact_modulus(material, material)
    hertz = hertz_point(force, radius, modulus)
    points = _square(WIDE * hertz.half_width, hertz.half_width)
    reference = hertz
    if shear:
        reference = hertz_point_tangential(
            force, radius, modulus, tangential_modulus(material, material), mu, [shear]
        )
    return Scene(
        "cattaneo-half-space",
        HalfSpace(
            "sphere",
            material,
            points,
            height=lambda x: -np.sum(x**2, axis=0) / (2 * radius),
            force={"x": shear, "z": -force},
        ),
        HalfSpace("flat", material, points),
        mu,
        kind="solid",
        elements=elements,
        units=UNITS,
        reference=reference,
    )


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
    along x.

    rough_sliding() makes the path on which the shift grows until all contacts slip. Lengths are in
    mm, forces in N and stresses in MPa.

    Parameters
    ----------
    points : Number of points along each side of the square.
    length : Of each side.
    hurst, shortest, slope, seed : As for contactopt.scenes.rough_surfaces.self_affine(); by default
        `shortest` is a sixteenth of the length.
    material : Of the half-space.
    mu : Friction coefficient.
    pressure : Mean pressure on the square.
    shift : Displacement of the rough surface along x.
    periodic : Whether surface and tractions repeat themselves beyond the square.

    Returns
    -------
    On a square grid of points.

    Raises
    ------
    InputError : If an argument is out of range.
    """
    check_count("points", points)
    check_positive(length=length, pressure=pressure)
    check_number("shift", shift)
    shortest = length / 16 if shortest is None else shortest
    heights = self_affine(
        (points, points), (length, length), hurst=hurst, shortest=shortest, slope=slope, seed=seed
    )
    ticks = (np.arange(points) + 0.5) * (length / points) - length / 2
    force = -pressure * length**2
    return Scene(
        "rough",
        Rigid(
            "rough surface",
            gap=heights.max() - heights,
            force={"z": force},
            displacement={"x": shift},
        ),
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
    steps : Number of states after the first one.
    shift : Of the last state. By default 1.5 times the shift at which contacts slip everywhere if
        the highest summit is flattened to the mean height: tangential and normal displacements at
        full sliding are about as mu (2 - nu) to 2 (1 - nu) (Ciavarella 1998, Jaeger 1998).
    changes : Arguments of rough().

    Returns
    -------
    The states in their order.
    """
    check_count("steps", steps)
    first = rough(**changes)  # type: ignore[arg-type]
    upper, lower = first.upper, first.lower
    assert isinstance(upper, Rigid) and isinstance(lower, HalfSpace)
    if shift is None:
        nu, mu = (
            lower.material.nu,
            0.0 if callable(first.mu) or first.mu is None else float(np.max(first.mu)),
        )
        shift = 1.5 * mu * (2 - nu) / (2 - 2 * nu) * float(np.mean(upper.gap))  # type: ignore[arg-type]
    at = np.linspace(0.0, shift, steps + 1)
    return tuple(replace(first, upper=replace(upper, displacement={"x": float(x)})) for x in at)


def _square(
    reach: float, radius: float
) -> Callable[[int, float | None], tuple[np.ndarray, np.ndarray]]:
    """Points on a square |x|, |y| < reach about the origin, `elements` of them across the radius."""

    def points(elements: int, zone: float | None) -> tuple[np.ndarray, np.ndarray]:
        half = max(2, int(np.ceil(reach / radius * elements)))
        ticks = (np.arange(-half, half) + 0.5) * (radius / elements)
        return ticks, ticks

    return points
