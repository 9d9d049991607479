"""Readings of all scenes and paths, against the displacements of the nodes of their bodies."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from conftest import MATERIAL, block

from contactopt import Contact, Part, Plate, Scene, Support, Traction, gradient, run
from contactopt.meshes.polar import ring
from contactopt.readings.plate_motions import approach
from contactopt.readings.quantities import value_of
from contactopt.scenes import PATHS, SCENES
from contactopt.scenes.scene import BodyForce
from contactopt.solving.follow import follow

SMALL = {"cattaneo-2d": {"steps": 1}, "cattaneo-3d": {"steps": 1}, "hertz-dissimilar": {"steps": 2}}
SMALL["rough"] = {"steps": 2, "points": 40}


@cache
def small(name):
    """The result of a named scene or path on a coarse mesh."""
    elements = {} if name == "rough" else {"elements": 4 if "3d" in name else 8}
    return run(name, figures=(), **SMALL.get(name, {}), **elements)


def states(result):
    """The reduction, solution, history row and fields of every state."""
    path = result.path or follow([result.scene])
    for step in range(len(path.states)):
        row = {name: values[step] for name, values in path.history.items()}
        yield *path.at(step), row, {own.name: own for own in path.fields(step)}


def carried(scene, reduction, solution, fields, part):
    """The motion of a part (dim,) by the nodes under its plates, or the force-driven motion of a
    part without a mesh; None without a plate.
    """
    if not part.meshed:
        if not part.force:
            return None
        given = part.displacement or {}
        found = [float(given.get(name, 0.0)) for name in scene.components]
        names = dict(zip(reduction.problem.motions, solution.multipliers))
        for name in part.force:
            label = f"body '{part.name}': translation along {name}"
            found[scene.components.index(name)] = names[label]
        return np.array(found)
    mesh, U, found = fields[part.name].mesh, fields[part.name].displacement, np.zeros(scene.dim)
    plates = [load for load in part.loads if isinstance(load, Plate)]
    for c, name in enumerate(scene.components):
        where = [load.boundary for load in plates if name in load.force]
        where += [s.boundary for s in part.supports if (s.displacement or {}).get(name)]
        if where:
            nodes = np.unique(mesh.facets[:, mesh.boundaries[where[0]]])
            assert np.ptp(U[c, nodes]) <= 1e-9 * np.abs(U).max()  # a plate is rigid
            found[c] = U[c, nodes].mean()
    return found if plates else None


@pytest.mark.parametrize("name", sorted({*SCENES, *PATHS}))
def test_every_reading_is_that_of_the_nodes(name):
    result = small(name)
    for reduction, solution, row, fields in states(result):
        scene = reduction.scene
        parts = {part.name: part for part in scene.parts}
        ends = [
            carried(scene, reduction, solution, fields, parts[body])
            for body in scene.pairs[0].bodies
        ]
        if any(end is not None for end in ends):
            above, below = (np.zeros(scene.dim) if end is None else end for end in ends)
            frame = reduction.frames.mean(axis=0)
            frame /= np.linalg.norm(frame, axis=1, keepdims=True)
            near, along = frame[:2] @ (above - below)
            scale = np.abs([*above, *below]).max()
            assert row["approach"] == pytest.approx(-near, abs=1e-9 * scale)
            assert row["shift"] == pytest.approx(along, abs=1e-9 * scale)
            assert approach(reduction, solution) == pytest.approx(-near, abs=1e-9 * scale)
        else:
            assert approach(reduction, solution) is None
        r = solution.reactions
        pairs = reduction.problem.pairs
        for pair in pairs:  # the sum of several is the force on no body
            column = "normal_force" + (f":{pair.name}" if len(pairs) > 1 else "")
            assert row[column] == pytest.approx(r[pair.contacts, 0].sum(), rel=1e-12)
    if result.path is None:
        assert result.summary["approach"] == approach(result.reduction, result.solution)
    else:
        assert result.summary["approach"] == result.path.history["approach"][-1]


@pytest.mark.parametrize("name", sorted(SCENES))
def test_the_forces_on_every_body_balance(name):
    """Those that a pair, a support and a plate are said to exert, with their moments."""
    result = small(name)
    scene, summary = result.scene, result.summary
    for body, part in {part.name: part for part in scene.parts}.items():
        if not part.meshed or any(isinstance(load, Traction | BodyForce) for load in part.loads):
            continue
        found = [
            (1.0 if side == 0 else -1.0, summary["pairs"][pair.name])
            for pair in scene.pairs
            for side in range(2)
            if pair.bodies[side] == body
        ]
        lowers = [sign for sign, _ in found if sign < 0]
        found += [
            (1.0, own)
            for holder, own in summary["holders"].items()
            if holder.startswith(f"body '{body}'")
        ]
        scale = sum(np.abs(own["force"]).sum() for _, own in found)
        scale += sum(pair["normal_force"] for pair in summary["pairs"].values())
        size = np.abs(result.reduction.problem.coordinates).max()
        force = sum(sign * np.array(own["force"]) for sign, own in found)
        moment = sum(sign * np.array(own["moment"]) for sign, own in found)
        assert np.abs(force).max() <= 1e-8 * scale
        if not lowers:  # the moment of a pair is that on its upper body, across the gap
            assert np.abs(moment).max() <= 1e-8 * scale * size


def rings(inside, outside, degree=1, mu=0.0):
    """A shaft pressed into a hub by an interference, of different numbers of elements."""
    turn = np.linspace(0, 2 * np.pi, inside + 1), 0.1 + np.linspace(0, 2 * np.pi, outside + 1)
    shaft, hub = (
        ring(np.linspace(*radii), own) for radii, own in zip(((5, 20, 4), (19.9, 40, 5)), turn)
    )
    return Scene(
        "rings",
        Part("shaft", shaft, MATERIAL, (Support("inner"),), contact="outer"),
        Part("hub", hub, MATERIAL, (Support("outer"),), contact="inner"),
        mu,
        degree=degree,
    )


@pytest.mark.parametrize("inside, outside", [(24, 31), (40, 24)])
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_the_moment_of_a_pair_is_that_of_its_support(inside, outside, mu):
    summary = run(rings(inside, outside, mu=mu), figures=()).summary
    (pair,), held = summary["pairs"].values(), summary["holders"]
    size = 20 * pair["normal_force"]
    assert pair["moment"][0] == pytest.approx(
        -held["body 'shaft', support 'inner'"]["moment"][0], abs=1e-9 * size
    )
    assert summary["approach"] is None


def clamped(shear, glued=False):
    """Two plates that washers press on each other; both are held at one end, and one is pulled."""

    def plate(name, low, high, contact, washer, force, pulled):
        mesh = block("plane-strain", low, high, cells=6, width=3.0)
        held = Support("side0") if pulled is None else None
        loads = (Plate(washer, {"y": force}, glued=glued),)
        if pulled is not None:
            mesh = mesh.with_boundaries({"end": lambda x: x[0] > 3.0 - 1e-9})
            loads += (Plate("end", {"x": pulled}),)
        return Part(name, mesh, MATERIAL, (held,) if held else (), loads, contact=contact)

    middle = lambda y: lambda x: (np.abs(x[1] - y) < 1e-9) & (np.abs(x[0] - 1.5) < 1.0)  # noqa: E731
    upper = plate("upper", 0, 1, "bottom", "washer", -2.0, shear)
    lower = plate("lower", -1, 0, "top", "washer", 2.0, None)
    upper = replace(upper, mesh=upper.mesh.with_boundaries({"washer": middle(1.0)}))
    lower = replace(lower, mesh=lower.mesh.with_boundaries({"washer": middle(-1.0)}))
    return Scene("clamped", upper, lower, 0.4)


def test_washers_count_on_held_bodies_too():
    path = follow([clamped(shear) for shear in (0.0, 0.2, 0.4)])
    assert path.solved
    for step in range(len(path.states)):
        upper, lower = path.fields(step)
        at = [
            own.displacement[:, np.unique(own.mesh.facets[:, own.mesh.boundaries[name]])].mean(
                axis=1
            )
            for own, name in ((upper, "washer"), (lower, "washer"), (upper, "end"))
        ]
        assert path.history["approach"][step] == pytest.approx(at[1][1] - at[0][1], rel=1e-9)
        assert path.history["shift"][step] == pytest.approx(at[2][0], rel=1e-9, abs=1e-12)
        for name, value in (
            ("upper': plate 'washer' along y", at[0][1]),
            ("upper': plate 'end' along x", at[2][0]),
        ):
            assert path.history[f"motion:body '{name}"][step] == pytest.approx(value, rel=1e-9)
    alone = run(clamped(0.4))
    found = {own.name: own for own in alone.fields}
    moved = [
        own.displacement[1, np.unique(own.mesh.facets[:, own.mesh.boundaries["washer"]])].mean()
        for own in (found["upper"], found["lower"])
    ]
    assert alone.summary["approach"] == pytest.approx(moved[1] - moved[0], rel=1e-9)


@pytest.mark.parametrize("quantity", ["approach", "shift"])
def test_the_motion_of_a_held_washer_has_derivatives(quantity):
    def value(factor):
        material = replace(MATERIAL, E=factor * MATERIAL.E)
        scene = clamped(0.2)
        scene = replace(scene, upper=replace(scene.upper, material=material))
        result = run(scene, tol=1e-12)
        return value_of(quantity, result.reduction, result.solution), result

    step = 1e-5
    slope = gradient(value(1.0)[1], quantity, "E:upper").by["E:upper"] * MATERIAL.E
    assert slope == pytest.approx((value(1 + step)[0] - value(1 - step)[0]) / (2 * step), rel=1e-5)


@pytest.mark.parametrize("held", ["upper", "lower"])
def test_neither_reading_changes_with_a_translation_of_the_scene(held):
    """A bar between two washers: equilibrium makes all the same but for a translation."""

    def scene(support, moved=0.0):
        def part(name, low, high, supports=(), **force):
            mesh = block("plane-strain", low, high, cells=4, width=2.0)
            end = "side0" if name == "bar" else "top" if low >= 1 else "bottom"
            return Part(name, mesh, MATERIAL, supports, (Plate(end, force, glued=False),))

        bodies = [
            part("lower", -1, 0, (Support("side0", {"x": moved}),), y=2.0),
            part("bar", 0, 1, x=0.2),
            part("upper", 1, 2, (Support("side0", {"x": moved}),), y=-2.0),
        ]
        if support:
            end = {"upper": ("top", 2), "lower": ("bottom", 0)}[held]
            own = bodies[end[1]]
            supports = (*own.supports, Support(end[0], {"y": moved}))
            bodies[end[1]] = replace(own, supports=supports, loads=())
        contacts = (
            Contact("upper:bottom", "bar:top", 0.3),
            Contact("bar:bottom", "lower:top", 0.3),
        )
        return Scene("washers", bodies=tuple(bodies), contacts=contacts)

    (free, *others) = (follow([scene(*own)]) for own in ((False,), (True,), (True, 0.25)))
    assert free.solved
    for path in others:
        assert path.solved
        for name in ("approach", "shift"):
            assert path.history[name] == pytest.approx(free.history[name], rel=1e-6), name
    ends = {own.name: own for own in free.fields(0)}
    at = [
        ends[name].displacement[1, np.unique(mesh.facets[:, mesh.boundaries[side]])].mean()
        for name, side in (("upper", "top"), ("lower", "bottom"))
        for mesh in (ends[name].mesh,)
    ]
    assert free.history["approach"][0] == pytest.approx(at[1] - at[0], rel=1e-9)


def test_a_body_between_two_others_has_no_mean_normal():
    """As the upper body of both pairs: their normals are opposite."""
    parts = [
        Part("low", block("plane-strain", -1, 0), MATERIAL, (Support("bottom"),), contact="top"),
        Part("mid", block("plane-strain", 0, 1), MATERIAL, contact="bottom"),
        Part(
            "high",
            block("plane-strain", 1, 2),
            MATERIAL,
            (),
            (Plate("top", {"y": -1.0}),),
            contact="bottom",
        ),
    ]
    sides = (("mid:bottom", "low:top"), ("mid:top", "high:bottom"))
    approaches = []
    for flip in (False, True):
        second = sides[1][::-1] if flip else sides[1]
        pairs = (Contact(*sides[0], 0.3), Contact(*second, 0.3))
        scene = Scene("s", bodies=tuple(parts), contacts=pairs)
        approaches.append(run(scene).summary["approach"])
    assert approaches[0] is None and approaches[1] > 0
