"""Flat punches: the paper's block on a foundation, and a rigid punch on a half-space."""

from functools import partial
from typing import Any

import numpy as np

from contactopt.analytic import (
    Reference,
    contact_modulus,
    dundurs,
    flat_punch_axisymmetric_friction,
    flat_punch_line,
    flat_punch_line_friction,
)
from contactopt.checks import check_positive
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.meshes.structured import contact_grid, graded, patch, rename, tensor_mesh
from contactopt.scenes.common import GROWTH, KINDS, RUBBER, check_choice, explained, model, one_of
from contactopt.scenes.scene import Part, Plate, Rigid, Scene, Support

EDGE = 1e-3  # first element at the edge of the rigid punch, over its half-width
RATIO = 1.4  # of its neighbouring elements: a mesh for quadratic displacements
# half-space: size of the foundation over the half-width
LARGE = {"plane-strain": 10000.0, "axisymmetric": 1000.0}


@explained
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
    """A block pressed on a foundation by a rigid plate glued to its top.

    Parameters
    ----------
    dim : 2 for plane strain, of which half is modelled; 3 for a square block on a square
        foundation, of which a quarter is modelled
    width, height : of the block [mm]
    foundation_width, foundation_height : of the foundation, which is clamped below [mm]
    rigid : None, 'punch' or 'foundation': that body is rigid

    Returns
    -------
    Scene : 'punch-2d' or 'punch-3d'. In plane strain with a rigid punch it carries the frictionless
        solution for a half-plane
    """
    check_choice("dim", dim, 2, 3)
    check_choice("rigid", rigid, None, "punch", "foundation")
    check_positive(width=width, height=height, depth=depth, force=force)
    check_positive(foundation_width=foundation_width, foundation_height=foundation_height)
    if foundation_width < width:
        raise InputError(
            f"the foundation ({foundation_width:g} wide) must"
            f" be at least as wide as the punch ({width:g})."
        )
    a, up = width / 2, "xyz"[dim - 1]
    punch = partial(_block, dim, a, a, height)
    foundation = partial(_block, dim, a, foundation_width / 2, -foundation_height)
    symmetry = tuple(Support(f"symmetry {c}", {c: 0.0}) for c in "xy"[: dim - 1])
    load = {up: -force}
    top = Part("punch", punch, upper, symmetry, (Plate("top", load),))
    bottom = Part("foundation", foundation, lower, (*symmetry, Support("bottom")))
    return Scene(
        f"punch-{dim}d",
        one_of(rigid, Rigid("punch", force=load), top),
        one_of(rigid, Rigid("foundation"), bottom),
        mu,
        elements=elements,
        **model(KINDS[dim], depth, 2 ** (dim - 1), bilateral),
        reference=flat_punch_line(force / depth, a) if dim == 2 and rigid == "punch" else None,
    )


def _block(
    dim: int, a: float, half_width: float, height: float, elements: int, zone: float | None
) -> Any:
    """A block above a contact of half-width a, or with a negative height beneath it."""
    rise = graded(abs(height), a / elements, GROWTH[dim])
    grid = contact_grid(a, elements, half_width, GROWTH[dim])
    mesh = tensor_mesh(*[grid] * (dim - 1), rise if height > 0 else -rise[::-1])
    low, high = (f"{'xyz'[dim - 1]}{side}" for side in "-+")
    mesh = rename(mesh, top=high, **{f"symmetry {c}": f"{c}-" for c in "xy"[: dim - 1]})
    if height > 0:
        return rename(mesh, contact=low)
    return patch(rename(mesh, bottom=low), "top", "contact", [a] * (dim - 1))


@explained
def rigid_punch(
    kind: str = "plane-strain",
    *,
    half_width: float = 20.0,
    foundation: float | None = None,
    depth: float = 40.0,
    lower: Material = RUBBER,
    mu: float = 0.3,
    force: float = 100.0,
    elements: int = 64,
    bilateral: bool = False,
) -> Scene:
    """A rigid flat punch, strip or disc, pressed on a half-space: Spence's problem with friction.

    The solution is self-similar as the load grows, so that one static step from the unloaded state
    is exact. The half-space is a block that is clamped below. Its elements shrink to 1e-3 of the
    half-width towards the edge of the punch, where the tractions are singular, and displacements
    are quadratic. With linear ones and as many unknowns, the stick zone has three times the error
    (reports/accuracy/report.md).

    Parameters
    ----------
    kind : 'plane-strain' for a strip, 'axisymmetric' for a disc
    half_width : of the strip, or radius of the disc [mm]
    foundation : height of the block and its width from the axis. By default 10,000 half-widths in
        plane strain, where the size stretches the contact by a strain of about half_width /
        foundation, and 1,000 radii of a disc, which makes the approach .2 % too small

    Returns
    -------
    Scene : 'rigid-punch-2d' or 'rigid-punch-axisymmetric', with the exact solution unless contact
        is bilateral
    """
    check_choice("kind", kind, *LARGE)
    size = LARGE[kind] * half_width if foundation is None else foundation
    check_positive(half_width=half_width, foundation=size, depth=depth, force=force)
    if size < 2 * half_width:
        raise InputError(
            f"the foundation ({size:g}) must be at least two half-widths large, {2 * half_width:g}."
        )
    plane = kind == "plane-strain"
    across, up = ("x", "y") if plane else ("r", "z")
    mesh = partial(_half_space, half_width, size)
    return Scene(
        "rigid-punch-2d" if plane else "rigid-punch-axisymmetric",
        Rigid("punch", force={up: -force}),
        Part("foundation", mesh, lower, (Support("axis", {across: 0.0}), Support("bottom"))),
        mu,
        elements=elements,
        degree=2,
        **model(kind, depth, 2 if plane else 1, bilateral),
        reference=None if bilateral else _exact(kind, force, half_width, depth, lower, mu),
    )


def _exact(
    kind: str, force: float, half_width: float, depth: float, lower: Material, mu: float
) -> Reference:
    beta = dundurs(None, lower)[1]
    if kind == "plane-strain":
        return flat_punch_line_friction(force / depth, half_width, mu, beta)
    return flat_punch_axisymmetric_friction(force, half_width, contact_modulus(lower), mu, beta)


def _half_space(half_width: float, size: float, elements: int, zone: float | None) -> Any:
    """The block under the rigid punch."""
    first = EDGE * half_width
    contact = _towards_edge(half_width, elements, first)
    beyond = half_width + graded(size - half_width, first, RATIO)[1:]
    block = tensor_mesh(np.concatenate([contact, beyond]), -graded(size, first, RATIO)[::-1])
    return patch(rename(block, axis="x-", bottom="y-", top="y+"), "top", "contact", [half_width])


def _towards_edge(half_width: float, elements: int, first: float) -> np.ndarray:
    """Grid from 0 to half_width: even at first, falling to `first` at the edge."""
    h = half_width / elements
    steps = first * RATIO ** np.arange(max(0.0, np.floor(np.log(h / first) / np.log(RATIO)) + 1))
    steps = steps[np.cumsum(steps) < half_width - h / 2]  # leaves room for an even one
    towards = half_width - np.append(0.0, np.cumsum(steps))[::-1]
    even = np.linspace(0.0, towards[0], int(np.ceil(towards[0] / h - 1e-9)) + 1)
    return np.concatenate([even[:-1], towards])
