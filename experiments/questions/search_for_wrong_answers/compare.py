"""What two ways say of one scene, and where they differ by more than their levels do."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from contactopt import HalfSpace, InputError, Rigid, Scene, reduce_bodies, run, solve
from contactopt.problem.contact_status import contact_status
from contactopt.readings.quantities import elastic_energy
from experiments.questions.search_for_wrong_answers.meshes import Move

LEVELS = (0, 1, 2)  # each about twice as fine as the one before
FINER = (1, 2, 3)  # where the others disagree
OTHERS = ("nsgs", "lemke", "tresca")  # methods that may find other solutions than the default one
TOL = 1e-9  # of the certificate
ROUNDING = 1e-5  # of a quantity's scale: what the certificate leaves open
SHARP = 1e-4  # between one mesh and the same mesh moved
SLOWEST = 0.9  # largest ratio of the differences between levels that an estimate believes
# nodes among which a value at a point is fitted, in the plane and in space
SLOW = 20.0  # [s] for a method that may find another solution
AROUND = {2: 20, 3: 120}

Values = dict[str, float]


@dataclass(frozen=True, eq=False)
class Way:
    """One way to the answer.

    build    level -> scene of meshes, in the long form
    axes     components of its space that are those of the case
    swapped  whether upper and lower bodies are exchanged before it is solved
    move     how it is moved before it is solved
    simplest whether all that can be left out is left out before it is solved
    """

    build: Callable[[int], Scene]
    axes: tuple[int, ...] = (0, 1)
    swapped: bool = False
    move: Move | None = None
    simplest: bool = False


@dataclass(frozen=True, eq=False)
class Case:
    """Two ways to one answer, the first of which may be an exact one.

    points   body -> points of it where stress and displacement are read
    whole    whether both ways model whole bodies, so that forces across planes of symmetry can be
             compared
    smooth   whether the pressure is finite, so that its peak can be compared
    without  kinds of quantities that the two ways do not share
    loose    how far apart the surfaces are where they touch: places of contact are known to this
    strain   size of the strains and slopes by which the ways differ in geometry
    """

    family: str
    ways: tuple[Way | Values, Way]
    points: dict[str, list[tuple[float, ...]]] = field(default_factory=dict)
    whole: bool = True
    smooth: bool = False
    without: tuple[str, ...] = ()
    loose: float = 0.0
    strain: float = 0.0


def swapped(scene: Scene) -> Scene:
    """The scene with upper and lower exchanged in every pair."""
    other = {"upper": "lower", "lower": "upper", None: None}
    pairs = tuple(
        replace(pair, upper=pair.lower, lower=pair.upper, carrier=other[pair.carrier])
        for pair in scene.contacts
    )
    return replace(scene, contacts=pairs, bodies=tuple(_turned(part) for part in scene.bodies))


def _turned(part: Any) -> Any:
    if isinstance(part, Rigid) and part.normal is not None:
        return replace(part, normal=tuple(-np.array(part.normal)))
    return part


def read(way: Way, level: int, case: Case, moved: bool = True, degree: int | None = None) -> Values:
    """Solve a level of a way; all quantities in the frame and units of the case."""
    scene = way.build(level)
    scene = scene if degree is None else replace(scene, degree=degree)
    scene = swapped(scene) if way.swapped else scene
    move = way.move if moved and way.move is not None else Move(np.eye(scene.dim))
    result = run(
        move.scene(scene) if way.move is not None and moved else scene,
        tol=TOL,
        figures=(),
        simplest=way.simplest,
    )
    if result.problem.dim < scene.dim:
        move = Move(np.eye(result.problem.dim))
    if result.summary["status"] != "solved":
        raise ArithmeticError(f"{result.summary['status']}: {result.summary['message']}")
    L, S, axes, found = move.length, move.stress, list(way.axes), {}
    problem, r = result.problem, result.solution.reactions
    status = contact_status(problem, r)
    reduction = result.reduction
    found["energy"] = elastic_energy(reduction, result.solution) / (S * L**3)
    places = move.back(problem.coordinates)[axes] / L
    for i, (pair, table) in enumerate(zip(problem.pairs, result.summary["pairs"].values())):
        own, sign = pair.contacts, -1.0 if way.swapped else 1.0
        force = sign * move.back(np.array(table["force"])) / (S * L**2)
        n, area = np.maximum(r[own, 0], 0) / (S * L**2), problem.areas[own] / L**2
        total = max(n.sum(), 1e-300)
        found |= {f"force {axis} {i}": float(value) for axis, value in enumerate(force[axes])}
        found[f"normal {i}"] = total
        found[f"friction {i}"] = float(np.linalg.norm(r[own, 1:], axis=1).sum()) / (S * L**2)
        found[f"bearing {i}"] = float(np.sum(np.sqrt(n * area)) ** 2 / total)
        if case.smooth:
            found[f"pressure {i}"] = float(np.sum(n[area > 0] ** 2 / area[area > 0]) / total)
        found[f"reach {i}"] = float(
            np.sqrt(np.sum(n * np.sum(places[:, own] ** 2, axis=0)) / total)
        )
        found[f"stick {i}"] = float(n[status.stick[own]].sum() / total)
        if case.whole:
            found |= {
                f"centre {axis} {i}": float(x @ n / total) for axis, x in enumerate(places[:, own])
            }
        if case.smooth:
            found[f"peak {i}"] = (result.summary["pressure"] or table["max_pressure"]) / S
    for body in result.fields:
        at = move.back(body.mesh.p) / L
        at = at if axes == [0, 2] else at[axes]  # a section lies at y = 0, a slab is alike along z
        moved_by = move.back(body.displacement)[axes] / L
        for j, point in enumerate(case.points.get(body.name, [])):
            mean = body.stress[:, :3].sum(axis=1) / 3
            values = np.column_stack([moved_by.T, body.von_mises / S, mean / S])
            target = np.insert(point, 1, 0.0) if len(at) > len(point) else np.array(point)
            read_off = fitted(at - target[:, None], values, AROUND[len(body.mesh.p)])
            names = [f"moved {axis}" for axis in range(len(axes))] + ["von_mises", "mean_stress"]
            found |= {
                f"{name} {body.name} {j}": float(value) for name, value in zip(names, read_off)
            }
    return found


def fitted(offsets: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Values (m,) at a point of fields (n, m) at nodes, whose offsets (dim, n) from it are given.

    A quadratic is fitted among `count` nodes with weights that fall smoothly to zero. It knows no
    axes, so that turning changes nothing.
    """
    distance = np.linalg.norm(offsets, axis=0)
    reach = np.sort(distance)[min(count, len(distance) - 1)]
    near = distance < reach
    x, weights = offsets[:, near] / reach, (1 - distance[near] / reach)[:, None]
    pairs = [x[i] * x[j] for i in range(len(x)) for j in range(i, len(x))]
    terms = np.stack([np.ones(x.shape[1]), *x, *pairs], axis=1)
    return np.asarray(np.linalg.lstsq(terms * weights, values[near] * weights, rcond=None)[0][0])


def scale_of(name: str, values: list[Values]) -> float:
    """What a quantity is measured by: forces by the largest force, others by their kind."""
    kind = name.split()[0]
    groups = {
        "force": ("force", "normal"),
        "friction": ("normal",),
        "moved": ("moved",),
        "mean_stress": ("von_mises", "mean_stress", "pressure"),
        "von_mises": ("von_mises", "mean_stress", "pressure"),
        "centre": ("reach",),
    }
    same = groups.get(kind, (name,))
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
    """What came out of one seed.

    Disagreements in words, the width of the estimates in shares of the scales, and whether the
    problem has several solutions.
    """

    seed: int
    family: str
    wrong: tuple[str, ...]
    widths: tuple[float, ...] = ()
    several: bool = False

    @property
    def disagrees(self) -> bool:
        return bool(self.wrong) and not self.several


def compared(case: Case, levels: list[list[Values]]) -> tuple[list[str], list[float]]:
    """What two ways disagree on beyond their errors, and the widths of all estimates."""
    wrong, widths = [], []
    everything = [own for way in levels for own in way]
    for name in levels[0][0].keys() & levels[1][0].keys():
        if name.split()[0] in case.without:
            continue
        scale = scale_of(name, everything)
        rows = [np.array([own[name] for own in way]) for way in levels]
        width, apart = sum(error(row) for row in rows), abs(rows[0][-1] - rows[1][-1])
        widths.append(float(width / scale))
        loose = case.loose if name.split()[0] in ("centre", "reach") else 0.0
        if not apart <= width + (ROUNDING + case.strain) * scale + loose:
            told = " | ".join(" ".join(f"{value:.5g}" for value in row) for row in rows)
            wrong.append(f"{name}: {told}; apart {apart / scale:.1e}, levels {width / scale:.1e}")
    return wrong, widths


def judge(seed: int, case: Case) -> Verdict:
    """Compare the two ways of a case, and the second with itself where it is not moved.

    Where they disagree, both are compared once more on finer meshes, and then with quadratic
    displacements: linear elements lock in thin lips, and three of their levels may then differ less
    than the last one errs. Where friction leaves several solutions, two ways may find two of them,
    and both are right.
    """
    try:
        wrong, widths = compared(case, read_levels(case, LEVELS))
        for degree in (None, 2):
            if wrong:
                wrong, widths = compared(case, read_levels(case, FINER, degree))
        way = case.ways[1]
        bent = way.swapped and any(isinstance(part, HalfSpace) for part in way.build(0).bodies)
        if way.move is not None and not bent:
            wrong += unmoved(case, way)
        many = bool(wrong) and any(has_several(own) for own in case.ways if isinstance(own, Way))
    except Exception as failure:  # whatever stops a scene is what is looked for
        where = traceback.extract_tb(failure.__traceback__)[-1]
        return Verdict(
            seed, case.family, (f"{type(failure).__name__} at {where.name}: {str(failure)[:160]}",)
        )
    return Verdict(seed, case.family, tuple(sorted(wrong)), tuple(widths), many)


def read_levels(
    case: Case, levels: tuple[int, ...], degree: int | None = None
) -> list[list[Values]]:
    """What each way says on each level; an exact solution says it once."""
    return [
        [way]
        if isinstance(way, dict)
        else [read(way, level, case, degree=degree) for level in levels]
        for way in case.ways
    ]


def has_several(way: Way) -> bool:
    """Whether methods find two certified solutions of the coarsest problem that differ in force."""
    problem = reduce_bodies(way.build(LEVELS[0])).problem
    found = [solve(problem, tol=TOL).reactions]
    for method in OTHERS:
        with suppress(InputError):  # of a method that does not take this problem
            other = solve(problem, method, tol=TOL, time_limit=SLOW)
            found += [other.reactions] if other.status.label == "solved" else []
    return any(np.linalg.norm(r - found[0]) > SHARP * np.linalg.norm(found[0]) for r in found)


def unmoved(case: Case, way: Way) -> list[str]:
    """What changes when a way is not moved.

    The peak of a pressure that is all but even lies about any of its nodes.
    """
    still, moved = read(way, LEVELS[0], case, moved=False), read(way, LEVELS[0], case)
    return [
        f"{name} moved: {still[name]:.8g} becomes {moved[name]:.8g}"
        for name in still
        if name.split()[0] != "peak"
        and not abs(still[name] - moved[name]) <= SHARP * scale_of(name, [still, moved])
    ]
