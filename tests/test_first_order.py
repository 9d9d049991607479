from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from conftest import one_contact

from contactopt import InputError, InterfaceProblem, fclib, reduce, scenes, solve
from contactopt.methods.admm import ADMM, Balanced
from contactopt.methods.apg import APG
from contactopt.methods.kernels.mprgp import largest_eigenvalue, mprgp, smalbe

LIBRARY = Path(__file__).parents[2] / "shared" / "fclib"
METHODS = {"apg": APG(), "admm": ADMM()}


def spd(n: int, seed: int = 0, condition: float = 1e3) -> np.ndarray:
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(n, n)))[0]
    return (axes * np.geomspace(1 / condition, 1, n)) @ axes.T


def active_set_by_enumeration(P, c):
    """The exact solution of a small QP with x >= 0: the only set of free unknowns that satisfies
    the conditions.
    """
    n = len(c)
    for size in range(n + 1):
        for free in map(list, combinations(range(n), size)):
            x = np.zeros(n)
            x[free] = np.linalg.solve(P[np.ix_(free, free)], -c[free])
            if x.min() >= -1e-12 and np.delete(P @ x + c, free).min(initial=0) >= -1e-12:
                return x
    raise AssertionError


@pytest.mark.parametrize("seed", range(6))
def test_box_qp_against_enumeration(seed):
    P, c = spd(8, seed, 50.0), np.random.default_rng(seed).normal(size=8)
    low = np.random.default_rng(seed + 50).normal(size=8)
    exact = active_set_by_enumeration(P, c + P @ low) + low
    result = mprgp(P, c, low, tol=1e-12)
    assert result.met and np.allclose(result.x, exact, atol=1e-9)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_box_qp_holds_its_word_in_all_units(scale):
    n = 120
    P, c = spd(n), scale * np.random.default_rng(1).normal(size=n)
    low = np.where(np.arange(n) % 3, 0.0, -np.inf)  # some unknowns are free
    result = mprgp(P, c, low, tol=1e-9)
    assert result.met and result.x[1] >= 0 and 0 < np.sum(result.x == low) < n
    g = P @ result.x + c
    g[result.x <= low] = np.minimum(g, 0)[result.x <= low]  # what pulls away from a bound
    assert np.linalg.norm(g) <= 1.01e-9 * np.linalg.norm(c)
    again = mprgp(P, c, low, result.x, tol=1e-9)
    assert again.iterations <= 1 and again.met


def test_too_few_iterations_are_confessed():
    P, c = spd(60), np.random.default_rng(4).normal(size=60)
    assert not mprgp(P, c, np.zeros(60), tol=1e-12, max_iterations=3).met


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rows", [1, 2, 3])
def test_balance_rows(rows, seed):
    """Rows that are far from orthogonal, and few free unknowns to satisfy them."""
    n = 50
    rng = np.random.default_rng(6 + seed)
    P, c, A = spd(n, 5), rng.normal(size=n), np.abs(rng.normal(size=(rows, n)))
    b = A @ np.where(np.arange(n) % 2, 1.0, 0.0)
    result = smalbe(P, c, np.zeros(n), A, b, tol=1e-9)
    assert result.iterations < 1000
    x, y = result.x, result.multipliers
    u = P @ x + c + A.T @ y
    assert result.met and np.allclose(A @ x, b, rtol=1e-8)
    assert x.min() >= 0 and u.min() > -1e-6 and abs(x @ u) < 1e-6


def test_shapes_are_checked():
    with pytest.raises(InputError, match="low"):
        mprgp(np.eye(3), np.zeros(3), np.zeros(2))
    with pytest.raises(InputError, match="A must"):
        smalbe(np.eye(3), np.zeros(3), np.zeros(3), np.ones((1, 2)), np.ones(1))


def test_largest_eigenvalue():
    assert largest_eigenvalue(spd(30), 60) == pytest.approx(1.0, rel=0.05)
    assert largest_eigenvalue(np.zeros((3, 3))) == 0.0


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
