"""A way to a value: a sequence of meshes, each of them the one before with all elements halved, and
what the sequence converges to.

From three values in a row, v0, v1 and v2, follows the order p of the error, 2^p = (v1 - v0) / (v2 -
v1), and the limit v2 + (v2 - v1) / (2^p - 1). The bar of a limit is what it differs from the limit
one mesh earlier, the last step where there is none, and at least LUCK times what it differs from
the last value: limits can agree by luck. Where the order is not between SLOWEST and FASTEST there
is no limit: the last value stands. Its bar is the last step, and at least LUCK times the step
before: an error of first order is still as large. Where contact ends by itself, the edge is put on
a node of every mesh, so that the sequence sees one and the same error.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contactopt.problem import Status
from contactopt.readings.quantities import value_of
from contactopt.scenes.refined_scenes import split_scene
from contactopt.scenes.scene import Scene
from contactopt.solving.solve_scene import Options, Solved, solve_scene
from contactopt.solving.zone import solve_zone
from experiments.questions.classics.bodies import centre_of_friction

SLOWEST, FASTEST, LUCK = 0.7, 5.0, 0.5
EXACT = 1e-10  # relative step below which a sequence stands still
TIGHT = Options(tol=1e-10)
OWN = {"centre of friction": centre_of_friction}  # quantities that contactopt does not have


@dataclass(frozen=True)
class Way:
    """A scene on a sequence of meshes: `base` elements across the half-width of contact on the
    first of `levels` meshes, and displacements of a degree.
    """

    scene: Scene
    base: int
    levels: int
    degree: int

    @property
    def told(self) -> str:
        return f"degree {self.degree}, {self.base} to {self.base * 2 ** (self.levels - 1)} elements"


@dataclass(frozen=True)
class Limit:
    """What a sequence converges to: values on all meshes, limit, its bar, order [-] (nan: none)."""

    values: tuple[float, ...]
    limit: float
    bar: float
    order: float


def limit_of(values: Sequence[float]) -> Limit:
    """The limit of a sequence of at least three values, each on elements half as large."""
    found = [_extrapolated(*values[i : i + 3]) for i in range(len(values) - 2)]
    (last, order), step = found[-1], abs(values[-1] - values[-2])
    if step <= EXACT * abs(values[-1]):
        return Limit(tuple(values), values[-1], EXACT * abs(values[-1]), np.nan)
    if not np.isfinite(last):
        bar = max(step, abs(values[-2] - values[-3]) * LUCK)
        return Limit(tuple(values), values[-1], bar, np.nan)
    before = found[-2][0] if len(found) > 1 else np.nan
    bar = abs(last - before) if np.isfinite(before) else step
    return Limit(tuple(values), last, max(bar, LUCK * abs(last - values[-1])), order)


def _extrapolated(v0: float, v1: float, v2: float) -> tuple[float, float]:
    """The limit and the order; nan where the values show none."""
    ratio = (v1 - v0) / (v2 - v1) if v2 != v1 else np.inf
    order = float(np.log2(ratio)) if ratio > 0 else np.nan
    if not SLOWEST <= order <= FASTEST:
        return np.nan, np.nan
    return v2 + (v2 - v1) / (ratio - 1), order


def follow_way(way: Way, quantities: Sequence[str]) -> tuple[dict[str, Limit], int, float]:
    """The limits of some quantities, the unknowns of the last mesh, and CPU seconds."""
    start, scene = time.process_time(), replace(way.scene, degree=way.degree)
    found: dict[str, list[float]] = {quantity: [] for quantity in quantities}
    zone, unknowns = scene.zone, 0
    if zone is not None and len(scene.pairs) == 1:
        for level in (way.levels - 2, way.levels - 1):
            fine = replace(split_scene(scene, way.base, level), zone=zone)
            zone = solve_zone(fine, way.base, TIGHT).zones[-1]
    for level in range(way.levels):
        solved = solve_scene(split_scene(scene, way.base, level), way.base, zone, TIGHT)
        unknowns = solved.reduction.dofs
        for quantity in quantities:
            found[quantity].append(_value(quantity, solved))
    limits = {quantity: limit_of(values) for quantity, values in found.items()}
    return limits, unknowns, time.process_time() - start


def _value(quantity: str, solved: Solved) -> float:
    scene, status = solved.reduction.scene, solved.solution.status
    if status is not Status.SOLVED:
        raise RuntimeError(f"scene '{scene.name}' is not solved: {status}.")
    if quantity in OWN:
        return OWN[quantity](solved.reduction, solved.solution)
    return value_of(quantity, solved.reduction, solved.solution)
