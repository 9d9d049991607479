import numpy as np
import pytest

from contactopt import reduce, scenes, solve
from contactopt.analysis.zone import contact_half_width, pressed, solve_zone, stick_half_width, stuck


@pytest.fixture(scope="module")
def hertz():
    scene = scenes.sphere()
    return scene, *solve_zone(scene)


def test_hertz_within_half_a_percent(hertz):
    scene, reduction, solution, zones = hertz
    pressure = solution.reactions[:, 0] / reduction.problem.areas
    assert solution.solved
    assert zones[-1] == pytest.approx(scene.reference.half_width, rel=5e-3)
    assert pressure.max() == pytest.approx(scene.reference.peak, rel=5e-3)
    assert solution.reactions[:, 0].sum() == pytest.approx(100, rel=1e-10)
    assert scene.reference.half_width / 400 <= 0.1


def test_the_zone_ends_at_a_node_and_two_zones_agree(hertz):
    _, reduction, _, zones = hertz
    x = reduction.problem.coordinates[0]
    spacing = x[1] - x[0]
    assert np.abs(x - zones[-2]).min() < 1e-9
    assert abs(zones[-1] - zones[-2]) <= 0.05 * spacing * 1.0001
    assert len(zones) >= 3  # the first guess was not the answer


@pytest.mark.parametrize("guess", [0.8, 1.1])
def test_the_zone_does_not_depend_on_the_first_guess(hertz, guess):
    from dataclasses import replace

    scene, _, _, zones = hertz
    _, _, others = solve_zone(replace(scene, zone=guess * zones[-1]))
    assert others[-1] == pytest.approx(zones[-1], rel=4e-3)


def test_similar_bodies_press_alike_with_and_without_friction(hertz):
    """Dundurs' beta is zero: friction changes the Hertz pressure by a finite-size effect only."""
    scene, reduction, solution, zones = hertz
    smooth = solve(reduce(scenes.sphere(mu=0.0), zone=zones[-2]), tol=1e-10)
    change = np.abs(smooth.reactions[:, 0] - solution.reactions[:, 0]) / reduction.problem.areas
    assert change.max() < 5e-3 * scene.reference.peak


def test_half_width_is_finer_than_the_mesh(hertz):
    scene, *_ = hertz
    for zone in (1.02, 1.25):
        problem = reduce(scene, elements=32, zone=zone * scene.reference.half_width)
        width = contact_half_width(scene, problem, solve(problem).reactions)
        assert width == pytest.approx(scene.reference.half_width, rel=5e-3)


def test_a_scene_without_a_zone_is_solved_once():
    scene = scenes.flat_punch(2, elements=6)
    _, solution, zones = solve_zone(scene)
    assert zones == [] and solution.solved


def test_stick_and_contact_masks():
    r = np.array([[1.0, 0.2], [1.0, -0.5], [0.0, 0.0], [1e-14, 0.0]])
    assert pressed(r).tolist() == [True, True, False, False]
    assert stuck(r, np.full(4, 0.5)).tolist() == [True, False, False, False]


def test_stick_ratio_of_the_rigid_punch():
    """Spence's exact value .689087 for plane strain, nu = mu = .3, on a foundation 1,280 half-widths wide."""
    scene = scenes.flat_punch(2, rigid="punch", mu=0.3, foundation_width=25600, foundation_height=12800, elements=64)
    problem = reduce(scene)
    solution = solve(problem)
    assert solution.solved
    assert stick_half_width(scene, problem, solution.reactions) / 20 == pytest.approx(0.689087, abs=0.01)
