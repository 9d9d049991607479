"""Named scenes on the meshes that they have by default, beside exact values where the bodies are
large enough for them, else beside limits of quadratic displacements.
"""

from __future__ import annotations

from typing import Any

from contactopt import scenes
from contactopt.readings.quantities import value_of
from contactopt.solving.zone import solve_zone
from experiments.questions.classics.sequences import Way, follow_way

LEVELS = 3  # meshes of the limit
GOOD = {"pressure": 1e-3, "normal_force": 1e-3, "width": 2e-3, "stick": 2e-3}
ROUND = ("pressure", "width", "stick")
# quantities, and elements of the first of these meshes; none: exact
NAMED = {
    "sphere": (ROUND, 12),
    "cylinder-2d": (ROUND, 8),
    "hertz-dissimilar": (ROUND, 12),
    "pin-in-bush": (("pressure", "width", "normal_force"), 8),
    "press-fit": (("pressure", "normal_force"), 12),
    "punch-2d": (("stick",), 12),
    "rigid-punch-2d": (("stick",), 0),
    "rigid-punch-axisymmetric": (("stick",), 0),
    "cattaneo-2d": (ROUND, 0),
    "cattaneo-3d": (ROUND, 0),
}


def defaults_of(name: str) -> list[dict[str, Any]]:
    """The rows of one named scene."""
    scene, (quantities, first) = scenes.make_scene(name), NAMED[name]
    solved, exact = solve_zone(scene), scene.reference
    if first:
        limits = follow_way(Way(scene, first, LEVELS, 2), quantities)[0]
        found = {quantity: (one.limit, one.bar) for quantity, one in limits.items()}
    else:
        stick = exact.stick_half_width / exact.half_width
        found = {"pressure": (exact.peak, 0.0), "width": (exact.half_width, 0.0)}
        found["stick"] = stick, 0.0
    rows = []
    for quantity in quantities:
        value, (true, bar) = value_of(quantity, solved.reduction, solved.solution), found[quantity]
        off, bar = value / true - 1, bar / true
        known = bar <= GOOD[quantity] / 2
        rows.append(
            {
                "scene": name,
                "quantity": quantity,
                "unknowns": solved.reduction.dofs,
                "default": value,
                "true": true,
                "bar": bar,
                "off": off,
                "asked": GOOD[quantity],
                "within": ("yes" if abs(off) <= GOOD[quantity] else "no") if known else "unknown",
            }
        )
    return rows
