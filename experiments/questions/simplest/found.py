"""Scenes that nobody prepared: what is found, what it saves, and how far the answers are from those of the whole scene."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from contactopt import (
    BodyForce,
    Contact,
    InputError,
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    Simplification,
    Support,
    Traction,
    load_mesh,
    scenes,
    simplify,
)
from contactopt.analysis.quantities import approach, elastic_energy
from contactopt.analysis.simplest.turning import turned
from contactopt.analysis.solve_scene import Solved, solve_scene
from contactopt.scenes.meshes import rename, tensor_mesh

Row = dict[str, Any]
STEEL, ALUMINIUM = Material(210e3, 0.3), Material(70e3, 0.33)
REPEATS = 3  # solves of which the fastest counts


def turn(degrees: float) -> np.ndarray:
    """Rotation of the plane (2, 2)."""
    a = np.deg2rad(degrees)
    return np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])


def gmsh_mesh(
    build: Callable[[Any], list[tuple[int, int]]], sides: Callable[[np.ndarray], str], size: float, dim: int = 2
) -> Any:
    """A mesh of Gmsh: `build` makes the body from the kernel, `sides` names a side by its middle."""
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    body = build(gmsh.model.occ)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(dim, [tag for _, tag in body], name="body")
    groups: dict[str, list[int]] = {}
    for _, side in gmsh.model.getBoundary(body, oriented=False):
        groups.setdefault(sides(np.array(gmsh.model.occ.getCenterOfMass(dim - 1, side))), []).append(side)
    for name, tags in groups.items():
        gmsh.model.addPhysicalGroup(dim - 1, tags, name=name)
    gmsh.model.mesh.generate(dim)
    with TemporaryDirectory() as folder:
        gmsh.write(f"{folder}/body.msh")
        mesh = load_mesh(Path(folder) / "body.msh")
    gmsh.finalize()
    return mesh


def stamp(shift: float = 0.0, push: float = 0.0) -> Scene:
    """A stamp with two shoulders and a hole, by Gmsh, on a block by Gmsh; `shift` moves the hole, `push` the plate sideways."""

    def body(occ: Any) -> Any:
        head, foot = (2, occ.addRectangle(-10, 5, 0, 20, 10)), (2, occ.addRectangle(-4, 0, 0, 8, 5))
        fused, _ = occ.fuse([head], [foot])
        return occ.cut(fused, [(2, occ.addDisk(shift, 10, 0, 2.5, 2.5))])[0]

    upper = gmsh_mesh(body, lambda x: "foot" if x[1] < 1e-6 else "top" if x[1] > 15 - 1e-6 else "side", 0.8)
    lower = gmsh_mesh(
        lambda occ: [(2, occ.addRectangle(-20, -15, 0, 40, 15))],
        lambda x: "top" if x[1] > -1e-6 else "bottom" if x[1] < -15 + 1e-6 else "side",
        0.8,
    )
    head = Part("stamp", upper, STEEL, loads=(Plate("top", {"x": push, "y": -500.0}),), contact="foot")
    return Scene("stamp of Gmsh", head, Part("block", lower, ALUMINIUM, (Support("bottom"),), contact="top"), 0.3)


def bridge(weight: float = 1.0) -> Scene:
    """A beam on two piers on a rigid floor, all held by contact alone; `weight` of the right pier over that of the left."""

    def block(x: tuple[float, float], y: tuple[float, float]) -> Any:
        ticks = [np.linspace(low, high, round(high - low) * 4 + 1) for low, high in (x, y)]
        return rename(tensor_mesh(*ticks), contact="y-", top="y+")

    def load(factor: float) -> tuple[Any, ...]:
        return (BodyForce((0.0, -1e-3 * factor)),)

    left = Part("left pier", block((-5, -3), (0, 4)), ALUMINIUM, loads=load(1.0))
    right = Part("right pier", block((3, 5), (0, 4)), ALUMINIUM, loads=load(weight))
    beam = Part("beam", block((-6, 6), (4, 6)), STEEL, loads=(*load(1.0), Traction("top", (0.0, -0.2))))
    pairs = [Contact(f"{name} pier", "floor", 0.5) for name in ("left", "right")]
    pairs += [Contact("beam", f"{name} pier:top", 0.5) for name in ("left", "right")]
    return Scene("bridge of blocks", bodies=(Rigid("floor"), left, right, beam), contacts=tuple(pairs))


def whole_cylinder(depth: float | None = None) -> Scene:
    """All of a rigid cylinder on a block, the gap as a function; with a depth a solid between rollers."""
    x = np.concatenate([-np.geomspace(60, 4, 24), np.linspace(-3.75, 3.75, 61), np.geomspace(4, 60, 24)])
    y = np.concatenate([-np.geomspace(60, 1, 24), np.linspace(-0.875, 0, 8)])

    def gap(p: np.ndarray) -> np.ndarray:
        return np.asarray(p[0] ** 2 / 400)

    if depth is None:
        mesh = rename(tensor_mesh(x, y), contact="y+", bottom="y-")
        block = Part("block", mesh, ALUMINIUM, (Support("bottom"),))
        return Scene("cylinder", Rigid("cylinder", (0.0, 1.0), gap, {"x": 0.0, "y": -600.0}), block, 0.2)
    mesh = rename(
        tensor_mesh(x[::2], np.linspace(0, depth, 5), y[1::2]), contact="z+", bottom="z-", near="y-", far="y+"
    )
    ends = tuple(Support(name, {"y": 0.0}) for name in ("near", "far"))
    block = Part("block", mesh, ALUMINIUM, (Support("bottom"), *ends))
    force = {"x": 0.0, "z": -600.0 * depth}
    return Scene("cylinder, solid", Rigid("cylinder", (0.0, 0.0, 1.0), gap, force), block, 0.2, kind="solid")


def punch(dim: int = 3) -> Scene:
    """A square block pressed on a larger one, all of both."""

    def box(half: float, low: float, high: float, across: int, rows: int) -> Any:
        return tensor_mesh(*[np.linspace(-half, half, across + 1)] * 2, np.linspace(low, high, rows + 1))

    upper = rename(box(2.0, 0.0, 3.0, 8, 6), contact="z-", top="z+")
    lower = rename(box(6.0, -6.0, 0.0, 24, 8), bottom="z-", top="z+")
    middle = lower.p[:, lower.facets[:, lower.boundaries["top"]]].mean(axis=1)
    lower = lower.with_boundaries({"contact": lower.boundaries["top"][np.all(np.abs(middle[:2]) < 2, axis=0)]})
    block = Part("block", upper, STEEL, loads=(Plate("top", {"x": 0.0, "y": 0.0, "z": -5e4}),))
    return Scene(
        "block on block, solid", block, Part("ground", lower, ALUMINIUM, (Support("bottom"),)), 0.3, kind="solid"
    )


def pillar() -> Scene:
    """A round pillar on a round floor, tetrahedra of Gmsh."""

    def cylinder(radius: float, low: float, high: float) -> Callable[[Any], list[tuple[int, int]]]:
        return lambda occ: [(3, occ.addCylinder(0, 0, low, 0, 0, high - low, radius))]

    def named(top: str, bottom: str, low: float, high: float) -> Callable[[np.ndarray], str]:
        return lambda x: top if x[2] > high - 1e-6 else bottom if x[2] < low + 1e-6 else "side"

    upper = gmsh_mesh(cylinder(1.0, 0.0, 2.0), named("top", "contact", 0.0, 2.0), 0.25, 3)
    lower = gmsh_mesh(cylinder(2.0, -1.5, 0.0), named("contact", "bottom", -1.5, 0.0), 0.3, 3)
    block = Part("pillar", upper, STEEL, loads=(Plate("top", {"z": -1e4}),))
    return Scene(
        "pillar of Gmsh, solid", block, Part("floor", lower, ALUMINIUM, (Support("bottom"),)), 0.3, kind="solid"
    )


def asked() -> dict[str, Scene]:
    """The scenes of the table."""
    return {
        "stamp of Gmsh": stamp(),
        "stamp of Gmsh, turned by 30 degrees": turned(stamp(), turn(30.0)),
        "bridge of blocks": bridge(),
        "arch": scenes.arch(),
        "stack": scenes.stack(tilt=8.0, mu=0.3),
        "block on block, solid": punch(),
        "cylinder": whole_cylinder(),
        "cylinder, solid": whole_cylinder(3.0),
        "pillar of Gmsh, solid": pillar(),
        "press-fit": scenes.press_fit(),
        "cattaneo-3d": scenes.cattaneo(3),
    }


def spoilt() -> dict[str, Scene]:
    """Scenes that look symmetric and are not."""
    plain = bridge()
    slippery = tuple(replace(pair, mu=0.4) if pair.name == "beam-right pier.top" else pair for pair in plain.contacts)
    ball = whole_cylinder()
    moved = replace(ball, upper=replace(ball.upper, gap=lambda p: (p[0] - 0.01) ** 2 / 400))
    return {
        "stamp whose hole is .2 mm off": stamp(shift=0.2),
        "stamp that is pushed sideways": stamp(push=1.0),
        "bridge with a heavier pier": bridge(weight=1.001),
        "bridge with less friction on the right": replace(plain, contacts=slippery),
        "cylinder .01 off the middle": moved,
    }


def numbers(solved: Solved) -> dict[str, float]:
    """Energy, approach, normal force and largest pressure of the whole, whatever part of it is modelled."""
    problem, r = solved.reduction.problem, solved.solution.reactions
    return {
        "energy": elastic_energy(solved.reduction, solved.solution),
        "approach": approach(problem, solved.solution) or 0.0,
        "pressure": float((r[:, 0] / problem.areas).max()),
    }


def price(scene: Scene) -> tuple[Solved, float]:
    """The solved scene, and the least of the processor seconds of its solves."""
    seconds = []
    for _ in range(REPEATS):
        begin = time.process_time()
        solved = solve_scene(scene)
        seconds.append(time.process_time() - begin)
    return solved, min(seconds)


def found_rows() -> list[Row]:
    """Each simplification of each scene: what it saves, and how far its answers are from those of the whole scene."""
    rows = []
    for name, scene in asked().items():
        begin = time.process_time()
        found = simplify(scene)
        search = time.process_time() - begin
        whole, first = price(scene)
        exact = numbers(whole)
        for each in found.found:
            rows.append({"scene": name} | _row(each, exact, first) | {"search, s": search})
            print(rows[-1], flush=True)
    return rows


def _row(each: Simplification, exact: dict[str, float], first: float) -> Row:
    """Errors beside the whole scene; half-spaces have no energy and no approach of bodies."""
    assert each.scene is not None
    solved, seconds = price(each.scene)
    own = numbers(solved)
    names = ("pressure",) if each.name == "half-spaces" else tuple(exact)
    errors = {f"{key}, error": abs(own[key] / exact[key] - 1) if key in names and exact[key] else "-" for key in exact}
    claim = "exact" if each.error == 0 and each.exact else "the mesh's" if each.exact else f"{each.error:.1e}"
    (n, k), after = each.before, each.after
    assert after is not None
    parts = {"left out": each.name, "unknowns": f"{n} -> {after[0]}", "contacts": f"{k} -> {after[1]}"}
    return parts | {"CPU s": f"{first:.3g} -> {seconds:.3g}", "error said": claim} | errors


def spoilt_rows() -> list[Row]:
    """What is said of scenes that look symmetric and are not."""
    rows = []
    for name, scene in spoilt().items():
        found = simplify(scene, solve=False)
        rows.append({"scene": name, "simplifications": len(found.found), "said": " ".join(found.notes) or "-"})
        print(rows[-1], flush=True)
    return rows


def size_rows() -> list[Row]:
    """Half-planes instead of blocks of all thicknesses and cylinders of all curvatures: the error said and the error made."""
    rows = []
    for what, rigid, values in (
        ("H / a", "cylinder", (1.5, 2.0, 4.0, 8.0, 16.0)),
        ("a / R", "foundation", (0.05, 0.1, 0.2, 0.3)),
    ):
        hertz = scenes.cylinder(rigid=rigid).reference
        assert hertz is not None
        for value in values:
            changes: Row = {"foundation_height": value * hertz.half_width}
            if what == "a / R":
                changes = {"force": 100.0 * (value * 400.0 / hertz.half_width) ** 2}
            rows.append(_size(what, value, scenes.cylinder(mu=0.0, elements=64, rigid=rigid, **changes)))
            print(rows[-1], flush=True)
    return rows


def _size(what: str, value: float, scene: Scene) -> Row:
    from contactopt.analysis.simplest import joints, large_bodies

    spot = large_bodies.spot_of(joints.coarse(scene))
    row: Row = {"size": what, "value": value, "offered": "no", "error said": "-", "error of the peak pressure": "-"}
    if isinstance(spot, str):
        return row | {"offered": spot}
    whole, made = (numbers(solve_scene(each))["pressure"] for each in (scene, large_bodies.as_half_spaces(scene, spot)))
    try:
        offered = "yes" if simplify(scene)["half-spaces"] else "no"
    except InputError:
        offered = "no"
    return row | {"offered": offered, "error said": spot.error, "error of the peak pressure": abs(made / whole - 1)}
