from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.special import ellipe, ellipkm1

from contactopt import InputError, Material
from contactopt.analytic import (
    contact_modulus,
    cycle_loss_line,
    cycle_loss_point,
    dundurs,
    flat_punch_axisymmetric,
    flat_punch_axisymmetric_bonded,
    flat_punch_line,
    flat_punch_line_bonded,
    hertz_line,
    hertz_line_tangential,
    hertz_point,
    hertz_point_tangential,
    tangential_modulus,
)

RUBBER = Material(5.0, 0.3)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


def graded_rule(*breaks):
    """Composite Gauss rule on (breaks[0], breaks[-1]), refined towards every break: for singular
    integrands.
    """
    x, w = [], []
    for low, high in pairwise(breaks):
        cuts = (high - low) / 2 * 0.2 ** np.arange(10)
        edges = np.concatenate([[low], low + cuts[::-1], high - cuts[1:], [high]])
        x.append(
            ((edges[1:] + edges[:-1])[:, None] / 2 + np.diff(edges)[:, None] / 2 * NODES).ravel()
        )
        w.append((np.diff(edges)[:, None] / 2 * WEIGHTS).ravel())
    return np.concatenate(x), np.concatenate(w)


def contact_rule(a, *breaks):
    """Rule on (-a, a) or (0, a) with x = a sin(t), which takes root singularities at the edges
    away.
    """
    t, w = graded_rule(*np.arcsin(np.unique(breaks) / a))
    return np.clip(a * np.sin(t), -a * (1 - 1e-15), a * (1 - 1e-15)), w * a * np.cos(t)


def half_space(pressure, shear, a, r, beta, inner=()):
    """E*/2 (u_z, u_r) at radius r under axisymmetric tractions, by quadrature over rings of load.

    Independent of the product's Abel transforms: Johnson (1985), section 3.7, by elliptic
    integrals.
    """
    s, w = contact_rule(a, 0, *inner, r, a)
    p, q, m = pressure(s), shear(s), np.minimum(4 * r * s / (r + s) ** 2, 1)
    complete = ellipkm1(((r - s) / (r + s)) ** 2)
    normal = w @ (p * s * 2 / np.pi * complete / (r + s)) - beta * w @ np.where(s > r, q, 0)
    ring = (r + s) / (np.pi * r * s) * ((1 - m / 2) * complete - ellipe(m))
    return normal, w @ (q * s * ring) - beta / r * w @ np.where(s < r, p * s, 0)


def half_plane(pressure, shear, a, x, beta, inner=()):
    """E*/2 (u_z', u_x') at x under plane tractions: Johnson (1985), eq (2.25), principal values by
    subtraction.
    """
    s, w = contact_rule(a, -a, 0, *inner, *(-np.array(inner)), x, a)
    p, q = float(pressure(np.array(x))), float(shear(np.array(x)))
    logarithm = np.log((a + x) / (a - x))
    cauchy = [
        (w @ ((f(s) - at) / (x - s)) + at * logarithm) / np.pi
        for f, at in ((pressure, p), (shear, q))
    ]
    return -cauchy[0] + beta * q, -beta * p - cauchy[1]


def test_moduli():
    assert contact_modulus(RUBBER, RUBBER) == pytest.approx(2.7472527, rel=1e-7)
    assert contact_modulus(RUBBER, None) == pytest.approx(5 / (1 - 0.09))
    shear_modulus = 5 / 2.6
    assert tangential_modulus(RUBBER, RUBBER) == pytest.approx(shear_modulus / 3.4)
    assert tangential_modulus(None, RUBBER) == pytest.approx(shear_modulus / 1.7)
    assert dundurs(RUBBER, RUBBER) == (0, 0)
    assert dundurs(None, RUBBER) == pytest.approx((1, 2 / 7))
    steel = Material(210e3, 0.25)
    assert dundurs(steel, RUBBER) == pytest.approx(-np.array(dundurs(RUBBER, steel)))
    # alpha is the relative difference of the plane-strain moduli
    moduli = 5 / (1 - 0.09), 210e3 / (1 - 0.0625)
    assert dundurs(steel, RUBBER)[0] == pytest.approx((moduli[1] - moduli[0]) / sum(moduli))
    for function in (contact_modulus, tangential_modulus, dundurs):
        with pytest.raises(InputError, match="both bodies are rigid"):
            function(None, None)


@pytest.mark.parametrize(
    "radius,a,peak,approach", [(50, 11.093, 0.3880, 2.461), (100, 13.976, 0.2444, 1.953)]
)
def test_hertz_point_published_values(radius, a, peak, approach):
    reference = hertz_point(100.0, radius, contact_modulus(RUBBER, RUBBER))
    assert (reference.half_width, reference.peak, reference.approach) == pytest.approx(
        (a, peak, approach), rel=3e-4
    )


def test_pressures_carry_the_load():
    for reference in (
        hertz_line(7, 50, 2.7),
        flat_punch_line(7, 20),
        flat_punch_line_bonded(7, 20, 2 / 7),
    ):
        a = reference.half_width
        x, w = contact_rule(a, -a, a)
        assert w @ reference.pressure(x) == pytest.approx(7, rel=1e-7)
    for reference in (
        hertz_point(7, 50, 2.7),
        flat_punch_axisymmetric(7, 20, 2.7),
        flat_punch_axisymmetric_bonded(7, 20, 2.7, 0.5),
    ):
        a = reference.half_width
        r, w = contact_rule(a, 0, a)
        assert w @ (2 * np.pi * r * reference.pressure(r)) == pytest.approx(7, rel=1e-7)
    assert hertz_point(7, 50, 2.7).pressure(np.array([1e3])) == 0
    assert np.isnan(flat_punch_line(7, 20).pressure(np.array([20.0, 21.0]))).all()


def test_hertz_satisfies_the_half_space():
    zero = np.zeros_like
    line, point = hertz_line(7.0, 50.0, 2.7), hertz_point(7.0, 50.0, 2.7)
    for share in (0.2, 0.7, 0.99):
        x = share * line.half_width
        slope = half_plane(line.pressure, zero, line.half_width, x, 0.0)[0]
        assert 2 / 2.7 * slope == pytest.approx(-x / 50, rel=1e-8)
        r = share * point.half_width
        depth = 2 / 2.7 * half_space(point.pressure, zero, point.half_width, r, 0.0)[0]
        assert depth == pytest.approx(point.approach - r**2 / 100, rel=1e-8)


@pytest.mark.parametrize("beta", [0.0, 2 / 7, 0.5, -0.3])
def test_bonded_punches_satisfy_the_half_space(beta):
    line = flat_punch_line_bonded(7.0, 20.0, beta)
    point = flat_punch_axisymmetric_bonded(7.0, 20.0, 2.7, beta)
    for x in (1.0, 9.0, 19.0):
        assert half_plane(line.pressure, line.shear, 20.0, x, beta) == pytest.approx(
            (0, 0), abs=1e-6
        )
        normal, tangential = half_space(point.pressure, point.shear, 20.0, x, beta)
        assert (2 / 2.7 * normal, tangential) == pytest.approx(
            (point.approach, 0), rel=1e-6, abs=1e-6
        )
        assert line.shear(np.array(-x)) == -line.shear(np.array(x))


def test_bonded_stiffness_and_frictionless_limit():
    ratio = (
        flat_punch_axisymmetric(7, 20, 2.7).approach
        / flat_punch_axisymmetric_bonded(7, 20, 2.7, 2 / 7).approach
    )
    assert ratio == pytest.approx(0.7 * np.log(1.8) / 0.4, rel=1e-12)
    assert ratio == pytest.approx(1.028627, abs=1e-6)
    r = np.array([0.0, 3.0, 19.9])
    for free, bonded in (
        (flat_punch_line(7, 20), flat_punch_line_bonded(7, 20, 0.0)),
        (flat_punch_axisymmetric(7, 20, 2.7), flat_punch_axisymmetric_bonded(7, 20, 2.7, 0.0)),
    ):
        assert bonded.pressure(r) == pytest.approx(free.pressure(r), rel=1e-12)
        assert not np.any(bonded.shear(r))


# Cattaneo-Mindlin
P, R, E, GS, MU = 7.0, 50.0, 2.7, 0.6, 0.4
LIMIT = MU * P
HISTORIES = [
    [0.6],
    [0.9, 0.1],
    [0.8, -0.5, 0.3],
    [0.7, -0.7],
    [-0.4, 0.2],
    [0.5, 0.2, 0.4, -0.1, 0.95],
]


def line(shares):
    return hertz_line_tangential(P, R, E, MU, [s * LIMIT for s in shares])


def point(shares):
    return hertz_point_tangential(P, R, E, GS, MU, [s * LIMIT for s in shares])


def zones(shares):
    """Stick half-widths of all the loadings so far, where the traction has kinks."""
    return [line(shares[: i + 1]).stick_half_width for i in range(len(shares))]


@pytest.mark.parametrize("shares", HISTORIES)
def test_tangential_traction(shares):
    """It carries the load, obeys Coulomb, and shifts the centre as Cerruti's solution says."""
    plane, sphere = line(shares), point(shares)
    a = plane.half_width
    x, w = contact_rule(a, 0, *zones(shares), a)
    q = plane.shear(x)
    assert 2 * w @ q == pytest.approx(shares[-1] * LIMIT, rel=1e-8)
    assert np.all(np.abs(q) <= MU * plane.pressure(x) * (1 + 1e-12))
    # less the full stick, T / (pi sqrt(a^2 - x^2))
    excess = -2 / (np.pi * E) * 2 * w @ (q * np.log(2 * x / a))
    assert plane.shift == pytest.approx(excess, rel=1e-6)

    a = sphere.half_width
    cuts = [point(shares[: i + 1]).stick_half_width for i in range(len(shares))]
    r, w = contact_rule(a, 0, *cuts, a)
    q = sphere.shear(r)
    assert w @ (2 * np.pi * r * q) == pytest.approx(shares[-1] * LIMIT, rel=1e-8)
    assert np.all(np.abs(q) <= MU * sphere.pressure(r) * (1 + 1e-12))
    assert sphere.shift == pytest.approx(w @ q / (2 * GS), rel=1e-8)


def test_no_slip_inside_the_stick_zone():
    """After every reversal the tangential strain inside the stick zone is what it was before."""
    history = [0.9, -0.3, 0.5]
    for i in range(3):
        now, before = line(history[: i + 1]), line(history[:i] or [0.0])
        assert now.stick_half_width == pytest.approx(
            now.half_width * np.sqrt(1 - [0.9, 0.6, 0.4][i]), rel=1e-12
        )
        for share in (0.1, 0.8):
            x, kinks = share * now.stick_half_width, zones(history)
            strain = [
                half_plane(np.zeros_like, f.shear, f.half_width, x, 0.0, kinks)[1]
                for f in (now, before)
            ]
            assert strain[0] == pytest.approx(strain[1], abs=1e-8)


def test_closed_loops_leave_no_trace():
    x = np.linspace(0, line([0.1]).half_width, 40)
    for long, short in [
        ([0.3, 0.6], [0.6]),
        ([0.8, -0.2, 0.1, -0.2, 0.5], [0.8, -0.2, 0.5]),
        ([0.8, 0.2, 0.5, 0.3, 0.5, 0.9], [0.9]),
        ([0.8, -0.8, 0.8], [0.8]),
        ([0.6, -0.7], [-0.7]),
    ]:
        assert line(long).shear(x) == pytest.approx(line(short).shear(x), abs=1e-14)
        assert point(long).shift == pytest.approx(point(short).shift)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 1.0])
def test_cycle_loss_is_the_area_of_the_loop(share):
    t = np.linspace(0, np.pi, 2001)
    loads = share * np.cos(t)
    for solution, loss in (
        (line, cycle_loss_line(P, E, MU, share * LIMIT)),
        (point, cycle_loss_point(P, R, E, GS, MU, share * LIMIT)),
    ):
        shift = np.array([solution([share, load]).shift for load in loads])
        area = 2 * trapezoid(loads * LIMIT, shift)  # the way back is its mirror image
        assert area == pytest.approx(loss, rel=2e-5)


def test_cycle_loss_of_cylinders_is_the_work_of_friction():
    """4 int mu p s dx with the slip s of the first loading."""
    share = 0.7
    first = line([share])
    a, c = first.half_width, first.stick_half_width
    x = np.linspace(c, a, 400)[1:-1]
    strain = [2 / E * half_plane(np.zeros_like, first.shear, a, s, 0.0, [c])[1] for s in x]
    slip = np.concatenate(
        [[0.0], np.cumsum((np.array(strain)[1:] + np.array(strain)[:-1]) / 2 * np.diff(x))]
    )
    work = 4 * 2 * trapezoid(MU * first.pressure(x) * np.abs(slip), x)
    assert work == pytest.approx(cycle_loss_line(P, E, MU, share * LIMIT), rel=2e-3)


def test_unit_systems():
    """Lengths times 1e3, forces times 7: stresses scale with force over area."""
    one = hertz_point_tangential(P, R, E, GS, MU, 1.0)
    two = hertz_point_tangential(7 * P, 1e3 * R, 7e-6 * E, 7e-6 * GS, MU, 7.0)
    assert two.shift == pytest.approx(1e3 * one.shift)
    assert two.shear(np.array([1e3])) == pytest.approx(7e-6 * one.shear(np.array([1.0])))


def test_bad_input():
    with pytest.raises(InputError, match="slide"):
        hertz_line_tangential(P, R, E, MU, 1.01 * LIMIT)
    with pytest.raises(InputError, match="slide"):
        cycle_loss_point(P, R, E, GS, MU, 1.01 * LIMIT)
    with pytest.raises(InputError, match="slide"):
        hertz_point_tangential(P, R, E, GS, MU, float("nan"))
    for call in (
        lambda: hertz_point(-1, 2, 3),
        lambda: hertz_line(1, 0, 3),
        lambda: flat_punch_line(1, float("inf")),
        lambda: flat_punch_line_bonded(1, 1, 1.0),
        lambda: flat_punch_axisymmetric_bonded(1, 1, 1, float("nan")),
        lambda: hertz_line_tangential(P, R, E, 0.0, 0.1),
    ):
        with pytest.raises(InputError):
            call()
