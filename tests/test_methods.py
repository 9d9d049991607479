"""One contract for every method of the table."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from conftest import one_contact

from contactopt import (
    InputError,
    InterfaceProblem,
    Status,
    fclib,
    natural_map_residual,
    reduce,
    scenes,
    solve,
)
from contactopt.methods import METHODS, find_method

ALL = sorted(METHODS)
OTHER_LAW = {"relaxation"}  # solves associated friction: agrees only where nothing slips
APPROXIMATE = {"penalty"}  # a certificate of about 1e-6 on these problems by construction
PLANE = {"lemke"}
DIRECT = {"lemke"}  # one iteration, whatever the start
TOL = 1e-7
NEAR = 5e-6  # certificate asked of the approximate ones


@pytest.fixture(scope="module")
def problems():
    flat = reduce(scenes.flat_punch(2, elements=6, mu=0.2))
    rng = np.random.default_rng(2)
    A = rng.normal(size=(12, 12))
    free = InterfaceProblem(A @ A.T / 12 + np.eye(12), rng.normal(size=(6, 2)) - 0.5, 0.2)
    solid = reduce(scenes.flat_punch(3, elements=3, mu=0.2))
    found = {"plate, 2D": flat, "no plate, 2D": free, "plate, 3D": solid}
    return {name: (problem, solve(problem, tol=1e-11)) for name, problem in found.items()}


@pytest.mark.parametrize("name", ALL)
def test_settings_are_fields_of_a_frozen_object_with_defaults(name):
    method = find_method(name)
    assert dataclasses.is_dataclass(method) and method == find_method(name)
    with pytest.raises(dataclasses.FrozenInstanceError):
        method.anything = 1
    with pytest.raises(InputError, match=name):
        find_method(name, no_such_setting=1)


@pytest.mark.parametrize("name", ALL)
def test_every_method_gives_the_certified_answer_or_says_why_not(name, problems):
    for label, (problem, exact) in problems.items():
        if name in PLANE and problem.dim == 3:
            with pytest.raises(InputError, match="2D"):
                solve(problem, name)
            continue
        tol = NEAR if name in APPROXIMATE else TOL
        solution = solve(problem, name, tol=tol, max_iterations=20_000, time_limit=20)
        assert solution.reactions.shape == problem.q.shape
        residual = natural_map_residual(problem, solution.reactions, solution.multipliers)
        assert solution.residual == pytest.approx(residual, rel=1e-12, abs=1e-14)
        assert solution.solved == (solution.residual <= tol)
        if name in OTHER_LAW:
            assert solution.solved or solution.status is Status.SETTLED
            continue
        assert solution.solved, f"{label}: {solution.message} ({solution.residual:.1e})"
        size = np.abs(exact.reactions).max()
        assert np.allclose(solution.reactions, exact.reactions, rtol=0, atol=10 * tol * size), label
        assert np.allclose(solution.multipliers, exact.multipliers, rtol=100 * tol), label


@pytest.mark.parametrize("name", ALL)
def test_limits_hold_for_every_method(name, problems):
    problem, _ = problems["plate, 2D"]
    solution = solve(problem, name, tol=1e-30, max_iterations=2)
    assert solution.iterations <= 2 and not solution.solved
    assert np.all(np.isfinite(solution.reactions))


@pytest.mark.parametrize("name", ALL)
def test_open_contacts_carry_nothing(name):
    solution = solve(
        InterfaceProblem(np.eye(4), np.ones((2, 2)), 0.3), name, tol=1e-8, max_iterations=1000
    )
    assert solution.solved and np.abs(solution.reactions).max() < 1e-7


@pytest.mark.parametrize("name", sorted(set(ALL) - OTHER_LAW))
def test_a_start_at_the_solution_is_kept(name, without_sweeps):
    """One iteration from there, and more than one without it, but for the pivots of Lemke, which
    take no start.
    """
    rng = np.random.default_rng(5)
    A = rng.normal(size=(40, 40))
    problem = InterfaceProblem(
        A @ A.T / 40 + 0.05 * np.eye(40), rng.normal(size=(20, 2)) - 0.5, 0.7
    )
    exact = solve(problem, tol=1e-11)
    tol = NEAR if name in APPROXIMATE else TOL
    cold = solve(problem, name, tol=tol, max_iterations=1)
    assert cold.solved == (name in DIRECT)
    warm = solve(problem, name, tol=tol, max_iterations=1, start=exact)
    assert warm.solved


def test_indefinite_compliance_is_not_called_solved():
    with pytest.raises(InputError, match="semidefinite"):
        InterfaceProblem(np.diag([1.0, -1.0]), np.zeros((1, 2)), 0.3)
    Q = np.kron(np.array([[1.0, 2.0], [2.0, 1.0]]), np.eye(2))
    problem = InterfaceProblem(Q, -np.ones((2, 2)), 0.3)
    for name in ALL:
        try:
            solution = solve(problem, name, max_iterations=50, time_limit=5)
        except InputError:
            continue
        assert solution.solved == (
            natural_map_residual(problem, solution.reactions, solution.multipliers) <= 1e-8
        )


@pytest.mark.parametrize("name", ["alternating", "lagrangian", "nsgs", "tresca"])
@pytest.mark.parametrize("relaxation", [0.0, 2.0, np.nan])
def test_bad_relaxation(name, relaxation):
    with pytest.raises(InputError, match="relaxation"):
        find_method(name, relaxation=relaxation)


NORMAL = [5.11864, 8.32203]
CYCLES = {"alternating": NORMAL, "lagrangian": NORMAL, "tresca": [1.0, 14.5]}


@pytest.mark.parametrize("name", CYCLES)
def test_a_known_cycle_is_recognised_and_relaxation_breaks_it(name):
    """K = [[1, 1.5], [1.5, 4]], f = (-10, 1)."""
    problem = one_contact((-10.0, 1.0), 1.0)
    last = solve(problem, name, max_iterations=2000)
    before = solve(problem, name, max_iterations=last.iterations - 1)
    assert last.status.label == "cycling" and not last.solved
    forces = sorted(float(each.reactions[0, 0]) for each in (last, before))
    assert forces == pytest.approx(CYCLES[name], abs=5e-3)  # where it was recognised
    relaxed = solve(problem, name, relaxation=0.5)
    assert relaxed.solved and relaxed.reactions[0] == pytest.approx([6.4, -6.4], abs=1e-6)
    for mu in (0.6, 0.67):
        found = solve(one_contact((-10.0, 1.0), mu), name, max_iterations=2000)
        assert found.solved == (mu < 2 / 3)


@pytest.mark.parametrize("name", sorted({*ALL} - {*CYCLES, *OTHER_LAW, *APPROXIMATE}))
def test_other_methods_do_not_cycle_there(name):
    found = solve(one_contact((-10.0, 1.0), 1.0), name, max_iterations=1000)
    assert found.solved and found.reactions[0] == pytest.approx([6.4, -6.4], abs=1e-5)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", ["acary_cadoux", "alternating", "tresca"])
def test_one_convex_program_is_enough_without_friction(name, dim):
    problem = reduce(scenes.flat_punch(dim, elements=3, mu=0.0))
    found = solve(problem, name, tol=1e-12)
    assert found.solved and found.iterations == 1 and not np.any(found.reactions[:, 1:])


@pytest.mark.parametrize("name", sorted({*ALL} - OTHER_LAW - APPROXIMATE))
def test_a_plate_pressed_and_dragged(name):
    """Six equal springs under 6 and a pull of 1 share both equally; lambda is the plate's motion,
    -1 and 1/6.
    """
    V = np.tile(np.eye(2), (6, 1))
    problem = InterfaceProblem(np.eye(12), np.zeros((6, 2)), 0.5, V, np.array([-6.0, 1.0]))
    found = solve(problem, name, tol=1e-9, max_iterations=5000)
    assert found.solved
    assert np.allclose(found.reactions, [1.0, -1 / 6], atol=1e-7)
    assert np.allclose(found.multipliers, [-1.0, 1 / 6], atol=1e-7)


@pytest.mark.parametrize("name", ["acary_cadoux", "admm", "apg", "nsgs", "tresca"])
@pytest.mark.parametrize("file", ["Box_Stacks", "CubeH8", "LMGC_100_PR_PerioBox"])
def test_files_of_fclib(name, file):
    found = sorted((Path(__file__).parents[2] / "shared" / "fclib").glob(f"{file}*.hdf5"))
    if not found:
        pytest.skip("the FCLib files are not here")
    tol = 1e-6 if name == "nsgs" else 1e-8
    assert solve(fclib.read(found[0]), name, tol=tol, max_iterations=2000).solved
