"""Flat punches: the paper's block on a foundation, and a rigid punch on a half-space."""

from __future__ import annotations

import numpy as np

from contactopt.analytic import (
    Reference,
    contact_modulus,
    dundurs,
    flat_punch_axisymmetric_friction,
    flat_punch_line,
    flat_punch_line_friction,
)
from contactopt.checks import check_number, check_positive
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.scenes.common import GROWTH, RUBBER, UNITS
from contactopt.scenes.scene import Part, Plate, Rigid, Scene, Support

EDGE = 1e-3  # first element at the edge of the rigid punch, over its half-width
RATIO = 1.4  # of its neighbouring elements: a mesh for quadratic displacements
# half-space: size of the foundation over the half-width
LARGE = {"plane-strain": 10000.0, "axisymmetric": 1000.0}


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

    The foundation is clamped below.

    Lengths are in mm, forces in N and Young's moduli in MPa.

    Parameters
    ----------
    dim : 2 for plane strain, of which half is modelled; 3 for a square block on a square
        foundation, of which a quarter is modelled.
    width, height : Of the block.
    foundation_width, foundation_height : Of the foundation.
    depth : Length of both bodies along the direction without strain, in plane strain.
    upper, lower : Materials of the block and of the foundation.
    mu : Friction coefficient.
    force : Total force on the plate, positive in compression.
    elements : Number of elements across the contact half-width.
    rigid : None, 'punch' or 'foundation': that body is rigid.
    bilateral : Whether contact cannot open.

    Returns
    -------
    Named 'punch-2d' or 'punch-3d'. In plane strain with a rigid punch it carries the frictionless
    solution for a half-plane.

    Raises
    ------
    InputError : If a size is not positive, the foundation is narrower than the block, or a choice
        is unknown.
    """
    if dim not in (2, 3):
        raise InputError(f"dim must be 2 or 3; got {dim!r}.")
    if rigid not in (None, "punch", "foundation"):
        raise InputError(f"rigid must be None, 'punch' or 'foundation'; got {rigid!r}.")
    check_positive(
        width=width,
        height=height,
        foundation_width=foundation_width,
        foundation_height=foundation_height,
        depth=depth,
    )
    check_number("force", force, low=0.0)
    if foundation_width < width:
        raise InputError(
            f"the foundation ({foundation_width:g} wide) must be at least as wide as the punch"
            f" ({width:g})."
        )
    a, up, growth = width / 2, "xyz"[dim - 1], GROWTH[dim]

    def punch_mesh(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        from contactopt.meshes.structured import contact_grid, graded, rename, tensor_mesh

        rise = graded(height, a / elements, growth)
        across = contact_grid(a, elements, a, growth)
        mesh = tensor_mesh(*[across] * (dim - 1), rise)
        return rename(
            mesh,
            contact=f"{up}-",
            top=f"{up}+",
            **{f"symmetry {c}": f"{c}-" for c in "xy"[: dim - 1]},
        )

    def foundation_mesh(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        from contactopt.meshes.structured import contact_grid, graded, patch, rename, tensor_mesh

        depth_grid = -graded(foundation_height, a / elements, growth)[::-1]
        across = contact_grid(a, elements, foundation_width / 2, growth)
        mesh = tensor_mesh(*[across] * (dim - 1), depth_grid)
        mesh = rename(
            mesh,
            top=f"{up}+",
            bottom=f"{up}-",
            **{f"symmetry {c}": f"{c}-" for c in "xy"[: dim - 1]},
        )
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
        law="bilateral" if bilateral else "coulomb",
        elements=elements,
        units=UNITS,
        reference=flat_punch_line(force / depth, a) if dim == 2 and rigid == "punch" else None,
    )


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
    """A rigid flat punch, strip or disc, pressed on a half-space.

    This is Spence's problem where friction acts.

    The solution is self-similar as the load grows, so that one static step from the unloaded state
    is exact. The half-space is a block that is clamped below. Its elements shrink to 1e-3 of the
    half-width towards the edge of the punch, where the tractions are singular, and displacements
    are quadratic. With linear ones and as many unknowns, the stick zone has three times the error
    (reports/accuracy/report.md). Lengths are in mm, forces in N and Young's moduli in MPa.

    Parameters
    ----------
    kind : 'plane-strain' for a strip, 'axisymmetric' for a disc.
    half_width : Of the strip, or radius of the disc.
    foundation : Height of the block and its width from the axis. By default 10,000 half-widths in
        plane strain, where the size stretches the contact by a strain of about half_width /
        foundation, and 1,000 radii of a disc, which makes the approach .2 % too small.
    depth : Length of the strip.
    lower : Material of the half-space.
    mu : Friction coefficient.
    force : Total force on the punch, positive in compression.
    elements : Number of elements across the half-width.
    bilateral : Whether contact cannot open.

    Returns
    -------
    Named 'rigid-punch-2d' or 'rigid-punch-axisymmetric', with the exact solution unless contact is
    bilateral.

    Raises
    ------
    InputError : If a size is not positive, the foundation is smaller than two half-widths, or the
        kind is unknown.
    """
    if kind not in LARGE:
        raise InputError(f"kind must be one of {', '.join(LARGE)}; got {kind!r}.")
    size = LARGE[kind] * half_width if foundation is None else foundation
    check_positive(half_width=half_width, foundation=size, depth=depth, force=force)
    if size < 2 * half_width:
        raise InputError(
            f"the foundation ({size:g}) must be at least two half-widths ({2 * half_width:g})"
            " large."
        )
    across, up = ("x", "y") if kind == "plane-strain" else ("r", "z")

    def mesh(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        from contactopt.meshes.structured import graded, patch, rename, tensor_mesh

        first = EDGE * half_width
        contact = _towards_edge(half_width, elements, first)
        beyond = half_width + graded(size - half_width, first, RATIO)[1:]
        block = tensor_mesh(np.concatenate([contact, beyond]), -graded(size, first, RATIO)[::-1])
        block = rename(block, axis="x-", bottom="y-", top="y+")
        return patch(block, "top", "contact", [half_width])

    plane = kind == "plane-strain"
    return Scene(
        "rigid-punch-2d" if plane else "rigid-punch-axisymmetric",
        Rigid("punch", force={up: -force}),
        Part("foundation", mesh, lower, (Support("axis", {across: 0.0}), Support("bottom"))),
        mu,
        kind=kind,
        thickness=depth if plane else 1.0,
        copies=2 if plane else 1,
        law="bilateral" if bilateral else "coulomb",
        elements=elements,
        degree=2,
        units=UNITS,
        reference=None if bilateral else _exact(kind, force, half_width, depth, lower, mu),
    )


def _exact(
    kind: str, force: float, half_width: float, depth: float, lower: Material, mu: float
) -> Reference:
    beta = dundurs(None, lower)[1]
    if kind == "plane-strain":
        return flat_punch_line_friction(force / depth, half_width, mu, beta)
    return flat_punch_axisymmetric_friction(force, half_width, contact_modulus(lower), mu, beta)


def _towards_edge(half_width: float, elements: int, first: float) -> np.ndarray:
    """Grid from 0 to half_width: even spacing half_width / elements at most, falling to `first` at
    the edge.
    """
    h = half_width / elements
    steps = first * RATIO ** np.arange(max(0.0, np.floor(np.log(h / first) / np.log(RATIO)) + 1))
    steps = steps[np.cumsum(steps) < half_width - h / 2]  # leaves room for an even one
    towards = half_width - np.append(0.0, np.cumsum(steps))[::-1]
    even = np.linspace(0.0, towards[0], int(np.ceil(towards[0] / h - 1e-9)) + 1)
    return np.concatenate([even[:-1], towards])
