"""Answers on half-spaces against Hertz, Cattaneo, Mindlin and Westergaard, and against meshes."""

import numpy as np
import pytest
import skfem

import contactopt
from contactopt import HalfSpace, Material, Part, Plate, Rigid, Scene, Support, scenes
from contactopt.readings.half_space_readings import (
    contact_stiffness,
    pressure_distribution,
    surface_contact,
    surface_maps,
)
from tests.test_half_space import E_STAR, STEEL, ball, ticks


@pytest.mark.parametrize("law", ["frictionless", "coulomb"])
def test_half_plane_is_hertz_line_contact(law):
    x = ticks(400, 6.0)
    scene = Scene(
        "line",
        Rigid("cylinder", gap=lambda p: p[0] ** 2 / 40, force={"y": -3.0}),
        HalfSpace(
            "base", Material(5.0, 0.0) if law == "frictionless" else Material(5.0, 0.4999), x
        ),
        0.3 * (law == "coulomb"),
        thickness=10.0,
        law=law,
    )
    problem = contactopt.reduce(scene)
    r = contactopt.solve(problem).reactions
    modulus = 5.0 / (1 - scene.lower.material.nu**2)
    exact = contactopt.analytic.hertz_line(0.3, 20.0, modulus)
    p = r[:, 0] / problem.areas
    assert p.max() == pytest.approx(exact.peak, rel=2e-3)
    assert np.abs(p - exact.pressure(x)).max() < 0.03 * exact.peak
    assert np.sqrt(np.mean((p - exact.pressure(x)) ** 2)) < 0.003 * exact.peak


def test_depth_of_a_half_plane_moves_the_approach_only():
    def solved(depth):
        x = ticks(64)
        scene = Scene(
            "line",
            Rigid("cylinder", gap=lambda p: p[0] ** 2 / 40, force={"y": -3.0}),
            HalfSpace("base", STEEL, x, depth=depth), 0.3,
        )  # fmt: skip
        return contactopt.solve(contactopt.reduce(scene), tol=1e-11)

    near, far = solved(50.0), solved(500.0)
    np.testing.assert_allclose(near.reactions, far.reactions, atol=1e-8)
    assert near.multipliers[0] - far.multipliers[0] == pytest.approx(
        3.0 * 2 / (np.pi * E_STAR) * np.log(10), rel=1e-8
    )


def approach_error(n):
    a = (3 * 3.0 * 10 / (4 * E_STAR)) ** (1 / 3)
    x = (np.arange(n) + 0.5) * 2.5 * a / n - 1.25 * a
    scene = Scene(
        "hertz",
        Rigid("ball", gap=lambda p: np.sum(p[:2] ** 2, axis=0) / 20, force={"z": -3.0}),
        HalfSpace("base", STEEL, (x, x)), 0.0, kind="solid", law="frictionless",
    )  # fmt: skip
    solution = contactopt.solve(contactopt.reduce(scene), tol=1e-10)
    return abs(-solution.multipliers[0] / (a**2 / 10) - 1)


def test_hertz_point_contact_converges():
    sizes = np.array([8, 16, 32, 64])
    errors = [approach_error(n) for n in sizes]
    # second order in the mean
    assert errors[-1] < 1e-4 and np.polyfit(np.log(sizes), np.log(errors), 1)[0] < -1.8


def test_hertz_scene_is_exact():
    result = contactopt.run("hertz-half-space", elements=48)
    exact, problem = result.scene.reference, result.problem
    assert result.summary["approach"] == pytest.approx(exact.approach, rel=1e-3)
    assert result.summary["max_pressure"] == pytest.approx(exact.peak, rel=1e-3)
    assert np.sqrt(surface_contact(problem, result.solution).area / np.pi) == pytest.approx(
        exact.half_width, rel=5e-3
    )


def test_upper_half_space_mirrors_the_lower():
    """The same contact seen upside down: the rough body below, the half-space above."""
    points = (ticks(16), ticks(12, 7.5))
    gap = lambda p: (p[0] - 0.3) ** 2 / 20 + (p[1] + 0.5) ** 2 / 25  # noqa: E731
    down = Scene(
        "a",
        Rigid("r", gap=gap, force={"z": -2.0, "x": 0.2, "y": 0.1}),
        HalfSpace("h", STEEL, points),
        0.3,
        kind="solid",
    )
    up = Scene(
        "a",
        HalfSpace("h", STEEL, points, force={"z": -2.0, "x": -0.2, "y": -0.1}),
        Rigid("r", gap=gap),
        0.3,
        kind="solid",
    )
    first, second = (
        contactopt.solve(contactopt.reduce(s), tol=1e-10).reactions for s in (down, up)
    )
    np.testing.assert_allclose(first[:, 0], second[:, 0], atol=1e-8)
    np.testing.assert_allclose(first[:, 1:], -second[:, 1:], atol=1e-8)


def oval(turned=False, away=0.0, length=1.0, force=1.0):
    """A sheared oval on cells that are longer than wide, possibly turned by a right angle, far
    away, or in other units.
    """
    rows = [ticks(20) * length + away, ticks(14) * length - away]
    along = {"x": 0.4 * force}
    if turned:
        rows, along = rows[::-1], {"y": 0.4 * force}
    centre = np.array([-away, away] if turned else [away, -away])[:, None]
    radii = np.array([25.0, 20.0] if turned else [20.0, 25.0])[:, None] * length
    rigid = Rigid(
        "oval",
        gap=lambda x: np.sum((x[:2] - centre) ** 2 / radii, axis=0),
        force={"z": -3.0 * force} | along,
    )
    material = Material(STEEL.E * force / length**2, STEEL.nu)
    scene = Scene("oval", rigid, HalfSpace("base", material, rows), 0.3, kind="solid")
    solution = contactopt.solve(contactopt.reduce(scene), tol=1e-10)
    assert solution.solved
    return solution.reactions.reshape(*(len(row) for row in rows), 3) / force


def test_turned_by_a_right_angle_it_is_the_same():
    np.testing.assert_allclose(
        oval(turned=True).transpose(1, 0, 2)[..., [0, 2, 1]], oval(), atol=1e-8
    )


@pytest.mark.parametrize("changes", [{"away": 1e3}, {"length": 1e-3, "force": 1e5}])
def test_place_and_units_do_not_matter(changes):
    np.testing.assert_allclose(oval(**changes), oval(), atol=1e-8)


def test_cattaneo_scene():
    result = contactopt.run("cattaneo-half-space", elements=24, material=Material(5.0, 0.0))
    exact, problem, r = result.scene.reference, result.problem, result.solution.reactions
    distance = np.linalg.norm(problem.chart.places, axis=0)
    found, q = -r[:, 1] / problem.areas, exact.shear(distance)
    assert np.linalg.norm(found - q) < 0.03 * np.linalg.norm(q)
    stick = surface_contact(problem, result.solution).stick_area
    assert np.sqrt(stick / np.pi) == pytest.approx(exact.stick_half_width, rel=0.02)
    assert -r[:, 1].sum() == pytest.approx(25.0)


def test_shear_cycle_loses_what_mindlin_says():
    from dataclasses import replace

    scene = scenes.cattaneo_half_space(material=Material(5.0, 0.0), shear=25.0, elements=32)
    states = []
    for shear in [
        0.0,
        25.0,
        -25.0,
        -18.75,
        25.0,
    ]:  # from the start at -18.75 Newton's steps diverge if they go on from -25
        states.append(replace(scene, upper=replace(scene.upper, force={"x": shear, "z": -100.0})))
    path = contactopt.follow(states)
    work = path.history["friction_work"]
    assert path.solved and path.history["energy_error"].max() < 1e-10
    modulus = 5.0 / 2
    tangential = contactopt.analytic.tangential_modulus(Material(5.0, 0.0), Material(5.0, 0.0))
    exact = contactopt.analytic.cycle_loss_point(100.0, 400.0, modulus, tangential, 0.5, 25.0)
    # three large steps; many converge to the loop
    assert work[4] - work[1] == pytest.approx(exact, rel=0.05)


def test_stiffness_of_hertz_contact_is_its_width():
    problem = contactopt.reduce(ball(40, "frictionless", 0.0, 0.0))
    solution = contactopt.solve(problem)
    stiffness = contact_stiffness(problem, solution)
    a = (3 * 3.0 * 10 / (4 * E_STAR)) ** (1 / 3)
    assert stiffness[0, 0] == pytest.approx(2 * E_STAR * a, rel=0.03)
    assert np.all(stiffness[1:, 1:] == 0)
    edges, density = pressure_distribution(problem, solution, 20)
    assert np.sum(density * np.diff(edges)) == pytest.approx(1)


def test_prescribed_approach_is_the_total_force_turned_round():
    pressed = contactopt.solve(contactopt.reduce(ball(20, "frictionless", 0.0, 0.0)), tol=1e-11)
    points = (ticks(20), ticks(20))
    for above in (
        Rigid(
            "ball",
            gap=lambda x: np.sum(x[:2] ** 2, axis=0) / 20,
            displacement={"z": pressed.multipliers[0]},
        ),
        HalfSpace(
            "ball",
            Material(1e9, 0.3),
            points,
            lambda x: -np.sum(x**2, axis=0) / 20,
            displacement={"z": pressed.multipliers[0]},
        ),
    ):
        scene = Scene(
            "given", above, HalfSpace("base", STEEL, points), 0.0, kind="solid", law="frictionless"
        )
        moved = contactopt.solve(contactopt.reduce(scene), tol=1e-11)
        np.testing.assert_allclose(moved.reactions, pressed.reactions, atol=1e-7)


def test_half_space_meets_finite_elements():
    """A block of finite elements, thick and wide beside its contact."""
    from contactopt.meshes.structured import graded, rename, tensor_mesh

    x = np.linspace(-1.0, 1.0, 33)
    outer = graded(40.0, x[1] - x[0], 1.4)[1:]
    across = np.concatenate([-1 - outer[::-1], x, 1 + outer])

    def block(elements, zone):
        mesh = rename(tensor_mesh(across, -graded(40.0, x[1] - x[0], 1.3)[::-1]), bottom="y-")
        return mesh.with_boundaries({"contact": lambda p: (p[1] == 0) & (np.abs(p[0]) < 1)})

    lower = Part("block", block, STEEL, (Support("bottom"),))
    height = lambda p: -(p[0] ** 2) / 8  # noqa: E731
    pairs = [
        Scene(
            "pair",
            HalfSpace("ball", STEEL, x, height=height, force={"y": -0.3}, depth=40.0),
            below,
            0.3,
        )
        for below in (lower, HalfSpace("flat", STEEL, x, depth=40.0))
    ]
    mixed, pure = (contactopt.solve(contactopt.reduce(pair)) for pair in pairs)
    assert mixed.solved and pure.solved
    assert mixed.reactions[:, 0].sum() == pytest.approx(0.3)
    assert np.abs(mixed.reactions - pure.reactions).max() < 0.05 * pure.reactions.max()


def test_a_mesh_on_a_half_space_is_the_same_scene_turned_upside_down():
    """The cells of the half-space reach beyond the mesh, whose areas count."""
    x = np.linspace(0, 1.75, 8)

    def block(y, loads=(), supports=(), contact="low"):
        mesh = skfem.MeshQuad.init_tensor(x, y).with_boundaries(
            {"low": lambda p: p[1] == y[0], "top": lambda p: p[1] == y[-1]}
        )
        return Part("block", mesh, Material(1000.0, 0.3), supports, loads, contact)

    ground, y = Material(200.0, 0.25), np.linspace(0, 1, 5)
    found = []
    for upper, lower in (
        (block(y, (Plate("top", {"y": -1.0, "x": 0.1}),)), HalfSpace("half", ground, x)),
        (
            HalfSpace("half", ground, x, force={"y": -1.0, "x": -0.1}),
            block(y - 1, (), (Support("low"),), "top"),
        ),
    ):
        problem = contactopt.reduce(Scene("s", upper, lower, 0.4))
        found.append((problem.areas, contactopt.solve(problem, tol=1e-11).reactions[:, 0]))
    assert found[0][0].sum() == pytest.approx(1.75)
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6)


def test_periodic_wavy_surface_is_westergaards():
    """Mean pressure p on a rigid wave of amplitude h."""
    n, length, amplitude = 512, 8.0, 0.05
    x = ticks(n, length)
    flat = np.pi * E_STAR * amplitude / length
    mean = 0.3 * flat
    scene = Scene(
        "wave",
        Rigid(
            "wave",
            gap=lambda p: amplitude * (1 - np.cos(2 * np.pi * p[0] / length)),
            force={"y": -mean * length},
        ),
        HalfSpace("base", STEEL, x, periodic=True),
        0.0,
        law="frictionless",
    )
    problem = contactopt.reduce(scene)
    solution = contactopt.solve(problem)
    a = length / np.pi * np.arcsin(np.sqrt(0.3))
    exact = (
        2
        * flat
        * np.cos(np.pi * x / length)
        * np.sqrt(np.maximum(0.3 - np.sin(np.pi * x / length) ** 2, 0.0))
    )
    assert surface_contact(problem, solution).area / 2 == pytest.approx(a, rel=0.01)
    assert (
        np.sqrt(np.mean((solution.reactions[:, 0] / problem.areas - exact) ** 2))
        < 0.01 * exact.max()
    )


def test_rough_scene_slides_in_the_end():
    result = contactopt.run("rough", points=48, steps=3)
    last = surface_contact(result.problem, result.solution)
    assert result.path.solved and last.slip_area == pytest.approx(last.area)
    history = result.path.history
    assert history["shear_force"][-1] == pytest.approx(0.3 * history["normal_force"][-1], rel=1e-3)
    assert np.all(np.diff(history["friction_work"]) > 0) and history["energy_error"].max() < 1e-9
    maps = surface_maps(result.reduction, result.solution)
    assert maps["pressure"].shape == maps["gap"].shape == (48, 48)
    assert maps["slip"].shape == (48, 48, 2)
    np.testing.assert_allclose(
        np.minimum(maps["pressure"] / maps["pressure"].max(), maps["gap"]), 0, atol=1e-7
    )
