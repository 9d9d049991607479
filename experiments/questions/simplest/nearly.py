"""Random scenes, nearly symmetric: what is called exact, beside the solved whole."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from skfem import MeshQuad, MeshTri

from contactopt import (
    BodyForce,
    Contact,
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
from contactopt.meshes.polar import ring
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.readings.quantities import approach, elastic_energy
from contactopt.simplification.proof import Spread
from contactopt.simplification.search import proved_part
from contactopt.solving.solve_scene import Options, Solved, solve_scene

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
    if rng.random() < 0.5:
        made = [_crossed(mesh) for mesh in made]
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


def _crossed(mesh: MeshQuad) -> MeshTri:
    """Four triangles for each square, which keep its symmetry."""
    p = np.concatenate([mesh.p, mesh.p[:, mesh.t].mean(axis=1)], axis=1)
    middle = mesh.p.shape[1] + np.arange(mesh.t.shape[1])
    cells = [np.stack([mesh.t[i], mesh.t[(i + 1) % 4], middle]) for i in range(4)]
    sides = {
        name: np.sort(mesh.facets[:, facets], axis=0) for name, facets in mesh.boundaries.items()
    }
    made = MeshTri(p, np.concatenate(cells, axis=1))
    keys = {tuple(pair): number for number, pair in enumerate(np.sort(made.facets, axis=0).T)}
    return made.with_boundaries(
        {name: np.array([keys[tuple(p)] for p in pairs.T]) for name, pairs in sides.items()}
    )


def tube(rng: np.random.Generator, spoil: float) -> Scene:
    """A tube under a plate: its bore is off, it is turned, or a spot of its rim is higher."""
    sectors, way = 4 * int(rng.integers(4, 10)), rng.integers(3) if spoil else -1
    angles = np.linspace(0, 2 * np.pi, sectors + 1) + (np.deg2rad(5) * spoil if way == 1 else 0.0)
    inner, radii = rng.uniform(0.3, 0.7), int(rng.integers(3, 6))
    made = ring(np.linspace(inner, 1, radii + 1), angles)
    straight = MeshQuad(made.p[:, : made.nvertices], made.t)
    depth = (1 - np.linalg.norm(straight.p, axis=0)) / (1 - inner)
    off = np.array([[np.cos(rng.uniform(0, 6))], [np.sin(rng.uniform(0, 6))]]) * (
        0.05 * spoil if way == 0 else 0.0
    )
    mesh = MeshQuad(straight.p + off * depth, straight.t).with_boundaries(
        {
            "bore": lambda x: np.linalg.norm(x - off, axis=0) < (1 + 3 * inner) / 4,
            "contact": lambda x: (np.linalg.norm(x, axis=0) > (3 + inner) / 4) & (x[1] > 0.2),
        }
    )

    def gap(p: np.ndarray) -> np.ndarray:
        return (
            1 - p[1] - (0.01 * spoil * np.exp(-(((p[0] - 0.07) / 0.03) ** 2)) if way == 2 else 0.0)
        )

    plate = Rigid("plate", (0.0, 1.0), gap, {"x": 0.0, "y": -(10 ** rng.uniform(-2, -0.5))})
    return Scene("tube", plate, Part("tube", mesh, SOFT, (Support("bore"),)), rng.uniform(0, 0.5))


def bridge(rng: np.random.Generator, spoil: float) -> Scene:
    """A beam on two piers: one is heavier, softer, more slippery, or its floor is lower."""
    way, count = rng.integers(4) if spoil else -1, int(rng.integers(1, 4))

    def solid(
        name: str, x: tuple[float, float], y: tuple[float, float], own: float, wrong: bool
    ) -> Part:
        ticks = [np.linspace(low, high, round(high - low) * 2 * count + 1) for low, high in (x, y)]
        weight = -1e-3 * (1 + spoil * (wrong and way == 0))
        material = Material(own * (1 + spoil * (wrong and way == 1)), 0.3)
        loads = (
            BodyForce((0.0, weight)),
            *((Traction("top", (0.0, -0.2)),) if name == "beam" else ()),
        )
        return Part(
            name, rename(tensor_mesh(*ticks), contact="y-", top="y+"), material, loads=loads
        )

    left = solid("left", (-5, -3), (0, 4), 5.0, False)
    right = solid("right", (3, 5), (0, 4), 5.0, True)
    beam = solid("beam", (-6, 6), (4, 6), 20.0, False)
    mu = rng.uniform(0.3, 0.7)
    pairs = [
        Contact(name, "floor", mu * (1 + spoil * (way == 2 and name == "right")))
        for name in ("left", "right")
    ]
    pairs += [Contact("beam", f"{name}:top", mu) for name in ("left", "right")]
    floor = Rigid("floor", gap=lambda p: 0.1 * spoil * (p[0] > 4.1) * (way == 3))
    return Scene("bridge", bodies=(floor, left, right, beam), contacts=tuple(pairs))


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


KINDS: tuple[Callable[[np.random.Generator, float], Scene], ...] = (
    block,
    punch,
    tube,
    bridge,
    roller,
)


def numbers(solved: Solved) -> np.ndarray:
    """Energy, approach and peak pressure of the whole, whatever part of it is modelled."""
    problem, solution = solved.reduction.problem, solved.solution
    r = solution.reactions
    energy = elastic_energy(solved.reduction, solution)
    peak = float((r[:, 0] / problem.areas).max())
    return np.array([energy, approach(problem, solution) or 0.0, peak])


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
        return row | {
            "proof": 0.0,
            "certificate": 0.0,
            "difference": 0.0,
            "said": " ".join(found.notes),
        }
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
    return row | measured | {"difference": float(apart.max()), "said": " ".join(found.notes)}


def rows(count: int) -> list[Row]:
    """All scenes up to a number."""
    made = []
    for number in range(count):
        made.append(checked(number))
        print({key: value for key, value in made[-1].items() if key != "said"}, flush=True)
    return made


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


def prices() -> list[Row]:
    """Processor seconds of the whole, and of the part with its proof, the least of three."""
    made = []
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
    for name, scene in named.items():
        seconds = []
        for solve in (lambda s=scene: solve_scene(s), lambda s=scene: proved_part(s, Options())):
            own = []
            for _ in range(3):
                begin = time.process_time()
                solve()
                own.append(time.process_time() - begin)
            seconds.append(min(own))
        kept = proved_part(scene, Options())[0].found
        unknowns = f"{kept[0].before[0]} -> {kept[-1].after[0]}"
        made.append(
            {
                "scene": name,
                "unknowns": unknowns,
                "whole, s": seconds[0],
                "part and proof, s": seconds[1],
            }
        )
    return made
