import pytest

from contactopt import InputError, solve
from contactopt.methods.admm import ADMM
from contactopt.methods.apg import APG

METHODS = {"apg": APG(), "admm": ADMM()}


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


def test_weight_without_sense():
    with pytest.raises(InputError, match="rho"):
        ADMM(0.0)
