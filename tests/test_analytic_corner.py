import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from contactopt import InputError, Material
from contactopt.analytic import corner, dundurs, edge_stick_threshold

RUBBER = Material(5.0, 0.3)


@pytest.mark.parametrize(
    "mu,exponent",
    [
        (0, 0.774013),
        (0.1, 0.724882),
        (0.2, 0.679924),
        (0.3, 0.637988),
        (0.4, 0.598319),
        (0.5, 0.560389),
    ],
)
def test_square_punch_of_the_same_material(mu, exponent):
    assert corner(RUBBER, RUBBER, mu).exponent == pytest.approx(exponent, abs=1e-6)
    assert corner(Material(70.0, 0.0), Material(70.0, 0.0), mu).exponent == pytest.approx(
        exponent, abs=1e-6
    )


def test_edges_stick_above_the_threshold():
    """Where the slipping corner is as singular as the bonded one; the edge does not slip below its
    ratio q/p.
    """
    bonded = corner(RUBBER, RUBBER, None)
    assert bonded.exponent == pytest.approx(0.544484, abs=1e-6)
    threshold = edge_stick_threshold(RUBBER, RUBBER)
    assert threshold == pytest.approx(0.5431, abs=5e-5)
    assert corner(RUBBER, RUBBER, threshold).exponent == pytest.approx(bonded.exponent, abs=1e-9)
    assert bonded.ratio == pytest.approx(threshold)


@pytest.mark.parametrize("angle", [1.2, 1.5, 1.8])
def test_bonded_bodies_of_one_material_are_a_notch(angle):
    """Williams: sin(lambda angle) = -lambda sin(angle) for the symmetric field, wherever the
    interface lies.
    """
    angle *= np.pi
    notch = brentq(lambda s: np.sin(s * angle) + s * np.sin(angle), 0.4, 0.99)
    for share in (0.2, 0.5, 0.7):
        assert corner(
            RUBBER, RUBBER, None, (share * angle, (1 - share) * angle)
        ).exponent == pytest.approx(notch, abs=1e-9)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_rigid_punch(nu):
    """Frictionless 1/2; sliding 1/2 + atan(mu beta)/pi; bonded 1/2 +- i ln(3 - 4 nu)/(2 pi)."""
    lower, beta = Material(5.0, nu), (1 - 2 * nu) / (2 * (1 - nu))
    assert corner(None, lower).exponent == pytest.approx(0.5, abs=1e-9)
    for mu in (-0.4, 0.3, 1.0):
        found = corner(None, lower, mu)
        assert found.exponent == pytest.approx(0.5 + np.arctan(mu * beta) / np.pi, abs=1e-9)
        assert found.ratio == pytest.approx(mu)
    bonded = corner(None, lower, None)
    assert (bonded.exponent, bonded.oscillation) == pytest.approx(
        (0.5, np.log(3 - 4 * nu) / (2 * np.pi)), abs=1e-9
    )
    assert edge_stick_threshold(None, lower) == np.inf


def test_nearly_rigid_punch_tends_to_the_rigid_one():
    stiff = corner(Material(5e7, 0.2), RUBBER, 0.3)
    assert stiff.exponent == pytest.approx(corner(None, RUBBER, 0.3).exponent, abs=1e-5)


@pytest.mark.parametrize("mu", [0.0, 0.3, -0.2, None])
def test_only_dundurs_constants_count(mu):
    first = Material(12.0, 0.1), Material(5.0, 0.4)

    def same(values):
        return np.array(dundurs(Material(values[0], 0.25), Material(5.0, values[1]))) - dundurs(
            *first
        )

    modulus, nu = fsolve(same, [12.0, 0.4], xtol=1e-13)
    assert 0 < nu < 0.5 and abs(nu - 0.4) > 0.01
    second = Material(modulus, 0.25), Material(5.0, nu)
    one, two = corner(*first, mu), corner(*second, mu)
    assert (one.exponent, one.oscillation) == pytest.approx(
        (two.exponent, two.oscillation), abs=1e-9
    )


def potentials(exponent: float, theta: float, nu: float) -> np.ndarray:
    """(sigma_tt, sigma_rt, u_r, u_t) at r = 1 of a unit shear modulus, for phi = a z^lambda, psi =
    b z^lambda.

    Kolosov and Muskhelishvili: sigma_tt + i sigma_rt = 2 Re phi' + e^(2 i theta) (conj(z) phi'' +
    psi'), 2 (u_r + i u_t) = e^(-i theta) (kappa phi - z conj(phi') - conj(psi)). Columns: real and
    imaginary a, then b.
    """
    kappa, columns = 3 - 4 * nu, []

    def power(p):  # z^p on the ray, beyond the principal branch too
        return np.exp(1j * p * theta)

    for a, b in ((1, 0), (1j, 0), (0, 1), (0, 1j)):
        first = exponent * a * power(exponent - 1)
        second = exponent * (exponent - 1) * a * power(exponent - 2)
        stress = 2 * first.real + power(2) * (
            power(-1) * second + exponent * b * power(exponent - 1)
        )
        moved = (
            (kappa * a * power(exponent) - power(1) * np.conj(first) - np.conj(b * power(exponent)))
            * power(-1)
            / 2
        )
        columns.append([stress.real, stress.imag, moved.real, moved.imag])
    return np.array(columns).T


@pytest.mark.parametrize("mu", [0.0, 0.4, -0.4, None])
def test_no_root_is_missed(mu):
    """Against another formulation, complex potentials: the first sign change of its determinant,
    many materials and angles.
    """
    random, grid = np.random.default_rng(1), np.linspace(0.02, 0.999, 400)
    singular = 0
    for _ in range(25):
        bodies = (
            Material(10 ** random.uniform(-2, 2), random.uniform(0, 0.49)),
            Material(1.0, random.uniform(0, 0.49)),
        )
        angles = tuple(random.uniform(0.3, 6.0, 2))

        def determinant(s, bodies=bodies, angles=angles):
            upper, lower = (potentials(s, 0.0, body.nu) for body in bodies)
            for fields, body in ((upper, bodies[0]), (lower, bodies[1])):
                fields[2:] *= 2 * (1 + body.nu) / body.E
            both, none = np.hstack([upper, -lower]), np.zeros((2, 4))
            free = [
                np.hstack([potentials(s, angles[0], bodies[0].nu)[:2], none]),
                np.hstack([none, potentials(s, -angles[1], bodies[1].nu)[:2]]),
            ]
            meet = (
                both
                if mu is None
                else [*both[:2], both[3], np.append(np.zeros(4), lower[1] - mu * lower[0])]
            )
            return np.linalg.det(np.vstack([*free, meet]))

        signs = np.sign([determinant(s) for s in grid])
        change = np.flatnonzero(signs[1:] != signs[:-1])
        first = brentq(determinant, grid[change[0]], grid[change[0] + 1]) if len(change) else 1.0
        found = corner(*bodies, mu, angles)
        singular += first < 1
        if found.oscillation:
            assert found.exponent <= first
        else:
            assert found.exponent == pytest.approx(first, abs=1e-8)
    assert singular >= 10


def test_symmetric_bodies_are_no_corner():
    """Two half-planes that lie on each other, frictionless: a flat surface, singular as a crack's
    tip.
    """
    assert corner(RUBBER, RUBBER, 0.0, (np.pi, np.pi)).exponent == pytest.approx(0.5, abs=1e-6)
    assert corner(RUBBER, RUBBER, 0.0, (np.pi / 4, np.pi / 4)).exponent == 1


def test_bad_input():
    with pytest.raises(InputError, match="both bodies are rigid"):
        corner(None, None)
    with pytest.raises(InputError, match="angle"):
        corner(RUBBER, RUBBER, 0.0, (0.0, np.pi))
    with pytest.raises(InputError, match="friction"):
        corner(RUBBER, RUBBER, float("nan"))
