"""Closed forms under normal load: Hertz, and the rigid flat punch without friction and bonded."""

import numpy as np

from contactopt.analytic.reference import Field, Reference, check_beta, ellipse
from contactopt.checks import check_positive


def hertz_point(force: float, radius: float, modulus: float) -> Reference:
    """A sphere pressed on a half-space (Hertz).

    The contact radius has a^3 = 3 P R / (4 E*). The pressure is p0 sqrt(1 - r^2 / a^2) with p0 = 3
    P / (2 pi a^2), and the approach of distant points is a^2 / R. This holds for a much smaller
    than R, without friction or between similar materials (beta = 0). Source: Johnson (1985),
    Contact Mechanics, section 4.2(a).

    Parameters
    ----------
    force : Normal force, positive in compression [force].
    radius : R of the round body; of two, 1 / R is the sum of curvatures [length].
    modulus : Contact modulus E* as in contact_modulus() [stress].

    Returns
    -------
    Pressure over the radius, contact radius, peak and approach.
    """
    check_positive(force=force, radius=radius, modulus=modulus)
    a = (3 * force * radius / (4 * modulus)) ** (1 / 3)
    peak = 3 * force / (2 * np.pi * a**2)
    return Reference("Hertz", lambda x: ellipse(x, a, peak), a, peak, a**2 / radius)


def hertz_line(force_per_length: float, radius: float, modulus: float) -> Reference:
    """A cylinder pressed on a half-plane (Hertz).

    The contact half-width has a^2 = 4 P R / (pi E*). The pressure is p0 sqrt(1 - x^2 / a^2) with p0
    = 2 P / (pi a). There is no approach, which depends on the size of the bodies. The solution is
    valid where that of hertz_point() is. Source: Johnson (1985), Contact Mechanics, section 4.2(c).

    Parameters
    ----------
    force_per_length : Normal force P, positive in compression [force / length].
    radius : R of the round body; of two, 1 / R is the sum of curvatures [length].
    modulus : Contact modulus E* as in contact_modulus() [stress].

    Returns
    -------
    Pressure over the place, half-width and peak.
    """
    check_positive(force_per_length=force_per_length, radius=radius, modulus=modulus)
    a = float(np.sqrt(4 * force_per_length * radius / (np.pi * modulus)))
    peak = 2 * force_per_length / (np.pi * a)
    return Reference("Hertz", lambda x: ellipse(x, a, peak), a, peak)


def flat_punch_line(force_per_length: float, half_width: float) -> Reference:
    """A rigid flat punch on a half-plane without friction:  p = P / (pi sqrt(a^2 - x^2)).

    Source: Johnson (1985), Contact Mechanics, section 2.8(a).

    Parameters
    ----------
    force_per_length : Normal force P, positive in compression [force / length].
    half_width : Half-width a of the punch [length].

    Returns
    -------
    Pressure over the place, and the half-width.
    """
    check_positive(force_per_length=force_per_length, half_width=half_width)
    pressure = under_punch(lambda u: force_per_length / np.pi + 0 * u, half_width, 1)
    return Reference("rigid punch, frictionless", pressure, half_width)


def flat_punch_axisymmetric(force: float, radius: float, modulus: float) -> Reference:
    """A rigid circular flat punch on a half-space without friction:  p = P / (2 pi a sqrt(a^2 -
    r^2)).

    The approach is P / (2 a E*). Source: Johnson (1985), Contact Mechanics, section 3.4.

    Parameters
    ----------
    force : Normal force, positive in compression [force].
    radius : Radius a of the punch [length].
    modulus : Contact modulus E* as in contact_modulus() [stress].

    Returns
    -------
    Pressure over the radius, contact radius and approach.
    """
    check_positive(force=force, radius=radius, modulus=modulus)
    pressure = under_punch(lambda u: force / (2 * np.pi) + 0 * u, radius, 2)
    return Reference(
        "rigid punch, frictionless", pressure, radius, approach=force / (2 * radius * modulus)
    )


def flat_punch_line_bonded(force_per_length: float, half_width: float, beta: float) -> Reference:
    """A rigid flat punch bonded to a half-plane:  p + i q = P / (pi sqrt((1 - beta^2) (a^2 - x^2)))
    e^(2 i eta u).

    Here u = artanh(x / a) and eta = artanh(beta) / pi; on a half-plane of Poisson's ratio nu, eta =
    ln(3 - 4 nu) / (2 pi). The solution is exact for the linear problem. Its tractions change sign
    without end within about 2 a e^(-pi / (2 eta)) of the edges. Source: Johnson (1985), Contact
    Mechanics, section 2.8(b).

    Parameters
    ----------
    force_per_length, half_width : As for flat_punch_line().
    beta : Dundurs' constant as in dundurs(), of size below one [-].

    Returns
    -------
    Pressure and shear traction over the place, and the half-width.
    """
    check_positive(force_per_length=force_per_length, half_width=half_width)
    check_beta(beta)
    eta, size = np.arctanh(beta) / np.pi, force_per_length / (np.pi * np.sqrt(1 - beta**2))
    return Reference(
        "rigid punch, bonded",
        under_punch(lambda u: size * np.cos(2 * eta * u), half_width, 1),
        half_width,
        shear=under_punch(lambda u: size * np.sin(2 * eta * u), half_width, 1, odd=True),
        stick_half_width=half_width,
    )


def flat_punch_axisymmetric_bonded(
    force: float, radius: float, modulus: float, beta: float
) -> Reference:
    """A rigid circular flat punch bonded to a half-space:  approach (P / (2 a E*)) beta /
    artanh(beta).

    The Abel transforms of the tractions, with u = artanh(t / a), D = E* approach / 2 and
    eta = artanh(beta) / pi, are
        P(t) = int_t^a r p / sqrt(r^2 - t^2) dr,   Q(t) = t int_t^a q / sqrt(r^2 - t^2) dr,
        P + i Q = D cosh(pi eta) e^(2 i eta u).
    The stiffness over that without friction is (1 - nu) ln(3 - 4 nu) / (1 - 2 nu). At the edges the
    tractions behave as in flat_punch_line_bonded(). Sources: Mossakovskii (1954), PMM 18, 187-196;
    Spence (1968), Proc. R. Soc. A 305, 55-80.

    Parameters
    ----------
    force, radius, modulus : As for flat_punch_axisymmetric().
    beta : Dundurs' constant as in dundurs(), of size below one [-].

    Returns
    -------
    Pressure and shear traction over the radius, contact radius and approach.
    """
    check_positive(force=force, radius=radius, modulus=modulus)
    check_beta(beta)
    eta = float(np.arctanh(beta)) / np.pi
    relative = beta / np.arctanh(beta) if beta else 1.0
    size = force * relative / (2 * np.pi * np.sqrt(1 - beta**2))
    return Reference(
        "rigid punch, bonded",
        under_punch(lambda u: size * _bonded_pressure(u, eta), radius, 2),
        radius,
        approach=force * relative / (2 * radius * modulus),
        shear=under_punch(lambda u: size * _bonded_shear(u, eta), radius, 2, odd=True),
        stick_half_width=radius,
    )


def under_punch(value: Field, a: float, power: int, odd: bool = False) -> Field:
    """The traction under a punch of half-width a from its bounded factor, a function of u:
    value(u) / (a^(power - 1) sqrt(a^2 - x^2)) with u = artanh(|x| / a), and nan where |x| >= a.

    power  of 1 / length that the traction has: 1 for a line, 2 for a disc
    odd    whether it is odd in x: it is multiplied by the sign of x then
    """

    def field(x: np.ndarray) -> np.ndarray:
        x = np.asarray(x, dtype=float)
        inside = np.abs(x) < a
        s = np.where(inside, np.abs(x), 0.0)
        size = value(np.log1p(2 * s / (a - s)) / 2) / (
            a ** (power - 1) * np.sqrt((a - s) * (a + s))
        )
        return np.where(inside, size * np.sign(x) if odd else size, np.nan)

    return field


# The inverse Abel transform of cos(2 eta v) over a line that oscillates without end: the part that
# the kernel has at infinity, cosh(u), is integrated in the mean (Abel's sum), what remains decays.
# With sinh^2 v = sinh^2 u + w^2 and w = y cosh u the rest is analytic in y up to i.
def _bonded_pressure(u: np.ndarray, eta: float) -> np.ndarray:
    """p sqrt(a^2 - r^2) over that of the frictionless punch and D cosh(pi eta) [-]."""
    rest = _decaying_part(u, lambda v: 2 * eta * np.sin(2 * eta * v) / np.sinh(v))
    return np.cos(2 * eta * u) + rest


def _bonded_shear(u: np.ndarray, eta: float) -> np.ndarray:
    def slope(v: np.ndarray) -> np.ndarray:  # of sin(2 eta v) / tanh(v)
        return (
            2 * eta * np.cos(2 * eta * v) / np.tanh(v) - np.sin(2 * eta * v) / np.sinh(v) ** 2
        ) / np.sinh(v)

    return np.sin(2 * eta * u) - np.tanh(u) * _decaying_part(u, slope)


def _decaying_part(u: np.ndarray, value: Field) -> np.ndarray:
    """int_u^inf value(v) sinh(v) (sqrt-kernel less its limit) dv / cosh(u)."""
    nodes, weights = np.polynomial.legendre.leggauss(80)
    y, dy = (1 + nodes) / (1 - nodes), 2 * weights / (1 - nodes) ** 2
    cosh = np.cosh(u)[..., None]
    v = np.arcsinh(np.hypot(np.sinh(u)[..., None], y * cosh))
    return np.asarray(
        np.sum(dy * value(v) * cosh**3 / (np.cosh(v) * (np.cosh(v) + y * cosh)), axis=-1)
    )
