"""Rigid indenters on a half-space, on families of meshes all of whose elements shrink as `elements`
grows.

Elements of a / n next to the contact grow outwards by the ratio exp(SLOPE / n min(1 + r / a,
FAR)^POWER) of neighbours: slowly where the field of the contact still varies, faster where it has
faded. The number of elements across a body of size L then hardly depends on L, and doubling n
halves every element, so that no part of the error stays behind.
"""

from __future__ import annotations

import numpy as np

from contactopt.analytic import (
    contact_modulus,
    dundurs,
    flat_punch_axisymmetric_friction,
    flat_punch_line_friction,
    hertz_line,
    hertz_point,
)
from contactopt.material import Material
from contactopt.meshes.structured import patch, rename, tensor_mesh
from contactopt.scenes.scene import Part, Rigid, Scene, Support

SLOPE, POWER, FAR = 2.8, 0.3, 100.0
MATERIAL = Material(5.0, 0.3)
MARGIN = 1.25  # candidates of contact beyond the zone
CORNER = 2.0  # exponent of the grading towards the edge of a flat punch


def outwards(start: float, first: float, slope: float, size: float) -> np.ndarray:
    """Grid from `start` to `size` [a] with elements from `first` on, growing as said above."""
    grid, h = [start], first
    while grid[-1] < size:
        grid.append(grid[-1] + h)
        h *= np.exp(slope * min(1 + grid[-1], FAR) ** POWER)
    offsets = np.array(grid) - start
    return np.asarray(start + offsets * ((size - start) / offsets[-1]))


def indenter(
    kind: str, size: float = 100.0, elements: int = 32, uniform: bool = False, loop: bool = True
) -> Scene:
    """A rigid paraboloid or parabolic cylinder without friction: Hertz's contact exactly, but for
    the size of the block.

    size     height and half-width of the block over the half-width of contact
    uniform  no grading;  loop  remeshing to the contact zone, else a zone 1.25 times as wide as it
             is
    """
    plane = kind == "plane-strain"
    modulus, radius, force = contact_modulus(MATERIAL), 400.0, 0.5 if plane else 20.0
    hertz = hertz_line(force, radius, modulus) if plane else hertz_point(force, radius, modulus)
    a, (across, up) = hertz.half_width, ("x", "y") if plane else ("r", "z")

    def mesh(n: int, zone: float | None):  # type: ignore[no-untyped-def]
        unit = (zone if loop and zone else MARGIN * a) / n
        contact = unit * np.arange(int(np.ceil(MARGIN * n)) + 1)
        slope = 0.0 if uniform else SLOPE / n
        x = np.concatenate([contact[:-1], a * outwards(contact[-1] / a, unit / a, slope, size)])
        depth = a * outwards(0.0, unit / a, slope, size)
        return _block(x, depth, contact[-1])

    return Scene(
        f"hertz-{'line' if plane else 'point'}",
        Rigid(
            "indenter",
            normal=(0.0, 1.0),
            gap=lambda x: x[0] ** 2 / (2 * radius),
            force={up: -force},
        ),
        Part("half-space", mesh, MATERIAL, (Support("axis", {across: 0.0}), Support("bottom"))),
        0.0,
        kind=kind,
        copies=2 if plane else 1,
        elements=elements,
        zone=MARGIN * a if loop else None,
        units=("mm", "MPa"),
        reference=hertz,
    )


def flat(kind: str, mu: float, size: float = 1e4, elements: int = 32) -> Scene:
    """A rigid flat punch of half-width 1 under a unit force, graded towards its edge."""
    plane = kind == "plane-strain"
    across, up = ("x", "y") if plane else ("r", "z")
    beta, modulus = dundurs(None, MATERIAL)[1], contact_modulus(MATERIAL)
    exact = (
        flat_punch_line_friction(1.0, 1.0, mu, beta)
        if plane
        else flat_punch_axisymmetric_friction(1.0, 1.0, modulus, mu, beta)
    )

    def mesh(n: int, zone: float | None):  # type: ignore[no-untyped-def]
        near = np.linspace(0, 1, n + 1) ** CORNER
        far = outwards(1.0, near[-1] - near[-2], CORNER / n, size)
        beyond = np.concatenate([1 + near, 1 + far[1:]])
        return _block(
            np.concatenate([1 - near[:0:-1], beyond]), np.concatenate([near, far[1:]]), 1.0
        )

    return Scene(
        f"flat-{'line' if plane else 'disc'}, mu = {mu:g}",
        Rigid("punch", force={up: -1.0}),
        Part("half-space", mesh, MATERIAL, (Support("axis", {across: 0.0}), Support("bottom"))),
        mu,
        kind=kind,
        copies=2 if plane else 1,
        elements=elements,
        reference=exact,
    )


def _block(x: np.ndarray, depth: np.ndarray, contact: float):  # type: ignore[no-untyped-def]
    block = rename(tensor_mesh(x, -depth[::-1]), axis="x-", bottom="y-", top="y+")
    return patch(block, "top", "contact", [contact])
