import numpy as np
import pytest
from scipy.integrate import quad

from contactopt import Material
from contactopt.analytic import contact_modulus, flat_punch_line, hertz_line, hertz_point

RUBBER = Material(5.0, 0.3)


def test_contact_modulus():
    assert contact_modulus(RUBBER, RUBBER) == pytest.approx(2.7472527, rel=1e-7)
    assert contact_modulus(RUBBER, None) == pytest.approx(5 / (1 - 0.09))


@pytest.mark.parametrize("radius,a,peak,approach", [(50, 11.093, 0.3880, 2.461), (100, 13.976, 0.2444, 1.953)])
def test_hertz_point_published_values(radius, a, peak, approach):
    reference = hertz_point(100.0, radius, contact_modulus(RUBBER, RUBBER))
    assert (reference.half_width, reference.peak, reference.approach) == pytest.approx((a, peak, approach), rel=3e-4)


def test_pressures_carry_the_load():
    point, line, punch = hertz_point(100, 50, 2.7), hertz_line(7, 50, 2.7), flat_punch_line(7, 20)
    a = point.half_width
    assert quad(lambda r: 2 * np.pi * r * point.pressure(np.array(r)), 0, a)[0] == pytest.approx(100)
    b = line.half_width
    assert quad(lambda x: line.pressure(np.array(x)), -b, b)[0] == pytest.approx(7)
    # x = a sin(t) removes the edge singularity
    assert quad(lambda t: punch.pressure(20 * np.sin(t)) * 20 * np.cos(t), -1.57079, 1.57079)[0] == pytest.approx(
        7, rel=1e-4
    )
    assert not np.any(point.pressure(np.array([a * 1.01])))


def test_hertz_line_satisfies_the_half_plane_equation():
    """Independent check: the surface slope under p is x/R inside, -(2/(pi E*)) PV int p/(x-s) ds = -x/R."""
    radius, modulus = 50.0, 2.7
    line = hertz_line(7.0, radius, modulus)
    a = line.half_width
    for x in (0.2 * a, 0.7 * a):
        slope = -2 / (np.pi * modulus) * quad(lambda s: -line.pressure(np.array(s)), -a, a, weight="cauchy", wvar=x)[0]
        assert slope == pytest.approx(-x / radius, rel=1e-6)
