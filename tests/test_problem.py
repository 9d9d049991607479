import json
import pickle

import numpy as np
import pytest
from conftest import one_contact

from contactopt import (
    InputError,
    InterfaceProblem,
    Status,
    natural_map_residual,
    reduce,
    scenes,
    siconos_residual,
    solve,
)
from contactopt.problem import balance_residual, dimensionless, fit_multipliers
from contactopt.problem.laws.bilateral import Bilateral


@pytest.mark.parametrize("reaction", [(1.0, 0.8), (0.4, 0.4), (0.0, 0.0)])
def test_the_three_solutions_of_one_contact_have_residual_zero(reaction):
    """Stick, slip and open all solve this problem; (normal, tangential)."""
    problem = one_contact((0.8, 1.0), mu=1.0)
    assert natural_map_residual(problem, [reaction]) < 1e-14


@pytest.mark.parametrize("reaction", [(1.0, 0.7), (0.4, -0.4), (0.5, 0.5), (1.0, 1.1), (-0.1, 0.0)])
def test_what_does_not_solve_has_a_large_residual(reaction):
    assert natural_map_residual(one_contact((0.8, 1.0), mu=1.0), [reaction]) > 1e-2


@pytest.mark.parametrize("status", Status)
def test_a_status_is_equal_to_its_word(status):
    assert status == status.label == str(status) == f"{status}" == json.loads(json.dumps(status))
    assert Status(status.label) is status is pickle.loads(pickle.dumps(status))
    assert " " in status.sentence


def test_rho_one_is_the_published_formula():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(6, 6))
    problem = InterfaceProblem(A @ A.T, rng.normal(size=(2, 3)), 0.5)
    r = rng.normal(size=(2, 3))
    u = (problem.Q @ r.ravel()).reshape(2, 3) + problem.q
    error = np.zeros((2, 3))
    for i in range(2):
        x = r[i] - u[i]
        x[0] -= 0.5 * np.linalg.norm(u[i, 1:])
        n, t = x[0], np.linalg.norm(x[1:])
        if t <= 0.5 * n:
            p = x
        elif 0.5 * t <= -n:
            p = np.zeros(3)
        else:
            h = (n + 0.5 * t) / 1.25
            p = np.array([h, *(0.5 * h * x[1:] / t)])
        error[i] = r[i] - p
    size = max(np.linalg.norm(r), np.linalg.norm(problem.q), np.linalg.norm(u))
    assert siconos_residual(problem, r) == pytest.approx(np.linalg.norm(error) / size, rel=1e-12)


@pytest.mark.parametrize("force,length", [(1e6, 1e-3), (1e-9, 1e3), (1.0, 1e-9)])
def test_certificate_and_scaling_do_not_depend_on_units(punch, force, length):
    units = InterfaceProblem(
        punch.Q * length / force,
        punch.q * length,
        punch.mu,
        punch.V,
        punch.s * force,
        areas=punch.areas,
    )
    r = np.abs(np.random.default_rng(0).normal(size=punch.q.shape))
    assert natural_map_residual(units, r * force) == pytest.approx(
        natural_map_residual(punch, r), rel=1e-6
    )
    a, b = dimensionless(units)[0], dimensionless(punch)[0]
    assert np.allclose(a.Q, b.Q, rtol=1e-12, atol=0) and np.allclose(a.s, b.s, rtol=1e-12)
    ours, base = solve(units, tol=1e-10), solve(punch, tol=1e-10)
    assert ours.solved and np.allclose(ours.reactions / force, base.reactions, rtol=0, atol=1e-8)


def test_zero_reactions_are_no_solution_of_a_pressed_problem(punch):
    assert natural_map_residual(punch, np.zeros(punch.q.shape)) == 1.0


def test_unloaded_problem_at_rest():
    problem = InterfaceProblem(np.eye(2), np.zeros((1, 2)), 0.3)
    assert natural_map_residual(problem, np.zeros((1, 2))) == 0.0


@pytest.mark.parametrize("noise", [1e-15, 1e-17, 1e-200, 5e-324])
def test_rounding_in_an_open_contact_is_no_error(noise):
    with np.errstate(all="raise", under="ignore"):
        assert natural_map_residual(one_contact((0.8, 1.0), mu=1.0), [[noise, 0.0]]) < 1e-8


def test_bilateral_contact_carries_tension_and_its_friction():
    problem = InterfaceProblem(np.eye(2), [[2.0, 0.5]], Bilateral(0.3))  # r_n = -2 keeps u_n = 0
    assert natural_map_residual(problem, [[-2.0, -0.5]]) < 1e-15
    assert natural_map_residual(problem, [[0.0, 0.0]]) > 0.1
    slipping = InterfaceProblem(np.eye(2), [[2.0, 0.9]], Bilateral(0.3))
    assert natural_map_residual(slipping, [[-2.0, -0.6]]) < 1e-15


def test_balance_counts(punch):
    r = solve(punch, tol=1e-10).reactions.copy()
    r[:, 0] *= 1.01
    assert balance_residual(punch, r) == pytest.approx(0.01, rel=1e-6)  # of the plate's force
    assert natural_map_residual(punch, r) >= balance_residual(punch, r)


def test_multipliers_are_found_from_the_reactions(punch):
    solution = solve(punch, tol=1e-10)
    assert np.allclose(fit_multipliers(punch, solution.reactions), solution.multipliers, rtol=1e-8)


def test_reactions_beyond_the_range_of_floats(punch):
    for size in (1e200, 1e308):
        with np.errstate(all="raise"):
            residual = natural_map_residual(punch, np.full(punch.q.shape, size))
        assert residual > 1e-3


def test_reactions_that_are_not_finite(punch):
    assert natural_map_residual(punch, np.full(punch.q.shape, np.nan)) == np.inf


@pytest.mark.parametrize(
    "change,message",
    [
        (dict(law=[-0.1]), "must not be negative"),
        (dict(law=[np.nan]), "not finite"),
        (dict(Q=np.eye(3)), "Q must have shape"),
        (dict(q=np.zeros((1, 4))), "2 or 3 columns"),
        (dict(s=np.ones(1)), "V must have shape"),
        (dict(V=np.ones((2, 1))), "V has columns but s is empty"),
        (dict(Q=1j * np.eye(2)), "Q must be real"),
        (dict(Q="text"), "Q must be an array of numbers"),
        (dict(Q=[[1.0, 0.0], [1.0]]), "rows have different lengths"),
        (dict(q=[["a", "b"]]), "q must be an array of numbers"),
        (dict(q=None), "q must be an array of numbers"),
        (dict(law="steel"), "mu must be an array of numbers"),
        (dict(law=[0.1, 0.2]), "mu must have shape"),
    ],
)
def test_bad_problems_are_refused(change, message):
    good = dict(Q=np.eye(2), q=np.zeros((1, 2)), law=[0.5])
    with pytest.raises(InputError, match=message):
        InterfaceProblem(**(good | change))


def test_wrong_shape_of_reactions(punch):
    with pytest.raises(InputError, match="normal first"):
        natural_map_residual(punch, np.zeros(3))


def test_problem_is_frozen_and_has_a_fingerprint(punch):
    with pytest.raises(ValueError):
        punch.Q[0, 0] = 1.0
    again = reduce(scenes.flat_punch(2, elements=8))
    other = reduce(scenes.flat_punch(2, elements=8, mu=0.4))
    assert punch.fingerprint == again.fingerprint != other.fingerprint
