"""Random scenes of many kinds, each with two ways to its answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt import BodyForce, HalfSpace, Material, Part, Plate, Rigid, Scene, Support, Traction
from contactopt.analytic import contact_modulus, hertz_line, hertz_point, press_fit
from contactopt.scenes.round import cylinder
from contactopt.scenes.discs import half_disc
from contactopt.scenes.meshes import graded, simplices, tensor_mesh
from experiments.questions.search_for_wrong_answers.compare import Case, Values, Way, scene_of
from experiments.questions.search_for_wrong_answers.meshes import (
    extruded,
    named,
    outlined,
    quads,
    random_move,
    ring,
    ticks,
)

Random = np.random.Generator
Build = Callable[[int], Any]


def material(rng: Random) -> Material:
    return Material(float(10 ** rng.uniform(0, 1.5)), float(rng.uniform(0, 0.45)))


def friction(rng: Random) -> float:
    return 0.0 if rng.random() < 0.2 else float(rng.uniform(0.05, 1.0))


def other_way(rng: Random, template: Callable[[dict[str, Any], dict[str, Any]], Scene], meshes: dict[str, Build]) -> Way:
    """The second way: these meshes coupled by mortar, carried by either side, exchanged or not, and moved."""
    settings = {"coupling": "mortar", "carrier": str(rng.choice(["upper", "lower"])), "degree": int(rng.integers(1, 3))}

    def build(level: int) -> Scene:
        return template({name: mesh(level) for name, mesh in meshes.items()}, dict(settings))

    return Way(build, swapped=bool(rng.random() < 0.5), move=random_move(rng, build(0)))


def first_way(rng: Random, template: Callable[[dict[str, Any], dict[str, Any]], Scene], meshes: dict[str, Build]) -> Way:
    """The first way: structured meshes whose nodes match, quadrilaterals or, cut, triangles."""
    cut, degree = rng.random() < 0.3, int(rng.integers(1, 3))

    def build(level: int) -> Scene:
        made = {name: mesh(level) for name, mesh in meshes.items()}
        return template({name: simplices(m) if cut else m for name, m in made.items()}, {"degree": degree})

    return Way(build)


def polygon(corners: Any, names: list[str], touching: set[str], extra: dict[str, list[float]] | None = None) -> Callable:
    """Size -> triangles of Gmsh in a polygon, small along the sides that touch; `extra`: shares of a side with corners."""

    def mesh(size: float) -> Any:
        loop, count = [], len(corners)
        for i, name in enumerate(names):
            a, b = np.array(corners[i], dtype=float), np.array(corners[(i + 1) % count], dtype=float)
            fine = name in touching or names[i - 1] in touching
            loop.append((*a, size if fine else 3 * size, name))
            loop += [(*(a + s * (b - a)), size, name) for s in (extra or {}).get(name, [])]
        return outlined(loop)

    return mesh


SIDES = ["bottom", "right", "top", "left"]


def column(rng: Random, layers: int, thin: bool) -> tuple[list[Any], list[Any], float]:
    """Corners of bodies one upon another, where along their upper sides they touch, and the sum of the gaps between them."""
    bodies, patches, y, gaps = [], [], 0.0, 0.0
    left, right = 0.0, float(rng.uniform(2, 4))
    for layer in range(layers):
        height = float(rng.uniform(0.5, 1.5) if layer == 0 or not thin or rng.random() < 0.6 else rng.uniform(0.05, 0.2))
        a, b = (rng.uniform(-0.15, 0.15, 2) * (right - left)) if layer == layers - 1 else (0.0, 0.0)
        bodies.append([(left, y), (right, y), (right + b, y + height), (left + a, y + height)])
        wide = (right - left) * float(1.0 if rng.random() < 0.3 else rng.uniform(0.5, 0.95))
        start = left + float(rng.uniform(0, 1)) * (right - left - wide)
        patches.append((start, start + wide))
        apart = float(rng.uniform(0.01, 0.3)) if rng.random() < 0.3 else 0.0
        left, right, y = start, start + wide, y + height + apart
        gaps += apart if layer < layers - 1 else 0.0
    return bodies, patches[:-1], gaps


def stack(rng: Random, layers: int = 2, solid: bool = False) -> Case:
    """Blocks one upon another, thin ones among them, pressed by a plate, a traction or their weight; or as a slab in space."""
    corners, patches, gaps = column(rng, layers, not solid)
    names, mu, materials = [f"body {i}" for i in range(layers)], friction(rng), [material(rng) for _ in range(layers)]
    force, lean = float(10 ** rng.uniform(-3, -1)), float(rng.uniform(-0.6, 0.6)) * mu
    top = corners[-1]
    span, depth = top[2][0] - top[3][0], float(rng.uniform(0.3, 1.0)) if solid else 1.0
    flat = abs(lean) * sum(c[2][1] - c[0][1] for c in corners) < 0.2 * min(c[1][0] - c[0][0] for c in corners)
    kind = rng.choice(["plate", "traction", "weight", "moved"]) if mu > 0.1 and flat else rng.choice(["plate", "moved"])
    law = str(rng.choice(["coulomb", "tresca", "tied"], p=[0.8, 0.1, 0.1])) if gaps == 0 and mu else "coulomb"
    load: Any = Plate("top", {"x": lean * force, "y": -force})
    if mu == 0:
        load = Plate("top", {"y": -force})
    third = (0.0,) if solid else ()
    if kind == "traction":
        load = Traction("top", (lean * force / span / depth, -force / span / depth, *third))
    elif kind == "weight":
        load = BodyForce((lean * force, -force, *third))
    shift = {"x": lean * 1e-3, "y": -gaps - 1e-3}
    rollers = (Support("near", {"z": 0.0}), Support("far", {"z": 0.0}))

    def template(meshes: dict[str, Any], settings: dict[str, Any]) -> Scene:
        space = len(next(iter(meshes.values())).p) == 3
        bodies = []
        for i, name in enumerate(names):
            held = ((Support("bottom"),) if i == 0 else ()) + (rollers if space else ())
            own = load if space or kind in ("plate", "moved") else replace(load, value=load.value[:2])
            carried = (own,) if i == layers - 1 and kind != "moved" else ()
            if i == layers - 1 and kind == "moved":
                held += (Support("top", {**shift, "z": 0.0} if space else shift),)
            bodies.append(Part(name, meshes[name], materials[i], held, carried))
        pairs = [(f"{upper}:bottom", f"{lower}:contact") for lower, upper in zip(names, names[1:])]
        settings["law"] = law
        size = {"kind": "solid"} if space else {"thickness": depth}
        return scene_of(bodies, pairs, mu * force if law == "tresca" else mu, **size, **settings)

    finest = min(min(high - low for low, high in patches) / 8, 2 * min(c[2][1] - c[1][1] for c in corners))

    def structured(i: int, part: float = 1.0) -> Build:
        def mesh(level: int) -> Any:
            size, body = finest * part / (1.5 if solid else 2) ** level, corners[i]
            (left, right), height = (body[0][0], body[1][0]), body[2][1] - body[1][1]
            marks = [left, right] + [x for patch in patches[:] for x in patch if left < x < right]
            s = (ticks(sorted(marks), size) - left) / (right - left)
            touch = None
            if i < layers - 1:
                low, high = ((x - left) / (right - left) for x in patches[i])
                touch = ("top", low, high)
            return quads(body, s, ticks([0.0, height], min(size, height / 2)), touch)

        return mesh

    def free(i: int) -> Build:
        body, last = corners[i], i == layers - 1
        sides = ["bottom", "right", "top" if last else "contact", "left"]
        touching = {"contact"} | ({"bottom"} if i else set())
        left, right = body[0][0], body[1][0]
        extra = {} if last else {"contact": sorted((right - x) / (right - left) for x in patches[i] if left < x < right)}
        share = float(rng.uniform(0.7, 1.3))
        return lambda level: polygon(body, sides, touching, extra)(finest * share / 2**level)

    def slab(i: int) -> Build:
        share, cut = float(rng.uniform(0.8, 1.6)), rng.random() < 0.3
        plane, rows = structured(i, share), int(rng.integers(1, 3))

        def mesh(level: int) -> Any:
            made = extruded(plane(level), np.linspace(0, depth, rows + 1))
            return simplices(made) if cut else made

        return mesh

    # Both bodies of a structured pair have the same nodes along a patch, as its ends are nodes of both.
    a = first_way(rng, template, {name: structured(i) for i, name in enumerate(names)})
    b = other_way(rng, template, {name: (slab if solid else free)(i) for i, name in enumerate(names)})
    points = {
        name: [tuple(np.mean(body, axis=0)), tuple(np.array(body).T @ np.array([0.2, 0.3, 0.4, 0.1]))]
        for name, body in zip(names, corners)
    }
    family = f"slab of {layers} blocks in space" if solid else f"{layers} blocks"
    if solid and rng.random() < 0.3:
        b = replace(b, move=None, simplest=True)
    return Case(family, (a, b), points, loose=1.001 * gaps)


def crown(rng: Random, kind: str = "plane-strain") -> Case:
    """A body with a slightly round face pressed on a flat one: smooth pressure, an edge of contact that nobody knows."""
    ring_like, wide, mu = kind == "axisymmetric", 1.0, friction(rng)
    one, two = material(rng), material(rng)
    radius, a = wide * float(rng.uniform(50, 500)), wide * float(rng.uniform(0.15, 0.4))
    heights, base, offset = rng.uniform(0.6, 1.5, 2), float(rng.uniform(1.0, 2.0)), 0.0
    modulus = contact_modulus(one, two)
    force = 4 / 3 * modulus * a**3 / radius if ring_like else np.pi * modulus * a**2 / (4 * radius)
    push = 0.0 if ring_like else float(rng.uniform(-0.8, 0.8)) * mu * force
    up = "z" if ring_like else "y"
    load = {"z": -force} if ring_like else {"y": -force} if mu == 0 else {"x": push, "y": -force}
    axis = (Support("left", {"r": 0.0}),) if ring_like else ()
    reach = 0.8 * wide
    start = 0.0 if ring_like else -wide
    lower = [(start * base, -heights[1]), (base, -heights[1]), (base, 0.0), (start * base, 0.0)]
    upper = [(start, 0.0), (wide, 0.0), (wide, heights[0]), (start, heights[0])]
    assert up

    def parabola(x: np.ndarray) -> np.ndarray:
        return np.stack([x[0], x[0] ** 2 / (2 * radius)])

    def raised(mesh: Any) -> Any:
        p = mesh.doflocs.copy()
        p[1] += p[0] ** 2 / (2 * radius) * (1 - p[1] / heights[0])
        return type(mesh)(p, mesh.t).with_boundaries(mesh.boundaries)

    def template(meshes: dict[str, Any], settings: dict[str, Any]) -> Scene:
        bodies = [
            Part("upper", meshes["upper"], one, axis, (Plate("top", load),), curve={"contact": parabola}),
            Part("lower", meshes["lower"], two, (*axis, Support("bottom"))),
        ]
        return scene_of(bodies, [("upper:contact", "lower:contact")], mu, kind=kind, **settings)

    def structured(name: str) -> Build:
        def mesh(level: int) -> Any:
            h = a / (5 * 2**level)
            corners, height = (upper, heights[0]) if name == "upper" else (lower, heights[1])
            edge = corners[1][0]
            marks = [-edge, -reach, -1.5 * a, 1.5 * a, reach, edge] if start else [0.0, 1.5 * a, reach, edge]
            x = ticks(marks, 3 * h, 2 * h, h, 2 * h, 3 * h) if start else ticks(marks, h, 2 * h, 3 * h)
            low = (x[0] if not start else -reach) / (x[-1] - x[0]) - x[0] / (x[-1] - x[0]), (reach - x[0]) / (x[-1] - x[0])
            rise = graded(height, h, 1.3 ** (0.5**level))
            rise = rise if name == "upper" else height - rise[::-1]
            made = quads(corners, (x - x[0]) / (x[-1] - x[0]), rise, ("bottom" if name == "upper" else "top", *low))
            return raised(made) if name == "upper" else made

        return mesh

    def free(name: str) -> Build:
        corners = upper if name == "upper" else lower
        share = float(rng.uniform(0.7, 1.2))

        def mesh(level: int) -> Any:
            h = a / (5 * 2**level) * share
            sides = ["contact", "right", "top", "left"] if name == "upper" else ["bottom", "right", "contact", "left"]
            loop = []
            for i, side in enumerate(sides):
                loop.append((*corners[i], 3 * h, side))
                if side == "contact":
                    marks = [x for x in (-1.5 * a, 1.5 * a) if start or x > 0]
                    y = corners[i][1]
                    loop += [(x, y, h, side) for x in (marks if name == "upper" else marks[::-1])]
                    if not start:
                        loop[-2 if name == "upper" else -1] = (*loop[-2 if name == "upper" else -1][:2], h, side)
            if not start:  # the axis is where contact begins
                loop = [(x, y, h if abs(x) < 1e-9 and abs(y) < 1e-9 else size, side) for x, y, size, side in loop]
            made = outlined(loop)
            return raised(made) if name == "upper" else made

        return mesh

    first = first_way(rng, template, {name: structured(name) for name in ("upper", "lower")})
    second = other_way(rng, template, {name: free(name) for name in ("upper", "lower")})
    points = {"upper": [(0.3 + offset, 0.6 * heights[0])], "lower": [(0.25, -0.4 * heights[1]), (0.1, -0.6 * a)]}
    return Case(f"crowned body, {kind}", (first, second), points, smooth=True, whole=not ring_like, loose=a**2 / radius, strain=a / radius)


def pin(rng: Random) -> Case:
    """A pin with a hole, loaded obliquely, in a bush that is held outside; with or without clearance."""
    hole, outer, mu = float(rng.uniform(0.3, 0.6)), float(rng.uniform(1.6, 2.5)), friction(rng)
    play = 0.0 if rng.random() < 0.3 else float(10 ** rng.uniform(-4, -1))
    one, two = material(rng), material(rng)
    angle, force = rng.uniform(0, 2 * np.pi), min(one.E, two.E) * min(play or 1e-3, 1e-3) * float(rng.uniform(0.3, 3))
    load = Plate("inside", {"x": force * np.cos(angle), "y": force * np.sin(angle)})

    def circle(r: float) -> Callable[[np.ndarray], np.ndarray]:
        return lambda x: r * x / np.hypot(*x)

    def template(meshes: dict[str, Any], settings: dict[str, Any]) -> Scene:
        bodies = [
            Part("pin", meshes["pin"], one, (), (load,), curve={"outside": circle(1 - play)}),
            Part("bush", meshes["bush"], two, (Support("outside"),), curve={"inside": circle(1.0)}),
        ]
        return scene_of(bodies, [("pin:outside", "bush:inside")], mu, **settings)

    turn = float(rng.uniform(0, 1))

    def structured(inner: float, out: float) -> Build:
        def mesh(level: int) -> Any:
            count = 28 * 2**level
            rings = max(2, round(count / (2 * np.pi) * np.log(out / inner)))
            return ring(np.geomspace(inner, out, rings + 1), turn + 2 * np.pi * np.arange(count) / count)

        return mesh

    def free(inner: float, out: float, order: int, sizes: tuple[float, float]) -> Build:
        def loop(r: float, h: float, name: str) -> Any:
            return [(r * np.cos(t), r * np.sin(t), h, name) for t in turn + np.pi / 2 * np.arange(4)]

        def mesh(level: int) -> Any:
            h = 2 * np.pi / (28 * 2**level)
            return outlined(
                loop(out, h * sizes[1], "outside"), loop(inner, h * sizes[0], "inside"), order=order, arcs=True
            )

        return mesh

    order, fine, coarse = int(rng.integers(1, 3)), float(rng.uniform(0.7, 1.3)), float(rng.uniform(1, 2))
    a = first_way(rng, template, {"pin": structured(hole, 1 - play), "bush": structured(1.0, outer)})
    meshes = {
        "pin": free(hole, 1 - play, order, (0.7 * coarse, fine)),
        "bush": free(1.0, outer, order, (1.0, 1.5 * coarse)),
    }
    b = other_way(rng, template, meshes)
    if order == 2:  # curved edges come with quadratic displacements here, as tools write them
        own = b.build
        b = replace(b, build=lambda level: replace(own(level), degree=2))
    points = {"pin": [(0.0, (hole + 1) / 2), ((hole + 1) / 2, 0.0)], "bush": [(0.0, -(1 + outer) / 2)]}
    return Case("pin in bush", (a, b), points, smooth=True, loose=play, strain=1e-3)


def wedge(rng: Random) -> Case:
    """A wedge pressed between two flanks, obliquely."""
    angle, high, foot, thick = np.radians(rng.uniform(15, 60)), float(rng.uniform(0.6, 1.2)), float(rng.uniform(0.3, 1)), 1.0
    mu, force = float(rng.uniform(0, 0.6)), 0.01
    side = high * np.tan(angle)
    half, out = foot / 2, foot / 2 + side + thick
    shapes = {
        "wedge": [(-half, 0.0), (half, 0.0), (half + side, high), (-half - side, high)],
        "left flank": [(-out, 0.0), (-half, 0.0), (-half - side, high), (-out, high)],
        "right flank": [(half, 0.0), (out, 0.0), (out, high), (half + side, high)],
    }
    materials = {name: material(rng) for name in shapes}
    load = Plate("top", {"x": float(rng.uniform(-0.3, 0.3)) * force, "y": -force})

    def template(meshes: dict[str, Any], settings: dict[str, Any]) -> Scene:
        held = {"wedge": (), "left flank": (Support("left"),), "right flank": (Support("right"),)}
        loads = {"wedge": (load,)}
        bodies = [Part(name, meshes[name], materials[name], held[name], loads.get(name, ())) for name in shapes]
        pairs = [("wedge:left", "left flank:right"), ("wedge:right", "right flank:left")]
        return scene_of(bodies, pairs, mu, **settings)

    def structured(name: str) -> Build:
        def mesh(level: int) -> Any:
            h = high / (8 * 2**level)
            wide = shapes[name][1][0] - shapes[name][0][0]
            return quads(shapes[name], ticks([0.0, wide], h), ticks([0.0, high], h))

        return mesh

    def free(name: str, share: float) -> Build:
        touching = {"wedge": {"left", "right"}, "left flank": {"right"}, "right flank": {"left"}}[name]
        return lambda level: polygon(shapes[name], SIDES, touching)(high / (8 * 2**level) * share)

    a = first_way(rng, template, {name: structured(name) for name in shapes})
    b = other_way(rng, template, {name: free(name, float(rng.uniform(0.7, 1.3))) for name in shapes})
    points = {name: [tuple(np.mean(corners, axis=0))] for name, corners in shapes.items()}
    return Case("wedge", (a, b), points)


def fit(rng: Random) -> Case:
    """A press fit: a quarter of two rings in the plane against Lame's solution or against a cylinder's section."""
    bore, outer, d = float(rng.uniform(0.3, 0.7)), float(rng.uniform(1.4, 2.5)), float(10 ** rng.uniform(-4, -2.5))
    shaft, hub, share, mu = material(rng), material(rng), float(rng.uniform(0, 1)), friction(rng)
    inner_radius, outer_radius = 1 + share * d, 1 - (1 - share) * d
    exact = press_fit(d, bore, 1.0, outer, shaft, hub).peak or 0.0
    order, size = int(rng.integers(1, 3)), rng.uniform(0.7, 1.3, 4)

    def circle(r: float) -> Callable[[np.ndarray], np.ndarray]:
        return lambda x: r * x / np.hypot(*x)

    def quarter(inner: float, out: float, sizes: np.ndarray) -> Build:
        def mesh(level: int) -> Any:
            h = 0.15 / 2**level
            loop = [(inner, 0.0, h * sizes[0], "straight x"), (out, 0.0, h * sizes[1], "outside"),
                    (0.0, out, h * sizes[1], "straight y"), (0.0, inner, h * sizes[0], "inside")]  # fmt: skip
            return outlined(loop, order=order, arcs=True)

        return mesh

    sides = (Support("straight x", {"y": 0.0}), Support("straight y", {"x": 0.0}))
    meshes = {"shaft": quarter(bore, inner_radius, size[:2]), "hub": quarter(outer_radius, outer, size[2:])}

    def template(meshes: dict[str, Any], settings: dict[str, Any]) -> Scene:
        bodies = [
            Part("shaft", meshes["shaft"], shaft, sides, curve={"outside": circle(inner_radius)}),
            Part("hub", meshes["hub"], hub, sides, curve={"inside": circle(outer_radius)}),
        ]
        settings["degree"] = max(order, settings["degree"])
        return scene_of(bodies, [("shaft:outside", "hub:inside")], mu, copies=4, **settings)

    def section(level: int) -> Scene:
        grids = [(bore, inner_radius), (outer_radius, outer)]
        made = []
        for (low, high), own, name in zip(grids, (shaft, hub), ("shaft", "hub")):
            mesh = tensor_mesh(np.linspace(low, high, 8 * 2**level + 1), np.linspace(0, 1, 3 * 2**level + 1))
            mesh = mesh.with_boundaries({"end": lambda x: (x[1] < 1e-9) | (x[1] > 1 - 1e-9)})
            made.append(Part(name, mesh, own, (Support("end", {"z": 0.0}),)))
        return scene_of(made, [("shaft:x+", "hub:x-")], mu, kind="axisymmetric", degree=1)

    second = other_way(rng, template, meshes)
    if rng.random() < 0.5:
        return Case("press fit, exact", ({"pressure 0": exact, "peak 0": exact}, second), smooth=True, strain=d)
    only = ("pressure", "peak")
    return Case("press fit, section", (Way(section), second), {}, False, True, only, strain=d)


def floor(rng: Random) -> Case:
    """An uneven block on a rigid floor: its shape is a function of the gap, or the shape of its mesh."""
    wide, high, mu, own = float(rng.uniform(1, 3)), float(rng.uniform(0.5, 2)), friction(rng), material(rng)
    depth, waves = float(10 ** rng.uniform(-5, -3.5)) * wide, rng.uniform(0.5, 4, 3)
    phase, sizes = rng.uniform(0, 2 * np.pi, 3), rng.uniform(0.2, 1, 3)
    force = own.E * depth * float(10 ** rng.uniform(-0.7, 0.7))
    load = {"y": -force} if mu == 0 else {"x": float(rng.uniform(-0.8, 0.8)) * mu * force, "y": -force}
    pushed = bool(rng.random() < 0.3)
    lift = {"y": depth * float(rng.uniform(0.2, 2)), "x": 0.0}

    def waved(x: np.ndarray) -> np.ndarray:
        return np.asarray(sum(a * np.cos(k * np.pi * x / wide + p) for a, k, p in zip(sizes, waves, phase)))

    lowest = waved(np.linspace(0, wide, 1000)).min()

    def shape(x: np.ndarray) -> np.ndarray:
        return np.asarray(depth * (waved(x[0]) - lowest))

    def raised(mesh: Any) -> Any:
        p = mesh.doflocs.copy()
        p[1] += shape(p) * (1 - p[1] / high)
        return type(mesh)(p, mesh.t).with_boundaries(mesh.boundaries)

    corners, normal = [(0.0, 0.0), (wide, 0.0), (wide, high), (0.0, high)], (0.0, 1.0)

    def template(meshes: dict[str, Any], settings: dict[str, Any], gap: Any = lambda x: x[1]) -> Scene:
        block, ground = Part("block", meshes["block"], own, (), (Plate("top", load),)), Rigid("floor", normal, gap)
        moved = "coupling" in settings  # the second way moves the block, the first the floor, where no force is given
        if pushed:
            down = {name: -value for name, value in lift.items()} if moved else None
            block = replace(block, loads=(), supports=(Support("top", down),))
            ground = ground if moved else replace(ground, displacement=lift)
        for key in ("coupling", "carrier"):
            settings.pop(key, None)
        return scene_of([block, ground], [("block:bottom", "floor")], mu, **settings)

    def structured(level: int) -> Any:
        h = wide / (20 * 2**level)
        return quads(corners, ticks([0.0, wide], h), graded(high, h, 1.3 ** (0.5**level)))

    free, share = polygon(corners, SIDES, {"bottom"}), float(rng.uniform(0.7, 1.2))
    first = first_way(rng, lambda meshes, settings: template(meshes, settings, shape), {"block": structured})
    second = other_way(rng, template, {"block": lambda level: raised(free(wide / (20 * 2**level) * share))})
    points = {"block": [(0.4 * wide, 0.5 * high), (0.7 * wide, 0.3 * high)]}
    only = ("energy", "normal", "force", "friction", "bearing", "reach", "stick", "area", "centre", "von_mises", "mean_stress")
    only += () if pushed else ("moved",)
    return Case("uneven block on a floor", (first, second), points, only=only, loose=2 * depth * sizes.sum(), strain=10 * depth / wide)


def exact_half_space(rng: Random) -> Case:
    """A rigid or elastic round body on a half-space or a half-plane, without friction, against Hertz."""
    solid, one, two = rng.random() < 0.5, material(rng), material(rng)
    rigid, radius, a = rng.random() < 0.4, float(rng.uniform(5, 50)), 1.0
    modulus = contact_modulus(None if rigid else one, two)
    exact: Values
    if solid:
        force = 4 / 3 * modulus * a**3 / radius
        peak = hertz_point(force, radius, modulus).peak or 0.0
        exact = {"pressure 0": 0.75 * peak, "reach 0": a * 0.4**0.5, "peak 0": peak, "area 0": np.pi * a**2}
    else:
        force = np.pi * modulus * a**2 / (4 * radius)
        peak = hertz_line(force, radius, modulus).peak or 0.0
        exact = {"pressure 0": 8 / (3 * np.pi) * peak, "reach 0": a / 2, "peak 0": peak, "area 0": 2 * a}
    exact["normal 0"] = force
    wide, shift = a * float(rng.uniform(1.3, 3)), rng.uniform(-0.1, 0.1, 2)
    load = {"z" if solid else "y": -force}

    def build(level: int) -> Scene:
        count = (10 if solid else 24) * 2**level
        row = np.linspace(-wide, wide, count) + shift[0]
        points = (row, np.linspace(-wide, wide, count + 1) + shift[1]) if solid else (row,)

        def gap(x: np.ndarray) -> np.ndarray:
            return np.asarray(np.sum(x[: 2 if solid else 1] ** 2, axis=0) / (2 * radius))

        upper: Any = HalfSpace("upper", one, points, height=lambda x: -gap(x), force=load)
        if rigid:
            upper = Rigid("upper", gap=gap, force=load)
        bodies = [upper, HalfSpace("lower", two, points)]
        return scene_of(bodies, [("upper", "lower")], 0.0, kind="solid" if solid else "plane-strain")

    axes = (0, 1, 2) if solid else (0, 1)
    other = bool(rng.random() < 0.5)
    way = Way(build, axes, other, random_move(rng, build(0), other))
    return Case("half-space, exact", (exact, way), smooth=True)


def waves(rng: Random) -> Case:
    """A rigid wave on a periodic half-plane against Westergaard's solution."""
    own, length, share = material(rng), float(rng.uniform(0.5, 3)), float(rng.uniform(0.1, 0.8))
    modulus, height = contact_modulus(None, own), float(10 ** rng.uniform(-4, -2))
    full = np.pi * modulus * height / length  # the mean pressure that closes all gaps; height is the amplitude
    closed = np.sin(np.pi * share / 2) ** 2
    force, a = full * closed * length, share * length / 2
    t = (np.arange(4000) + 0.5) / 4000 * np.pi - np.pi / 2
    x, dx = a * np.sin(t), a * np.cos(t) * np.pi / 4000
    p = 2 * full * np.cos(np.pi * x / length) * np.sqrt(np.maximum(closed - np.sin(np.pi * x / length) ** 2, 0))
    exact = {
        "normal 0": float(p @ dx), "pressure 0": float(p**2 @ dx / (p @ dx)), "peak 0": float(p.max()),
        "reach 0": float(np.sqrt(p * x**2 @ dx / (p @ dx))), "area 0": 2 * a,
    }  # fmt: skip

    def build(level: int) -> Scene:
        count = 64 * 2**level
        row = (np.arange(count) + 0.5) * length / count - length / 2
        bodies = [Rigid("wave", gap=lambda x: height * (1 - np.cos(2 * np.pi * x[0] / length)), force={"y": -force}), HalfSpace("plane", own, (row,), periodic=True)]
        return scene_of(bodies, [("wave", "plane")], 0.0)

    other = bool(rng.random() < 0.5)
    way = Way(build, (0, 1), other, random_move(rng, build(0), other))
    return Case("wave on a periodic half-plane", (exact, way), smooth=True)


def large_body(rng: Random) -> Case:
    """A rigid profile on a half-plane, and on a large body of finite elements, larger from level to level."""
    own, mu, a = material(rng), friction(rng), 1.0
    radius, bumps = float(rng.uniform(10, 50)), float(rng.uniform(0, 0.5))
    phase, period = float(rng.uniform(0, 6)), float(rng.uniform(0.5, 1.5))
    modulus = contact_modulus(None, own)
    force = np.pi * modulus * a**2 / (4 * radius)
    push = float(rng.uniform(-0.7, 0.7)) * mu * force
    load = {"y": -force} if mu == 0 else {"x": push, "y": -force}

    def gap(x: np.ndarray) -> np.ndarray:
        waved = bumps * (period / np.pi) ** 2 * (1 - np.cos(2 * np.pi * x[0] / period + phase)) / 4
        return np.asarray((x[0] ** 2 / 2 + waved) / radius)

    def plane(level: int) -> Scene:
        row = np.linspace(-2, 2, 60 * 2**level)
        return scene_of([Rigid("body", gap=gap, force=load), HalfSpace("ground", own, (row,))], [("body", "ground")], mu)

    share, degree = float(rng.uniform(0.8, 1.2)), int(rng.integers(1, 3))

    def finite(level: int) -> Scene:
        size, h = 15.0 * 2**level, a / (8 * 2**level) * share
        corners = [(-size, -size), (size, -size), (size, 0.0), (2.0, 0.0), (1.3, 0.0), (-1.3, 0.0), (-2.0, 0.0), (-size, 0.0)]
        names = ["bottom", "right", "top", "contact", "contact", "contact", "top", "left"]
        fine = [size / 5, size / 5, size / 5, 2 * h, h, h, 2 * h, size / 5]
        mesh = outlined([(*x, own_size, name) for x, own_size, name in zip(corners, fine, names)])
        part = Part("ground", mesh, own, (Support("bottom"),))
        rigid = Rigid("body", (0.0, 1.0), gap, load)
        return scene_of([rigid, part], [("body", "ground:contact")], mu, degree=degree)

    second = Way(finite)
    second = replace(second, move=random_move(rng, finite(0)))
    only = ("normal", "force", "friction", "pressure", "reach", "stick", "area", "centre", "peak")
    return Case("half-plane or large body", (Way(plane), second), smooth=True, only=only, loose=0.1)


def ball(rng: Random) -> Case:
    """A crowned round body on a plate, its section, and the half of it in space."""
    one, two, mu = material(rng), material(rng), friction(rng)
    wide, radius, a = 1.0, float(rng.uniform(50, 500)), float(rng.uniform(0.3, 0.5))
    heights = rng.uniform(0.6, 1.2, 2)
    force = 4 / 3 * contact_modulus(one, two) * a**3 / radius

    def build(level: int, section: bool, share: float = 1.0, degree: int = 1) -> Scene:
        h = a / ((6 * 2**level if section else 3 * 1.4**level) * share)
        made = []
        for i, height in enumerate(heights):
            radii = ticks([0.0, wide], h * (1.0 if section or i == 0 else other))
            rise = graded(height, h, 1.3 ** (0.5**level))
            rise = rise if i == 0 else -rise[::-1]
            if section:
                mesh = tensor_mesh(radii, rise).with_boundaries({"axis": lambda x: x[0] < 1e-9})
            else:
                from contactopt.scenes.discs import extrude

                mesh = extrude(*half_disc(radii, max(2, len(radii) // 4)), rise)
            p = mesh.p.copy()
            if i == 0:
                p[-1] += np.sum(p[:-1] ** 2, axis=0) / (2 * radius) * (1 - p[-1] / height)
            mesh = type(mesh)(p, mesh.t) if section is False else type(mesh)(p, mesh.t).with_boundaries(mesh.boundaries)
            far, low = float(rise[-1] if i == 0 else rise[0]), 0.9 * wide
            sides = {
                "far": lambda x, far=far: np.abs(x[-1] - far) < 1e-9,
                "contact": lambda x, far=far: (np.abs(x[-1]) < low**2 / (2 * radius) + 1e-6)
                & (np.linalg.norm(x[:-1], axis=0) < low) & (np.abs(x[-1] - far) > 1e-9)
                & (np.abs(x[-1] - (i == 0) * np.sum(x[:-1] ** 2, axis=0) / (2 * radius)) < 0.3 * h * wide / radius + 1e-9),
                "axis": lambda x: (x[0] if section else x[1]) < 1e-9,
            }  # fmt: skip
            mesh = named(mesh, sides)
            held = (Support("axis", {"r": 0.0} if section else {"y": 0.0}),) + ((Support("far"),) if i else ())
            loads = () if i else (Plate("far", {"z": -force}),)
            made.append(Part(["upper", "lower"][i], mesh, (one, two)[i], held, loads))
        kind, copies = ("axisymmetric", 1) if section else ("solid", 2)
        return scene_of(made, [("upper:contact", "lower:contact")], mu, kind=kind, copies=copies, degree=degree)

    other = float(rng.choice([1.0, rng.uniform(0.8, 1.3)]))
    second = Way(lambda level: build(level, False), (0, 2))
    second = replace(second, move=random_move(rng, second.build(0)))
    points = {"upper": [(0.3, 0.5 * heights[0])], "lower": [(0.3, -0.5 * heights[1])]}
    first = Way(lambda level: build(level, True, float(rng.uniform(0.8, 1.2))))
    only = ("energy", "normal", "pressure", "peak", "friction", "stick", "moved", "von_mises", "mean_stress")
    return Case("section or space", (first, second), {} and points, whole=False, smooth=True, only=only, strain=a / radius)


def boxes(rng: Random) -> Case:
    """Box on box in space, bricks whose nodes match, or bricks and tetrahedra that do not."""
    wide, high, mu = rng.uniform(0.6, 1.2, 2), rng.uniform(0.5, 1.0, 2), friction(rng)
    one, two, force = material(rng), material(rng), 0.01
    base, start = wide * rng.uniform(1.0, 1.8, 2), np.zeros(2)
    start = (base - wide) * rng.uniform(0, 1, 2)
    turn, push = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0, 0.8)) * mu * force
    load = {"x": push * np.cos(turn), "y": push * np.sin(turn), "z": -force}
    load = {"z": -force} if mu == 0 else load

    def template(meshes: dict[str, Any], settings: dict[str, Any]) -> Scene:
        bodies = [
            Part("upper", meshes["upper"], one, (), (Plate("z+", load),)),
            Part("lower", meshes["lower"], two, (Support("z-"),)),
        ]
        return scene_of(bodies, [("upper:z-", "lower:contact")], mu, kind="solid", **settings)

    def bricks(name: str, share: float, cut: bool, alike: bool) -> Build:
        def mesh(level: int) -> Any:
            h = (0.25 if alike else 0.35 * share) / 1.4**level
            low, high_, z = (start, start + wide, high[0]) if name == "upper" else (0 * base, base, -high[1])
            marks = [sorted({float(low[i]), float(high_[i]), float(start[i]), float(start[i] + wide[i])}) for i in (0, 1)]
            rows = [ticks(mark, h) for mark in marks]
            made = tensor_mesh(*rows, ticks(sorted([0.0, float(z)]), h))
            middle = made.p[:, made.facets].mean(axis=1)
            own = np.all((middle[:2] > start[:, None]) & (middle[:2] < (start + wide)[:, None]), axis=0)
            touch = np.flatnonzero(own & (np.abs(middle[2]) < 1e-9))
            if name == "lower":
                made = made.with_boundaries({"contact": touch if alike else made.boundaries["z+"]})
            return simplices(made) if cut else made

        return mesh

    names = ("upper", "lower")
    a = replace(first_way(rng, template, {name: bricks(name, 1.0, False, True) for name in names}), axes=(0, 1, 2))
    b = other_way(
        rng, template, {name: bricks(name, float(rng.uniform(0.7, 1.2)), rng.random() < 0.4, False) for name in names}
    )
    points = {"upper": [(*(start + 0.4 * wide), 0.5 * high[0])], "lower": [(*(start + 0.4 * wide), -0.5 * high[1])]}
    return Case("box on box", (a, replace(b, axes=(0, 1, 2))), points)


def roller(rng: Random) -> Case:
    """A cylinder on a flat body: half of it graded around the contact, or all of it by Gmsh, coarse where it is far apart."""
    one, two, mu = material(rng), material(rng), friction(rng)
    a, wide, high = float(rng.uniform(0.03, 0.1)), float(rng.uniform(1.5, 4)), float(rng.uniform(1, 3))
    force = np.pi * contact_modulus(one, two) * a**2 / 4

    def half(level: int) -> Scene:
        return cylinder(
            radius=1.0, foundation_width=wide, foundation_height=high, depth=1.0, upper=one, lower=two, mu=mu, force=force,
            elements=6 * 2**level,
        )  # fmt: skip

    def arc(x: np.ndarray) -> np.ndarray:
        off = x - np.array([[0.0], [1.0]])
        return np.array([[0.0], [1.0]]) + off / np.hypot(*off)

    def template(meshes: dict[str, Any], settings: dict[str, Any]) -> Scene:
        bodies = [
            Part("cylinder", meshes["cylinder"], one, (), (Plate("straight top", {"y": -force}),), curve={"arc": arc}),
            Part("foundation", meshes["foundation"], two, (Support("bottom"),)),
        ]
        return scene_of(bodies, [("cylinder:arc", "foundation:contact")], mu, **settings)

    fine, coarse = float(rng.uniform(0.8, 1.3)), float(rng.uniform(0.1, 0.5))

    def round_body(level: int) -> Any:
        h = a / (5 * 2**level) * fine
        angles = [-np.pi, -np.pi / 2 - 1.3 * a, -np.pi / 2, -np.pi / 2 + 1.3 * a, 0.0]
        sizes, names = [coarse, h, h, h, coarse], ["arc"] * 4 + ["straight top"]
        made = outlined([(np.cos(t), np.sin(t), s, n) for t, s, n in zip(angles, sizes, names)], arcs=True)
        return type(made)(made.doflocs + np.array([[0.0], [1.0]]), made.t).with_boundaries(made.boundaries)

    def flat_body(level: int) -> Any:
        h, c = a / (5 * 2**level) * fine * 1.2, wide / 2
        places = [(-c, -high), (c, -high), (c, 0.0), (1.3 * a, 0.0), (-1.3 * a, 0.0), (-c, 0.0)]
        names = ["bottom", "right", "contact", "contact", "contact", "left"]
        return outlined([(*x, s, n) for x, s, n in zip(places, [coarse] * 3 + [h, h, coarse], names)])

    second = other_way(rng, template, {"cylinder": round_body, "foundation": flat_body})
    only = ("energy", "normal", "friction", "pressure", "peak", "reach", "area", "stick", "bearing")
    return Case("roller", (Way(half), second), whole=False, smooth=True, only=only, loose=a**2, strain=a)


def heights(rng: Random) -> Case:
    """A rigid profile on a half-space: as a gap, or as the height of the half-space; smooth or rough, with friction."""
    solid, periodic, mu, own = rng.random() < 0.4, bool(rng.random() < 0.4), friction(rng), material(rng)
    count, tall = 4, float(10 ** rng.uniform(-4, -3))
    k, phase = rng.integers(1, 4, (count, 2)), rng.uniform(0, 2 * np.pi, count)
    force = contact_modulus(None, own) * tall * float(10 ** rng.uniform(-1, 0.3))
    push, names = float(rng.uniform(-0.8, 0.8)) * mu * force, "xyz" if solid else "xy"
    load = {names[-1]: -force} | ({"x": push} if mu else {})

    def gap(x: np.ndarray) -> np.ndarray:
        waved = sum(np.cos(2 * np.pi * (k[i, 0] * x[0] + (k[i, 1] * x[1] if solid else 0)) + phase[i]) for i in range(count))
        bent = 0.0 if periodic else 8 * np.sum(x[: 2 if solid else 1] ** 2, axis=0)
        return np.asarray(tall * (waved + count + bent))

    def build(level: int, high: bool, first: int) -> Scene:
        n = first * 2**level
        row = (np.arange(n) + 0.5) / n - 0.5
        points, kind = ((row, row), "solid") if solid else ((row,), "plane-strain")
        surface = (lambda x: -gap(x)) if high else None
        rigid = Rigid("body", gap=None if high else gap, force=load)
        ground = HalfSpace("ground", own, points, height=surface, periodic=periodic, depth=None if solid else 3.0)
        return scene_of([rigid, ground], [("body", "ground")], mu, kind=kind)

    first = 10 if solid else 40
    way = Way(lambda level: build(level, True, first + 3), tuple(range(len(names))), bool(rng.random() < 0.5))
    way = replace(way, move=random_move(rng, way.build(0), way.swapped))
    a = Way(lambda level: build(level, False, first), tuple(range(len(names))))
    return Case("gap or height of a half-space", (a, way), smooth=True, loose=20 * tall)


def bridge(rng: Random) -> Case:
    """A beam on two piers: one surface in two pairs."""
    mu, materials = friction(rng), [material(rng) for _ in range(3)]
    long, thick, high = float(rng.uniform(3, 5)), float(rng.uniform(0.3, 1)), float(rng.uniform(0.5, 1.5))
    feet = [(0.0, float(rng.uniform(0.4, 1))), (long - float(rng.uniform(0.4, 1)), long)]
    force = 0.003
    load = {"y": -force} if mu == 0 else {"x": float(rng.uniform(-0.6, 0.6)) * mu * force, "y": -force}
    shapes = {"beam": [(0.0, high), (long, high), (long, high + thick), (0.0, high + thick)]}
    shapes |= {
        name: [(a, 0.0), (b, 0.0), (b, high), (a, high)] for name, (a, b) in zip(("left pier", "right pier"), feet)
    }

    def template(meshes: dict[str, Any], settings: dict[str, Any]) -> Scene:
        held = {"left pier": (Support("bottom"),), "right pier": (Support("bottom"),)}
        bodies = [
            Part(name, meshes[name], own, held.get(name, ()), () if name in held else (Plate("top", load),))
            for name, own in zip(shapes, materials)
        ]
        pairs = [(f"beam:on {name}", f"{name} pier:top") for name in ("left", "right")]
        return scene_of(bodies, pairs, mu, **settings)

    def marked(mesh: Any, alike: bool) -> Any:
        middle = mesh.p[0, mesh.facets].mean(axis=0)
        bottom = np.asarray(mesh.boundaries["bottom"])
        own = [bottom[(middle[bottom] > a) & (middle[bottom] < b)] if alike else bottom for a, b in feet]
        return mesh.with_boundaries({"on left": own[0], "on right": own[1]})

    def structured(name: str) -> Build:
        def mesh(level: int) -> Any:
            h, (a, b) = 0.1 / 2**level, (shapes[name][0][0], shapes[name][1][0])
            x = ticks(sorted({a, b} | {x for foot in feet for x in foot if a < x < b}), h)
            made = quads(shapes[name], (x - a) / (b - a), ticks([0.0, thick if name == "beam" else high], h))
            return marked(made, True) if name == "beam" else made

        return mesh

    def free(name: str, share: float) -> Build:
        corners = shapes[name]
        extra = {"bottom": [x / long for x in (feet[0][1], feet[1][0])]} if name == "beam" else {}
        mesh = polygon(corners, SIDES, {"bottom" if name == "beam" else "top"}, extra)
        return lambda level: (marked(mesh(h), False) if name == "beam" else mesh(h)) if (h := 0.1 / 2**level * share) else None

    a = first_way(rng, template, {name: structured(name) for name in shapes})
    b = other_way(rng, template, {name: free(name, float(rng.uniform(0.7, 1.2))) for name in shapes})
    points = {name: [tuple(np.mean(corners, axis=0))] for name, corners in shapes.items()}
    return Case("beam on two piers", (a, b), points)


FAMILIES: dict[str, Callable[[Random], Case]] = {
    "blocks": stack,
    "three": lambda rng: stack(rng, 3),
    "slab": lambda rng: stack(rng, 2, True),
    "crown": crown,
    "ring": lambda rng: crown(rng, "axisymmetric"),
    "pin": pin,
    "wedge": wedge,
    "fit": fit,
    "floor": floor,
    "exact": exact_half_space,
    "waves": waves,
    "large": large_body,
    "ball": ball,
    "boxes": boxes,
    "roller": roller,
    "heights": heights,
    "bridge": bridge,
}
