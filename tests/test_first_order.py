from pathlib import Path

import numpy as np
import pytest

from contactopt import InputError, solve
from contactopt.linear.operators import eigenvalue_bound
from contactopt.methods.admm import ADMM, Balanced
from contactopt.methods.apg import APG

LIBRARY = Path(__file__).parents[2] / "shared" / "fclib"
METHODS = {"apg": APG(), "admm": ADMM()}


def spd(n: int, seed: int = 0, condition: float = 1e3) -> np.ndarray:
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(n, n)))[0]
    return (axes * np.geomspace(1 / condition, 1, n)) @ axes.T


def test_the_bound_is_a_little_above_the_largest_eigenvalue():
    assert 1.0 < eigenvalue_bound(spd(30)) < 1.1
    assert eigenvalue_bound(np.zeros((3, 3))) == 1.0


@pytest.mark.parametrize("name", METHODS)
def test_warm_start_saves_iterations(name, cube):
    cold = solve(cube, METHODS[name], tol=1e-8)
    near = solve(cube, tol=1e-12)
    assert solve(cube, METHODS[name], tol=1e-8, start=near).iterations < cold.iterations / 3


def test_a_bad_first_weight_is_balanced(cube):
    counts = [
        solve(cube, ADMM(rho), tol=1e-8, max_iterations=5000).iterations for rho in (1e-4, 1.0, 1e4)
    ]
    assert max(counts) < 40 * counts[1] and max(counts) < 3000


def test_system_with_balance_rows(cube):
    rng = np.random.default_rng(9)
    right, s = rng.normal(size=cube.q.shape), np.array([3.0])
    r, lam = Balanced(cube, 0.7).solve(right, s)
    assert np.allclose(
        (cube.Q @ r.ravel() + 0.7 * r.ravel() + cube.V @ lam), right.ravel(), atol=1e-10
    )
    assert cube.V.T @ r.ravel() == pytest.approx(-s)


def test_weight_without_sense():
    with pytest.raises(InputError, match="rho"):
        ADMM(0.0)
