"""Coulomb friction under growing load between dissimilar materials: flat punches and Hertz."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from contactopt.analytic.normal import (
    flat_punch_axisymmetric,
    flat_punch_line,
    hertz_line,
    hertz_point,
    under_punch,
)
from contactopt.analytic.panels import ODD
from contactopt.analytic.reference import Field, Reference, check_beta
from contactopt.analytic.spence import UnitPunch, unit_punch
from contactopt.checks import check_number, check_positive


def flat_punch_line_friction(
    force_per_length: float, half_width: float, mu: float, beta: float
) -> Reference:
    """A rigid flat punch pressed on a half-plane with Coulomb friction, from zero load.

    The fully coupled equations and their sources stand in contactopt.analytic.spence. The stick
    ratio c / a is right to 1e-6, and the tractions to 1e-5 of themselves. At the edges they grow
    like (a - |x|)^(atan(mu |beta|) / pi - 1/2).

    Parameters
    ----------
    force_per_length, half_width : As for flat_punch_line().
    mu, beta : Friction coefficient, at least 0, and Dundurs' constant as in dundurs() [-].

    Returns
    -------
    Pressure and shear traction, half-width of contact and stick.
    """
    if not _slips(mu, beta):
        return _without_slip(flat_punch_line(force_per_length, half_width), mu)
    check_positive(force_per_length=force_per_length, half_width=half_width)
    punch = unit_punch(mu, abs(beta), False)
    return _flat_punch(punch, force_per_length, half_width, 1, beta, None)


def flat_punch_axisymmetric_friction(
    force: float, radius: float, modulus: float, mu: float, beta: float
) -> Reference:
    """A rigid circular flat punch pressed on a half-space with Coulomb friction, from zero load.

    The accuracy is that of flat_punch_line_friction().

    Parameters
    ----------
    force, radius, modulus : As for flat_punch_axisymmetric().
    mu, beta : Friction coefficient, at least 0, and Dundurs' constant as in dundurs() [-].

    Returns
    -------
    Pressure and shear traction, half-width of contact and stick, and approach.
    """
    if not _slips(mu, beta):
        return _without_slip(flat_punch_axisymmetric(force, radius, modulus), mu)
    check_positive(force=force, radius=radius, modulus=modulus)
    punch = unit_punch(mu, abs(beta), True)
    return _flat_punch(punch, force, radius, 2, beta, punch.approach * force / (radius * modulus))


def hertz_line_friction(
    force_per_length: float, radius: float, modulus: float, mu: float, beta: float
) -> Reference:
    """A cylinder on a half-plane of another material with Coulomb friction, under a load that never
    fell.

    While the load grows by dP the contact is that of a rigid flat punch of its present half-width
    a. The tractions are therefore an integral over those of growing punches, with their ratio c /
    a, and a follows from the slope -x / R of the surface. This holds for a much smaller than R.
    Source: Spence (1975), J. Elasticity 5, 297-319.

    Parameters
    ----------
    force_per_length, radius, modulus : As for hertz_line().
    mu, beta : Friction coefficient, at least 0, and Dundurs' constant as in dundurs() [-].

    Returns
    -------
    Pressure and shear traction, half-width of contact and stick.
    """
    if not _slips(mu, beta):
        return _without_slip(hertz_line(force_per_length, radius, modulus), mu)
    check_positive(force_per_length=force_per_length, radius=radius, modulus=modulus)
    punch = unit_punch(mu, abs(beta), False)
    v, weights = punch.panels.v, punch.panels.weights
    # slope of the gap x/R = 2 kappa x J / E* for P = kappa a^2 / 2 with J = int_1^inf H p(t) / t^2
    # dt of the unit punch
    slope = 2 / np.pi * weights @ (punch.p * _log_cosh(v) * np.cosh(v) / np.sinh(v) ** 2)
    a = float(np.sqrt(4 * force_per_length * radius * slope / modulus))
    return _round(punch, 2 * force_per_length / a, a, beta, None)


def hertz_point_friction(
    force: float, radius: float, modulus: float, mu: float, beta: float
) -> Reference:
    """A sphere on a half-space of another material with Coulomb friction, under a load that never
    fell.

    As in hertz_line_friction(), the tractions are an integral over those of growing flat punches,
    where dP / da is proportional to a^2. The contact radius and the approach follow from the depth
    of the surface, approach - r^2 / (2 R).

    Parameters
    ----------
    force, radius, modulus : As for hertz_point().
    mu, beta : Friction coefficient, at least 0, and Dundurs' constant as in dundurs() [-].

    Returns
    -------
    Pressure and shear traction, half-width of contact and stick, and approach.
    """
    if not _slips(mu, beta):
        return _without_slip(hertz_point(force, radius, modulus), mu)
    check_positive(force=force, radius=radius, modulus=modulus)
    punch = unit_punch(mu, abs(beta), True)
    v, weights = punch.panels.v, punch.panels.weights
    s = np.tanh(v)
    # displacement outside a unit punch, beta H Q, over that below it, integrated with t^-3 from 1
    # to infinity
    moment = (2 * _log_cosh(v) - s**2) / (2 * s**3) / np.cosh(v) ** 2
    outside = weights @ ((punch.panels.abel(ODD) @ punch.q) * moment)
    curvature = 1 - 8 * abs(beta) / (np.pi * punch.approach) * outside
    a = float((1.5 * punch.approach * force * radius * curvature / modulus) ** (1 / 3))
    return _round(punch, 3 * force / a**2, a, beta, a**2 / (radius * curvature))


def _slips(mu: float, beta: float) -> bool:
    check_number("the friction coefficient mu", mu, low=0.0, closed=True)
    check_beta(beta)
    return mu > 0 and beta != 0


def _without_slip(frictionless: Reference, mu: float) -> Reference:
    """The same pressure without shear: mu = 0, or sticking because the surfaces move alike."""
    return replace(
        frictionless,
        shear=lambda x: 0 * frictionless.pressure(x),
        stick_half_width=frictionless.half_width if mu > 0 else 0.0,
    )


def _flat_punch(
    punch: UnitPunch, force: float, a: float, power: int, beta: float, approach: float | None
) -> Reference:
    sign = np.sign(beta)
    return Reference(
        "rigid punch, Coulomb friction",
        under_punch(lambda v: force * punch.pressure(v), a, power),
        a,
        approach=approach,
        shear=under_punch(lambda v: sign * force * punch.shear(v), a, power, odd=True),
        stick_half_width=a * punch.stick_ratio,
    )


def _round(
    punch: UnitPunch, size: float, a: float, beta: float, approach: float | None
) -> Reference:
    def grown(part: Callable[[np.ndarray, np.ndarray], np.ndarray], odd: bool) -> Field:
        def field(x: np.ndarray) -> np.ndarray:
            x = np.asarray(x, dtype=float)
            s = np.minimum(np.abs(x) / a, 1 - 1e-15)
            # -1e-9 at the very edge
            value = size * np.maximum(part(s, np.log1p(2 * s / (1 - s)) / 2), 0.0)
            return np.where(np.abs(x) < a, np.sign(beta * x) * value if odd else value, 0.0)

        return field

    return Reference(
        "Hertz geometry, Coulomb friction",
        grown(punch.grown_pressure, odd=False),
        a,
        size * punch.centre[0],
        approach,
        grown(punch.grown_shear, odd=True),
        a * punch.stick_ratio,
    )


def _log_cosh(v: np.ndarray) -> np.ndarray:
    return np.log1p(np.sinh(v) ** 2) / 2
