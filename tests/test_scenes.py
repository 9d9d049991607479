import numpy as np
import pytest
from conftest import MATERIAL, block

from contactopt import (
    InputError,
    Material,
    Part,
    Plate,
    Scene,
    Support,
    Traction,
    reduce,
    scenes,
    solve,
)
from contactopt.readings.edges import contact_edge, stick_edge
from contactopt.scenes import PATHS, SCENES, make_path, make_scene


@pytest.mark.parametrize("name", ["punch-2d", "punch-3d", "sphere"])
def test_named_scenes_are_the_papers(name):
    scene = make_scene(name)
    assert scene.name == name and scene.mu == 0.5
    for part in (scene.upper, scene.lower):
        assert (part.material.E, part.material.nu) == (5.0, 0.3)
    (plate,) = scene.upper.loads
    assert sum(plate.force.values()) == -100.0


@pytest.mark.parametrize(
    "name,size",
    [
        ("punch-2d", {}),
        ("punch-3d", {"elements": 3}),
        ("sphere", {}),
        ("cylinder-2d", {"elements": 8}),
    ],
)
@pytest.mark.parametrize("rigid", [None, "upper", "foundation"])
def test_rigid_variants_solve(name, size, rigid):
    if rigid == "upper":
        rigid = name.split("-")[0]
    problem = reduce(make_scene(name, rigid=rigid, **size))
    solution = solve(problem)
    assert solution.solved
    assert solution.reactions[:, 0].sum() == pytest.approx(100, rel=1e-9)


def test_everything_can_be_changed():
    scene = scenes.flat_punch(
        2, width=10.0, height=5.0, foundation_width=30.0, foundation_height=15.0, depth=2.0,
        upper=Material(1.0, 0.1), lower=Material(2.0, 0.4), mu=0.1, force=3.0, elements=4,
    )  # fmt: skip
    problem = reduce(scene)
    assert problem.contacts == 5 and np.all(problem.mu == 0.1)
    assert problem.areas.sum() == pytest.approx(20.0)  # 10 mm wide, 2 mm deep: all of the body
    assert solve(problem).reactions[:, 0].sum() == pytest.approx(3.0)
    assert reduce(scenes.sphere(radius=100, force=1.0, elements=8)).contacts == 11


def test_quarter_model_counts_the_whole_body():
    problem = reduce(scenes.flat_punch(3, elements=4))
    assert problem.contacts == 25
    assert problem.areas.sum() == pytest.approx(40.0 * 40.0)


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_has_its_name(name):
    assert make_scene(name).name == name
    if name in PATHS:
        assert {scene.name for scene in make_path(name, steps=2)} == {name}


def ends(scene, elements=None):
    """c/a of stick over contact, and the problem with its reactions."""
    problem = reduce(scene, elements)
    r = solve(problem).reactions
    return stick_edge(scene, problem, r)[0] / contact_edge(scene, problem, r), problem, r


@pytest.mark.parametrize("kind", ["plane-strain", "axisymmetric"])
@pytest.mark.parametrize("mu,nu", [(0.1, 0.3), (0.7, 0.3), (0.25, 0.0)])
def test_rigid_punch_sticks_where_spence_says(kind, mu, nu):
    scene = scenes.rigid_punch(kind, mu=mu, lower=Material(3.0, nu))
    ratio, _, r = ends(scene)
    assert r[:, 0].sum() == pytest.approx(100.0)
    assert ratio == pytest.approx(
        scene.reference.stick_half_width / scene.reference.half_width, abs=0.005
    )


def test_rigid_punch_tractions():
    scene = scenes.rigid_punch(mu=0.3)
    _, problem, r = ends(scene)
    x = problem.coordinates[0]
    inner = x < 0.95 * 20
    exact = np.stack([scene.reference.pressure(x[inner]), -scene.reference.shear(x[inner])], axis=1)
    np.testing.assert_allclose(
        (r / problem.areas[:, None])[inner], exact, atol=0.02 * exact[:, 0].max()
    )


def test_cylinder_is_hertz():
    scene = make_scene("cylinder-2d")
    _, problem, r = ends(scene)
    exact = scene.reference
    assert contact_edge(scene, problem, r) == pytest.approx(exact.half_width, rel=3e-3)
    assert (r[:, 0] / problem.areas).max() == pytest.approx(exact.peak, rel=2e-3)
    # similar materials: friction changes nothing
    smooth = solve(reduce(scenes.cylinder(mu=0.0))).reactions
    assert np.abs(smooth[:, 0] - r[:, 0]).max() < 2e-3 * r[:, 0].max()


@pytest.mark.parametrize("shear", [10.0, 30.0, 45.0])
def test_sheared_cylinder_is_cattaneos(shear):
    scene = scenes.cattaneo(2, shear=shear)
    ratio, problem, r = ends(scene)
    assert -r[:, 1].sum() == pytest.approx(shear)
    assert ratio == pytest.approx(np.sqrt(1 - shear / 50), rel=0.01)
    exact = scene.reference.shear(problem.coordinates[0])
    error = np.sum(problem.areas * (-r[:, 1] / problem.areas - exact) ** 2) / np.sum(
        problem.areas * exact**2
    )
    assert np.sqrt(error) < 0.02
    opposite = solve(reduce(scenes.cattaneo(2, shear=-shear))).reactions
    order = np.argsort(problem.coordinates[0])
    np.testing.assert_allclose(opposite[order, 1], -r[order[::-1], 1], atol=1e-9 * np.abs(r).max())


@pytest.mark.slow
def test_sheared_sphere_is_cattaneos():
    scene = scenes.cattaneo(3, shear=30.0, elements=10)
    ratio, problem, r = ends(scene)
    assert ratio == pytest.approx(0.4 ** (1 / 3), rel=0.015)
    assert np.abs(r[:, 2]).sum() < 0.02 * np.abs(r[:, 1]).sum()  # nu = 0: slip along x
    exact = scene.reference.shear(np.linalg.norm(problem.coordinates[:2], axis=0))
    error = np.sum(problem.areas * (-r[:, 1] / problem.areas - exact) ** 2) / np.sum(
        problem.areas * exact**2
    )
    assert np.sqrt(error) < 0.05


def test_paths_are_states_of_one_scene():
    cycle = make_path("cattaneo-2d", steps=2, shear=20.0, elements=4)
    shears = [s.upper.loads[0].force["x"] for s in cycle]
    assert shears == [0, 10, 20, 10, 0, -10, -20, -10, 0, 10, 20]
    assert all(s.upper.loads[0].force["y"] == -100.0 for s in cycle)
    growing = make_path("hertz-dissimilar", steps=4, force=64.0, elements=4)
    assert [-s.upper.force["z"] for s in growing] == [1.0, 8.0, 27.0, 64.0]
    assert len({s.zone for s in growing}) == 1


@pytest.mark.parametrize("make,message", [
    (lambda: make_path("punch-2d"), "has no load path; choose from"),
    (lambda: make_path("cattaneo-2d", steps=0), "steps must be a whole number"),
    (lambda: make_path("cattaneo-2d", stops=3), "stops"),
    (lambda: scenes.cattaneo(4), "dim must be 2 or 3"),
    (lambda: scenes.cattaneo(2, shear=50.0), "the bodies slide off"),
    (lambda: scenes.cattaneo(2, mu=0.0), "the bodies slide off"),
    (lambda: scenes.cattaneo(2, force=1e9), "too much for bodies|larger bodies"),
    (lambda: scenes.rigid_punch("solid"), "kind must be .plane-strain. or .axisymmetric."),
    (lambda: scenes.rigid_punch(foundation=30.0), "at least two half-widths"),
    (lambda: scenes.indentation(foundation=3.0), "at least two contact radii"),
    (lambda: scenes.cylinder(rigid="sphere"), "rigid must be None, 'cylinder' or 'foundation'"),
    (lambda: scenes.cylinder(force=1e9), "too much for a cylinder"),
    (lambda: scenes.cylinder(depth=0.0), "depth"),
    (lambda: make_scene("punch-4d"), "unknown scene 'punch-4d'; choose from punch-2d"),
    (lambda: make_scene("sphere", depth=3), "depth"),
    (lambda: scenes.flat_punch(4), "dim must be 2 or 3"),
    (lambda: scenes.flat_punch(2, mu=-0.1),
     "friction coefficient mu must be a finite number at least 0"),
    (lambda: scenes.flat_punch(2, mu=np.nan), "mu must be a finite number"),
    (lambda: scenes.flat_punch(2, force=-1), "force must be a finite number greater than 0"),
    (lambda: scenes.flat_punch(2, width=0), "width"),
    (lambda: scenes.flat_punch(2, foundation_width=10), "at least as wide as the punch"),
    (lambda: scenes.flat_punch(2, elements=0), "whole number"),
    (lambda: scenes.flat_punch(2, elements=2.5), "whole number"),
    (lambda: scenes.flat_punch(2, rigid="both"), "rigid must be"),
    (lambda: scenes.sphere(force=1e9), "too much for a sphere"),
    (lambda: scenes.sphere(rigid="punch"), "rigid must be"),
    (lambda: scenes.sphere(radius=np.inf), "radius"),
    (lambda: scenes.flat_punch(2, upper=Material(-5, 0.3)), "Young's modulus E"),
])  # fmt: skip
def test_bad_scenes_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize(
    "change,message",
    [
        (dict(kind="plane-shear"), "unknown kind"),
        (dict(thickness=0.0), "thickness"),
        (dict(copies=0), "copies"),
        (dict(zone=-1.0), "zone"),
    ],
)
def test_bad_scene_fields(change, message):
    part = Part("a", block("plane-strain", 0, 1), MATERIAL)
    with pytest.raises(InputError, match=message):
        Scene("s", part, part, 0.1, **change)


@pytest.mark.parametrize(
    "part,message",
    [
        (dict(supports=(Support("top", {"z": 0.0}),)), "no component 'z'; use x, y"),
        (dict(supports=(Support("top", {"y": np.nan}),)), "y value"),
        (dict(supports=(Support("top", ("x", "y")),)), "by its name, as in {'y': 0.0}"),
        (dict(loads=(Traction("top", (1.0,)),)), "Traction needs a tuple of 2 values"),
        (dict(loads=(Traction("top", (1.0, np.inf)),)), "Traction value"),
        (dict(loads=(Plate("top", {"q": 1.0}),)), "no component 'q'"),
    ],
)
def test_bad_parts_are_refused(part, message):
    good = Part("a", block("plane-strain", 0, 1), MATERIAL)
    with pytest.raises(InputError, match=message):
        Scene("s", good, Part("b", block("plane-strain", -1, 0), MATERIAL, **part), 0.1)
