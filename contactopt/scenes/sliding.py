"""Tangential loading: a round body pressed on a flat one of the same material, then pushed to and
fro.
"""

from functools import partial
from typing import Any

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
from contactopt.checks import check_count, check_positive
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.meshes.discs import extrude, half_disc
from contactopt.meshes.structured import graded, tensor_mesh
from contactopt.scenes.common import (
    KINDS,
    MARGIN,
    RUBBER,
    check_choice,
    check_shear,
    explained,
    model,
    upper_of,
)
from contactopt.scenes.scene import Part, Plate, Scene, Support

RADIUS = {2: 4000.0, 3: 10000.0}  # so that contact is small: a / R = .005 and .007
ELEMENTS = {2: 32, 3: 20}
FINE = 2.0  # by how much smaller the elements at the edges are
SECTORS = 3  # of an eighth of the circle, in 3D
GROWTH = {2: 1.2, 3: 1.4}
LARGE = {2: 50.0, 3: 8.0}  # size of the bodies over the contact half-width


@explained
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
    clamped below. Their meshes are mirror images but for the round surface, so that normal and
    tangential loads hardly disturb each other. Put on at once, the loads give the answer of one
    after the other, because slip never turns back. Unloading needs a path: shear_cycle().

    Parameters
    ----------
    dim : 2 for plane strain; 3 for a sphere, of which the half with y >= 0 is modelled
    radius : of the round body [mm]. By default it is so large that the contact is small
    size : height and half-width of each body [mm]. By default 50 contact half-widths, or 8 in 3D,
        which disturbs the tractions less than the mesh does. The shift depends on the size; the
        energy lost in a cycle does not
    material : of both bodies. In 3D it has nu = 0 by default, for which the tractions of Cattaneo
        and Mindlin are exact
    shear : total tangential force [N]

    Returns
    -------
    Scene : 'cattaneo-2d' or 'cattaneo-3d', with the solution of Cattaneo and Mindlin
    """
    check_choice("dim", dim, 2, 3)
    radius = RADIUS[dim] if radius is None else radius
    material = (RUBBER if dim == 2 else Material(RUBBER.E, 0.0)) if material is None else material
    check_positive(radius=radius, depth=depth, force=force)
    check_shear(shear, mu, force)
    exact = _exact(force, radius, depth if dim == 2 else None, material, mu, shear)
    a, up = exact.half_width, "xyz"[dim - 1]
    size = LARGE[dim] * a if size is None else size
    check_positive(size=size)
    if size < 2 * a or a > radius / 4:
        raise InputError(
            f"the contact half-width would be {a:.3g}: too much for bodies of radius {radius:g} and"
            f" size {size:g}; lower the force or take stiffer or larger bodies."
        )
    mesh, curve = partial(_block, exact, dim, size), partial(_paraboloid, radius)
    symmetry = (Support("symmetry", {"y": 0.0}),) if dim == 3 else ()
    plate = Plate("far", {"x": shear, up: -force})
    return Scene(
        f"cattaneo-{dim}d",
        Part("upper", partial(mesh, radius), material, symmetry, (plate,), curve=curve),
        Part("lower", partial(mesh, None), material, (*symmetry, Support("far"))),
        mu,
        elements=ELEMENTS[dim] if elements is None else elements,
        **model(KINDS[dim], depth, dim - 1),
        reference=exact,
    )


def shear_cycle(dim: int = 2, *, steps: int = 8, **changes: object) -> tuple[Scene, ...]:
    """The states of cattaneo() under a cycle of shear: the normal force alone, shear up to its
    value, to the negative of it, and back.

    Parameters
    ----------
    dim : 2 or 3, as for cattaneo()
    steps : number of states from zero to the largest shear. The whole path has 5 steps + 1 states
    changes : arguments of cattaneo()

    Returns
    -------
    tuple of Scene : the states in their order
    """
    check_count("steps", steps)
    scene = cattaneo(dim, **changes)  # type: ignore[arg-type]
    up = np.arange(steps + 1) / steps
    share = np.concatenate([up, up[-2::-1], -up[1:], -up[-2::-1], up[1:]])
    return tuple(_sheared(scene, float(x)) for x in share)


def _sheared(scene: Scene, share: float) -> Scene:
    """The scene at a share of its shear."""
    upper: Any = scene.upper
    force = upper.loads[0].force
    return upper_of(scene, loads=(Plate("far", {**force, "x": share * force["x"]}),))


def _exact(
    force: float, radius: float, depth: float | None, material: Material, mu: float, shear: float
) -> Reference:
    """The solution for cylinders of a depth, or for spheres, pressed and then sheared."""
    modulus = contact_modulus(material, material)
    if depth is not None:
        if not shear:
            return hertz_line(force / depth, radius, modulus)
        return hertz_line_tangential(force / depth, radius, modulus, mu, [shear / depth])
    if not shear:
        return hertz_point(force, radius, modulus)
    along = tangential_modulus(material, material)
    return hertz_point_tangential(force, radius, modulus, along, mu, [shear])


def _paraboloid(radius: float, x: np.ndarray) -> np.ndarray:
    """Points (dim, k) moved onto the round surface."""
    return np.concatenate([x[:-1], np.sum(x[:-1] ** 2, axis=0, keepdims=True) / (2 * radius)])


def _block(
    exact: Reference, dim: int, size: float, radius: float | None, elements: int, zone: float | None
) -> Any:
    """The mesh of the upper body with its radius, or of the lower one, which has none."""
    a, growth = exact.half_width, GROWTH[dim]
    contact = _towards_edges(exact.stick_half_width or a, a, elements, growth)
    reach = contact[-1]
    half = np.concatenate([contact, reach + graded(size - reach, reach - contact[-2], growth)[1:]])
    rise = graded(size, a / elements, growth)
    rise = -rise[::-1] if radius is None else rise
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
    if radius is None:
        return body

    def raised(x: np.ndarray) -> np.ndarray:
        square = np.minimum(np.sum(x[:-1] ** 2, axis=0), reach**2)
        return np.asarray(x[-1] + square / (2 * radius) * (1 - x[-1] / size))

    return body.morphed(*[None] * (dim - 1), raised)


def _towards_edges(stick: float, half_width: float, elements: int, growth: float) -> np.ndarray:
    """Grid of candidate contacts, finer at the edges of stick and contact."""
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
