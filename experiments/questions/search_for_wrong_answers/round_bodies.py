"""Round bodies on Gmsh's triangles, of which half is modelled, against exact solutions."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import quad

from contactopt import BodyForce, Contact, Part, Scene, Support
from contactopt.analytic import (
    Reference,
    contact_modulus,
    hertz_line,
    hertz_point,
    pin_in_hole,
)
from experiments.questions.search_for_wrong_answers.blocks import Random, material
from experiments.questions.search_for_wrong_answers.compare import Case, Values
from experiments.questions.search_for_wrong_answers.outlines import outlined

MODEL = 0.3  # of a / R: by which round bodies differ from the half-spaces of Hertz and Persson
REACH = 1.3  # half-widths of contact up to which triangles are small
CLEARANCE = 1e-3  # of the pin, over its radius


def arc(radius: float, angle: float, fine: float, name: str) -> list[Any]:
    """Corners of a half circle from its lowest point, with small triangles up to an angle."""
    sizes = (0.0, fine), (angle, fine), (np.pi / 2 + angle / 2, radius / 5)
    return [(radius * np.sin(t), -radius * np.cos(t), size, name) for t, size in sizes]


def known(exact: Reference, axisymmetric: bool) -> Values:
    """The mean pressure, its peak and how far the contact reaches, by quadrature."""
    a = exact.half_width

    def total(power: int, lever: int) -> float:
        def integrand(t: float) -> float:  # x = a sin t, so that nothing is steep at the edge
            x = a * np.sin(t)
            p = float(np.nan_to_num(exact.pressure(np.array([x])))[0])
            return p**power * x ** (lever + axisymmetric) * a * np.cos(t)

        return float(quad(integrand, 0.0, np.pi / 2)[0])

    reach = float(np.sqrt(total(1, 2) / total(1, 0)))
    values = {"pressure": total(2, 0) / total(1, 0), "peak": exact.peak or 0.0, "reach": reach}
    return {f"{name} 0": value for name, value in values.items()}


def pressed(rng: Random, shape: str) -> Case:
    """A roller or a ball on a block, or a pin in a hole of a large body, by their weight."""
    R, pin, ball = float(10 ** rng.uniform(-1, 2)), shape == "pin", shape == "ball"
    hard = material(rng)
    soft = hard if pin else material(rng)
    modulus, a = contact_modulus(hard, soft), R * float(rng.uniform(0.01, 0.03))
    if pin:
        force = modulus * CLEARANCE * R * float(10 ** rng.uniform(-1, 0.3))
        exact = pin_in_hole(force, R, CLEARANCE * R, modulus)
    else:
        force = 4 * a**3 * modulus / (3 * R) if ball else np.pi * a**2 * modulus / (4 * R)
        exact = (hertz_point if ball else hertz_line)(force, R, modulus)
    a, r = exact.half_width, R * (1 - CLEARANCE * pin)
    wide, angle = (30 if pin else 4) * R, REACH * a / R
    order, degree = int(rng.integers(1, 3)), int(rng.integers(1, 3))
    shares = rng.uniform(0.8, 1.6, 2)
    volume = 4 / 3 * np.pi * r**3 if ball else np.pi * r**2
    hold = Support("straight axis", {"r" if ball else "x": 0.0})
    carrier = str(rng.choice(["upper", "lower"]))
    lift = r - R * pin  # of the disc's middle

    def block(fine: float) -> Any:
        far = wide / 5
        if pin:
            hole = [(0.0, R, R / 5, "contact"), *arc(R, angle, fine, "contact")[:0:-1]]
            outside = [*arc(wide, 0.5, far, "straight far"), (0.0, wide, far, "straight axis")]
            return outlined([*outside, *hole, (0.0, -R, fine, "straight axis")], order, arcs=True)
        top = [(0.0, 0.0, fine, "contact"), (angle * R, 0.0, fine, "contact")]
        sides = [(wide, 0.0, far, "side"), (wide, -wide, far, "straight far")]
        return outlined([*top, *sides, (0.0, -wide, far, "straight axis")], order)

    def build(level: int) -> Scene:
        one, two = a / (6 * 2**level * shares)
        rim = [*arc(r, angle, one, "contact"), (0.0, r, r / 5, "straight axis")]
        disc = outlined(rim, order, arcs=True)
        disc = type(disc)(disc.doflocs + np.array([[0.0], [lift]]), disc.t).with_boundaries(
            disc.boundaries
        )
        weight = (BodyForce((0.0, -force / volume)),)
        held = hold, Support("straight far")
        bodies = (
            Part("disc", disc, hard, (hold,), weight, curve={"contact": circle(r, lift)}),
            Part(
                "base", block(two), soft, held, curve={"contact": circle(R, 0.0)} if pin else None
            ),
        )
        pair = Contact("disc:contact", "base:contact", 0.0, coupling="mortar", carrier=carrier)
        kind = "axisymmetric" if ball else "plane-strain"
        return Scene("search", bodies=bodies, contacts=(pair,), kind=kind, degree=degree)

    swapped, first = bool(rng.random() < 0.5), known(exact, ball)
    if pin:  # of which the places of contact lie on an arc
        del first["reach 0"]
    return Case(shape, (first, build), swapped=swapped, model=MODEL * (0.02 if pin else a / R))


def circle(radius: float, y: float) -> Any:
    """Points moved to a circle about (0, y)."""
    middle = np.array([[0.0], [y]])
    return lambda x: middle + radius * (x - middle) / np.hypot(*(x - middle))
