"""Cattaneo and Mindlin: a constant normal force, then a tangential one that rises, falls and rises
again.

Similar materials (beta = 0), so that Hertz's pressure stands. Under a rising load T, x = T/(mu P),
c/a = (1 - x)^(1/k) with k = 2 for cylinders and 3 for spheres:
    q = mu p0 [sqrt(1 - r^2/a^2) - (c/a) sqrt(1 - r^2/c^2)], the second term inside c only.
A reversal adds the same with twice mu and the opposite sign, and a closed loop leaves no trace
(Masing's rules). Exact in plane strain, and in three dimensions for nu = 0; else the slip is out of
line with q by about nu/(4 - 2 nu), which is neglected. Sources: Cattaneo (1938), Rend. Accad.
Lincei 27; Mindlin (1949), J. Appl. Mech. 16, 259-268; Mindlin and Deresiewicz (1953), J. Appl.
Mech. 20, 327-344; Johnson (1985), Contact Mechanics, sections 7.2(d), 7.4(a).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from contactopt.analytic.normal import hertz_line, hertz_point
from contactopt.analytic.reference import Reference, ellipse
from contactopt.checks import check_number, check_positive
from contactopt.errors import InputError


def hertz_line_tangential(
    force_per_length: float,
    radius: float,
    modulus: float,
    mu: float,
    loads: float | Sequence[float],
) -> Reference:
    """Cylinders under a normal force P and then a tangential force T (Cattaneo, Mindlin).

    The shift is the part that slip adds to the displacement of full stick, which is linear in T and
    depends on the bodies. While T rises it is (mu P / (pi E*)) [(1 - x) ln(1 - x) + x] with x = T /
    (mu P), from the displacement at the centre: Johnson (1985), eq (2.24).

    Parameters
    ----------
    force_per_length, radius, modulus : As for hertz_line().
    mu : Friction coefficient, at least 0 [-].
    loads : The present tangential force T, or its turning points so far and the present one; |T| <=
        mu P [force / length].

    Returns
    -------
    Pressure and shear traction over the place, half-width of contact and stick, and shift.
    """
    normal = hertz_line(force_per_length, radius, modulus)
    limit = _limit(mu, force_per_length)

    def rising(x: float) -> float:
        return limit / (np.pi * modulus) * (x + ((1 - x) * np.log1p(-x) if x < 1 else 0.0))

    return _tangential(normal, mu, limit, loads, 2, rising)


def hertz_point_tangential(
    force: float,
    radius: float,
    modulus: float,
    tangential: float,
    mu: float,
    loads: float | Sequence[float],
) -> Reference:
    """Spheres under a normal force P and then a tangential force T (Cattaneo, Mindlin).

    While T rises the shift is 3 mu P / (16 a Gs) [1 - (1 - x)^(2/3)] with x = T / (mu P).

    Parameters
    ----------
    force, radius, modulus : As for hertz_point().
    tangential : Tangential modulus Gs as in tangential_modulus() [stress].
    mu : Friction coefficient, at least 0 [-].
    loads : The present tangential force T, or its turning points so far and the present one; |T| <=
        mu P [force].

    Returns
    -------
    Pressure and shear traction over the radius, radius of contact and stick, approach, and shift.
    """
    check_positive(tangential_modulus=tangential)
    normal = hertz_point(force, radius, modulus)
    limit = _limit(mu, force)
    full = 3 * limit / (16 * normal.half_width * tangential)
    return _tangential(normal, mu, limit, loads, 3, lambda x: full * (1 - (1 - x) ** (2 / 3)))


def cycle_loss_line(force_per_length: float, modulus: float, mu: float, amplitude: float) -> float:
    """Energy that cylinders lose per cycle of a tangential force between plus and minus an
    amplitude.

    The loss is 4 mu^2 P^2 / (pi E*) [(1 - x) ln(1 - x) + x - x^2 / 2] with x = amplitude / (mu P).
    This is the area of the loop that Masing's rules draw from the shift of hertz_line_tangential().

    Parameters
    ----------
    force_per_length, modulus : As for hertz_line().
    mu : Friction coefficient, at least 0 [-].
    amplitude : Largest tangential force per length [force / length].

    Returns
    -------
    Energy per length and cycle [force].
    """
    check_positive(force_per_length=force_per_length, modulus=modulus)
    limit = _limit(mu, force_per_length)
    x = _share(abs(amplitude), limit)
    log = (1 - x) * np.log1p(-x) if x < 1 else 0.0
    return float(4 * limit**2 / (np.pi * modulus) * (log + x - x**2 / 2))


def cycle_loss_point(
    force: float, radius: float, modulus: float, tangential: float, mu: float, amplitude: float
) -> float:
    """Energy that spheres lose per cycle of a tangential force between plus and minus an amplitude.

    The loss is 9 mu^2 P^2 / (10 a Gs) {1 - (1 - x)^(5/3) - (5 x / 6) [1 + (1 - x)^(2/3)]} with x =
    amplitude / (mu P). Sources: Mindlin, Deresiewicz (1953); Johnson (1985), Contact Mechanics,
    section 7.4.

    Parameters
    ----------
    force, radius, modulus : As for hertz_point().
    tangential : Tangential modulus Gs as in tangential_modulus() [stress].
    mu : Friction coefficient, at least 0 [-].
    amplitude : Largest tangential force [force].

    Returns
    -------
    Energy per cycle [force length].
    """
    check_positive(tangential_modulus=tangential)
    a = hertz_point(force, radius, modulus).half_width
    limit = _limit(mu, force)
    x = _share(abs(amplitude), limit)
    brackets = 1 - (1 - x) ** (5 / 3) - 5 * x / 6 * (1 + (1 - x) ** (2 / 3))
    return float(9 * limit**2 / (10 * a * tangential) * brackets)


def masing_branches(loads: Sequence[float]) -> list[tuple[float, float]]:
    """The branches of a history that still count by Masing's rules, each with its factor 1 or 2."""
    points = [0.0]
    for load in loads:
        if len(points) > 1 and (points[-1] - points[-2]) * (load - points[-1]) >= 0:
            points.pop()
        points.append(float(load))
        while len(points) > 3 and abs(points[-1] - points[-2]) >= abs(points[-2] - points[-3]):
            del points[-3:-1]  # a closed loop
        if len(points) > 2 and abs(points[-1]) >= abs(points[1]):
            del points[1:-1]  # back on the curve of first loading
    return [
        (end - start, 1.0 if i == 0 else 2.0) for i, (start, end) in enumerate(pairwise(points))
    ]


def _tangential(
    normal: Reference,
    mu: float,
    limit: float,
    loads: float | Sequence[float],
    order: int,
    rising: Callable[[float], float],
) -> Reference:
    branches = masing_branches(np.atleast_1d(np.asarray(loads, dtype=float)).tolist())
    shares = [
        (np.sign(change) * factor, _share(abs(change) / factor, limit))
        for change, factor in branches
    ]
    a, peak = normal.half_width, mu * (normal.peak or 0.0)
    stick = [(sign, (1 - x) ** (1 / order)) for sign, x in shares]

    def shear(r: np.ndarray) -> np.ndarray:
        total = np.zeros(np.shape(r))
        for sign, ratio in stick:
            total = total + sign * (
                ellipse(r, a, peak) - (ellipse(r, ratio * a, ratio * peak) if ratio else 0.0)
            )
        return total

    shift = float(sum(sign * rising(x) for sign, x in shares))
    return replace(
        normal,
        label="Cattaneo-Mindlin",
        shear=shear,
        stick_half_width=a * stick[-1][1],
        shift=shift,
    )


def _limit(mu: float, force: float) -> float:
    check_number("the friction coefficient mu", mu, low=0.0)
    return mu * force


def _share(load: float, limit: float) -> float:
    if not load <= limit * (1 + 1e-12):
        raise InputError(
            f"the tangential load {load:g} exceeds mu times"
            f" the normal load, {limit:g}: the bodies slide."
        )
    return min(load / limit, 1.0)
