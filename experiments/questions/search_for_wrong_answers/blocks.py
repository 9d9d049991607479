"""Random scenes of blocks with four straight sides, each meshed by two makers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from contactopt import BodyForce, Contact, Material, Part, Plate, Scene, Support, Traction
from contactopt.meshes.structured import simplices, tensor_mesh
from experiments.questions.search_for_wrong_answers.compare import Case, Way
from experiments.questions.search_for_wrong_answers.outlines import outlined

Random = np.random.Generator
SIDES = {"bottom": "y-", "right": "x+", "top": "y+", "left": "x-"}


def ticks(places: list[float], size: float) -> np.ndarray:
    """A grid through some places, whose cells are about as long as given."""
    places = [x for x, after in pairwise(places) if after - x > 1e-9] + places[-1:]
    parts = [np.linspace(a, b, max(1, round((b - a) / size)) + 1) for a, b in pairwise(places)]
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])


@dataclass(frozen=True, eq=False)
class Block:
    """A body by its corners, counter-clockwise from the lower left.

    touch   name of a boundary -> its side, and from where to where along x or y it touches
    """

    name: str
    corners: Any
    material: Material
    touch: dict[str, tuple[str, float, float]]
    supports: tuple[Support, ...] = ()
    loads: tuple[Any, ...] = ()

    def structured(self, h: float, marks: list[float]) -> Any:
        """Quadrilaterals with nodes at the marks along x; boundaries end where bodies touch."""
        (left, low), (right, _), (_, high), _ = self.corners
        x = ticks([left, *(mark for mark in sorted(marks) if left < mark < right), right], h)
        flat = tensor_mesh(
            (x - left) / (right - left), (ticks([low, high], h) - low) / (high - low)
        )
        (s, t), (a, b, c, d) = flat.p, np.asarray(self.corners, dtype=float)[:, :, None]
        places = (1 - s) * (1 - t) * a + s * (1 - t) * b + s * t * c + (1 - s) * t * d
        made = type(flat)(np.ascontiguousarray(places), flat.t)
        sides = {new: flat.boundaries[old] for new, old in SIDES.items()}
        middle = made.p[:, made.facets].mean(axis=1)
        for name, (side, start, end) in self.touch.items():
            own = middle[int(side in ("left", "right"))][sides[side]]
            sides[name] = sides[side][(own > start) & (own < end)]
        return made.with_boundaries(sides)

    def free(self, h: float) -> Any:
        """Triangles of Gmsh, fine where bodies touch; boundaries are whole sides."""
        touching, loop, names = {side for side, *_ in self.touch.values()}, [], list(SIDES)
        for i, side in enumerate(names):
            a, b = np.array(self.corners[i]), np.array(self.corners[(i + 1) % 4])
            loop.append((*a, h if {side, names[i - 1]} & touching else 3 * h, side))
            along = int(side in ("left", "right"))
            ends = [x for other, *own in self.touch.values() if other == side for x in own]
            shares = sorted((x - a[along]) / (b[along] - a[along]) for x in ends)
            loop += [(*(a + s * (b - a)), h, side) for s in shares if 1e-9 < s < 1 - 1e-9]
        made = outlined(loop)
        sides = {name: made.boundaries[side] for name, (side, *_) in self.touch.items()}
        return made.with_boundaries({**made.boundaries, **sides})


@dataclass(frozen=True, eq=False)
class Blocks:
    """A scene of blocks: contacts by names, friction, and the size of its elements."""

    blocks: tuple[Block, ...]
    contacts: tuple[tuple[str, str], ...]
    mu: float
    size: float
    thickness: float = 1.0
    law: str = "coulomb"

    def scene(self, mesh: Callable[[Block], Any], degree: int, **given: Any) -> Scene:
        """The scene with these meshes; `given` are settings of its contacts."""
        bodies = [Part(b.name, mesh(b), b.material, b.supports, b.loads) for b in self.blocks]
        pairs = tuple(Contact(*pair, self.mu, law=self.law, **given) for pair in self.contacts)
        own = {"thickness": self.thickness, "degree": degree}
        return Scene("search", bodies=tuple(bodies), contacts=pairs, **own)

    def matching(self, rng: Random) -> Way:
        """The first way: quadrilaterals, or triangles cut from them; nodes match."""
        cut, degree = rng.random() < 0.3, int(rng.integers(1, 3))
        touching = [own for block in self.blocks for own in block.touch.values()]
        marks = [x for side, *ends in touching if side in ("top", "bottom") for x in ends]

        def build(level: int) -> Scene:
            def mesh(block: Block) -> Any:
                made = block.structured(self.size / 2**level, marks)
                return simplices(made) if cut else made

            return self.scene(mesh, degree)

        return build

    def unlike(self, rng: Random) -> Way:
        """The second way: triangles of Gmsh, coupled by mortar."""
        shares = {block.name: float(rng.uniform(0.7, 1.3)) for block in self.blocks}
        degree, carrier = int(rng.integers(1, 3)), str(rng.choice(["upper", "lower"]))

        def build(level: int) -> Scene:
            def mesh(block: Block) -> Any:
                return block.free(self.size * shares[block.name] / 2**level)

            return self.scene(mesh, degree, coupling="mortar", carrier=carrier)

        return build

    def case(self, family: str, rng: Random, **about: Any) -> Case:
        """Both ways, compared at two points in every block."""
        shares = [0.25] * 4, [0.2, 0.3, 0.4, 0.1]
        points = {b.name: [share @ np.array(b.corners) for share in shares] for b in self.blocks}
        ways = self.matching(rng), self.unlike(rng)
        return Case(family, ways, points, swapped=bool(rng.random() < 0.5), **about)


def material(rng: Random) -> Material:
    """From soft to stiff, up to nearly incompressible."""
    return Material(float(10 ** rng.uniform(0, 1.5)), float(rng.uniform(0, 0.45)))


def friction(rng: Random) -> float:
    """None in a fifth of the scenes."""
    return 0.0 if rng.random() < 0.2 else float(rng.uniform(0.05, 1.0))


def oblique(rng: Random, mu: float, force: float) -> dict[str, float]:
    """A force that presses and, where friction can hold it, pushes."""
    return {"x": float(rng.uniform(-0.8, 0.8)) * mu * force, "y": -force} if mu else {"y": -force}


def stacked(rng: Random, layers: int) -> tuple[list[Any], float]:
    """Corners of blocks one upon another, some thin or apart, and the sum of the gaps."""
    left, right, y, gaps, corners = 0.0, float(rng.uniform(2, 4)), 0.0, 0.0, []
    for layer in range(layers):
        thin = layer and rng.random() < 0.4
        high = float(rng.uniform(0.05, 0.2) if thin else rng.uniform(0.5, 1.5))
        lean = rng.uniform(-0.15, 0.15, 2) * (right - left) * (layer == layers - 1)
        top = [(right + lean[1], y + high), (left + lean[0], y + high)]
        corners.append([(left, y), (right, y), *top])
        wide = (right - left) * float(1.0 if rng.random() < 0.3 else rng.uniform(0.5, 0.95))
        apart = float(rng.uniform(0.01, 0.3)) * float(rng.random() < 0.3 and layer < layers - 1)
        left += float(rng.uniform(0, 1)) * (right - left - wide)
        right, y, gaps = left + wide, y + high + apart, gaps + apart
    return corners, gaps


def stack(rng: Random, layers: int = 2) -> Case:
    """Blocks one upon another, under a plate, a moved side, a traction or their weight."""
    # Without friction nothing says where a body between two others is along them.
    mu, depth = friction(rng) or (0.3 if layers > 2 else 0.0), float(rng.uniform(0.3, 1.0))
    force, (corners, gaps) = float(10 ** rng.uniform(-3, -1)), stacked(rng, layers)
    load, span = oblique(rng, mu, force), corners[-1][2][0] - corners[-1][3][0]
    push = load.get("x", 0.0) / force
    tall, narrow = corners[-1][2][1], min(c[1][0] - c[0][0] for c in corners)
    free = mu > 0.1 and abs(push) * tall < 0.2 * narrow
    kind = rng.choice(["plate", "moved", "traction", "weight"] if free else ["plate", "moved"])
    carried: dict[str, tuple[Any, ...]] = {
        "plate": (Plate("top", load),),
        "moved": (),
        "traction": (Traction("top", (push * force / span / depth, -force / span / depth)),),
        "weight": (BodyForce((push * force, -force)),),
    }
    held = (Support("top", {"x": push * 1e-3, "y": -gaps - 1e-3}),) if kind == "moved" else ()
    made = []
    for i, own in enumerate(corners):
        touch = {"under": ("bottom", own[0][0], own[1][0])} if i else {}
        if i < layers - 1:
            touch["over"] = ("top", corners[i + 1][0][0], corners[i + 1][1][0])
        last = i == layers - 1
        supports = (() if i else (Support("bottom"),)) + held * last
        loads = carried[kind] if last else ()
        made.append(Block(f"body {i}", own, material(rng), touch, supports, loads))
    rare = bool(mu) and not gaps
    law = str(rng.choice(["coulomb", "tresca", "tied"], p=[0.8, 0.1, 0.1])) if rare else "coulomb"
    pairs = tuple((f"body {i + 1}:under", f"body {i}:over") for i in range(layers - 1))
    thinnest = min(2 * (c[2][1] - c[1][1]) for c in corners)
    size = min([thinnest] + [(c[1][0] - c[0][0]) / 8 for c in corners[1:]])
    mu = {"coulomb": mu, "tresca": mu * force, "tied": 0.0}[law]
    scene = Blocks(tuple(made), pairs, mu, size, depth, law)
    return scene.case(f"{layers} blocks", rng, loose=1.001 * gaps)


def bridge(rng: Random) -> Case:
    """A beam on two piers: one surface in two pairs."""
    mu, long = friction(rng), float(rng.uniform(3, 5))
    (thick, high), (one, two) = rng.uniform(0.4, 1.2, 2).tolist(), rng.uniform(0.4, 1, 2).tolist()
    feet = {"left": (0.0, one), "right": (long - two, long)}
    beam = [(0.0, high), (long, high), (long, high + thick), (0.0, high + thick)]
    touch = {f"on {name}": ("bottom", *foot) for name, foot in feet.items()}
    load = Plate("top", oblique(rng, mu, 3e-3))
    blocks = [Block("beam", beam, material(rng), touch, (), (load,))]
    for name, (a, b) in feet.items():
        pier, head = [(a, 0.0), (b, 0.0), (b, high), (a, high)], {"head": ("top", a, b)}
        blocks.append(Block(name, pier, material(rng), head, (Support("bottom"),)))
    pairs = tuple((f"beam:on {name}", f"{name}:head") for name in feet)
    return Blocks(tuple(blocks), pairs, mu, 0.1).case("beam on two piers", rng)
