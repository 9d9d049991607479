"""Twenty scenes that the rule has not seen: other geometry, loads and materials, known answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from math import gamma, pi, sqrt
from typing import Any

import numpy as np

from contactopt import Material, Scene, scenes
from contactopt.accuracy.proposal import propose
from contactopt.analytic import (
    Reference,
    contact_modulus,
    dundurs,
    flat_punch_axisymmetric_friction,
    flat_punch_line_friction,
)
from contactopt.readings.quantities import value_of
from experiments.questions.accuracy.half_space import flat
from experiments.questions.classics.blocks import UNIT, bonded, indented
from experiments.questions.classics.layered import pressed_cylinder
from experiments.questions.front.bodies import (
    Known,
    ellipse,
    flat_model,
    half_space,
    line,
    point,
    solid_model,
)
from experiments.questions.front.measured import Row, solved, timed

STEEL, ALUMINIUM, RUBBER = Material(210e3, 0.3), Material(70e3, 0.33), Material(2.0, 0.45)
MESHES = {0: (4, 8, 16), 1: (3, 4, 6, 8, 12, 16), 2: (2, 3, 4, 6, 8)}
SOLID = (2, 3, 4)
TOLERANCE, PAIRS = 1e-4, 3
ROUND, LAYER = 10.0, 1.0  # radius of the cylinder on a layer, and the layer's height
Make = Callable[[], Scene]


@dataclass(frozen=True)
class Unseen:
    """A scene: what is asked, its known value, the edge and the size as the rule knows them, and
    the scene in each degree (0: a half-space; 'solid': in three dimensions).
    """

    name: str
    quantity: str
    accuracy: float
    exact: float
    edge: str
    ways: dict[Any, Make]
    size: float = np.inf


def power(m: int, plane: bool, material: Material, height: float = 0.02) -> Known:
    """A rigid profile height |x|^m, whose contact has a half-width of 1.

    On a half-space its approach is k height, k = sqrt(pi) gamma(m/2 + 1) / gamma(m/2 + 1/2), under
    the force 2 E* m / (m + 1) of the approach (Sneddon 1965). For m = 4 the pressure is 4 k height
    E* / (3 pi) (1 + 2 r^2) sqrt(1 - r^2). On a half-plane it is E* height (1 + 2 x^2) sqrt(1 -
    x^2). Both are largest at r^2 = 1/2.
    """
    modulus = contact_modulus(material)
    k = sqrt(pi) * gamma(m / 2 + 1) / gamma(m / 2 + 0.5)
    force = 0.75 * pi * modulus * height if plane else 2 * modulus * m / (m + 1) * k * height
    peak = (
        None
        if m != 4
        else (modulus * height if plane else 4 * k * height * modulus / (3 * pi)) * sqrt(2)
    )
    exact = Reference("power", lambda x: x, 1.0, peak, None if plane else k * height)
    own = 1 if plane else 2
    shape = lambda x: height * (x[:own] ** 2).sum(axis=0) ** (m / 2)  # noqa: E731
    return Known(plane, shape, force, (1.0,) * own, exact, material)


def pressed(name: str, quantity: str, accuracy: float, known: Known) -> Unseen:
    """A rigid profile on a half-space: without a mesh, and on meshes of both degrees."""
    truth = {"pressure": known.exact.peak, "width": known.exact.half_width}
    ways: dict[Any, Make] = {0: partial(half_space, known)}
    if len(set(known.axes)) == 1:
        ways |= {degree: partial(flat_model, known, degree) for degree in (1, 2)}
    else:
        ways |= {"solid": partial(solid_model, known)}
    exact = (truth | {"approach": known.exact.approach})[quantity]
    return Unseen(name, quantity, accuracy, float(exact or 0), "free", ways)


def both(scene: Scene) -> dict[Any, Make]:
    """A scene with linear and with quadratic displacements."""
    return {degree: lambda d=degree: replace(scene, degree=d) for degree in (1, 2)}


def punch(name: str, kind: str, quantity: str, accuracy: float, mu: float, nu: float) -> Unseen:
    """A rigid flat punch on another material."""
    material = Material(70.0, nu)
    beta, modulus = dundurs(None, material)[1], contact_modulus(material)
    made = flat(kind, mu)
    if kind == "plane-strain":
        exact = flat_punch_line_friction(1.0, 1.0, mu, beta)
    else:
        exact = flat_punch_axisymmetric_friction(1.0, 1.0, modulus, mu, beta)
    scene = made.with_parts(lambda part: replace(part, material=material) if part.meshed else part)
    value = exact.approach if quantity == "approach" else exact.stick_half_width
    return Unseen(name, quantity, accuracy, float(value or 0), "corner", both(scene))


def fitted(name: str, kind: str, sizes: tuple[float, float, float], hub: Material) -> Unseen:
    """A press fit of other sizes."""
    bore, radius, outside = sizes
    scene = scenes.press_fit(
        kind, bore=bore, radius=radius, outside=outside, interference=1e-6 * radius, hub=hub, mu=0.0
    )
    return Unseen(name, "pressure", 0.01, scene.reference.peak, "none", both(scene))


def layer(name: str, quantity: str, held: bool) -> Unseen:
    """A cylinder on a layer, which is no half-space."""
    found = pressed_cylinder(0.05, ROUND, ((LAYER, UNIT),), held)
    shape = lambda x: x**2 / (2 * ROUND)  # noqa: E731
    a = found.half_width
    scene = indented("cylinder", "plane-strain", shape, 0.05, a, (30.0, LAYER), 1.3)
    scene = bonded(scene) if held else scene
    ways = both(scene) | {0: partial(half_space, line(0.05, ROUND, UNIT))}
    value = {"pressure": found.peak, "width": a}[quantity]
    return Unseen(name, quantity, 0.01, value, "free", ways, LAYER / a)


def unseen() -> list[Unseen]:
    """All twenty."""
    cattaneo = scenes.cattaneo(2, mu=0.3, shear=18.0, material=STEEL)
    balls = scenes.cattaneo_half_space(material=Material(70.0, 0.0), mu=0.2, shear=14.0)
    two = scenes.sphere(radius=100.0, foundation_radius=300.0, foundation_height=300.0,
                        upper=ALUMINIUM, lower=STEEL, mu=0.0)  # fmt: skip
    like = Material(contact_modulus(ALUMINIUM, STEEL) * 0.91, 0.3)
    pair = point(100.0, 100.0, like)
    share = [own.reference.stick_half_width / own.reference.half_width for own in (cattaneo, balls)]
    return [
        pressed("steel roller", "pressure", 0.01, line(1e3, 50.0, STEEL)),
        pressed("rubber, line", "width", 0.01, line(0.01, 10.0, RUBBER)),
        pressed("steel ball", "pressure", 0.01, point(100.0, 10.0, STEEL)),
        pressed("cork, point", "approach", 0.03, point(5.0, 30.0, Material(20.0, 0.05))),
        pressed("ellipse, .7", "pressure", 0.01, ellipse(0.7, 0.01, STEEL)),
        pressed("ellipse, .25", "pressure", 0.01, ellipse(0.25, 0.02, ALUMINIUM)),
        pressed("x^4, line", "pressure", 0.01, power(4, True, STEEL)),
        pressed("x^4, point", "pressure", 0.01, power(4, False, RUBBER)),
        pressed("x^4, point", "width", 0.01, power(4, False, ALUMINIUM)),
        pressed("cone", "approach", 0.01, power(1, False, ALUMINIUM)),
        Unseen("steel rollers, sheared", "stick", 0.03, share[0], "free", both(cattaneo), 50.0),
        Unseen("balls, sheared", "stick", 0.03, share[1], "free", {0: lambda: balls}),
        punch("strip, mu = .5", "plane-strain", "stick", 0.03, 0.5, 0.3),
        punch("disc, mu = .5", "axisymmetric", "approach", 0.01, 0.5, 0.2),
        punch("disc, smooth", "axisymmetric", "approach", 0.01, 0.0, 0.45),
        fitted("sleeve, section", "plane-strain", (5.0, 15.0, 30.0), ALUMINIUM),
        fitted("sleeve, slice", "axisymmetric", (30.0, 50.0, 60.0), STEEL),
        layer("layer", "pressure", False),
        layer("layer, bonded", "width", True),
        Unseen("two balls", "pressure", 0.01, two.reference.peak, "free",
               both(two) | {0: partial(half_space, pair)}, 100.0 / two.reference.half_width),
    ]  # fmt: skip


def attempt(case: Unseen, way: Any, mesh: int, tol: float) -> tuple[float, float]:
    """CPU seconds and error of one choice."""
    scene = case.ways[way]()
    seconds, found = timed(lambda: solved(scene, mesh, tol, "auto"))
    return seconds, abs(value_of(case.quantity, found.reduction, found.solution)) / case.exact - 1


def tried(case: Unseen) -> Iterator[Row]:
    """The rule's choice first, then all others."""
    degrees = tuple(own for own in case.ways if own != "solid")
    rule = propose(case.quantity, case.accuracy, case.edge, case.size, degrees)
    assert rule is not None
    choices = [("rule", rule.degree, rule.elements, rule.tolerance)]
    for way in case.ways:
        meshes = SOLID if way == "solid" else MESHES[way]
        choices += [("other", way, mesh, TOLERANCE) for mesh in meshes]
    for by, way, mesh, tol in choices:
        row: Row = {"scene": case.name, "quantity": case.quantity, "accuracy": case.accuracy}
        row |= {"by": by, "way": way, "mesh": mesh, "tolerance": tol}
        try:
            seconds, error = attempt(case, way, mesh, tol)
        except Exception as wrong:
            yield row | {"cpu": np.nan, "error": np.nan, "end": str(wrong)[:80]}
            continue
        yield row | {"cpu": seconds, "error": error, "end": ""}


def without_luck(rows: list[Row]) -> list[Row]:
    """The runs that have the accuracy and whose finer meshes of the same kind have it too."""
    good = []
    for way in dict.fromkeys(row["way"] for row in rows):
        for row in sorted((r for r in rows if r["way"] == way), key=lambda row: -row["mesh"]):
            if not abs(row["error"]) <= row["accuracy"]:
                break
            good.append(row)
    return good


def judged(rows: list[Row]) -> list[Row]:
    """For each scene the rule's choice beside the cheapest one that meets the accuracy, and not by
    luck. The two are measured once more, PAIRS times in turn.
    """
    made = []
    for case in unseen():
        own = [r for r in rows if (r["scene"], r["quantity"]) == (case.name, case.quantity)]
        rule = next(row for row in own if row["by"] == "rule")
        best = min(without_luck(own), key=lambda row: row["cpu"], default=rule)
        seconds = np.array([[rule["cpu"], best["cpu"]]])
        if best is not rule:
            pair = [(case, row["way"], row["mesh"], row["tolerance"]) for row in (rule, best)]
            seconds = np.array([[attempt(*one)[0] for one in pair] for _ in range(PAIRS)])
        first, second = np.median(seconds, axis=0)
        made.append(
            {"scene": case.name, "quantity": case.quantity, "accuracy": case.accuracy}
            | {f"rule {name}": rule[name] for name in ("way", "mesh", "error")}
            | {f"best {name}": best[name] for name in ("way", "mesh", "error")}
            | {"rule cpu": float(first), "best cpu": float(second)}
            | {"ratio": float(np.median(seconds[:, 0] / seconds[:, 1]))}
            | {"meets": "yes" if abs(rule["error"]) <= case.accuracy else "no"}
        )
        print(made[-1], flush=True)
    return made
