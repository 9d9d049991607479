from pathlib import Path

import numpy as np
import pytest
from conftest import one_contact

from contactopt import InputError, InterfaceProblem, fclib, reduce, scenes, solve
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
@pytest.mark.parametrize("scene", ["punch", "cube"])
def test_they_find_the_solution_of_the_default_method(name, scene, request):
    problem = request.getfixturevalue(scene)
    exact = solve(problem, tol=1e-12)
    solution = solve(problem, METHODS[name], tol=1e-9, max_iterations=1000)
    assert solution.solved
    assert np.allclose(solution.reactions, exact.reactions, atol=1e-6 * exact.reactions.max())
    assert np.allclose(solution.multipliers, exact.multipliers, rtol=1e-6)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("options", [{"mu": 0.0}, {"bilateral": True}, {"mu": 0.1}])
def test_scenes(name, options):
    assert solve(
        reduce(scenes.flat_punch(2, elements=5, **options)), METHODS[name], max_iterations=1000
    ).solved


@pytest.mark.parametrize("name", METHODS)
def test_strong_friction_where_the_alternation_cycles(name):
    solution = solve(one_contact((-10.0, 1.0), 1.0), METHODS[name])
    assert solution.solved and solution.reactions[0] == pytest.approx([6.4, -6.4], abs=1e-5)


@pytest.mark.parametrize("name", METHODS)
def test_plate_pressed_and_dragged(name):
    """Six equal springs under 6 and a pull of 1 share both equally; lambda is the plate's motion,
    -1 and 1/6.
    """
    V = np.tile(np.eye(2), (6, 1))
    problem = InterfaceProblem(np.eye(12), np.zeros((6, 2)), 0.5, V, np.array([-6.0, 1.0]))
    solution = solve(problem, METHODS[name], tol=1e-10)
    assert solution.solved
    assert np.allclose(solution.reactions, [1.0, -1 / 6], atol=1e-8)
    assert np.allclose(solution.multipliers, [-1.0, 1 / 6], atol=1e-8)


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


@pytest.mark.skipif(not LIBRARY.is_dir(), reason="the FCLib files are not here")
@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("file", ["Box_Stacks", "CubeH8", "LMGC_100_PR_PerioBox"])
def test_fclib(name, file):
    problem = fclib.read(next(LIBRARY.glob(f"{file}*.hdf5")))
    assert solve(problem, METHODS[name], tol=1e-8, max_iterations=2000).solved


def test_weight_without_sense():
    with pytest.raises(InputError, match="rho"):
        ADMM(0.0)
