"""Many small problems at once: the answers of the loop, each with its own certificate."""

import numpy as np
import pytest

from contactopt import InputError, InterfaceProblem, natural_map_residual, solve, solve_batch
from contactopt.methods import batch


def problems(b, k, dim, seed=0, least=0.1):
    random, n = np.random.default_rng(seed), k * dim
    A = random.normal(size=(b, n, n))
    return A @ A.swapaxes(1, 2) / n + least * np.eye(n), random.normal(size=(b, k, dim))


@pytest.fixture
def no_compiler(monkeypatch):
    """The package as it is installed without one: Newton's method gets all problems."""
    monkeypatch.setattr(batch, "solve_small", lambda *given: (None, None))


@pytest.mark.parametrize("dim, mu", [(2, 0.0), (2, 0.6), (3, 0.3), (3, 1.2)])
def test_every_answer_is_that_of_the_loop(dim, mu):
    _check_answers(dim, mu)


@pytest.mark.parametrize("dim, mu", [(2, 0.0), (2, 0.6), (3, 0.3), (3, 1.2)])
def test_every_answer_is_that_of_the_loop_without_a_compiler(no_compiler, dim, mu):
    _check_answers(dim, mu)


def _check_answers(dim, mu):
    Q, q = problems(30, 5, dim)
    scales = 10.0 ** np.linspace(-8, 8, 30)  # units differ from problem to problem
    found = solve_batch(Q * scales[:, None, None], q, mu)
    for i, solution in enumerate(found):
        problem = InterfaceProblem(Q[i] * scales[i], q[i], mu=mu)
        assert solution.solved
        residual = natural_map_residual(problem, solution.reactions)
        assert residual == pytest.approx(solution.residual, abs=1e-14)
        expected = solve(problem).reactions
        assert np.allclose(solution.reactions, expected, atol=1e-7 * np.abs(expected).max())


def test_stragglers_are_solved_by_the_default(monkeypatch, no_compiler):
    """Newton's method cycles on the first; the second has a singular step, the third is easy."""
    Q = np.array([[[2.0, -1.6], [-1.6, 2.0]], [[0.0, 0.0], [0.0, 0.0]], np.eye(2)])
    q = np.array([[[-10.0, 1.0]], [[1.0, 0.0]], [[-1.0, 0.2]]])
    monkeypatch.setattr(batch, "STEPS", 2)
    found = solve_batch(Q, q, [[1.0], [0.5], [0.0]])
    assert [solution.solved for solution in found] == [True, True, True]
    assert {solution.method == batch.NAME for solution in found} == {True, False}


def test_the_steps_of_each_problem_are_counted(no_compiler):
    q = np.array([[[1.0, 0.0]], [[-1.0, 0.3]]])  # open, and sticking
    apart, touching = solve_batch(np.stack([np.eye(2)] * 2), q, 0.5)
    assert apart.iterations == 0 < touching.iterations <= batch.STEPS


def test_friction_of_each_problem_and_no_problem_at_all():
    Q, q = problems(3, 2, 3)
    mu = np.array([[0.0, 0.1], [0.2, 0.3], [0.4, 0.5]])
    for i, solution in enumerate(solve_batch(Q, q, mu)):
        alone = solve(InterfaceProblem(Q[i], q[i], mu=mu[i])).reactions
        assert np.allclose(solution.reactions, alone, atol=1e-9)
    assert solve_batch(np.zeros((0, 4, 4)), np.zeros((0, 2, 2)), 0.1) == []


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda Q, q, mu: (Q[0], q[0], mu), "single problem is an InterfaceProblem"),
        (lambda Q, q, mu: (Q[:2], q, mu), "Q must have shape"),
        (lambda Q, q, mu: (Q, q * np.nan, mu), "q holds a number that is not finite"),
        (lambda Q, q, mu: (Q, q, [-0.1, 0.2]), "must not be negative"),
        (lambda Q, q, mu: (Q, q, [0.1] * 7), "mu must be a number"),
        (lambda Q, q, mu: (np.stack([Q[0], -Q[1], Q[2]]), q, mu), "negative diagonal entry"),
    ],
)
def test_bad_input_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        solve_batch(*change(*problems(3, 2, 2), 0.3))
