import numpy as np
import pytest

from contactopt import InputError, InterfaceProblem, reduce, scenes, solve
from contactopt.problem.laws.bilateral import Bilateral


def test_one_tangential_direction_solved_as_discs_gives_the_same():
    """A 2D problem embedded in 3D with a second direction in which nothing happens: QP against
    SOCP.
    """
    flat = reduce(scenes.flat_punch(2, elements=5))
    k = flat.contacts
    place = np.arange(3 * k).reshape(k, 3)
    Q, q = np.eye(3 * k) * np.mean(np.diag(flat.Q)), np.zeros((k, 3))
    rows = place[:, :2].ravel()
    Q[np.ix_(rows, rows)] = flat.Q
    q[:, :2] = flat.q
    V = np.zeros((3 * k, 1))
    V[rows] = flat.V
    solid = InterfaceProblem(Q, q, flat.mu, V, flat.s)
    a = solve(flat, tol=1e-10, method="alternating")
    b = solve(solid, tol=1e-10, method="alternating")
    assert a.solved and b.solved
    assert np.allclose(b.reactions[:, :2], a.reactions, atol=1e-8)
    assert np.allclose(b.reactions[:, 2], 0, atol=1e-9)


def test_bilateral_contact_holds_against_pulling():
    base = reduce(scenes.flat_punch(2, elements=5, bilateral=True, mu=0.2))
    pulled = InterfaceProblem(base.Q, base.q, Bilateral(base.mu), base.V, -base.s)
    solution = solve(pulled, tol=1e-10, method="alternating")
    assert solution.solved and solution.reactions[:, 0].sum() == pytest.approx(-100)


def test_dragged_plate_without_friction_is_refused():
    problem = InterfaceProblem(np.eye(2), np.zeros((1, 2)), 0.0, np.eye(2), np.array([-1.0, 0.5]))
    with pytest.raises(InputError, match="needs friction"):
        solve(problem, method="alternating")
