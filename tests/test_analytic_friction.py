"""Coulomb friction between dissimilar materials, against the half-space."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipk
from test_analytic import contact_rule, half_plane, half_space

from contactopt import InputError
from contactopt.analytic import (
    flat_punch_axisymmetric,
    flat_punch_axisymmetric_bonded,
    flat_punch_axisymmetric_friction,
    flat_punch_line,
    flat_punch_line_bonded,
    flat_punch_line_friction,
    hertz_line,
    hertz_line_friction,
    hertz_point,
    hertz_point_friction,
    stick_ratio,
)

RIGID = 2 / 7  # beta of a rigid punch on nu = .3
CASES = [(0.05, RIGID), (0.3, RIGID), (0.3, 0.5), (1.0, 0.5), (2.0, 0.5), (0.1, 0.05), (0.5, -0.2)]


def solutions(mu, beta, round_bodies=False):
    """(plane, axisymmetric) with P = 7, E* = 2.7, a = 20 or R = 50."""
    if round_bodies:
        return hertz_line_friction(7.0, 50.0, 2.7, mu, beta), hertz_point_friction(
            7.0, 50.0, 2.7, mu, beta
        )
    return flat_punch_line_friction(7.0, 20.0, mu, beta), flat_punch_axisymmetric_friction(
        7.0, 20.0, 2.7, mu, beta
    )


@pytest.mark.parametrize(
    "mu,plane,circle,approach",
    [
        (0.1, 0.036448, 0.199827, 0.494878),
        (0.3, 0.689087, 0.895945, 0.488140),
        (0.5, 0.941018, 0.984139, 0.486546),
        (0.7, 0.987064, 0.996659, 0.486210),
    ],
)
def test_values_found_by_other_computations(mu, plane, circle, approach):
    assert stick_ratio(mu, RIGID) == pytest.approx(plane, abs=1e-6)
    assert stick_ratio(mu, RIGID, axisymmetric=True) == pytest.approx(circle, abs=1e-6)
    punch = flat_punch_axisymmetric_friction(3.0, 2.0, 5.0, mu, RIGID)
    assert punch.approach * 5 * 2 / 3 == pytest.approx(approach, abs=1e-6)
    assert punch.stick_half_width == pytest.approx(2 * circle, abs=2e-6)


def test_published_value():
    """Spence (1975): half the radius sticks at mu = .2986, nu = 0."""
    mu = brentq(lambda mu: stick_ratio(mu, 0.5, axisymmetric=True) - 0.5, 0.29, 0.31, xtol=1e-6)
    assert mu == pytest.approx(0.2986, abs=2e-4)


@pytest.mark.parametrize("mu,beta", CASES)
@pytest.mark.parametrize("round_bodies", [False, True])
def test_law_of_friction_and_load(mu, beta, round_bodies):
    for solution, dim in zip(solutions(mu, beta, round_bodies), (2, 3)):
        a, c = solution.half_width, solution.stick_half_width
        x, w = contact_rule(a, 0, c, a)
        p, q = solution.pressure(x), np.sign(beta) * solution.shear(x)
        assert w @ (2 * p if dim == 2 else 2 * np.pi * x * p) == pytest.approx(7, rel=1e-6)
        assert np.all(p >= 0) and np.all(q >= 0)
        assert q[x > c] == pytest.approx(mu * p[x > c], rel=1e-5, abs=1e-7 * p[0])
        assert np.all(q[x < c] < mu * p[x < c] * (1 + 1e-4))
        assert np.all(q[x < 0.8 * c] < 0.97 * mu * p[x < 0.8 * c])  # no slip in the stick zone
        assert solution.pressure(-x) == pytest.approx(p)
        assert solution.shear(-x) == pytest.approx(-np.sign(beta) * q)


@pytest.mark.parametrize("mu,beta", CASES)
def test_punches_satisfy_the_half_space(mu, beta):
    plane, circle = solutions(mu, beta)
    for share in (0.3, 0.95, 1.02, 2.0):
        x = share * plane.stick_half_width
        if x < 20:
            normal, tangential = half_plane(
                plane.pressure, plane.shear, 20.0, x, beta, [plane.stick_half_width]
            )
            mean = 7 / 40
            assert normal == pytest.approx(0, abs=2e-5 * mean)
            if share < 1:
                assert tangential == pytest.approx(0, abs=2e-5 * mean)
            else:
                # the surface slips against the friction
                assert tangential * np.sign(beta) < -1e-4 * mean
        r = share * circle.stick_half_width
        if r < 20:
            normal, tangential = half_space(
                circle.pressure, circle.shear, 20.0, r, beta, [circle.stick_half_width]
            )
            assert 2 / 2.7 * normal == pytest.approx(circle.approach, rel=2e-6)
            assert 2 / 2.7 * tangential / circle.approach * np.sign(beta) == pytest.approx(
                0, abs=1e-6
            ) or (share > 1 and tangential * beta < 0)


@pytest.mark.parametrize("mu,beta", CASES)
def test_round_bodies_satisfy_the_half_space(mu, beta):
    """The strain that a point had when it began to stick stays: u_x ~ x |x| there."""
    line, point = solutions(mu, beta, round_bodies=True)
    strain, stretch = [], []
    for share in (0.3, 0.6, 0.95, 1.1):
        x = share * line.stick_half_width
        if x < line.half_width:
            normal, tangential = half_plane(
                line.pressure, line.shear, line.half_width, x, beta, [line.stick_half_width]
            )
            assert 2 / 2.7 * normal == pytest.approx(
                -x / 50, rel=1e-5, abs=1e-6 * line.half_width / 50
            )
            strain.append(tangential / x)
        r = share * point.stick_half_width
        if r < point.half_width:
            normal, tangential = half_space(
                point.pressure, point.shear, point.half_width, r, beta, [point.stick_half_width]
            )
            assert 2 / 2.7 * normal == pytest.approx(point.approach - r**2 / 100, rel=1e-6)
            stretch.append(tangential / r**2)
    assert strain[:3] == pytest.approx([strain[0]] * 3, rel=1e-4)
    assert stretch[:3] == pytest.approx([stretch[0]] * 3, rel=1e-4)


@pytest.mark.parametrize("ratio", [0.2, 0.4, 0.8, 1.6])
def test_weak_coupling_gives_the_textbook_formulas(ratio):
    """mu/beta fixed, beta to zero: K'(k)/K(k) = beta/mu; ln((1 + k)/(1 - k))/(2 k) = (mu/beta)
    K'(k).
    """
    beta = 1e-3
    plane = brentq(lambda k: ellipk(1 - k**2) / ellipk(k**2) - 1 / ratio, 1e-6, 1 - 1e-9)
    circle = brentq(lambda k: np.arctanh(k) / k - ratio * ellipk(1 - k**2), 1e-6, 1 - 1e-9)
    assert stick_ratio(ratio * beta, beta) == pytest.approx(plane, abs=1e-5)
    assert stick_ratio(ratio * beta, beta, axisymmetric=True) == pytest.approx(circle, abs=1e-5)


def test_strong_friction_gives_the_bonded_punch():
    x = np.linspace(0.1, 19.5, 30)
    beta = 0.1
    for friction, bonded in zip(
        solutions(2.0, beta),
        (
            flat_punch_line_bonded(7.0, 20.0, beta),
            flat_punch_axisymmetric_bonded(7.0, 20.0, 2.7, beta),
        ),
    ):
        assert friction.pressure(x) == pytest.approx(bonded.pressure(x), rel=1e-6)
        assert friction.shear(x) == pytest.approx(bonded.shear(x), rel=5e-5)
        assert friction.approach == (bonded.approach and pytest.approx(bonded.approach, rel=1e-7))


@pytest.mark.parametrize("mu,beta", [(0.3, RIGID), (1.0, 0.5), (0.05, 0.05)])
def test_singularity_of_the_edge(mu, beta):
    """p ~ (a - x)^(atan(mu beta)/pi - 1/2), as Williams' corner of a rigid punch."""
    for punch in solutions(mu, beta):
        room = (20 - punch.stick_half_width) * np.array([1e-4, 1e-5])
        p = punch.pressure(20 - room)
        assert np.log(p[1] / p[0]) / np.log(10) == pytest.approx(
            0.5 - np.arctan(mu * beta) / np.pi, abs=1e-4
        )


def contact_algorithm(mu, beta, elements=400):
    """c/a of the plane punch by constant elements and active sets."""
    edges = np.sin(np.pi / 2 * np.linspace(0, 1, elements + 1))
    x, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)

    def potential(t):
        return t * np.log(np.abs(t)) - t

    right = potential(x[:, None] - edges[:-1]) - potential(x[:, None] - edges[1:])
    left = potential(x[:, None] + edges[1:]) - potential(x[:, None] + edges[:-1])
    even, odd = -(right + left) / np.pi, -(right - left) / np.pi
    # int from 0 to x
    total = np.tril(np.ones((elements, elements)), -1) * width + np.diag(width / 2)
    stick = np.ones(elements, dtype=bool)
    for _ in range(60):
        slip = ~stick
        matrix = np.block(
            [
                [even, beta * total, -np.ones((elements, 1))],
                [-beta * total, odd, np.zeros((elements, 1))],
            ]
        )
        matrix[elements:][slip] = 0
        matrix[elements:, :elements][slip, slip] = -mu
        matrix[elements:, elements : 2 * elements][slip, slip] = 1
        matrix = np.vstack([matrix, np.concatenate([2 * width, np.zeros(elements + 1)])])
        solution = np.linalg.solve(matrix, np.append(np.zeros(2 * elements), 1.0))
        p, q = solution[:elements], solution[elements:-1]
        moved = odd @ q - beta * total @ p
        # slip goes against the friction, inwards
        new = np.where(stick, np.abs(q) <= mu * p, moved > 0)
        if np.array_equal(new, stick):
            return edges[np.argmin(stick)]
        stick = new
    raise AssertionError("the active sets do not settle")


@pytest.mark.parametrize(
    "mu,beta", [(0.2, RIGID), (0.3, RIGID), (0.5, RIGID), (0.4, 0.5), (0.05, 0.05)]
)
def test_stick_zone_of_a_contact_algorithm(mu, beta):
    assert contact_algorithm(mu, beta) == pytest.approx(stick_ratio(mu, beta), abs=0.006)


def test_limits():
    x = np.array([0.0, 5.0, 19.0])
    for beta in (0.0, RIGID):
        plane, circle = solutions(0.0 if beta else 0.4, beta)
        assert plane.pressure(x) == pytest.approx(flat_punch_line(7.0, 20.0).pressure(x))
        assert circle.approach == flat_punch_axisymmetric(7.0, 20.0, 2.7).approach
        assert not np.any(plane.shear(x)) and not np.any(circle.shear(x))
        assert plane.stick_half_width == (0 if beta else 20)
    for axisymmetric in (False, True):
        assert stick_ratio(0.0, RIGID, axisymmetric) == 0
        assert stick_ratio(0.004, 0.5, axisymmetric) == 0
        assert stick_ratio(2.0, 0.01, axisymmetric) == 1
        assert stick_ratio(0.3, -RIGID, axisymmetric) == stick_ratio(0.3, RIGID, axisymmetric)
        values = [stick_ratio(mu, RIGID, axisymmetric) for mu in (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)]
        assert values == sorted(values)
    weak = solutions(0.1, 1e-6, round_bodies=True)
    for solution, exact in zip(weak, (hertz_line(7.0, 50.0, 2.7), hertz_point(7.0, 50.0, 2.7))):
        assert solution.half_width == pytest.approx(exact.half_width, rel=1e-8)
        assert solution.peak == pytest.approx(exact.peak, rel=1e-6)
        s = np.array([0.0, 0.3, 0.9, 1.1]) * exact.half_width
        assert solution.pressure(s) == pytest.approx(exact.pressure(s), abs=1e-6 * exact.peak)


def test_bad_input():
    for mu, beta in [(-0.1, 0.2), (float("nan"), 0.2), (0.1, 1.0), (0.1, float("inf"))]:
        with pytest.raises(InputError):
            stick_ratio(mu, beta)
        with pytest.raises(InputError):
            flat_punch_line_friction(1.0, 1.0, mu, beta)
    for call in (
        lambda: flat_punch_line_friction(0.0, 1.0, 0.3, 0.2),
        lambda: flat_punch_axisymmetric_friction(1.0, -1.0, 1.0, 0.3, 0.2),
        lambda: hertz_line_friction(1.0, 1.0, 0.0, 0.3, 0.2),
        lambda: hertz_point_friction(float("nan"), 1.0, 1.0, 0.3, 0.2),
    ):
        with pytest.raises(InputError):
            call()
