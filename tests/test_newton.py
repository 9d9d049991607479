"""The default and what it is made of: Newton's method, the proximal loop, warm starts."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import one_contact

from contactopt import (
    InputError,
    InterfaceProblem,
    natural_map_residual,
    reduce,
    scenes,
    solve,
    transfer,
)
from contactopt.benchmark.families.of_scenes import tangential
from contactopt.benchmark.families.packings import rigid_bodies
from contactopt.scenes import make_scene

SMALL = {"punch-2d": 16, "punch-3d": 5, "sphere": 12}


@pytest.mark.parametrize("name", SMALL)
def test_matrix_free_newton_takes_the_same_steps(name):
    problem = reduce(make_scene(name, mu=0.3, elements=SMALL[name]))
    dense = solve(problem, "newton", tol=1e-9)
    free = solve(problem, "newton", tol=1e-9, linear="krylov")
    # its steps are no more accurate than pays
    assert free.solved and free.iterations <= dense.iterations + 2
    assert np.allclose(free.reactions, dense.reactions, atol=1e-7)
    with pytest.raises(InputError, match="choose dense, krylov or coupled"):
        solve(problem, "newton", linear="magic")


@pytest.mark.parametrize("name", SMALL)
def test_the_scenes_are_certified_at_every_friction_coefficient(name):
    problem = reduce(make_scene(name, elements=SMALL[name]))
    for mu in (0.0, 0.05, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0):
        solution = solve(replace(problem, law=mu), tol=1e-10)
        assert solution.solved and solution.iterations <= 13, mu
        assert np.all(solution.reactions[:, 0] >= 0)


def test_small_problems_on_which_fixed_points_fail():
    cycling = solve(one_contact((-10.0, 1.0), 1.0), tol=1e-12)
    assert cycling.solved and cycling.reactions[0] == pytest.approx([6.4, -6.4])
    three = solve(one_contact((0.8, 1.0), 1.0), tol=1e-12)
    solutions = ([1.0, 0.8], [0.4, 0.4], [0.0, 0.0])
    assert three.solved and any(np.allclose(three.reactions[0], s, atol=1e-10) for s in solutions)


@pytest.mark.parametrize("seed", range(12))
def test_rank_deficient_problems_are_certified(seed):
    problem = rigid_bodies(6, 14, 0.7, seed)
    assert np.linalg.matrix_rank(problem.Q) < len(problem.Q)
    for method in ("auto", "proximal"):
        assert solve(problem, method).solved


def test_proximal_finds_what_newton_misses():
    """Newton's method runs in circles on some of these; the chain of the default does not."""
    problems = [rigid_bodies(10, 40, 0.7, seed) for seed in range(6)]
    newton = [solve(problem, "newton", max_iterations=50).solved for problem in problems]
    assert not all(newton) and all(solve(problem).solved for problem in problems)


def test_bonded_start_without_a_plate():
    problem = tangential(of="punch-3d", elements=9)
    solution = solve(problem, "newton")
    assert solution.solved and solution.iterations <= 4  # from no force at all it cycles


def test_duplicated_contacts_share_the_force():
    base = reduce(scenes.flat_punch(2, elements=6))
    twice = np.repeat(np.arange(base.contacts), 2)
    rows = (2 * twice[:, None] + np.arange(2)).ravel()
    doubled = InterfaceProblem(
        base.Q[np.ix_(rows, rows)], base.q[twice], base.mu[twice], base.V[rows], base.s
    )
    a, b = solve(base, tol=1e-10), solve(doubled, tol=1e-8)
    assert b.solved
    assert np.allclose(b.reactions[::2] + b.reactions[1::2], a.reactions, atol=1e-5)


@pytest.mark.parametrize("elements", [8, 32, 128])
def test_steps_hardly_depend_on_the_mesh(elements):
    coarse, fine = (
        reduce(scenes.flat_punch(2, elements=n, mu=0.3)) for n in (elements // 2, elements)
    )
    cold = solve(fine)
    warm = solve(fine, start=transfer(coarse, solve(coarse), fine))
    assert cold.solved and cold.iterations - 1 <= 12
    assert warm.solved and warm.iterations - 1 <= 4


@pytest.mark.parametrize("reach", [2.0, 200.0])
@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_steps_hardly_depend_on_how_far_the_surfaces_reach(reach, mu):
    """Candidates up to 200 half-widths away: peeling them off one by one takes 30 steps."""
    right = np.concatenate([np.linspace(0, 2, 41), 2.0 * np.geomspace(1.0, 100.0, 25)[1:]])
    x = np.concatenate([-right[:0:-1], right])
    x = x[np.abs(x) <= reach]
    areas = np.gradient(x)
    # Flamant: mean over a strip
    normal = -np.log(np.maximum(np.abs(x[:, None] - x), areas / 5.44) / 1e3) / np.pi
    Q = np.zeros((len(x), 2, len(x), 2))
    Q[:, 0, :, 0] = Q[:, 1, :, 1] = (normal + normal.T) / 2
    V = np.zeros((len(x), 2, 1))
    V[:, 0] = -1.0
    q = np.stack([x**2 / 4, 0 * x], axis=1)
    problem = InterfaceProblem(
        Q.reshape(2 * len(x), -1), q, mu, V.reshape(-1, 1), [np.pi / 4], areas
    )
    solution = solve(problem, method="newton")
    assert solution.solved and solution.iterations <= 8
    pressure = solution.reactions[:, 0] / areas
    # Hertz: half-width 1
    assert np.abs(pressure - np.sqrt(np.maximum(1 - x**2, 0.0)) / 2).max() < 0.03


def test_transfer_keeps_the_traction():
    coarse, fine = (reduce(scenes.flat_punch(3, elements=n)) for n in (3, 5))
    moved = transfer(coarse, solve(coarse), fine)
    assert moved.reactions[:, 0].sum() == pytest.approx(100, rel=0.05)
    assert natural_map_residual(fine, moved.reactions) < 0.2
    with pytest.raises(InputError, match="same dimension"):
        transfer(coarse, solve(coarse), reduce(scenes.flat_punch(2, elements=4)))


def test_start_of_the_wrong_size_is_refused(punch, cube):
    with pytest.raises(InputError, match="start has reactions"):
        solve(punch, start=solve(cube))
