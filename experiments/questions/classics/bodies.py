"""Two elastic bodies, or one in a rigid cup: named scenes with plates that are not glued and bases
without friction, whose corners are smooth.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from contactopt import scenes
from contactopt.coupling.reduction import Reduction
from contactopt.material import Material
from contactopt.problem import Solution
from contactopt.scenes.scene import BodyForce, Part, Plate, Rigid, Scene, Support, Traction
from experiments.questions.classics.blocks import UNIT

STEEL, ALUMINIUM = Material(210e3, 0.3), Material(70e3, 0.3)
FIT = 1e-5  # interference [mm]
LARGE, FAR = 4e8, 60.0  # radius of stretched cylinders [mm], size over the half-width of contact
SHIFT = 0.3  # of their zone of stick, over the half-width of contact


def smooth(scene: Scene) -> Scene:
    """The scene without glue."""
    up = scene.components[-1]

    def part(body: Any) -> Any:
        if not isinstance(body, Part):
            return body
        held = tuple(
            Support("bottom", {up: 0.0}) if support.boundary == "bottom" else support
            for support in body.supports
        )
        loads = tuple(
            replace(load, glued=False) if isinstance(load, Plate) else load for load in body.loads
        )
        return replace(body, supports=held, loads=loads)

    return scene.with_parts(part)


def roller() -> Scene:
    """The first of NAFEMS' advanced benchmarks: a steel cylinder of radius 50 mm on an aluminium
    block of 200 by 200 mm under 35 kN per mm, here without friction.
    """
    return smooth(
        scenes.cylinder(
            radius=50.0,
            foundation_width=200.0,
            foundation_height=200.0,
            depth=1.0,
            upper=STEEL,
            lower=ALUMINIUM,
            mu=0.0,
            force=35e3,
        )
    )


def ball() -> Scene:
    """A ball of radius 1 on a block of radius 2 and height 2, of one material."""
    return smooth(
        scenes.sphere(
            radius=1.0,
            foundation_radius=2.0,
            foundation_height=2.0,
            upper=UNIT,
            lower=UNIT,
            mu=0.0,
            force=0.005,
        )
    )


def cup(inner: float = 1.1) -> Scene:
    """A ball of radius 1 in a rigid cup of a radius `inner`."""
    free = scenes.sphere(radius=1.0, upper=UNIT, mu=0.0, force=0.0085, rigid="foundation")

    def gap(x: np.ndarray) -> np.ndarray:
        return np.asarray(x[1] - (inner - np.sqrt(inner**2 - x[0] ** 2)))

    shell = Rigid("cup", normal=(0.0, 1.0), gap=gap)
    return smooth(replace(free, lower=shell, zone=0.38, reference=None))


def lug(elements: int) -> Scene:
    """A pin of radius 1 in the hole of a ring of radius 3, whose outside is clamped."""
    clearance, force = 0.01, 0.02
    scene = scenes.pin_in_bush(
        radius=1.0,
        clearance=clearance,
        outside=3.0,
        depth=1.0,
        material=UNIT,
        force=force,
        elements=elements,
    )
    weight = BodyForce((0.0, -force / (np.pi * (1 - clearance) ** 2)))

    def part(body: Any) -> Any:
        return replace(body, loads=(weight,)) if body.loads else body

    return scene.with_parts(part)


def stretched() -> Scene:
    """Cattaneo's cylinders, so large that contact is as in half-planes. A bulk tension of the lower
    one alone, parallel to the surface, moves the zone of stick by SHIFT of the half-width.

    The plates are not glued and hold no level plane back. What pulls to the right is a plate on the
    right of the upper body, and what holds against it a support on the left of the lower one: each
    body is the other turned by half a circle, so that the shear of one stretches both surfaces
    alike.
    """
    exact = scenes.cattaneo(2, radius=LARGE).reference
    scene = scenes.cattaneo(2, radius=LARGE, size=FAR * exact.half_width)
    tension = 4 * SHIFT * float(scene.pairs[0].mu) * exact.peak
    held = Support("far", {"y": 0.0}), Support("x-", {"x": 0.0})

    def part(body: Any) -> Any:
        if body.supports:
            return replace(body, supports=held, loads=(Traction("x+", (tension, 0.0)),))
        force = body.loads[0].force
        pressed = Plate("far", {"y": force["y"]}, glued=False)
        return replace(body, loads=(pressed, Plate("x+", {"x": force["x"]}, glued=False)))

    return scene.with_parts(part)


def centre_of_friction(reduction: Reduction, solution: Solution) -> float:
    """Where the resultant of friction acts, over the half-width of the scene's exact solution."""
    friction, x = solution.reactions[:, 1], reduction.problem.coordinates[0]
    return float(x @ friction / friction.sum() / reduction.scene.reference.half_width)


def fit(kind: str, elements: int) -> Scene:
    """Steel shaft and hub, pressed together without friction, by so little that Lame is exact."""
    return scenes.press_fit(kind, interference=FIT, mu=0.0, elements=elements)
