"""What two ways say of one scene, and where they differ by more than their levels do."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from contactopt import Scene, run
from contactopt.problem.contact_status import contact_status
from contactopt.readings.quantities import elastic_energy

LEVELS = (0, 1, 2)  # each about twice as fine as the one before
FINER = (1, 2, 3)  # where the others disagree
TOL = 1e-9  # of the certificate
ROUNDING = 1e-5  # of a quantity's scale: what the certificate leaves open
SLOWEST = 0.9  # largest ratio of the differences between levels that an estimate believes
AROUND = 20  # nodes among which a value at a point is fitted

Values = dict[str, float]
Way = Callable[[int], Scene]  # level -> scene of meshes


@dataclass(frozen=True, eq=False)
class Case:
    """Two ways to one answer, the first of which may be an exact one.

    points   body -> points of it where stress and displacement are read
    swapped  whether upper and lower are exchanged in every pair of the second way
    loose    how far apart the surfaces are where they touch: places of contact are known to this
    model    error of the exact solution as a model of the scene, over the size of each quantity
    """

    family: str
    ways: tuple[Way | Values, Way]
    points: dict[str, list[Any]] = field(default_factory=dict)
    swapped: bool = False
    loose: float = 0.0
    model: float = 0.0

    @property
    def smooth(self) -> bool:
        """Whether the pressure is finite, so that its peak and its mean can be compared."""
        return not callable(self.ways[0])


def swapped(scene: Scene) -> Scene:
    """The scene with upper and lower exchanged in every pair."""
    other = {"upper": "lower", "lower": "upper", None: None}
    pairs = tuple(
        replace(pair, upper=pair.lower, lower=pair.upper, carrier=other[pair.carrier])
        for pair in scene.contacts
    )
    return replace(scene, contacts=pairs)


def read(scene: Scene, case: Case, exchanged: bool) -> Values:
    """Solve a scene, whose sides may be exchanged before, and read all quantities."""
    scene = swapped(scene) if exchanged else scene
    result = run(scene, tol=TOL, figures=())
    if result.summary["status"] != "solved":
        raise ArithmeticError(f"{result.summary['status']}: {result.summary['message']}")
    problem, r = result.problem, result.solution.reactions
    status = contact_status(problem, r)
    found = {"energy": elastic_energy(result.reduction, result.solution)}
    for i, (pair, table) in enumerate(zip(problem.pairs, result.summary["pairs"].values())):
        own = pair.contacts
        n, area, places = np.maximum(r[own, 0], 0), problem.areas[own], problem.coordinates[:, own]
        total = max(n.sum(), 1e-300)
        sign = -1.0 if exchanged else 1.0
        found |= {f"force {axis} {i}": sign * float(f) for axis, f in enumerate(table["force"])}
        found |= {f"centre {axis} {i}": float(x @ n / total) for axis, x in enumerate(places)}
        found |= {
            f"normal {i}": total,
            f"friction {i}": float(np.linalg.norm(r[own, 1:], axis=1).sum()),
            f"bearing {i}": float(np.sum(np.sqrt(n * area)) ** 2 / total),
            f"reach {i}": float(np.sqrt(np.sum(n * np.sum(places**2, axis=0)) / total)),
            f"stick {i}": float(n[status.stick[own]].sum() / total),
        }
        if case.smooth:
            mean = float(np.sum(n[area > 0] ** 2 / area[area > 0]) / total)
            found |= {f"pressure {i}": mean, f"peak {i}": result.summary["pressure"]}
    for body in result.fields:
        mean = body.stress[:, :3].sum(axis=1) / 3
        values = np.column_stack([body.displacement.T, body.von_mises, mean])
        names = [f"moved {axis}" for axis in range(scene.dim)] + ["von_mises", "mean_stress"]
        for j, point in enumerate(case.points.get(body.name, [])):
            at = fitted(body.mesh.p - np.array(point)[:, None], values)
            found |= {f"{name} {body.name} {j}": float(x) for name, x in zip(names, at)}
    return found


def fitted(offsets: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (m,) at a point of fields (n, m) at nodes, whose offsets (dim, n) from it are given.

    A quadratic is fitted among AROUND nodes with weights that fall smoothly to zero.
    """
    distance = np.linalg.norm(offsets, axis=0)
    reach = np.sort(distance)[min(AROUND, len(distance) - 1)]
    near = distance < reach
    (x, y), weights = offsets[:, near] / reach, (1 - distance[near] / reach)[:, None]
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    return np.asarray(np.linalg.lstsq(terms * weights, values[near] * weights, rcond=None)[0][0])


STRESS = ("von_mises", "mean_stress", "pressure")
SAME = {  # kind of quantity -> kinds whose largest value it is measured by, if not its own
    "force": ("force", "normal"),
    "friction": ("normal",),
    "moved": ("moved",),
    "mean_stress": STRESS,
    "von_mises": STRESS,
    "centre": ("reach",),
}


def scale_of(name: str, values: list[Values]) -> float:
    """What a quantity is measured by: forces by the largest force, others by their kind."""
    kind = name.split()[0]
    same = SAME.get(kind, (name,))
    if kind == "stick":
        return 1.0
    sizes = [
        abs(own[key]) for own in values for key in own if key in same or key.split()[0] in same
    ]
    return max(sizes, default=1.0) or 1.0


def error(row: np.ndarray) -> float:
    """The error of the last of three levels: their range, or more if they hardly converge."""
    if len(row) < 3:
        return 0.0
    first, last = np.abs(np.diff(row))[-2:]
    ratio = min(last / max(first, 1e-300), SLOWEST)
    return float(max(np.ptp(row), last * ratio / (1 - ratio)))


@dataclass(frozen=True)
class Verdict:
    """What came out of one seed: disagreements in words, and the width of the estimates in shares
    of the scales.
    """

    seed: int
    family: str
    wrong: tuple[str, ...]
    widths: tuple[float, ...] = ()


def compared(case: Case, levels: list[list[Values]]) -> tuple[list[str], list[float]]:
    """What two ways disagree on beyond their errors, and the widths of all estimates."""
    wrong, widths = [], []
    everything = [own for way in levels for own in way]
    for name in sorted(levels[0][0].keys() & levels[1][0].keys()):
        scale = scale_of(name, everything)
        rows = [np.array([own[name] for own in way]) for way in levels]
        width, apart = sum(error(row) for row in rows), abs(rows[0][-1] - rows[1][-1])
        widths.append(float(width / scale))
        loose = case.loose if name.split()[0] in ("centre", "reach") else 0.0
        if not apart <= width + (ROUNDING + case.model) * scale + loose:
            told = " | ".join(" ".join(f"{value:.5g}" for value in row) for row in rows)
            wrong.append(f"{name}: {told}; apart {apart / scale:.1e}, levels {width / scale:.1e}")
    return wrong, widths


def judge(seed: int, case: Case) -> Verdict:
    """Compare the two ways of a case.

    Where they disagree, both are compared once more on finer meshes, and then with quadratic
    displacements: linear elements lock in thin lips, and three of their levels may then differ less
    than the last one errs.
    """
    try:
        wrong, widths = compared(case, read_levels(case, LEVELS))
        for degree in (None, 2):
            if wrong:
                wrong, widths = compared(case, read_levels(case, FINER, degree))
    except Exception as failure:  # whatever stops a scene is what is looked for
        where = traceback.extract_tb(failure.__traceback__)[-1]
        told = f"{type(failure).__name__} at {where.name}: {str(failure)[:160]}"
        return Verdict(seed, case.family, (told,))
    return Verdict(seed, case.family, tuple(wrong), tuple(widths))


def read_levels(
    case: Case, levels: tuple[int, ...], degree: int | None = None
) -> list[list[Values]]:
    """What each way says on each level; an exact solution says it once."""

    def one(number: int, level: int) -> Values:
        scene = case.ways[number](level)  # type: ignore[operator]
        scene = scene if degree is None else replace(scene, degree=degree)
        return read(scene, case, exchanged=case.swapped and number == 1)

    return [
        [one(number, level) for level in levels] if callable(way) else [way]
        for number, way in enumerate(case.ways)
    ]
