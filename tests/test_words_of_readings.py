"""What a run says of a scene is so: no imbalance where nothing acts, no plane that is not there."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import MATERIAL, block, two_blocks

from contactopt import Contact, InputError, Part, Plate, Scene, Support, Traction, follow, run
from contactopt.bodies.assembled import Guides
from contactopt.checks import place_words
from contactopt.coupling.planes_of_symmetry import mirror_planes
from contactopt.figures import scene_check
from contactopt.meshes.structured import simplices
from contactopt.outcome import summary_rows
from contactopt.readings.places import PLACED
from contactopt.readings.quantities import ROWS, find_quantity
from contactopt.scenes import SCENES, make_scene
from tests.test_sliding import fitted


@pytest.mark.parametrize("moved", [-0.009, -0.5, 0.0, 3e-5])
@pytest.mark.parametrize("kind", ["plane-strain", "solid"])
def test_a_body_that_nothing_touches_is_in_equilibrium(moved, kind):
    scene = two_blocks(kind)
    up = scene.components[-1]
    away = {name: 0.0 for name in scene.components} | {up: 1.0 + moved}
    upper = replace(scene.upper, supports=(Support("top", away),), loads=())
    result = run(replace(scene, upper=upper))
    assert result.solution.solved and result.summary["remarks"] == []
    assert result.summary["limits"]["bodies"]["upper"]["imbalance"] == 0.0


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("degree", [1, 2])
def test_forces_within_the_tolerance_do_not_disturb_a_body(dim, degree):
    """An interior point leaves tiny forces where the surfaces are far apart."""
    kind = {2: "plane-strain", 3: "solid"}[dim]
    away = Support("top", dict(zip("xyz", (0.1, *[-0.5] * (dim - 1)))))
    push = Traction("top", (*[0.0] * (dim - 1), -1.0))
    bodies = (
        Part("a", block(kind, 2, 3), MATERIAL, (away,), contact="bottom"),
        Part("b", block(kind, 0, 1, 2), MATERIAL, (), (push,), contact="top"),
        Part("c", block(kind, -1, 0), MATERIAL, (Support("bottom"),), contact="top"),
    )
    pairs = Contact("a", "b", 0.3), Contact("b:bottom", "c", 0.3)
    result = run(Scene("apart", bodies=bodies, contacts=pairs, kind=kind, degree=degree))
    assert result.solution.solved
    assert result.summary["limits"]["bodies"]["a"]["imbalance"] == 0.0
    assert not any("equilibrium" in text for text in result.summary["remarks"])


def test_a_body_between_two_supports_that_strain_it_is_measured():
    """Its forces are those of supports alone, and count."""
    scene = two_blocks("plane-strain")
    held = Support("top", {"x": 0.0, "y": 1.0}), Support("bottom", {"x": 0.0, "y": 1.1})
    upper = replace(scene.upper, supports=held, loads=())
    found = run(replace(scene, upper=upper)).summary["limits"]["bodies"]["upper"]
    assert 0 < found["imbalance"] < 1e-9


@pytest.mark.parametrize("name", sorted(SCENES))
def test_no_list_of_planes_is_empty(name):
    scene = make_scene(name, **({} if name == "rough" else {"elements": 4}))
    for line in scene_check.check_scene([scene]).text.splitlines():
        assert not line.rstrip().endswith(("normals", ":", ",")), line


@pytest.mark.parametrize("guided, found", [((), [[1, 0]]), (((1, -45.0, 1.0),), [])])
def test_of_more_planes_than_images_those_count_that_guide_all_bodies(guided, found):
    """A floor under one body is none; two that guide both bodies are one too many."""
    root = Guides(np.array([[0.0, 12.0], [-45.0, 12.0]]), ((0, 0.0, 1.0), *guided))
    disc = Guides(np.array([[0.0, 30.0], [-45.0, 2.0]]), ((0, 0.0, 1.0), (1, -45.0, 1.0)))
    planes = mirror_planes(make_scene("punch-2d", elements=4), [root, disc], [])
    assert [plane.inward.tolist() for plane in planes] == found


KINDS = {name.partition(":")[0].partition("@")[0] for name in (*ROWS, *PLACED)}


@pytest.mark.parametrize("name", sorted(KINDS))
@pytest.mark.parametrize("rest", ["", ":", "::", ":punch-foundation", ":nothing:x"])
def test_no_refusal_names_an_empty_thing(name, rest):
    try:
        find_quantity(name + rest, make_scene("punch-2d"))
    except InputError as error:
        assert "''" not in str(error), error


def test_zeros_have_no_sign():
    scene = two_blocks("plane-strain")
    upper = replace(scene.upper, loads=(Plate("top", {"y": -0.0}, glued=False),))
    result = run(replace(scene, upper=upper))
    words = " ".join(summary_rows(result.summary).values())
    assert "-0 " not in words and "e-1" not in words.partition("residual")[0].split("method")[0]
    for table in (result.summary["pairs"], result.summary["holders"]):
        for own in table.values():
            for value in (*own["force"], *own["moment"]):
                assert value != 0 or np.copysign(1, value) > 0


@pytest.mark.parametrize("force", [3.0, 0.7])
def test_friction_that_is_rounding_is_none(force):
    """A search for its accuracy said that it does not converge."""
    scene = two_blocks("plane-strain", force, mu=0.3)
    made = simplices(scene.lower.mesh)
    scene = replace(scene, lower=replace(scene.lower, mesh=made.refined()))
    result = run(scene, figures=(), accuracy=0.1, quantity="shear_force")
    assert np.any(result.solution.reactions[:, 1])
    assert result.summary["pairs"]["upper-lower"]["friction_force"] == 0.0
    assert result.estimate.reached and result.estimate.value == 0.0
    path = follow([scene, scene])
    assert not np.any(path.history["shear_force"])


def test_places_have_no_rounding_of_zero():
    assert place_words(np.array([-16.24, 6.1e-16, -0.0])) == "-16.24, 0, 0"
    assert place_words(np.zeros(2)) == "0, 0" and place_words([1e-9, 2e-9]) == "1e-09, 2e-09"


def test_the_approach_of_a_fit_around_a_body_has_no_number():
    result = run(fitted(0.01))
    assert result.solution.solved and result.summary["approach"] is None
    assert "approach of the bodies" not in summary_rows(result.summary)
