import numpy as np
import pytest

from contactopt.methods.kernels.semismooth import Equations, Factored, crossover, evaluated
from contactopt.methods.kernels.sparse_blocks import block_matrix
from contactopt.problem.cones import half_line_derivative


def spd(n, seed=0):
    A = np.random.default_rng(seed).normal(size=(n, n))
    return A @ A.T / n + 0.3 * np.eye(n)


@pytest.mark.parametrize("seed", range(6))
def test_it_never_makes_an_answer_worse(seed):
    """The first Newton step leads far away from a good start, which must come back."""
    rng, none = np.random.default_rng(seed), np.zeros(0)
    A = rng.normal(size=(12, 3))
    Q, c, V = A @ A.T + 1e-6 * np.eye(12), rng.normal(size=12), np.zeros((12, 0))
    equations = Equations(Q, c[:, None], V, none, half_line_derivative)
    start = np.maximum(0.0, rng.normal(size=(12, 1)))
    at = evaluated(equations, start, none)
    before, change = at.residual, Factored(block_matrix(Q, 1))(equations, at)
    assert change is not None and equations.evaluate(start + change[0], none)[0] > 10 * before
    for steps in (2, 3, 5, 20):
        r, lam = crossover(Q, c, V, none, half_line_derivative, start, none, steps)
        assert equations.evaluate(r, lam)[0] <= before
    assert equations.evaluate(r, lam)[0] < 1e-8 * before  # with steps enough it is better


def test_a_singular_system_has_no_newton_step():
    """Two plates that move alike have multipliers that are not unique; all must be finite."""
    V, s, start = np.ones((3, 2)), -np.ones(2), np.ones((3, 1))
    equations = Equations(np.eye(3), np.zeros((3, 1)), V, s, half_line_derivative)
    at = evaluated(equations, start, np.zeros(2))
    assert Factored(block_matrix(equations.Q, 1))(equations, at) is None
    r, lam = crossover(np.eye(3), np.zeros(3), V, s, half_line_derivative, start, np.zeros(2))
    assert np.array_equal(r, start) and np.array_equal(lam, np.zeros(2))
