"""Tangential loading: a round body pressed on a flat one of the same material, then pushed to and
fro.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from contactopt.analytic import (
    Reference,
    contact_modulus,
    hertz_line,
    hertz_line_tangential,
    hertz_point,
    hertz_point_tangential,
    tangential_modulus,
)
from contactopt.checks import check_count, check_number, check_positive
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.scenes.common import MARGIN, RUBBER, UNITS
from contactopt.scenes.scene import Part, Plate, Scene, Support

RADIUS = {2: 4000.0, 3: 10000.0}  # so that contact is small: a / R = .005 and .007
ELEMENTS = {2: 32, 3: 20}
FINE = 2.0  # by how much smaller the elements at the edges are
SECTORS = 3  # of an eighth of the circle, in 3D
GROWTH = {2: 1.2, 3: 1.4}
LARGE = {2: 50.0, 3: 8.0}  # size of the bodies over the contact half-width


def cattaneo(
    dim: int = 2,
    *,
    radius: float | None = None,
    size: float | None = None,
    depth: float = 400.0,
    material: Material | None = None,
    mu: float = 0.5,
    force: float = 100.0,
    shear: float = 40.0,
    elements: int | None = None,
) -> Scene:
    """A cylinder or sphere pressed on a flat body of the same material, then pushed sideways.

    The upper body hangs on a plate that carries both loads and does not tilt, and the lower one is
    clamped below. Their meshes are mirror images but for the round surface, a parabola, so that
    normal and tangential loads hardly disturb each other. Put on at once, the loads give the same
    answer as one after the other, because slip never turns back. Unloading needs a path:
    shear_cycle(). Lengths are in mm, forces in N and Young's moduli in MPa.

    Parameters
    ----------
    dim : 2 for plane strain; 3 for a sphere, of which the half with y >= 0 is modelled.
    radius : Of the round body. By default it is so large that the contact is small.
    size : Height and half-width of each body. By default 50 contact half-widths, or 8 in 3D, which
        disturbs the tractions less than the mesh does. The shift depends on the size; the energy
        lost in a cycle does not.
    depth : Length of the cylinder along its axis.
    material : Of both bodies. In 3D it has nu = 0 by default, for which the tractions of Cattaneo
        and Mindlin are exact.
    mu : Friction coefficient.
    force : Total normal force, positive in compression.
    shear : Total tangential force.
    elements : Number of elements across the contact half-width.

    Returns
    -------
    Named 'cattaneo-2d' or 'cattaneo-3d', with the solution of Cattaneo and Mindlin.

    Raises
    ------
    InputError : If a size is not positive, the contact would be too wide for the bodies, or the
        shear is beyond the friction bound.
    """
    if dim not in (2, 3):
        raise InputError(f"dim must be 2 or 3; got {dim!r}.")
    radius = RADIUS[dim] if radius is None else radius
    material = (RUBBER if dim == 2 else Material(RUBBER.E, 0.0)) if material is None else material
    check_positive(radius=radius, depth=depth, force=force)
    check_number("shear", shear)
    if shear != 0 and abs(shear) >= mu * force:
        raise InputError(
            f"the shear {shear:g} is at least mu times the force, {mu * force:g}: the bodies slide"
            " off."
        )
    modulus = contact_modulus(material, material)
    hertz = (
        hertz_line(force / depth, radius, modulus)
        if dim == 2
        else hertz_point(force, radius, modulus)
    )
    a, growth = hertz.half_width, GROWTH[dim]
    size = LARGE[dim] * a if size is None else size
    check_positive(size=size)
    if size < 2 * a or a > radius / 4:
        raise InputError(
            f"the contact half-width would be {a:.3g}: too much for bodies of radius {radius:g} and"
            f" size {size:g}; lower the force or take stiffer or larger bodies."
        )

    reference = _exact(dim, force, radius, depth, material, mu, [shear]) if shear else hertz
    stick, up = reference.stick_half_width or a, "xyz"[dim - 1]

    def mesh(elements: int, sign: float):  # type: ignore[no-untyped-def]
        from contactopt.meshes.discs import extrude, half_disc
        from contactopt.meshes.structured import graded, tensor_mesh

        contact = _towards_edges(stick, a, elements, growth)
        reach, h = contact[-1], a / elements
        half = np.concatenate(
            [contact, reach + graded(size - reach, reach - contact[-2], growth)[1:]]
        )
        rise = graded(size, h, growth)
        rise = rise if sign > 0 else -rise[::-1]
        if dim == 2:
            body = tensor_mesh(np.concatenate([-half[:0:-1], half]), rise)
        else:
            body = extrude(*half_disc(half, SECTORS), rise)
        near = 1e-9 * size
        body = body.with_boundaries(
            {
                "contact": lambda x: (x[-1] == 0) & (np.linalg.norm(x[:-1], axis=0) < reach),
                "far": lambda x: np.abs(np.abs(x[-1]) - size) < near,
                "symmetry": lambda x: np.abs(x[1]) < near,
            }
        )

        def raised(x: np.ndarray) -> np.ndarray:
            square = np.minimum(np.sum(x[:-1] ** 2, axis=0), reach**2)
            return np.asarray(x[-1] + square / (2 * radius) * (1 - x[-1] / size))

        return body.morphed(*[None] * (dim - 1), raised) if sign > 0 else body

    symmetry = (Support("symmetry", {"y": 0.0}),) if dim == 3 else ()

    def paraboloid(x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[:-1], np.sum(x[:-1] ** 2, axis=0, keepdims=True) / (2 * radius)])

    plate = Plate("far", {"x": shear, up: -force})
    return Scene(
        f"cattaneo-{dim}d",
        Part(
            "upper",
            lambda elements, zone: mesh(elements, 1.0),
            material,
            symmetry,
            (plate,),
            curve=paraboloid,
        ),
        Part(
            "lower",
            lambda elements, zone: mesh(elements, -1.0),
            material,
            (*symmetry, Support("far")),
        ),
        mu,
        kind="plane-strain" if dim == 2 else "solid",
        thickness=depth if dim == 2 else 1.0,
        copies=dim - 1,
        elements=ELEMENTS[dim] if elements is None else elements,
        units=UNITS,
        reference=reference,
    )


def shear_cycle(dim: int = 2, *, steps: int = 8, **changes: object) -> tuple[Scene, ...]:
    """The states of cattaneo() under a cycle of shear: the normal force alone, shear up to its
    value, to the negative
    of it, and back.

    Parameters
    ----------
    dim : 2 or 3, as for cattaneo().
    steps : Number of states from zero to the largest shear. The whole path has 5 steps + 1 states.
    changes : Arguments of cattaneo().

    Returns
    -------
    The states in their order.
    """
    check_count("steps", steps)
    scene = cattaneo(dim, **changes)  # type: ignore[arg-type]
    up = np.arange(steps + 1) / steps
    share = np.concatenate([up, up[-2::-1], -up[1:], -up[-2::-1], up[1:]])
    return tuple(_sheared(scene, float(x)) for x in share)


def _sheared(scene: Scene, share: float) -> Scene:
    """The scene at a share of its shear."""
    assert isinstance(scene.upper, Part) and isinstance(scene.upper.loads[0], Plate)
    plate = scene.upper.loads[0]
    loads = (replace(plate, force={**plate.force, "x": share * plate.force["x"]}),)
    return replace(scene, upper=replace(scene.upper, loads=loads))


def _exact(
    dim: int,
    force: float,
    radius: float,
    depth: float,
    material: Material,
    mu: float,
    shears: list[float],
) -> Reference:
    modulus = contact_modulus(material, material)
    if dim == 2:
        return hertz_line_tangential(
            force / depth, radius, modulus, mu, [shear / depth for shear in shears]
        )
    return hertz_point_tangential(
        force, radius, modulus, tangential_modulus(material, material), mu, shears
    )


def _towards_edges(stick: float, half_width: float, elements: int, growth: float) -> np.ndarray:
    """Grid of the candidate contact nodes, finer at the edges of stick and contact, where the
    tractions are steep.

    Elements of half_width / elements but for the edges; a stick zone too small for that has no
    grading of its own.
    """
    largest = half_width / elements

    def fine_end(length: float) -> np.ndarray:
        """Grid from 0 to length, finest at 0."""
        sizes = np.minimum(largest / FINE * growth ** np.arange(8 * elements), largest)
        grid = np.concatenate([[0.0], np.cumsum(sizes)])
        cells = max(1, int(np.searchsorted(grid, length * (1 - 1e-9))))
        return np.asarray(grid[: cells + 1] * (length / grid[cells]))

    band = largest / (growth - 1)
    beyond = half_width + fine_end((MARGIN - 1) * half_width)
    if not 2 * SECTORS * largest + band < stick < half_width - largest:
        return np.concatenate([half_width - fine_end(half_width)[:0:-1], beyond])
    middle = fine_end((half_width - stick) / 2)
    return np.concatenate(
        [stick - fine_end(stick)[:0:-1], stick + middle, half_width - middle[-2:0:-1], beyond]
    )
