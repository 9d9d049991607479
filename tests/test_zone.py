from dataclasses import replace

import numpy as np
import pytest

from contactopt import InterfaceProblem, reduce, scenes, solve
from contactopt.problem.contact_status import contact_status
from contactopt.problem.laws.bilateral import Bilateral
from contactopt.readings.edges import contact_edge, stick_edge
from contactopt.solving.solve_scene import Options
from contactopt.solving.zone import solve_zone


@pytest.fixture(scope="module")
def hertz():
    scene = scenes.sphere()
    solved = solve_zone(scene)
    return scene, solved.reduction, solved.solution, solved.zones


def test_hertz_within_half_a_percent(hertz):
    scene, reduction, solution, zones = hertz
    pressure = solution.reactions[:, 0] / reduction.problem.areas
    assert solution.solved
    assert zones[-1] == pytest.approx(scene.reference.half_width, rel=5e-3)
    assert pressure.max() == pytest.approx(scene.reference.peak, rel=5e-3)
    assert solution.reactions[:, 0].sum() == pytest.approx(100, rel=1e-10)
    assert scene.reference.half_width / 400 <= 0.1


def test_the_zone_ends_at_a_node_and_is_read_from_the_answer(hertz):
    scene, reduction, solution, zones = hertz
    x = reduction.problem.chart.places[0]
    assert np.abs(x - zones[-2]).min() < 1e-9
    assert zones[-1] == contact_edge(scene, reduction.problem, solution.reactions)
    assert len(zones) >= 3  # the first guess was not the answer


@pytest.mark.parametrize("guess", [0.5, 2.0])
def test_the_zone_does_not_depend_on_the_first_guess(hertz, guess):
    """From half and from twice the zone, to a thirtieth of an element."""
    scene, _, _, zones = hertz
    others = solve_zone(replace(scene, zone=guess * zones[-1])).zones
    assert others[-1] == pytest.approx(zones[-1], rel=1e-3)


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
        width = contact_edge(scene, problem, solve(problem).reactions)
        assert width == pytest.approx(scene.reference.half_width, rel=5e-3)


def test_a_scene_without_a_zone_is_solved_once():
    solved = solve_zone(scenes.flat_punch(2, elements=6))
    assert solved.zones == () and solved.solution.solved


@pytest.mark.parametrize("solver", ["superlu", "pardiso"])
def test_the_coarse_start_keeps_the_form_of_q_and_the_solver(solver, monkeypatch):
    from contactopt.solving import solve_scene as module

    if solver == "pardiso":
        pytest.importorskip("pypardiso")
    seen, reduce_bodies = [], module.reduce_bodies

    def spy(scene, elements, zone, Q, solver, **more):
        seen.append((elements, Q, solver))
        return reduce_bodies(scene, elements, zone, Q, solver, **more)

    monkeypatch.setattr(module, "reduce_bodies", spy)
    solved = solve_zone(
        scenes.flat_punch(2, elements=32), options=Options(Q="implicit", solver=solver)
    )
    assert len(seen) > 1 and {call[1:] for call in seen} == {("implicit", solver)}
    assert len({call[0] for call in seen}) == len(seen)
    assert solved.solution.solved and "coarse" in solved.solution.seconds


def test_seconds_are_those_of_all_rounds(hertz):
    import time

    scene, *_ = hertz
    begin = time.perf_counter()
    seconds = solve_zone(scene).solution.seconds
    spent = time.perf_counter() - begin
    phases = {"assemble", "factorise", "compliance", "solve", "certificate", "checks"}
    assert set(seconds) == phases
    assert 0 < sum(seconds.values()) <= spent


def test_the_status_of_contacts():
    r = np.array([[1.0, 0.2], [1.0, -0.5], [0.0, 0.0], [1e-14, 0.0]])
    problem = InterfaceProblem(np.eye(8), np.zeros((4, 2)), 0.5)
    status = contact_status(problem, r)
    assert status.touching.tolist() == [True, True, False, False]
    assert status.stick.tolist() == [True, False, False, False]
    assert status.slip.tolist() == [False, True, False, False]
    assert np.all(status.open.astype(int) + status.stick + status.slip == 1)
    glued = contact_status(InterfaceProblem(np.eye(8), np.zeros((4, 2)), Bilateral(0.5)), r)
    assert not glued.open.any()


def test_stick_ratio_of_the_rigid_punch():
    """Spence's exact value for plane strain, nu = mu = .3."""
    scene = scenes.flat_punch(
        2, rigid="punch", mu=0.3, foundation_width=25600, foundation_height=12800, elements=64
    )
    problem = reduce(scene)
    solution = solve(problem)
    assert solution.solved
    assert stick_edge(scene, problem, solution.reactions)[0] / 20 == pytest.approx(
        0.689087, abs=0.01
    )
