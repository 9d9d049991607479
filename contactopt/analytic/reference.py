"""What exact solutions share: the record of one, and the elastic constants of two bodies."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contactopt.checks import check_number
from contactopt.errors import InputError
from contactopt.material import Material

Field = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Reference:
    """What a scene is compared with.

    pressure    position from the centre (k,) [length] -> contact pressure (k,) [stress]; nan under
                a punch's edge and beyond, where it is infinite or there is no contact
    half_width  of the contact zone [length]
    peak        largest pressure [stress], None where it is infinite
    approach    of the two bodies [length], None where it depends on their size
    shear       like pressure: traction on the lower body [stress]. Under normal load it points away
                from the centre (positive at x > 0), under a tangential load in the direction of
                that load. None: there is none
    stick_half_width  of the zone without slip [length], None: no friction
    shift       of the two bodies along a tangential load [length], None without one
    """

    label: str
    pressure: Field
    half_width: float
    peak: float | None = None
    approach: float | None = None
    shear: Field | None = None
    stick_half_width: float | None = None
    shift: float | None = None


def contact_modulus(first: Material | None, second: Material | None = None) -> float:
    """The contact modulus E* with 1 / E* = (1 - nu1^2) / E1 + (1 - nu2^2) / E2.

    Source: Johnson (1985), Contact Mechanics, section 4.2.

    Parameters
    ----------
    first, second : Materials of the two bodies; None is a rigid body.

    Returns
    -------
    E* [stress].
    """
    return 1 / sum((1 - m.nu**2) / m.E for m in _elastic(first, second))


def tangential_modulus(first: Material | None, second: Material | None = None) -> float:
    """The tangential modulus Gs with 1 / Gs = (2 - nu1) / G1 + (2 - nu2) / G2.

    A circular contact of radius a without slip has the tangential stiffness 8 a Gs. Source: Johnson
    (1985), Contact Mechanics, section 7.2.

    Parameters
    ----------
    first, second : Materials of the two bodies; None is a rigid body.

    Returns
    -------
    Gs [stress].
    """
    return 1 / sum((2 - m.nu) * 2 * (1 + m.nu) / m.E for m in _elastic(first, second))


def dundurs(upper: Material | None, lower: Material | None) -> tuple[float, float]:
    """Dundurs' constants of two bodies in plane strain.

    With A = (1 - nu) / G and B = (1 - 2 nu) / (2 G) of the upper body (1) and the lower body (2)
    they are alpha = (A2 - A1) / (A2 + A1) and beta = (B2 - B1) / (A2 + A1). Both are zero for equal
    materials and positive where the upper body is the stiffer. A rigid upper body, such as a punch,
    has alpha = 1 and beta = (1 - 2 nu) / (2 (1 - nu)). |alpha| <= 1, and |beta| <= 1/2 for nu >= 0.
    Source: Dundurs (1969), J. Appl. Mech. 36, 650-652. Johnson (1985), section 5.1, has beta with
    the opposite sign.

    Parameters
    ----------
    upper, lower : Materials; None is a rigid body.

    Returns
    -------
    alpha and beta [-].
    """
    _elastic(upper, lower)
    compliance = [0.0 if m is None else 2 * (1 + m.nu) / m.E for m in (upper, lower)]
    nu = [0.0 if m is None else m.nu for m in (upper, lower)]
    A1, A2 = ((1 - n) * c for n, c in zip(nu, compliance))
    B1, B2 = ((0.5 - n) * c for n, c in zip(nu, compliance))
    return (A2 - A1) / (A2 + A1), (B2 - B1) / (A2 + A1)


def ellipse(x: np.ndarray, a: float, peak: float) -> np.ndarray:
    """The half ellipse peak sqrt(1 - x^2 / a^2) at places (n,), and zero for |x| >= a."""
    return np.asarray(peak * np.sqrt(np.maximum(0.0, 1 - np.square(np.asarray(x) / a))))


def check_beta(beta: float) -> None:
    """InputError unless Dundurs' constant beta [-] is less than one in size, as it always is."""
    check_number("Dundurs' constant beta", beta, low=-1.0, high=1.0)


def _elastic(first: Material | None, second: Material | None) -> list[Material]:
    bodies = [m for m in (first, second) if m is not None]
    if not bodies:
        raise InputError("both bodies are rigid; at least one must be elastic.")
    return bodies
