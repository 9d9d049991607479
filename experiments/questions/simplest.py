"""What may be left out of a scene before it is solved, what does that save, and which errors does
it make?

Random scenes, most of them only nearly symmetric: what is called exact, beside the solved whole. A
number after the command is that of scenes for a quick look at them alone.
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt import (
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    Traction,
    scenes,
    simplify,
)
from contactopt import natural_map_residual as certificate
from contactopt.coupling.reduction import reduce_bodies
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.readings.plate_motions import approach
from contactopt.readings.quantities import elastic_energy
from contactopt.simplification.proof import Spread
from contactopt.simplification.search import proved_part
from contactopt.solving.solve_scene import Options, Solved, solve_scene
from experiments.report import markdown, measure, template

Row = dict[str, Any]
SOFT, STIFF = Material(5.0, 0.3), Material(20.0, 0.2)
SPOILT = 0.65  # share of the scenes that are only nearly symmetric
SMALLEST, LARGEST = 1e-7, 0.3  # how much these are spoilt, beside what is there
TIGHT = Options(tol=1e-11)
WRONG = 1e-4  # relative difference from the whole from which on an exact answer is wrong


def block(rng: np.random.Generator, spoil: float) -> Scene:
    """A rigid indenter on a block: a gap, friction, force, traction or mesh is on one side."""
    count, way = int(rng.integers(6, 20)), rng.integers(5) if spoil else -1
    ticks = (
        np.sin(np.linspace(-np.pi / 2, np.pi / 2, 2 * count + 1)) if rng.random() < 0.5 else None
    )
    x = 3 * (np.linspace(-1, 1, 2 * count + 1) if ticks is None else ticks) + rng.choice([0.0, 7.3])
    middle, place, wide = (x[0] + x[-1]) / 2, rng.uniform(0.1, 2.5), 10 ** rng.uniform(-2, 0)
    radius, friction = 10 ** rng.uniform(0.5, 2.5), rng.uniform(0.0, 0.6)
    mesh: Any = rename(tensor_mesh(x, np.linspace(-3, 0, count + 1)), contact="y+", bottom="y-")
    if way == 4:
        mesh = replace(
            mesh, doflocs=mesh.p + spoil * np.array([[0.2], [0.0]]) * (mesh.p[0] > middle + 1)
        )

    def there(p: np.ndarray) -> np.ndarray:
        return np.exp(-(((p[0] - middle - place) / wide) ** 2))

    def gap(p: np.ndarray) -> np.ndarray:
        return (p[0] - middle) ** 2 / (2 * radius) - (0.3 * spoil * there(p) if way == 0 else 0.0)

    def mu(p: np.ndarray) -> np.ndarray:
        return friction * (1 + 0.1 * np.abs(p[0] - middle)) + (
            spoil * there(p) if way == 1 else 0.0
        )

    pull = (Traction("x+", (spoil, 0.0)),) if way == 3 else ()
    weight = 10 ** rng.uniform(-2, 0.5)
    force = {"x": spoil * friction * weight if way == 2 else 0.0, "y": -weight}
    return Scene(
        "block",
        Rigid("indenter", (0.0, 1.0), gap, force),
        Part("block", mesh, SOFT, (Support("bottom"),), pull),
        mu,
    )


def punch(rng: np.random.Generator, spoil: float) -> Scene:
    """A punch on a larger block: its load, a traction or a node is off."""
    across, way = int(rng.integers(3, 7)), rng.integers(4) if spoil else -1
    fine = rng.integers(1, 3)
    upper = tensor_mesh(np.linspace(-2, 2, 2 * across + 1), np.linspace(0, 2, across + 1))
    lower = tensor_mesh(np.linspace(-4, 4, 4 * fine * across + 1), np.linspace(-3, 0, across + 1))
    made = [rename(upper, contact="y-", top="y+"), rename(lower, contact="y+", bottom="y-")]
    if way == 2:
        row = np.argmax(made[0].p[0])
        made[0].p[0, row] += spoil
    force = {"x": 0.3 * spoil if way == 0 else 0.0, "y": -10.0}
    loads = (
        Plate("top", force),
        Traction("x+", (-0.5, 0.0)),
        Traction("x-", (0.5 + spoil * (way == 1), 0.0)),
    )
    stiff = STIFF if way != 3 else Material(STIFF.E * (1 + spoil), STIFF.nu)
    top = Part("punch", made[0], SOFT, loads=loads)
    ground = Part(
        "ground",
        made[1],
        stiff,
        (Support("bottom"), *((Support("x-", {"x": 0.0}),) if way == 3 else ())),
    )
    return Scene("punch", top, ground, rng.uniform(0.1, 0.8))


def roller(rng: np.random.Generator, spoil: float) -> Scene:
    """A rigid roller on a block: a ridge, a slippery band, a crown, or an end that is free."""
    way, count = rng.integers(5) if spoil else -1, int(rng.integers(3, 6))
    depth, place, wide = rng.uniform(1, 4), rng.uniform(0, 1), rng.uniform(0.03, 0.3)
    ticks = (
        np.linspace(-3, 3, 2 * count + 1),
        np.linspace(0, depth, int(rng.integers(3, 7))),
        np.linspace(-3, 0, count),
    )
    mesh = rename(tensor_mesh(*ticks), contact="z+", bottom="z-", near="y-", far="y+")

    def band(p: np.ndarray) -> np.ndarray:
        return np.abs(p[1] / depth - place) < wide

    def gap(p: np.ndarray) -> np.ndarray:
        crown = 0.1 * spoil * (p[1] / depth - 0.5) ** 2 if way == 2 else 0.0
        return p[0] ** 2 / 20 - 0.3 * spoil * band(p) * (way == 0) + crown

    def mu(p: np.ndarray) -> np.ndarray:
        return 0.3 + spoil * band(p) * (way == 1) + 0.0 * p[0]

    ends = [Support("near", {"y": 0.0}), Support("far", {"y": 0.0})]
    curve = (
        (lambda x: x + np.array([[0], [0], [1]]) * 0.01 * spoil * x[1] / depth)
        if way == 4
        else None
    )
    held = (Support("bottom"), *ends[: 1 if way == 3 else 2])
    weight = 10 ** rng.uniform(-1, 0.7) * depth
    force = {"x": rng.choice([0.0, 0.1]) * weight, "z": -weight}
    block = Part("block", mesh, SOFT, held, curve=curve)
    return Scene("roller", Rigid("roller", (0.0, 0.0, 1.0), gap, force), block, mu, kind="solid")


KINDS: tuple[Callable[[np.random.Generator, float], Scene], ...] = (block, punch, roller)
COUNT = 300  # scenes


def numbers(solved: Solved) -> np.ndarray:
    """Energy, approach and peak pressure of the whole, whatever part of it is modelled."""
    problem, solution = solved.reduction.problem, solved.solution
    r = solution.reactions
    energy = elastic_energy(solved.reduction, solution)
    peak = float((r[:, 0] / problem.areas).max())
    return np.array([energy, approach(solved.reduction, solution) or 0.0, peak])


def scene_of(number: int) -> tuple[Scene, float]:
    """The scene of that number, and by how much it is spoilt."""
    rng = np.random.default_rng(number)
    spoil = (
        10 ** rng.uniform(np.log10(SMALLEST), np.log10(LARGEST)) if rng.random() < SPOILT else 0.0
    )
    return KINDS[number % len(KINDS)](rng, spoil), spoil


def checked(number: int) -> Row:
    """One scene: what was called exact, its proof, the reduced whole and its solution."""
    scene, spoil = scene_of(number)
    found = simplify(scene)
    exact = [each for each in found.found if each.exact]
    row: Row = {"scene": number, "kind": scene.name, "spoilt by": spoil, "exact": len(exact)}
    if not exact:
        return row | {"proof": 0.0, "certificate": 0.0, "difference": 0.0}
    part, whole = solve_scene(found.scene, options=TIGHT), solve_scene(scene, options=TIGHT)
    spread = Spread(part, [fold for each in exact for fold in each.folds])
    made = reduce_bodies(scene)
    parts = [
        spread.reactions(pair, coupling) for pair, coupling in zip(scene.pairs, made.couplings)
    ]
    r = np.concatenate([own[0] for own in parts if own is not None])
    ours, theirs = numbers(part), numbers(whole)
    apart = np.abs(ours - theirs) / np.maximum(np.abs(theirs), 1e-12 * np.abs(theirs).max())
    measured = {"proof": exact[-1].proof, "certificate": certificate(made.problem, r)}
    return row | measured | {"difference": float(apart.max())}


def rows(count: int) -> list[Row]:
    """All scenes up to a number."""
    return [checked(number) for number in range(count)]


def table(checks: list[Row]) -> list[Row]:
    """What was found, by the kind of scene."""
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in checks:
        groups[row["kind"], "nearly symmetric" if row["spoilt by"] else "symmetric"].append(row)
    made = []
    for (kind, sort), own in sorted(groups.items()):
        exact = [row for row in own if row["exact"]]
        least = min(
            (row["spoilt by"] for row in own if row["spoilt by"] and not row["exact"]), default=0.0
        )
        worst = {
            key: max((row[key] for row in exact), default=0.0)
            for key in ("proof", "certificate", "difference")
        }
        wrong = sum(row["difference"] > WRONG for row in exact)
        counts = {"kind": kind, "scenes": sort, "count": len(own), "called exact": len(exact)}
        made.append(counts | worst | {"wrong": wrong, "least spoilt of the others": least})
    return made


def least(act: Callable[[], object]) -> float:
    """Processor seconds, the least of three."""
    seconds = []
    for _ in range(3):
        begin = time.process_time()
        act()
        seconds.append(time.process_time() - begin)
    return min(seconds)


def prices() -> list[Row]:
    """What the whole costs, and the part with its proof."""
    ticks = [np.linspace(-2, 2, 17), np.linspace(-2, 2, 17), np.linspace(0, 3, 13)]
    mesh = rename(tensor_mesh(*ticks), contact="z-", top="z+", near="y-", far="y+")
    plate = Plate("top", {"x": 0.0, "y": 0.0, "z": -5.0})
    cube = Part("block", mesh, SOFT, loads=(plate,))
    held = tuple(Support(name, {"y": 0.0}) for name in ("near", "far"))
    layer = Part("block", mesh, SOFT, held, (Plate("top", {"x": 0.0, "z": -5.0}, glued=False),))
    named = {
        "arch, 16 elements across": scenes.arch(elements=16),
        "arch, 32 elements across": scenes.arch(elements=32),
        "cube": Scene("cube", cube, Rigid("floor"), 0.3, kind="solid"),
        "cube between rollers": Scene("layer", layer, Rigid("floor"), 0.3, kind="solid"),
    }
    made = []
    for name, scene in named.items():
        kept = proved_part(scene, Options())[0].found
        row = {"scene": name, "unknowns": f"{kept[0].before[0]} -> {kept[-1].after[0]}"}
        row["whole, s"] = least(lambda own=scene: solve_scene(own))
        row["part and proof, s"] = least(lambda own=scene: proved_part(own, Options()))
        made.append(row)
    return made


if __name__ == "__main__":
    if sys.argv[1:] and sys.argv[1].isdigit():
        print(markdown(table(rows(int(sys.argv[1])))))
    else:
        parts = {"nearly": lambda: table(rows(COUNT)), "prices": prices}
        measure("simplest", "The cheapest model first", template(__file__), parts)
