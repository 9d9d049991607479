"""Bodies with known answers, each as a half-space, in two dimensions and in three.

A rigid indenter of a given profile is pressed on an elastic body. `Known` says all that is exact
about it, and the functions below make one scene of it each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ellipe, ellipkm1

from contactopt import HalfSpace, Material, Part, Rigid, Scene, Support
from contactopt.analytic import Reference, contact_modulus, hertz_line, hertz_point
from contactopt.meshes.structured import patch, rename, tensor_mesh
from experiments.questions.accuracy.half_space import MATERIAL, SLOPE, outwards

LARGE = 1e4  # size of a body that stands for a half-space, over the half-width of contact
DEEP = 20.0  # the same in three dimensions
MARGIN = 1.25  # candidates of contact beyond the zone
Profile = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Known:
    """A rigid profile (dim - 1, k) -> height over its lowest point, pressed by a force (per length
    in the plane) on a half-space, without friction: half-axes of the contact, and exact answers.
    """

    plane: bool
    profile: Profile
    force: float
    axes: tuple[float, ...]
    exact: Reference
    material: Material = MATERIAL
    mu: float = 0.0

    @property
    def rest(self) -> dict[str, Any]:
        """What all scenes of it have in common."""
        return {"mu": self.mu, "law": "coulomb" if self.mu else "frictionless"} | {
            "reference": self.exact
        }


def line(force: float = 0.5, radius: float = 400.0, material: Material = MATERIAL) -> Known:
    """Hertz's contact along a line."""
    exact = hertz_line(force, radius, contact_modulus(material))
    shape = lambda x: x[0] ** 2 / (2 * radius)  # noqa: E731
    return Known(True, shape, force, (exact.half_width,), exact, material)


def point(force: float = 20.0, radius: float = 400.0, material: Material = MATERIAL) -> Known:
    """Hertz's contact at a point."""
    exact = hertz_point(force, radius, contact_modulus(material))
    shape = lambda x: (x[:2] ** 2).sum(axis=0) / (2 * radius)  # noqa: E731
    return Known(False, shape, force, (exact.half_width,) * 2, exact, material)


def ellipse(ratio: float = 0.4, peak: float = 0.05, material: Material = MATERIAL) -> Known:
    """Hertz's contact on an ellipse of half-axes 1 and `ratio`, with a peak over E*.

    With e^2 = 1 - ratio^2, the complete elliptic integrals K and E of e, and p0 / E* = peak, the
    profile A x^2 + B y^2 has A = peak ratio (K - E) / e^2 and B = peak ratio (E / ratio^2 - K) /
    e^2, and the approach is peak ratio K (Johnson 1985, section 4.2c). The width is that of the
    disc of the same area.
    """
    modulus, e2 = contact_modulus(material), 1 - ratio**2
    K, E = float(ellipkm1(ratio**2)), float(ellipe(e2))
    A, B = (peak * ratio * own / e2 for own in (K - E, E / ratio**2 - K))
    force = 2 * np.pi * ratio * peak * modulus / 3

    def pressure(x: np.ndarray) -> np.ndarray:  # along the long axis
        return np.asarray(peak * modulus * np.sqrt(np.maximum(1 - x**2, 0.0)))

    exact = Reference("Hertz", pressure, ratio**0.5, peak * modulus, peak * ratio * K)
    shape = lambda x: A * x[0] ** 2 + B * x[1] ** 2  # noqa: E731
    return Known(False, shape, force, (1.0, ratio), exact, material)


def rounded(known: Known) -> Known:
    """The round profile with the mean of the curvatures (geometric), and the answers of the other:
    a model in two dimensions of what is not round.
    """
    curved = [
        float(known.profile(np.array(place))[0]) for place in ([[1.0], [0.0]], [[0.0], [1.0]])
    ]
    radius = 0.5 / float(np.sqrt(np.prod(curved)))
    made = point(known.force, radius, known.material)
    return Known(False, made.profile, known.force, made.axes, known.exact, known.material, known.mu)


def half_space(known: Known) -> Scene:
    """No mesh; `elements` points across each half-axis of the contact."""

    def points(n: int, zone: float | None) -> Any:
        made = []
        for a in known.axes:
            half = int(np.ceil(MARGIN * n))
            made.append((np.arange(-half, half) + 0.5) * a / n)
        return made[0] if known.plane else tuple(made)

    up = "y" if known.plane else "z"
    normal = (0.0,) * len(known.axes) + (1.0,)
    tool = Rigid("indenter", normal, known.profile, {up: -known.force})
    body = HalfSpace("half-space", known.material, points)
    kind = "plane-strain" if known.plane else "solid"
    return Scene("half-space", tool, body, kind=kind, **known.rest)


def flat_model(known: Known, degree: int = 1, size: float = LARGE, uniform: bool = False) -> Scene:
    """Plane strain, or axisymmetric: half a section, graded away from the contact, `size`
    half-widths large.
    """
    a, up = known.axes[0], "y" if known.plane else "z"

    def mesh(n: int, zone: float | None) -> Any:
        unit, slope = (zone or MARGIN * a) / n, 0.0 if uniform else SLOPE / n
        near = unit * np.arange(int(np.ceil(MARGIN * n)) + 1)
        across = np.concatenate([near[:-1], a * outwards(near[-1] / a, unit / a, slope, size)])
        depth = a * outwards(0.0, unit / a, slope, size)
        block = rename(tensor_mesh(across, -depth[::-1]), axis="x-", bottom="y-", top="y+")
        return patch(block, "top", "contact", [near[-1]])

    def gap(x: np.ndarray) -> np.ndarray:
        return known.profile(np.array([x[0], 0.0 * x[0]]))

    tool = Rigid("indenter", (0.0, 1.0), gap, {up: -known.force})
    held = Support("axis", {"x" if known.plane else "r": 0.0}), Support("bottom")
    kind = "plane-strain" if known.plane else "axisymmetric"
    images = {"kind": kind, "copies": 2 if known.plane else 1}
    body = Part("body", mesh, known.material, held)
    return Scene(kind, tool, body, degree=degree, zone=MARGIN * a, **images, **known.rest)


def solid_model(known: Known, degree: int = 1, quarter: bool = True) -> Scene:
    """A quarter of the body in three dimensions, or the half with y > 0."""

    def beyond(a: float, n: int, near: int) -> np.ndarray:
        """From 0 on: elements of a / n as far as the contact, then growing by 1 + 4 / n."""
        start, growth = np.arange(near + 1) / n, 1 + 4 / n
        rest = DEEP - start[-1]
        count = int(np.ceil(np.log1p(rest * 4) / np.log(growth)))
        far = np.cumsum(growth ** np.arange(1.0, count + 1))
        return np.asarray(a * np.concatenate([start, start[-1] + far * rest / far[-1]]))

    def mesh(n: int, zone: float | None) -> Any:
        near = n + max(2, n // 4)
        grids = [beyond(a, n, near) for a in known.axes]
        if not quarter:
            grids[0] = np.concatenate([-grids[0][:0:-1], grids[0]])
        depth = -beyond(float(np.mean(known.axes)), n, n)[::-1]
        block = rename(tensor_mesh(*grids, depth), bottom="z-", top="z+")
        edge = [a * near / n for a in known.axes]
        inside = lambda x: np.all(np.abs(x[:2]) < np.array(edge)[:, None], axis=0)  # noqa: E731
        top = np.asarray(block.boundaries["top"])
        middle = block.p[:, block.facets[:, top]].mean(axis=1)
        return block.with_boundaries({"contact": top[inside(middle)]})

    sides = ("x-", "y-") if quarter else ("y-",)
    held = *(Support(name, {name[0]: 0.0}) for name in sides), Support("bottom")
    tool = Rigid("indenter", (0.0, 0.0, 1.0), known.profile, {"z": -known.force})
    body = Part("body", mesh, known.material, held)
    copies = 4 if quarter else 2
    return Scene("solid", tool, body, kind="solid", copies=copies, degree=degree, **known.rest)
