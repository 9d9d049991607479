import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactopt.problem.cones import coulomb_cone, disc, disc_derivative, half_line_derivative

number = st.floats(-10, 10)


@given(st.lists(st.tuples(number, number, number), min_size=1, max_size=5), st.floats(0, 3))
def test_coulomb_cone_projection_is_characterised_by_moreau(points, mu):
    """Moreau: x = P(x) - (P(x) - x), P(x) in the cone, P(x) - x in its dual, orthogonal."""
    x = np.array(points)
    p = coulomb_cone(x, np.full(len(x), mu))
    rest = p - x
    tol = 1e-9 * (1 + np.abs(x).max())
    assert np.all(np.linalg.norm(p[:, 1:], axis=1) <= mu * p[:, 0] + tol)
    assert np.all(mu * np.linalg.norm(rest[:, 1:], axis=1) <= rest[:, 0] + tol)
    assert np.allclose(np.sum(p * rest, axis=1), 0, atol=20 * tol)


def test_without_friction_only_pressure_is_left():
    points = np.array([[-1.0, 0.0], [-1.0, 2.0], [0.0, -1.0], [3.0, 1.0]])
    assert np.array_equal(coulomb_cone(points, np.zeros(4)), [[0, 0], [0, 0], [0, 0], [3, 0]])


def test_disc_of_radius_zero_and_one_dimension():
    assert np.array_equal(disc(np.array([[3.0, 4.0]]), np.array([0.0])), [[0.0, 0.0]])
    assert np.array_equal(disc(np.array([[-3.0], [0.5]]), np.array([1.0, 1.0])), [[-1.0], [0.5]])


@pytest.mark.parametrize("d", [1, 2])
def test_disc_derivative_is_the_difference_quotient(d):
    rng = np.random.default_rng(1)
    y, radius = rng.normal(size=(40, d)), rng.uniform(0, 1.5, 40)
    _, D = disc_derivative(y, radius)
    for j in range(d):
        step = 1e-7 * np.eye(d)[j]
        quotient = (disc(y + step, radius) - disc(y - step, radius)) / 2e-7
        assert np.allclose(D[:, :, j], quotient, atol=1e-6)


def test_half_line_derivative():
    value, D = half_line_derivative(np.array([[-1.0], [2.0]]))
    assert np.array_equal(value, [[0.0], [2.0]])
    assert np.array_equal(D, [[[0.0]], [[1.0]]])
