"""All solutions of small problems are listed, and problems without one are proved to have none."""

import numpy as np
import pytest
from conftest import one_contact
from test_complementarity import by_brute_force

from contactopt import InputError, InterfaceProblem, reduce, scenes, solve
from contactopt.methods.enumeration import all_solutions


def test_one_contact_with_three_solutions():
    """K = [[1, 1.5], [1.5, 4]], f = (.8, 1), mu = 1: open, slip and stick."""
    found = all_solutions(one_contact((0.8, 1.0), 1.0))
    assert sorted(tuple(np.round(s.reactions[0], 12)) for s in found) == [
        (0.0, 0.0),
        (0.4, 0.4),
        (1.0, 0.8),
    ]
    assert all(s.solved and s.residual < 1e-12 for s in found)
    assert len(all_solutions(one_contact((0.8, 1.0), 1.0), limit=2)) == 2


@pytest.mark.parametrize("nu", [0.0, 0.2, 0.3])
def test_one_triangle_loses_uniqueness_at_three_minus_four_nu(nu):
    """Contact node (0, 0), clamped at (1, 0) and (0, 1): K_tt / |K_tn| = 3 - 4 nu.

    The load is one of uniform slip.
    """
    first, shear = nu / ((1 + nu) * (1 - 2 * nu)), 0.5 / (1 + nu)  # Lame's constants over E
    K = np.array([[first + 3 * shear, first + shear], [first + shear, first + 3 * shear]])
    Q = np.linalg.inv(K)
    count = []
    for factor in (0.999, 1.001):
        mu = factor * (3 - 4 * nu)
        loads = []
        for way in (1.0, -1.0):
            r, u = np.array([1.0, -way * mu]), np.array([0.0, way])
            loads.append(len(all_solutions(InterfaceProblem(Q, [u - Q @ r], mu))))
        count.append(max(loads))
    assert count == [1, 3]


@pytest.mark.parametrize("mu", [0.0, 0.15, 0.5])
def test_the_punch_has_one_solution(mu):
    problem = reduce(scenes.flat_punch(2, elements=4, mu=mu))
    (only,) = all_solutions(problem)
    reference = solve(problem, tol=1e-11)
    assert np.allclose(only.reactions, reference.reactions, atol=1e-7)
    assert np.allclose(only.multipliers, reference.multipliers, rtol=1e-7)


def test_a_point_where_states_meet_is_listed_once():
    """Grazing contact: u = 0 and r = 0 is open, stuck and slipping both ways."""
    # the second one sticks at its limit
    problem = InterfaceProblem(np.eye(4), [[0.0, 0.0], [-1.0, 0.5]], 0.5)
    (only,) = all_solutions(problem)
    assert only.reactions == pytest.approx(np.array([[0.0, 0.0], [1.0, -0.5]]))


def of_kind(kind: str, seed: int) -> InterfaceProblem:
    """A random problem of 1 to 3 contacts whose Q is of some kind, with or without a plate."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, 4))
    A, skew = rng.normal(size=(2, 2 * k, 2 * k))
    Q = A @ A.T / (2 * k) + 0.05 * np.eye(2 * k)
    if kind == "unsymmetric":
        Q += skew - skew.T
    if kind == "semidefinite":
        A = A[:, : max(1, 2 * k - 2)]
        Q = A @ A.T / (2 * k)
    if kind == "indefinite":
        Q -= 0.5 * np.linalg.eigvalsh(Q)[-1] * np.eye(2 * k)
        Q[np.diag_indices(2 * k)] = np.maximum(np.diag(Q), 1e-3)
    plate = int(rng.integers(0, 2)) if k > 1 else 0
    V = np.zeros((2 * k, plate))
    V[::2] = 1.0
    mu = rng.choice([0.0, 0.2, 0.7, 1.5, 4.0], size=k)
    return InterfaceProblem(Q, rng.normal(size=(k, 2)), mu, V, np.full(plate, -1.0))


@pytest.mark.parametrize("kind", ["definite", "unsymmetric", "semidefinite", "indefinite"])
def test_all_solutions_are_those_of_all_states(kind):
    """Every one of the 4^k states is tried; where a singular Q has a continuum of solutions, each
    listed point is one of them, and there are some if and only if enumeration finds some.
    """
    counts = []
    for seed in range(125):
        problem = of_kind(kind, seed)
        expected, found = by_brute_force(problem), all_solutions(problem)
        assert bool(found) == bool(expected), seed
        assert all(s.residual <= 1e-8 for s in found), seed
        if kind != "semidefinite":
            assert len(found) == len(expected), seed
            for s in found:
                near = [np.abs(s.reactions - r).max() for r in expected]
                assert min(near) < 1e-6 * max(1.0, np.abs(s.reactions).max()), seed
        counts.append(len(found))
    assert min(counts) == (1 if kind == "definite" else 0) or kind == "unsymmetric"
    assert max(counts) > 1


def test_a_continuum_is_listed_by_one_point_of_its_states():
    """Q = ones couples r_n and r_t by their sum alone: r_n + r_t = 1 with |r_t| <= r_n / 2."""
    found = all_solutions(InterfaceProblem(np.ones((2, 2)), -np.ones((1, 2)), 0.5))
    assert found and all(s.residual < 1e-12 for s in found)
    assert all(s.reactions.sum() == pytest.approx(1.0) for s in found)


def test_a_dragged_plate_is_listed_too():
    dragged = InterfaceProblem(np.eye(2), np.zeros((1, 2)), 0.5, np.eye(2), np.array([-1.0, 0.2]))
    (only,) = all_solutions(dragged)
    assert only.reactions == pytest.approx(np.array([[1.0, -0.2]]))


def test_a_limit_of_nothing_is_refused():
    with pytest.raises(InputError, match="limit"):
        all_solutions(one_contact((0.8, 1.0), 1.0), limit=0)
