"""Random scenes of blocks with four straight or bent sides, each meshed by two makers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from contactopt import BodyForce, Contact, Material, Part, Plate, Rigid, Scene, Support, Traction
from contactopt.analytic import contact_modulus
from contactopt.meshes.structured import simplices
from experiments.questions.search_for_wrong_answers.compare import Case, Way
from experiments.questions.search_for_wrong_answers.meshes import (
    extruded,
    outlined,
    quads,
    random_move,
    ticks,
)

Random = np.random.Generator
Shape = Callable[[np.ndarray], np.ndarray]
SIDES = ("bottom", "right", "top", "left")


@dataclass(frozen=True, eq=False)
class Block:
    """A body by its corners, counter-clockwise from the lower left, bent by a function.

    touch   name of a boundary -> its side, and from where to where along x or y it touches
    """

    name: str
    corners: Any
    material: Material
    touch: dict[str, tuple[str, float, float]]
    supports: tuple[Support, ...] = ()
    loads: tuple[Any, ...] = ()
    bend: Shape | None = None
    curve: dict[str, Shape] | None = None

    def place(self, mesh: Any) -> Any:
        """The mesh bent."""
        if self.bend is None:
            return mesh
        return type(mesh)(self.bend(mesh.doflocs), mesh.t).with_boundaries(mesh.boundaries)

    def structured(self, h: float, marks: list[float]) -> Any:
        """Quadrilaterals with nodes at the marks along x; boundaries end where bodies touch."""
        (left, low), (right, _), (_, high), _ = self.corners
        x = ticks([left, *(mark for mark in sorted(marks) if left < mark < right), right], h)
        made = quads(self.corners, (x - left) / (right - left), ticks([low, high], h))
        middle = made.p[:, made.facets].mean(axis=1)
        sides = dict(made.boundaries)
        for name, (side, start, end) in self.touch.items():
            own = middle[int(side in ("left", "right"))][sides[side]]
            sides[name] = sides[side][(own > start) & (own < end)]
        return self.place(made.with_boundaries(sides))

    def free(self, h: float) -> Any:
        """Triangles of Gmsh, fine where bodies touch; boundaries are whole sides."""
        touching, loop = {side for side, *_ in self.touch.values()}, []
        for i, side in enumerate(SIDES):
            a, b = np.array(self.corners[i]), np.array(self.corners[(i + 1) % 4])
            loop.append((*a, h if {side, SIDES[i - 1]} & touching else 3 * h, side))
            along = int(side in ("left", "right"))
            ends = [x for other, *own in self.touch.values() if other == side for x in own]
            shares = sorted((x - a[along]) / (b[along] - a[along]) for x in ends)
            loop += [(*(a + s * (b - a)), h, side) for s in shares if 1e-9 < s < 1 - 1e-9]
        made = outlined(loop)
        sides = {name: made.boundaries[side] for name, (side, *_) in self.touch.items()}
        return self.place(made.with_boundaries({**made.boundaries, **sides}))


@dataclass(frozen=True, eq=False)
class Blocks:
    """A scene of blocks: contacts by names, friction, settings, and the size of its elements."""

    blocks: tuple[Block, ...]
    contacts: tuple[tuple[str, str], ...]
    mu: float
    size: float
    rigid: tuple[Rigid, ...] = ()
    settings: tuple[tuple[str, Any], ...] = ()
    law: str = "coulomb"

    def scene(self, mesh: Callable[[Block], Any], **given: Any) -> Scene:
        """The scene with these meshes; `given` are settings of its contacts, and the degree."""
        degree = given.pop("degree")
        bodies = [
            Part(b.name, mesh(b), b.material, b.supports, b.loads, curve=b.curve)
            for b in self.blocks
        ]
        pairs = tuple(Contact(*pair, self.mu, law=self.law, **given) for pair in self.contacts)
        own = dict(self.settings)
        return Scene("search", bodies=(*bodies, *self.rigid), contacts=pairs, degree=degree, **own)

    def matching(self, rng: Random, depth: float | None = None) -> Way:
        """The first way: quadrilaterals, triangles cut from them, or bricks; nodes match."""
        cut, degree = rng.random() < 0.3, int(rng.integers(1, 3 if depth is None else 2))
        marks = [
            x for b in self.blocks for side, *x in b.touch.values() if side in ("top", "bottom")
        ]

        def build(level: int) -> Scene:
            h = self.size / (2.0 if depth is None else 1.4) ** level

            def mesh(block: Block) -> Any:
                made = block.structured(h, [x for own in marks for x in own])
                made = made if depth is None else extruded(made, ticks([0.0, depth], h))
                return simplices(made) if cut and depth is None else made

            return self.scene(mesh, degree=degree)

        return Way(build, (0, 1) if depth is None else (0, 1, 2))

    def unlike(self, rng: Random, depth: float | None = None, rows: int = 0) -> Way:
        """The second way: Gmsh's triangles, bricks or tetrahedra, by mortar, and moved."""
        shares = {block.name: float(rng.uniform(0.7, 1.3)) for block in self.blocks}
        cut = {block.name: rng.random() < 0.3 for block in self.blocks}
        locking = depth is not None and any(cut.values())  # linear tetrahedra are too stiff
        given = {"degree": int(rng.integers(1, 3)) if depth is None else 1 + locking}
        if not self.rigid:
            given |= {"coupling": "mortar", "carrier": str(rng.choice(["upper", "lower"]))}

        def build(level: int) -> Scene:
            def mesh(block: Block) -> Any:
                h = self.size * shares[block.name] * (1.5 if locking else 1.0)
                h /= (2.0 if depth is None else 1.4) ** level
                if depth is None:
                    return block.free(h)
                own = [x for side, *x in block.touch.values() if side in ("top", "bottom")]
                z = np.linspace(0, depth, rows + 1) if rows else ticks([0.0, depth], h)
                made = extruded(block.structured(h, [x for pair in own for x in pair]), z)
                return simplices(made) if cut[block.name] else made

            return self.scene(mesh, **given)

        swap = bool(rng.random() < 0.5)
        axes = (0, 1, 2) if depth is not None and not rows else (0, 1)
        return Way(build, axes, swap, random_move(rng, build(0), swap))


def material(rng: Random) -> Material:
    """From soft to stiff, up to nearly incompressible."""
    return Material(float(10 ** rng.uniform(0, 1.5)), float(rng.uniform(0, 0.45)))


def friction(rng: Random) -> float:
    """None in a fifth of the scenes."""
    return 0.0 if rng.random() < 0.2 else float(rng.uniform(0.05, 1.0))


def oblique(rng: Random, mu: float, force: float) -> dict[str, float]:
    """A force that presses and, where friction can hold it, pushes."""
    return {"x": float(rng.uniform(-0.8, 0.8)) * mu * force, "y": -force} if mu else {"y": -force}


def inside(blocks: tuple[Block, ...]) -> dict[str, list[tuple[float, ...]]]:
    """Two points in every block."""
    shares = [[0.25] * 4, [0.2, 0.3, 0.4, 0.1]]
    return {
        b.name: [tuple(np.array(share) @ np.array(b.corners)) for share in shares] for b in blocks
    }


def stack(rng: Random, layers: int = 2, solid: str = "") -> Case:
    """Blocks one upon another, some thin or apart: in the plane, as a slab, or in space."""
    # Without friction nothing says where a body between two others is along them.
    mu, depth = friction(rng) or (0.3 if layers > 2 else 0.0), float(rng.uniform(0.3, 1.0))
    force = float(10 ** rng.uniform(-3, -1))
    left, right, y, gaps, corners = 0.0, float(rng.uniform(2, 4)), 0.0, 0.0, []
    for layer in range(layers):
        thin = layer and not solid and rng.random() < 0.4
        high = float(rng.uniform(0.05, 0.2) if thin else rng.uniform(0.5, 1.5))
        lean = rng.uniform(-0.15, 0.15, 2) * (right - left) * (layer == layers - 1)
        corners.append(
            [(left, y), (right, y), (right + lean[1], y + high), (left + lean[0], y + high)]
        )
        wide = (right - left) * float(1.0 if rng.random() < 0.3 else rng.uniform(0.5, 0.95))
        apart = float(rng.uniform(0.01, 0.3)) * float(rng.random() < 0.3 and layer < layers - 1)
        left += float(rng.uniform(0, 1)) * (right - left - wide)
        right, y, gaps = left + wide, y + high + apart, gaps + apart
    load, span = oblique(rng, mu, force), corners[-1][2][0] - corners[-1][3][0]
    push = load.get("x", 0.0) / force
    free = mu > 0.1 and abs(push) * y < 0.2 * min(c[1][0] - c[0][0] for c in corners)
    kind = rng.choice(["plate", "moved", "traction", "weight"] if free else ["plate", "moved"])
    carried: tuple[Any, ...] = (Plate("top", load),)
    if kind == "traction":
        carried = (Traction("top", (push * force / span / depth, -force / span / depth)),)
    elif kind == "weight":
        carried = (BodyForce((push * force, -force)),)
    shift = {"x": push * 1e-3, "y": -gaps - 1e-3}
    top = (Support("top", shift),) if kind == "moved" else ()
    made = []
    for i, own in enumerate(corners):
        touch = {"under": ("bottom", own[0][0], own[1][0])} if i else {}
        if i < layers - 1:
            touch["over"] = ("top", corners[i + 1][0][0], corners[i + 1][1][0])
        held = (() if i else (Support("bottom"),)) + (top if i == layers - 1 else ())
        loads = carried if i == layers - 1 and kind != "moved" else ()
        made.append(Block(f"body {i}", own, material(rng), touch, held, loads))
    law = (
        str(rng.choice(["coulomb", "tresca", "tied"], p=[0.8, 0.1, 0.1]))
        if mu and not gaps
        else "coulomb"
    )
    pairs = tuple((f"body {i + 1}:under", f"body {i}:over") for i in range(layers - 1))
    size = min(
        [2 * (c[2][1] - c[1][1]) for c in corners] + [(c[1][0] - c[0][0]) / 8 for c in corners[1:]]
    )
    bound = mu * force if law == "tresca" else mu
    plane = Blocks(tuple(made), pairs, bound, size, settings=(("thickness", depth),), law=law)
    points, loose = inside(plane.blocks), 1.001 * gaps
    if not solid:
        return Case(
            f"{layers} blocks", (plane.matching(rng), plane.unlike(rng)), points, loose=loose
        )
    space = in_space(plane, solid)
    if solid == "space":
        points = {name: [(*x, 0.4 * depth) for x in own] for name, own in points.items()}
        ways = space.matching(rng, depth), space.unlike(rng, depth)
        return Case(f"{layers} blocks in space", ways, points, loose=loose)
    second = space.unlike(rng, depth, int(rng.integers(1, 3)))
    second = replace(second, move=None, simplest=True) if rng.random() < 0.3 else second
    return Case(f"slab of {layers} blocks", (plane.matching(rng), second), points, loose=loose)


def in_space(plane: Blocks, solid: str) -> Blocks:
    """The scene in space; a slab is held along z at both ends."""
    ends = tuple(Support(name, {"z": 0.0}) for name in ("near", "far")) if solid == "slab" else ()
    blocks = []
    for block in plane.blocks:
        held = [
            own if own.displacement is None else Support("top", {**own.displacement, "z": 0.0})
            for own in block.supports
        ]
        loads = [
            own if isinstance(own, Plate) else replace(own, value=(*own.value, 0.0))
            for own in block.loads
        ]
        blocks.append(replace(block, supports=(*held, *ends), loads=tuple(loads)))
    return replace(plane, blocks=tuple(blocks), settings=(("kind", "solid"),))


def crown(rng: Random, ring: bool = False) -> Case:
    """A body with a slightly round face on a flat one: nobody knows the contact's edge."""
    one, two, mu, a = material(rng), material(rng), friction(rng), float(rng.uniform(0.25, 0.5))
    radius, high, low = float(rng.uniform(50, 500)), *map(float, rng.uniform(0.6, 1.5, 2))
    modulus, left, base = contact_modulus(one, two), 0.0 if ring else -1.0, float(rng.uniform(1, 2))
    force = 4 / 3 * modulus * a**3 / radius if ring else np.pi * modulus * a**2 / (4 * radius)
    load = {"z": -force} if ring else oblique(rng, mu, force)
    axis = (Support("left", {"r": 0.0}),) if ring else ()

    def bend(x: np.ndarray) -> np.ndarray:
        return np.stack([x[0], x[1] + x[0] ** 2 / (2 * radius) * (1 - x[1] / high)])

    def parabola(x: np.ndarray) -> np.ndarray:
        return np.stack([x[0], x[0] ** 2 / (2 * radius)])

    reach = (max(left, -0.8), 0.8)
    upper = [(left, 0.0), (1.0, 0.0), (1.0, high), (left, high)]
    lower = [(left * base, -low), (base, -low), (base, 0.0), (left * base, 0.0)]
    touch = {"contact": ("bottom", *reach)}
    curve = {"contact": parabola}
    blocks = (
        Block("upper", upper, one, touch, axis, (Plate("top", load),), bend, curve),
        Block("lower", lower, two, {"contact": ("top", *reach)}, (*axis, Support("bottom"))),
    )
    kind = "axisymmetric" if ring else "plane-strain"
    scene = Blocks(blocks, (("upper", "lower"),), mu, a / 4, settings=(("kind", kind),))
    ways = (scene.matching(rng), scene.unlike(rng))
    points = {"upper": [(0.3, 0.6 * high)], "lower": [(0.2, -0.5 * low)]}
    return Case(
        f"crown, {kind}", ways, points, not ring, True, loose=a**2 / radius, strain=a / radius
    )


def wedge(rng: Random) -> Case:
    """A wedge pressed obliquely between two flanks."""
    angle, high = np.radians(rng.uniform(15, 60)), float(rng.uniform(0.6, 1.2))
    half = float(rng.uniform(0.15, 0.5))
    mu, side = float(rng.uniform(0, 0.6)), high * np.tan(angle)
    out = half + high * np.tan(angle) + 1.0
    load = Plate("top", {"x": float(rng.uniform(-3e-3, 3e-3)), "y": -0.01})
    corners = [(-half, 0.0), (half, 0.0), (half + side, high), (-half - side, high)]
    left = [(-out, 0.0), (-half, 0.0), (-half - side, high), (-out, high)]
    right = [(half, 0.0), (out, 0.0), (out, high), (half + side, high)]
    both = {"on left": ("left", 0.0, high), "on right": ("right", 0.0, high)}
    blocks = (
        Block("wedge", corners, material(rng), both, (), (load,)),
        Block("left", left, material(rng), {"flank": ("right", 0.0, high)}, (Support("left"),)),
        Block("right", right, material(rng), {"flank": ("left", 0.0, high)}, (Support("right"),)),
    )
    pairs = (("wedge:on left", "left:flank"), ("wedge:on right", "right:flank"))
    scene = Blocks(blocks, pairs, mu, high / 8)
    return Case("wedge", (scene.matching(rng), scene.unlike(rng)), inside(blocks))


def bridge(rng: Random) -> Case:
    """A beam on two piers: one surface in two pairs."""
    mu, long = friction(rng), float(rng.uniform(3, 5))
    (thick, high) = map(float, rng.uniform(0.4, 1.2, 2))
    feet = {
        "left": (0.0, float(rng.uniform(0.4, 1))),
        "right": (long - float(rng.uniform(0.4, 1)), long),
    }
    beam = [(0.0, high), (long, high), (long, high + thick), (0.0, high + thick)]
    touch = {f"on {name}": ("bottom", *foot) for name, foot in feet.items()}
    blocks = [
        Block("beam", beam, material(rng), touch, (), (Plate("top", oblique(rng, mu, 3e-3)),))
    ]
    for name, (a, b) in feet.items():
        pier = [(a, 0.0), (b, 0.0), (b, high), (a, high)]
        blocks.append(
            Block(name, pier, material(rng), {"head": ("top", a, b)}, (Support("bottom"),))
        )
    scene = Blocks(
        tuple(blocks), tuple((f"beam:on {name}", f"{name}:head") for name in feet), mu, 0.1
    )
    return Case("beam on two piers", (scene.matching(rng), scene.unlike(rng)), inside(scene.blocks))


def floor(rng: Random) -> Case:
    """An uneven block on a rigid floor: uneven by the gap's function, or by its mesh."""
    mu, own, wide = friction(rng), material(rng), float(rng.uniform(1, 3))
    high = float(rng.uniform(0.5, 2))
    depth, waves = float(10 ** rng.uniform(-5, -3.5)) * wide, rng.uniform(0.5, 4, 3) * np.pi / wide
    phase, sizes, pushed = rng.uniform(0, 2 * np.pi, 3), rng.uniform(0.2, 1, 3), rng.random() < 0.3
    force = own.E * depth * float(10 ** rng.uniform(-0.7, 0.7))
    lift = depth * float(rng.uniform(0.2, 2))

    def shape(x: np.ndarray) -> np.ndarray:
        at = np.concatenate([np.linspace(0, wide, 1000), x[0]])
        waved = depth * (sizes @ np.cos(waves[:, None] * at + phase[:, None]))
        return np.asarray(waved[1000:] - waved[:1000].min())

    def bend(x: np.ndarray) -> np.ndarray:
        return np.stack([x[0], x[1] + shape(x) * (1 - x[1] / high)])

    corners = [(0.0, 0.0), (wide, 0.0), (wide, high), (0.0, high)]
    touch = {"under": ("bottom", 0.0, wide)}
    block = Block("block", corners, own, touch, (), (Plate("top", oblique(rng, mu, force)),))
    ground = Rigid("floor", (0.0, 1.0), shape)
    if pushed:  # the floor is lifted in one way, the block pushed down in the other
        ground = replace(ground, displacement={"x": 0.0, "y": lift})
        block = replace(block, loads=(), supports=(Support("top"),))
    first = Blocks((block,), (("block:under", "floor"),), mu, wide / 20, (ground,))
    held = (Support("top", {"x": 0.0, "y": -lift}),) if pushed else ()
    bent = replace(block, bend=bend, supports=held)
    second = replace(first, blocks=(bent,), rigid=(Rigid("floor", (0.0, 1.0), lambda x: x[1]),))
    points, tall = {} if pushed else inside((block,)), depth * sizes.sum()
    ways = first.matching(rng), second.unlike(rng)
    return Case("uneven block on a floor", ways, points, loose=2 * tall, strain=10 * tall / wide)
