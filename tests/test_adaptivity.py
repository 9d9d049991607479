"""Local refinement: meshes stay whole, curved boundaries curved; estimates agree with errors."""

from dataclasses import replace

import numpy as np
import pytest
import skfem
from conftest import MATERIAL
from scipy.spatial import Delaunay
from turned import moved, turn

from contactopt import BodyForce, InputError, Part, Rigid, Scene, Support, scenes
from contactopt.accuracy import refine
from contactopt.accuracy.indicators import element_errors
from contactopt.accuracy.marking import divisible, left_out
from contactopt.meshes.mesh_refinement import divide, slivers
from contactopt.meshes.structured import simplices
from contactopt.readings.quantities import find_quantity
from contactopt.scenes import make_scene
from contactopt.solving.follow import follow
from contactopt.solving.limits import Limits
from contactopt.solving.solve_scene import solve_scene


def locally(scene, *arguments, **limits):
    return refine([scene], *arguments, adaptive=True, **limits)


NAMES = {"bottom": lambda x: x[-1] == 0, "corner": lambda x: (x[0] == 1) & (x[-1] < 0.4)}
TICKS = np.linspace(0, 1, 4)
MESHES = {
    "triangles": skfem.MeshTri.init_tensor(TICKS, TICKS),
    "quadrilaterals": skfem.MeshQuad.init_tensor(TICKS, TICKS),
    "tetrahedra": skfem.MeshTet.init_tensor(TICKS, TICKS, TICKS),
    "hexahedra": skfem.MeshHex.init_tensor(TICKS, TICKS, TICKS),
}


def measure(mesh, name=None):
    """Size of a named boundary, or of the whole mesh."""
    element = skfem.ElementTriP1() if isinstance(mesh, skfem.MeshTri) else skfem.ElementTetP1()
    basis = (
        skfem.Basis(mesh, element) if name is None else skfem.FacetBasis(mesh, element, facets=name)
    )
    return float(basis.dx.sum())


@pytest.mark.parametrize("kind", list(MESHES))
def test_divided_meshes_are_whole_and_keep_their_boundaries(kind):
    random = np.random.default_rng(0)
    mesh = simplices(MESHES[kind].with_boundaries(NAMES))
    sizes = {name: measure(mesh, name) for name in NAMES}
    assert sizes == pytest.approx({"bottom": 1.0, "corner": 1 / 3})
    for _ in range(4):
        count = mesh.nelements
        mesh = divide(mesh, random.choice(count, 1 + count // 6, replace=False), {})
        assert mesh.nelements > count and mesh.is_valid()
        assert measure(mesh) == pytest.approx(1.0)
        assert {name: measure(mesh, name) for name in NAMES} == pytest.approx(sizes)
        inside = np.setdiff1d(np.arange(mesh.nfacets), mesh.boundary_facets())
        # no hanging nodes: every inner facet has two elements
        assert np.all(mesh.f2t[1, inside] >= 0)


def pressed_block(n):
    mesh = skfem.MeshTri.init_tensor(
        np.linspace(-1, 1, 2 * n + 1), np.linspace(0, 1, n + 1)
    ).with_boundaries({"contact": lambda x: x[1] == 0, "top": lambda x: x[1] == 1})
    block = Part("block", mesh, MATERIAL, supports=(Support("top"),))
    return Scene(
        "block", block, Rigid("floor", (0.0, 1.0), lambda x: x[0] ** 2 / 20 - 0.01), mu=0.3
    )


@pytest.mark.parametrize("quantity", ["energy", "approach"])
def test_the_estimate_agrees_with_the_error(quantity):
    """Against the same quantity on a mesh that is four times as fine near the corner."""
    scene = scenes.flat_punch(2, mu=0.5)
    best = locally(scene, quantity, 1e-3)[1]
    coarse = locally(scene, quantity, 8e-3)[1]
    error = abs(best.extrapolated - coarse.value) / best.extrapolated
    assert best.reached and coarse.reached
    assert 0.5 < coarse.error / error < 4
    assert abs(best.extrapolated - coarse.extrapolated) < 0.5 * abs(
        best.extrapolated - coarse.value
    )


def test_unknowns_go_where_the_quantity_needs_them():
    """The elements at Hertz's contact become small, and the rest of the mesh stays as it is."""
    scene = make_scene("cylinder-2d", mu=0.0)
    solved, estimate = locally(scene, "pressure", 5e-3)
    assert estimate.reached and solved.solution.solved
    assert estimate.value == pytest.approx(scene.reference.peak, rel=5e-3)
    first, last = estimate.levels[0], estimate.levels[-1]
    assert last.contacts >= 2.5 * first.contacts and last.unknowns < 2.5 * first.unknowns


@pytest.mark.parametrize("angle", [30.0, 137.0])
def test_a_turned_scene_is_refined_the_same(angle):
    scene = pressed_block(4)
    straight, turned = (
        locally(each, "energy", 0.02)[1] for each in (scene, moved(scene, turn(angle)))
    )
    assert [level.unknowns for level in turned.levels] == [
        level.unknowns for level in straight.levels
    ]
    assert turned.value == pytest.approx(straight.value, rel=1e-9)


def test_a_block_under_a_given_displacement_is_too_stiff_and_one_under_a_load_too_soft():
    """The energy of a given displacement falls with finer meshes, that of a given load grows."""
    for scene in (pressed_block(8), loaded_disc(24)):
        energies = {}
        for halvings in range(4):
            solved = solve_scene(scene)
            quantity = find_quantity("energy", solved.reduction.scene)
            energies[halvings] = quantity.read(solved.reduction, solved.solution).value
            if not halvings:
                total = element_errors(solved, quantity, 0.0).total
            scene = scene.with_parts(
                lambda part: replace(part, mesh=part.mesh.refined()) if part.meshed else part
            )
        assert 0.5 < total / (energies[3] - energies[0]) < 2


def loaded_disc(count):
    """A heavy disc, a polygon of so many sides, on the ground."""
    angle = np.arange(count) * 2 * np.pi / count
    ring = [r * np.stack([np.cos(angle), np.sin(angle)]) for r in (0.35, 0.7, 1.0)]
    points = np.concatenate([np.zeros((2, 1)), *ring], axis=1)
    mesh = skfem.MeshTri(points, Delaunay(points.T).simplices.T)
    mesh = mesh.with_boundaries({"contact": lambda x: np.linalg.norm(x, axis=0) > 0.9})
    disc = Part("disc", mesh, MATERIAL, (), (BodyForce((0.0, -0.01)),))
    return Scene("disc", disc, Rigid("ground", (0.0, 1.0), lambda x: 0.0 * x[0] - 1.0), mu=0.0)


def test_the_volume_between_facets_and_their_curve_is_known():
    """Of a circle and of a sphere, to the order of the sagitta, wherever the body is."""
    count = 48
    mesh = loaded_disc(count).upper.mesh

    def circle(x):
        return x / np.linalg.norm(x, axis=0)

    missing = np.pi - count / 2 * np.sin(2 * np.pi / count)
    assert slivers(mesh, {"contact": circle}).sum() == pytest.approx(missing, rel=2e-3)
    ball = skfem.MeshTet.init_ball(4)
    ball = ball.with_boundaries({"contact": ball.boundary_facets()})
    basis = skfem.Basis(ball, skfem.ElementTetP1())
    missing = 4 * np.pi / 3 - basis.dx.sum()
    assert slivers(ball, {"contact": circle}).sum() == pytest.approx(missing, rel=0.03)


def test_the_estimate_holds_what_a_polygon_lacks_of_a_circle():
    """A heavy disc that keeps its long chords weighs less: the estimate says so."""
    scene = loaded_disc(24)
    solved = solve_scene(scene)
    quantity = find_quantity("normal_force", solved.reduction.scene)
    value = quantity.read(solved.reduction, solved.solution).value
    shapes = divisible(scene, True)[1]
    volumes = [left_out(part, shapes) for part in solved.reduction.scene.parts]
    total = element_errors(solved, quantity, value, volumes).total
    assert total == pytest.approx(0.01 * np.pi - value, rel=0.02)


def test_bounds_end_the_loop_with_the_best_answer():
    scene = pressed_block(4)
    solved, estimate = locally(scene, "energy", 1e-9, limits=Limits(500))
    assert solved.solution.solved and not estimate.reached and "500" in estimate.message
    assert estimate.levels[-1].unknowns <= 500 and len(estimate.levels) > 1
    _, estimate = locally(scene, "energy", 1e-9, limits=Limits(seconds=0.0))
    assert len(estimate.levels) == 1 and "time limit" in estimate.message


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("energy", 2.0), "accuracy"),
        (("heat", 0.1), "unknown quantity"),
        (("approach", 0.1), "no plate"),
    ],
)
def test_bad_input(arguments, words):
    with pytest.raises(InputError, match=words):
        locally(pressed_block(2), *arguments)


def test_run_takes_it_and_says_what_it_did(tmp_path, capsys):
    from contactopt import run
    from contactopt.cli import main

    result = run("cylinder-2d", mu=0.0, accuracy=0.02, quantity="pressure", adaptive=True)
    assert result.estimate.reached
    assert result.summary["accuracy"]["levels"][-1]["contacts"] == result.problem.contacts
    line = [
        "run",
        "punch-2d",
        "--accuracy",
        "0.02",
        "--quantity",
        "energy",
        "--adaptive",
        "--no-figures",
    ]
    assert main([*line, "--out", str(tmp_path / "out")]) == 0
    assert "contacts" in capsys.readouterr().out
    with pytest.raises(InputError, match="needs an aim"):
        run("punch-2d", adaptive=True)
    with pytest.raises(InputError, match="that of a load path"):
        run("punch-2d", accuracy=0.1, quantity="friction_work", adaptive=True)


@pytest.mark.slow
def test_a_hysteresis_loop_has_a_known_error():
    states = scenes.shear_cycle(2, steps=2, shear=45.0)
    solved, estimate = refine(states, "friction_work", 0.03, adaptive=True)
    assert solved.path is not None and len(solved.path.states) == len(states)
    assert estimate.reached and estimate.extrapolated is None
    fine = follow(scenes.shear_cycle(2, steps=2, shear=45.0, elements=80))
    exact = fine.history["friction_work"][-1]
    first = estimate.levels[0]
    assert abs(first.value - exact) > 0.03 * exact  # the first mesh is too coarse
    assert abs(estimate.value - exact) <= estimate.error * estimate.value
    assert estimate.levels[-1].unknowns < 20 * first.unknowns
