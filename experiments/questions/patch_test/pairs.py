"""Random pairs of surfaces of every kind. To add a kind, write a function of a generator of random
numbers that gives a Pair, and name it in MAKERS.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import skfem

from contactopt import Contact, InputError, Material, Part, Rigid, Scene, Support, Traction
from contactopt.meshes.structured import simplices, tensor_mesh
from contactopt.scenes import SCENES, make_scene

LAWS = (("coulomb", 0.3), ("frictionless", 0.0), ("tied", 0.0))
AXES = {"plane-strain": "xy", "axisymmetric": "rz", "solid": "xyz"}


class Pair(NamedTuple):
    """A scene and what is known of it.

    kind      of the pair, for the table
    scene     its contact 0 is the pair
    pressure  exact and uniform pressure of the solution [stress]; None where only nodal forces are
              known
    covered   (dim, 2) the common part of both surfaces, in the coordinates of `axes`; None where
              the surfaces are curved, so that only remarks count
    axes      (dim, dim) columns: directions of the blocks, the last one normal to the surface
    differ    whether facets differ where nodes agree, so that these may not be joined node to node
    """

    kind: str
    scene: Scene
    pressure: float | None = None
    covered: np.ndarray | None = None
    axes: np.ndarray | None = None
    differ: bool = False


def _mirrored(mesh: skfem.Mesh, axis: int) -> skfem.Mesh:
    """The mesh mirrored in its own middle plane across an axis, with names for the new sides."""
    p = mesh.p.copy()
    p[axis] = p[axis].min() + p[axis].max() - p[axis]
    name = "xyz"[axis]
    swapped = {f"{name}-": f"{name}+", f"{name}+": f"{name}-"}
    sides = {swapped.get(side, side): facets for side, facets in mesh.boundaries.items()}
    return replace(mesh, doflocs=p, _boundaries=sides)


def _box(limits: np.ndarray, cells: list[int], shape: str, warp: float) -> skfem.Mesh:
    """A box between limits (dim, 2) with boundaries x-, x+ and so on. `shape` is 'bricks',
    'simplices', or 'mirrored': simplices with the other diagonals. A smooth `warp` moves nodes
    across the height, in the same way in all boxes between the same sides.
    """
    mesh = tensor_mesh(*(np.linspace(*side, n + 1) for side, n in zip(limits, cells)))
    if shape != "bricks":
        mesh = simplices(mesh)
    if shape == "mirrored":
        mesh = _mirrored(mesh, 0)
    flat = len(limits) - 1
    low, size = limits[:flat, 0], np.ptp(limits[:flat], axis=1)
    s = (mesh.p[:flat] - low[:, None]) / size[:, None]
    bent = warp * np.prod(np.sin(np.pi * s), axis=0) * size[:, None]
    p = mesh.p.copy()
    p[:flat] += bent * np.array([1.0, 0.6])[:flat, None]
    return replace(mesh, doflocs=p)


def _shapes(rng: np.random.Generator, dim: int) -> tuple[tuple[str, str], bool]:
    """Shapes of the elements of both bodies, and whether facets differ if nodes agree."""
    kinds = ["bricks", "simplices"] + ["mirrored"] * (dim == 3)
    shapes = str(rng.choice(kinds)), str(rng.choice(kinds))
    return shapes, dim == 3 and shapes[0] != shapes[1]


def _materials(rng: np.random.Generator, alike: bool, unit: float) -> tuple[Material, Material]:
    first, other = (
        Material(float(unit * 10 ** rng.uniform(3, 6)), float(rng.uniform(0, 0.45)))
        for _ in range(2)
    )
    return first, first if alike else other


def _sides(kind: str, confined: bool, low: float) -> tuple[Support, ...]:
    """Supports that leave the stress uniform."""
    axes = AXES[kind]
    if kind == "axisymmetric" and not confined and low > 0:
        return ()
    names = [f"{x}{end}" for x in "xy"[: len(axes) - 1] for end in ("-+" if confined else "-")]
    return tuple(Support(name, {axes["xy".index(name[0])]: 0.0}) for name in names)


def blocks(rng: np.random.Generator, kind: str) -> Pair:
    """Two blocks with a common face under a uniform pressure: nodes agree or not, facets agree or
    not, elements of any shape and degree, any law, other materials where the sides are held or
    nothing rubs, any unit, thin ones too.
    """
    dim, degree = len(AXES[kind]), int(rng.integers(1, 3))
    shapes, differ = _shapes(rng, dim)
    unit, stress = (float(10.0 ** rng.integers(-3, 4)) for _ in range(2))
    law, mu = LAWS[rng.integers(3)]
    confined, same = bool(rng.integers(2)), bool(rng.integers(2))
    start = float(rng.choice([0.0, 0.7])) if kind == "axisymmetric" else 0.0
    n = int(rng.integers(2, 5 if dim == 3 else 7))
    counts = n, n if same else n + int(rng.integers(1, 3))
    heights = [float(rng.choice([1.0, 0.3, 0.05])) for _ in range(2)]
    warp = float(rng.choice([0.0, 0.08]))
    materials = _materials(rng, law != "frictionless" and not confined, stress)
    wide = np.stack([[start, start + size] for size in rng.uniform(0.6, 1.5, dim - 1)])
    bodies, sides, axes = [], _sides(kind, confined, start), AXES[kind]
    for i, name in enumerate(("upper", "lower")):
        height = [0.0, heights[0]] if i == 0 else [-heights[1], 0.0]
        limits = unit * np.stack([*wide, height])
        cells = [counts[i]] * (dim - 1) + [int(rng.integers(1, 3))]
        mesh, up = _box(limits, cells, shapes[i], warp), "xyz"[dim - 1]
        load = (Traction(f"{up}+", (*[0.0] * (dim - 1), -stress)),) if i == 0 else ()
        held = sides if i == 0 else (*sides, Support(f"{up}-", {axes[-1]: 0.0}))
        bodies.append(Part(name, mesh, materials[i], held, load, f"{up}{'-+'[i]}"))
    scene = Scene(
        "blocks",
        bodies=tuple(bodies),
        contacts=(Contact("upper", "lower", mu, law),),
        kind=kind,
        degree=degree,
        units=("mm", "MPa"),
    )
    covered = unit * np.stack([*wide, [0.0, 0.0]])
    agree = "nodes agree" if same else "other nodes"
    label = f"{kind}, {agree}" + (", other facets" if same and differ else "")
    return Pair(label, scene, stress, covered, np.eye(dim), same and differ and degree == 1)


def overhanging(rng: np.random.Generator, dim: int) -> Pair:
    """Two blocks in any position that cover each other in part, or as a whole with nodes that
    agree; some are mirror images.
    """
    degree, (shapes, _) = int(rng.integers(1, 3)), _shapes(rng, dim)
    unit = float(10.0 ** rng.integers(-3, 4))
    flat, bodies = dim - 1, []
    limits = [np.stack([[0.0, 1.0]] * flat), np.sort(rng.uniform(-0.5, 1.5, (flat, 2)), axis=1)]
    limits[1][:, 1] = np.maximum(limits[1][:, 1], limits[1][:, 0] + 0.6)
    whole = not rng.integers(3)
    if whole:
        limits[1] = limits[0]
    begin, end = np.maximum(*(x[:, 0] for x in limits)), np.minimum(*(x[:, 1] for x in limits))
    if np.any(end - begin < 0.15):  # hardly anything faces anything
        return overhanging(rng, dim)
    counts = rng.integers(2, 7, (2, flat))
    turn = np.linalg.qr(rng.normal(size=(dim, dim)))[0]
    for i, name in enumerate(("upper", "lower")):
        height = [0.0, 0.5] if i == 0 else [-0.5, 0.0]
        cells = [*counts[0 if whole else i].tolist(), 1]
        mesh = _box(unit * np.stack([*limits[i], height]), cells, shapes[i], 0.0)
        mesh = replace(mesh, doflocs=turn @ mesh.p)
        bodies.append(Part(name, mesh, Material(1.0, 0.3), contact=f"{'xyz'[flat]}{'-+'[i]}"))
    pair = Contact("upper", "lower", 0.3, carrier=[None, "upper", "lower"][rng.integers(3)])
    kind = "plane-strain" if dim == 2 else "solid"
    scene = Scene("overhanging", bodies=tuple(bodies), contacts=(pair,), kind=kind, degree=degree)
    covered = unit * np.stack([*zip(begin, end), [0.0, 0.0]])
    how = "nodes agree" if whole else "covered in part"
    return Pair(f"{kind}, {how}, turned", scene, None, covered, turn)


def shells(rng: np.random.Generator, kind: str) -> Pair:
    """A ring, a tube or a sphere in another one, with or without a gap, conforming or not."""
    dim, degree = len(AXES[kind]), int(rng.integers(1, 3))
    shapes, differ = _shapes(rng, dim)
    n, same = int(rng.integers(3, 12)), bool(rng.integers(2))
    gap = float(rng.choice([0.0, 0.002, 0.1]))
    bodies = []
    for i, (low, high, name) in enumerate(((2.0 + gap, 3.0, "upper"), (1.0, 2.0, "lower"))):
        sectors = n if same or i == 0 else n + int(rng.integers(1, 4))
        limits = np.array([[0.0, np.pi / 2], *[[0.0, 1.0]] * (dim - 2), [low, high]])
        mesh = _box(limits, [sectors, *([3] * (dim - 2)), 2], shapes[i], 0.0)
        phi, r = mesh.p[0], mesh.p[-1]
        p = np.stack([r * np.sin(phi), r * np.cos(phi), *mesh.p[1:-1]])
        contact = f"{'xyz'[dim - 1]}{'-+'[i]}"
        axes = AXES[kind]
        held = Support("x-", {axes[0]: 0.0}), Support("x+", {axes[1]: 0.0})
        made = replace(mesh, doflocs=p)
        bodies.append(Part(name, made, Material(1.0, 0.3), held, (), contact))
    contacts = (Contact("upper", "lower", 0.3),)
    scene = Scene("shells", bodies=tuple(bodies), contacts=contacts, kind=kind, degree=degree)
    agree = "nodes agree" if same else "other nodes"
    label = f"{kind}, curved, {agree}" + (", other facets" if same and differ else "")
    return Pair(label, scene, differ=same and differ and degree == 1)


def on_rigid(rng: np.random.Generator) -> Pair:
    """A block on a rigid floor."""
    made = blocks(rng, str(rng.choice(list(AXES))))
    up = made.scene.bodies[0]
    n = (*[0.0] * (len(made.axes) - 1), 1.0)
    pair = Contact("upper", "floor", 0.0, "frictionless")  # the floor does not grow wider
    bodies = up, Rigid("floor", normal=n)
    scene = replace(made.scene, bodies=bodies, contacts=(pair,))
    return made._replace(kind="on a rigid floor", scene=scene, differ=False)


def named(rng: np.random.Generator) -> Pair:
    """A named scene of one of its meshes: Hertz's contacts, punches, half-spaces."""
    name, degree = str(rng.choice(list(SCENES))), int(rng.integers(1, 3))
    changes: dict[str, Any] = {"degree": degree, "simplices": bool(rng.integers(2))}
    try:
        return Pair("a named scene", make_scene(name, elements=int(rng.integers(3, 9)), **changes))
    except InputError:  # no number of elements
        return Pair("a named scene", make_scene(name, degree=degree))


MAKERS: tuple[Callable[[np.random.Generator], Pair], ...] = (
    *(lambda rng, kind=kind: blocks(rng, kind) for kind in (*AXES, "solid")),
    lambda rng: overhanging(rng, 2),
    lambda rng: overhanging(rng, 3),
    *(lambda rng, kind=kind: shells(rng, kind) for kind in (*AXES, "solid")),
    on_rigid,
    named,
)


def pair(seed: int) -> Pair:
    """The pair of a seed."""
    return MAKERS[seed % len(MAKERS)](np.random.default_rng(seed))
