"""The scenes of the table, and its rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from contactopt import scenes
from contactopt.analytic import (
    dundurs,
    flat_punch_axisymmetric_friction,
    flat_punch_line_friction,
    press_fit,
)
from contactopt.material import Material
from contactopt.scenes.scene import Scene
from experiments.questions.classics import bodies
from experiments.questions.classics.blocks import UNIT, bonded, coated, flat, indented, receding
from experiments.questions.classics.layered import Layers, pressed_cylinder
from experiments.questions.classics.receding_layer import receding_half_width, receding_peak
from experiments.questions.classics.rounded_punch import rounded_punch
from experiments.questions.classics.sequences import Limit, Way, follow_way

PLANE, DISC = "plane-strain", "axisymmetric"
ALL, KINKED = ("approach", "pressure", "width"), ("approach", "width")
BLOCK = (1.25, 8, 5, 1), (1.4, 6, 4, 2)  # ways of blocks and layers
TAPERED = 0.15  # radius of the flat end of the tapered punch
ROUND, WIDE = 10.0, 30.0  # radius of a cylinder on layers, half-width of these
CORE = Material(0.2, 0.3)  # below the coat
LOADED = 0.5  # half-width of the load on the receding layer
EDGE = 40.4  # first guess of the radius of contact of NAFEMS' punch [mm]


@dataclass(frozen=True)
class Classic:
    """A scene (growth of its elements, elements of its first mesh) -> Scene, the quantities of the
    table, and of both ways (growth, elements of the first mesh, meshes, degree); `exact` values, as
    far as they are known.
    """

    name: str
    scene: Callable[[float, int], Scene]
    quantities: tuple[str, ...]
    ways: tuple[tuple[float, int, int, int], ...]
    exact: dict[str, float] = field(default_factory=dict)


def _indented(
    name: str, kind: str, profile: Any, force: float, zone: float, kink: float = 0.0
) -> Any:
    unit = 1.0, 1.0
    return lambda growth, elements: indented(name, kind, profile, force, zone, unit, growth, kink)


def _flat(kind: str, mu: float, size: float) -> Any:
    return lambda growth, elements: flat("flat", kind, mu, (size, size), growth)


def _ratio(exact: Any) -> dict[str, float]:
    return {"stick": exact.stick_half_width / exact.half_width}


def classics() -> list[Classic]:
    return [*_on_blocks(), *_on_layers(), *_flat_punches(), *_round_bodies()]


def _on_blocks() -> list[Classic]:
    def parabola(x: np.ndarray) -> np.ndarray:
        return np.asarray(x**2 / 2)

    def taper(x: np.ndarray) -> np.ndarray:
        return np.maximum(x - TAPERED, 0.0) / 2

    cylinder = _indented("cylinder", PLANE, parabola, 0.02, 0.15)
    sphere = _indented("sphere", DISC, parabola, 0.01, 0.19)
    cone = _indented("cone", DISC, lambda x: x / 2, 0.05, 0.24)
    power = _indented("punch", PLANE, lambda x: x**4 / 4, 0.004, 0.28)
    wedge = _indented("wedge", PLANE, lambda x: x / 4, 0.05, 0.18)
    tapered = _indented("punch", DISC, taper, 0.05, 0.25, TAPERED)
    return [
        Classic("cylinder on block", cylinder, ALL, BLOCK),
        Classic("sphere on block", sphere, ALL, BLOCK),
        Classic("cone on block", cone, KINKED, BLOCK),
        Classic("rounded punch x^4 on block", power, ALL, BLOCK),
        Classic("wedge on block", wedge, KINKED, BLOCK),
        Classic("tapered punch on block", tapered, KINKED, BLOCK),
    ]


def _on_layers() -> list[Classic]:
    def exact(force: float, layers: Layers, bonded: bool) -> dict[str, float]:
        found = pressed_cylinder(force, ROUND, layers, bonded)
        return {"approach": found.approach, "pressure": found.peak, "width": found.half_width}

    def layer(force: float, zone: float, growth: float) -> Scene:
        def profile(x: np.ndarray) -> np.ndarray:
            return np.asarray(x**2 / (2 * ROUND))

        return indented("cylinder", PLANE, profile, force, zone, (WIDE, 1.0), growth)

    def on_core(growth: float, elements: int) -> Scene:
        return coated(layer(0.03, coat["width"], growth), 3.0, CORE, growth)

    one = ((1.0, UNIT),)
    coat = exact(0.03, (*one, (3.0, CORE)), False)
    receded = {"pressure": receding_peak(LOADED), "width": receding_half_width(LOADED)}
    return [
        Classic(
            "cylinder on layer",
            lambda growth, elements: layer(0.1, 0.9, growth),
            ALL,
            BLOCK,
            exact(0.1, one, False),
        ),
        Classic(
            "cylinder on bonded layer",
            lambda growth, elements: bonded(layer(0.1, 0.9, growth)),
            ALL,
            BLOCK,
            exact(0.1, one, True),
        ),
        Classic(
            "cylinder on coated layer",
            on_core,
            tuple(f"{quantity}:cylinder-block" for quantity in ALL[1:]),
            BLOCK,
            coat,
        ),
        Classic(
            "receding layer",
            lambda growth, elements: receding(LOADED, 5.0, 1.0, growth),
            ("pressure", "width"),
            BLOCK,
            receded,
        ),
    ]


def _flat_punches() -> list[Classic]:
    near, far = ((1.5, 5, 4, 1), (1.6, 4, 3, 2)), ((1.8, 5, 4, 1), (2.0, 4, 3, 2))
    beta = dundurs(None, UNIT)[1]
    line = flat_punch_line_friction(1.0, 1.0, 0.3, beta)
    disc = flat_punch_axisymmetric_friction(1.0, 1.0, 1.0, 0.3, beta)
    return [
        Classic("flat disc on block", _flat(DISC, 0.0, 2.0), ("approach",), near),
        Classic("flat strip on block", _flat(PLANE, 0.0, 2.0), ("approach",), near),
        Classic("Spence's disc, mu = .3", _flat(DISC, 0.3, 1e3), ("stick",), far, _ratio(disc)),
        Classic("Spence's strip, mu = .3", _flat(PLANE, 0.3, 5e3), ("stick",), far, _ratio(line)),
    ]


def _round_bodies() -> list[Classic]:
    two = (1.2, 8, 4, 1), (1.2, 6, 3, 2)
    small = (1.2, 8, 5, 1), (1.2, 6, 4, 2)
    lame = press_fit(bodies.FIT, 10.0, 20.0, 40.0, bodies.STEEL, bodies.STEEL)
    fitted = {"pressure": float(lame.peak or 0)}
    stick = _ratio(scenes.cattaneo(2).reference)
    # Hills and Nowell: friction of the zone of stick is that of Cattaneo, moved as a whole
    moved = -bodies.SHIFT * stick["stick"] ** 2 / (1 - stick["stick"] ** 2)

    def fit(growth: float, elements: int) -> Scene:
        return bodies.fit(DISC, elements)

    return [
        Classic("press fit", fit, ("pressure",), ((0, 8, 4, 1), (0, 6, 4, 2)), fitted),
        Classic("ball in rigid cup", lambda growth, elements: bodies.cup(), ALL, small),
        Classic("ball on block", lambda growth, elements: bodies.ball(), ALL, two),
        Classic("NAFEMS roller", lambda growth, elements: bodies.roller(), ALL, two),
        Classic(
            "NAFEMS rounded punch",
            lambda growth, elements: rounded_punch(EDGE, growth),
            ("energy", "pressure", "width"),
            ((1.3, 4, 4, 1), (1.4, 3, 3, 2)),
        ),
        Classic(
            "pin in lug",
            lambda growth, elements: bodies.lug(elements),
            ("pressure", "width"),
            small,
        ),
        Classic(
            "Cattaneo's cylinders, mu = .5",
            lambda growth, elements: scenes.cattaneo(2),
            ("stick",),
            ((0, 5, 3, 1), (0, 3, 3, 2)),
            stick,
        ),
        Classic(
            "Cattaneo's under bulk tension",
            lambda growth, elements: bodies.stretched(),
            ("stick", "centre of friction"),
            ((0, 4, 4, 1), (0, 3, 3, 2)),
            stick | {"centre of friction": moved},
        ),
    ]


def measured(number: int) -> list[dict[str, Any]]:
    """The rows of one of the classics, by its number."""
    return rows_of(classics()[number])


def rows_of(classic: Classic) -> list[dict[str, Any]]:
    """Both ways to all quantities of a classic."""
    found = []
    for growth, base, levels, degree in classic.ways:
        way = Way(classic.scene(growth, base), base, levels, degree)
        found.append((way, *follow_way(way, classic.quantities)))
    return [_row(classic, quantity, found) for quantity in classic.quantities]


def _row(classic: Classic, asked: str, found: Any) -> dict[str, Any]:
    first, second = (limits[asked] for _, limits, _, _ in found)
    quantity = asked.partition(":")[0]  # the pair is known
    best: Limit = min(first, second, key=lambda limit: limit.bar)
    apart = abs(first.limit - second.limit)
    bar = max(apart, best.bar)
    row: dict[str, Any] = {
        "scene": classic.name,
        "quantity": quantity,
        "value": best.limit,
        "relative bar": bar / abs(best.limit),
        "apart over bars": apart / (first.bar + second.bar),
        "exact": classic.exact.get(quantity, ""),
    }
    if quantity in classic.exact:
        row["off exact"] = best.limit / classic.exact[quantity] - 1
    else:
        row["off exact"] = ""
    for name, (way, limits, unknowns, seconds) in zip(("first", "second"), found):
        limit = limits[asked]
        row |= {
            f"{name} way": way.told,
            f"{name} limit": limit.limit,
            f"{name} bar": limit.bar / abs(limit.limit),
            f"{name} order": limit.order,
            f"{name} last value": limit.values[-1],
            f"{name} unknowns": unknowns,
            f"{name} CPU s": round(seconds, 1),
        }
    return row
