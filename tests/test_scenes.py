import numpy as np
import pytest
from conftest import MATERIAL, block

from contactopt import InputError, Material, Part, Plate, Scene, Support, Traction, reduce, scenes, solve
from contactopt.scenes import SCENES, make_scene


@pytest.mark.parametrize("name", SCENES)
def test_named_scenes_are_the_papers(name):
    scene = make_scene(name)
    assert scene.name == name and scene.mu == 0.5
    for part in (scene.upper, scene.lower):
        assert (part.material.E, part.material.nu) == (5.0, 0.3)
    (plate,) = scene.upper.loads
    assert sum(plate.force.values()) == -100.0


@pytest.mark.parametrize("name,size", [("punch-2d", {}), ("punch-3d", {"elements": 3}), ("sphere", {})])
@pytest.mark.parametrize("rigid", [None, "upper", "foundation"])
def test_rigid_variants_solve(name, size, rigid):
    if rigid == "upper":
        rigid = "sphere" if name == "sphere" else "punch"
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


@pytest.mark.parametrize(
    "make,message",
    [
        (lambda: make_scene("punch-4d"), "unknown scene 'punch-4d'; choose from punch-2d"),
        (lambda: make_scene("sphere", depth=3), "depth"),
        (lambda: scenes.flat_punch(4), "dim must be 2 or 3"),
        (lambda: scenes.flat_punch(2, mu=-0.1), "friction coefficient mu must be a finite number at least 0"),
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
    ],
)
def test_bad_scenes_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize(
    "change,message",
    [
        (dict(kind="plane-stress"), "unknown kind"),
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
        (dict(loads=(Traction("top", (1.0,)),)), "Traction needs 2 values"),
        (dict(loads=(Traction("top", (1.0, np.inf)),)), "Traction value"),
        (dict(loads=(Plate("top", {"q": 1.0}),)), "no component 'q'"),
    ],
)
def test_bad_parts_are_refused(part, message):
    good = Part("a", block("plane-strain", 0, 1), MATERIAL)
    with pytest.raises(InputError, match=message):
        Scene("s", good, Part("b", block("plane-strain", -1, 0), MATERIAL, **part), 0.1)
