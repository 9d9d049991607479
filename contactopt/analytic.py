"""Exact solutions of contact mechanics, in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contactopt.scene import Material


@dataclass(frozen=True)
class Reference:
    """What a scene is compared with.

    pressure    position from the centre (k,) [length] -> contact pressure (k,) [stress]
    half_width  of the contact zone [length]
    approach    of the two bodies [length], None where it depends on their size
    peak        largest pressure [stress], None where it is infinite
    """

    label: str
    pressure: Callable[[np.ndarray], np.ndarray]
    half_width: float
    peak: float | None = None
    approach: float | None = None


def contact_modulus(first: Material | None, second: Material | None = None) -> float:
    """E* with 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2 [stress]; None is a rigid body."""
    return 1 / sum((1 - m.nu**2) / m.E for m in (first, second) if m is not None)


def hertz_point(force: float, radius: float, modulus: float) -> Reference:
    """Sphere of that radius on a half-space: a^3 = 3 P R / (4 E*), p = p0 sqrt(1 - r^2/a^2), approach a^2 / R.

    Frictionless, or with friction between similar materials; valid for a << R. Source: Johnson (1985), Contact
    Mechanics, section 4.2.
    """
    a = (3 * force * radius / (4 * modulus)) ** (1 / 3)
    peak = 3 * force / (2 * np.pi * a**2)
    return Reference("Hertz", lambda x: _ellipse(x, a, peak), a, peak, a**2 / radius)


def hertz_line(force_per_length: float, radius: float, modulus: float) -> Reference:
    """Cylinder on a half-plane: a^2 = 4 P R / (pi E*), p = p0 sqrt(1 - x^2/a^2); the approach depends on the bodies.

    Validity as for hertz_point. Source: Johnson (1985), Contact Mechanics, section 4.2(c).
    """
    a = float(np.sqrt(4 * force_per_length * radius / (np.pi * modulus)))
    peak = 2 * force_per_length / (np.pi * a)
    return Reference("Hertz", lambda x: _ellipse(x, a, peak), a, peak)


def flat_punch_line(force_per_length: float, half_width: float) -> Reference:
    """Rigid flat punch on a half-plane, frictionless: p = P / (pi sqrt(a^2 - x^2)).

    Source: Johnson (1985), Contact Mechanics, section 2.8(a).
    """

    def pressure(x: np.ndarray) -> np.ndarray:
        inside = np.abs(x) < half_width
        root = np.sqrt(np.where(inside, half_width**2 - np.square(x), 1.0))
        return np.where(inside, force_per_length / (np.pi * root), np.nan)

    return Reference("rigid punch, frictionless", pressure, half_width)


def _ellipse(x: np.ndarray, a: float, peak: float) -> np.ndarray:
    return np.asarray(peak * np.sqrt(np.maximum(0.0, 1 - np.square(x / a))))
