"""The scenes of the table, and its rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt import scenes
from contactopt.analytic import (
    dundurs,
    flat_punch_axisymmetric_friction,
    flat_punch_line_friction,
    press_fit,
)
from contactopt.scenes.scene import Scene
from experiments.questions.classics import bodies
from experiments.questions.classics.blocks import UNIT, flat, indented, receding
from experiments.questions.classics.receding_layer import receding_half_width, receding_peak
from experiments.questions.classics.sequences import Limit, Way, follow_way

PLANE, DISC = "plane-strain", "axisymmetric"
ALL = ("approach", "pressure", "width")
TAPERED = 0.15  # radius of the flat end of the tapered punch
LOADED = 0.5  # half-width of the load on the receding layer


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
    exact: dict[str, float]


def _indented(
    name: str, kind: str, profile: Any, force: float, zone: float, high: float, kink: float = 0.0
) -> Any:
    size = (1.0 if high == 1 else 10 * high, high)
    return lambda growth, elements: indented(name, kind, profile, force, zone, size, growth, kink)


def _flat(kind: str, mu: float, size: float) -> Any:
    return lambda growth, elements: flat("flat", kind, mu, (size, size), growth)


def _ratio(exact: Any) -> dict[str, float]:
    return {"stick": exact.stick_half_width / exact.half_width}


def classics() -> list[Classic]:
    def parabola(x: np.ndarray) -> np.ndarray:
        return np.asarray(x**2 / 2)

    def taper(x: np.ndarray) -> np.ndarray:
        return np.maximum(x - TAPERED, 0.0) / 2

    block = (1.25, 8, 5, 1), (1.4, 6, 4, 2)
    two = (1.2, 8, 4, 1), (1.2, 6, 3, 2)
    small = (1.2, 8, 5, 1), (1.2, 6, 4, 2)
    corner = (1.5, 5, 4, 1), (1.6, 4, 3, 2)
    far = (1.8, 5, 4, 1), (2.0, 4, 3, 2)
    beta = dundurs(None, UNIT)[1]
    steel = bodies.STEEL
    lame = press_fit(bodies.FIT, 10.0, 20.0, 40.0, steel, steel)
    line = flat_punch_line_friction(1.0, 1.0, 0.3, beta)
    disc = flat_punch_axisymmetric_friction(1.0, 1.0, 1.0, 0.3, beta)
    layer = {"pressure": receding_peak(LOADED), "width": receding_half_width(LOADED)}
    return [
        Classic(
            "cylinder on block",
            _indented("cylinder", PLANE, parabola, 0.02, 0.15, 1.0),
            ALL,
            block,
            {},
        ),
        Classic(
            "sphere on block", _indented("sphere", DISC, parabola, 0.01, 0.19, 1.0), ALL, block, {}
        ),
        Classic(
            "cylinder on thin layer",
            _indented("cylinder", PLANE, parabola, 0.01, 0.15, 0.1),
            ALL,
            block,
            {},
        ),
        Classic(
            "cone on block",
            _indented("cone", DISC, lambda x: x / 2, 0.05, 0.24, 1.0),
            ("approach", "width"),
            block,
            {},
        ),
        Classic(
            "rounded punch x^4 on block",
            _indented("punch", PLANE, lambda x: x**4 / 4, 0.004, 0.28, 1.0),
            ALL,
            block,
            {},
        ),
        Classic(
            "wedge on block",
            _indented("wedge", PLANE, lambda x: x / 4, 0.05, 0.18, 1.0),
            ("approach", "width"),
            block,
            {},
        ),
        Classic(
            "tapered punch on block",
            _indented("punch", DISC, taper, 0.05, 0.25, 1.0, TAPERED),
            ("approach", "width"),
            block,
            {},
        ),
        Classic("flat disc on block", _flat(DISC, 0.0, 2.0), ("approach",), corner, {}),
        Classic("flat strip on block", _flat(PLANE, 0.0, 2.0), ("approach",), corner, {}),
        Classic("Spence's disc, mu = .3", _flat(DISC, 0.3, 1e3), ("stick",), far, _ratio(disc)),
        Classic("Spence's strip, mu = .3", _flat(PLANE, 0.3, 5e3), ("stick",), far, _ratio(line)),
        Classic(
            "receding layer",
            lambda growth, elements: receding(LOADED, 5.0, 1.0, growth),
            ("pressure", "width"),
            block,
            layer,
        ),
        Classic(
            "press fit",
            lambda growth, elements: bodies.fit(DISC, elements),
            ("pressure",),
            ((0, 8, 4, 1), (0, 6, 4, 2)),
            {"pressure": float(lame.peak or 0)},
        ),
        Classic("ball in rigid cup", lambda growth, elements: bodies.cup(), ALL, small, {}),
        Classic("ball on block", lambda growth, elements: bodies.ball(), ALL, two, {}),
        Classic("NAFEMS roller", lambda growth, elements: bodies.roller(), ALL, two, {}),
        Classic(
            "pin in lug",
            lambda growth, elements: bodies.lug(elements),
            ("pressure", "width"),
            small,
            {},
        ),
        Classic(
            "Cattaneo's cylinders, mu = .5",
            lambda growth, elements: scenes.cattaneo(2),
            ("stick",),
            ((0, 5, 3, 1), (0, 3, 3, 2)),
            _ratio(scenes.cattaneo(2).reference),
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


def _row(classic: Classic, quantity: str, found: Any) -> dict[str, Any]:
    first, second = (limits[quantity] for _, limits, _, _ in found)
    best: Limit = min(first, second, key=lambda limit: limit.bar)
    apart = abs(first.limit - second.limit)
    bar = max(apart, best.bar)
    row: dict[str, Any] = {
        "scene": classic.name,
        "quantity": quantity,
        "value": best.limit,
        "relative bar": bar / best.limit,
        "apart over bars": apart / (first.bar + second.bar),
        "exact": classic.exact.get(quantity, ""),
    }
    if quantity in classic.exact:
        row["off exact"] = best.limit / classic.exact[quantity] - 1
    else:
        row["off exact"] = ""
    for name, (way, limits, unknowns, seconds) in zip(("first", "second"), found):
        limit = limits[quantity]
        row |= {
            f"{name} way": way.told,
            f"{name} limit": limit.limit,
            f"{name} bar": limit.bar / limit.limit,
            f"{name} order": limit.order,
            f"{name} last value": limit.values[-1],
            f"{name} unknowns": unknowns,
            f"{name} CPU s": round(seconds, 1),
        }
    return row
