"""Stress at the corner where the edge of one elastic body meets the surface of another: sigma ~
r^(lambda - 1).

Two wedges in plane strain share the ray theta = 0, which runs from the corner into the contact: the
upper body fills 0 < theta < angle, the lower one -angle < theta < 0; the other faces are free.
Williams' fields, in each wedge:
    sigma_tt = lambda (lambda + 1) r^(lambda-1) [A cos(m t) + B sin(m t) + C cos(k t) + D sin(k t)],
    sigma_rt = lambda r^(lambda-1) [m (A sin(m t) - B cos(m t)) + k (C sin(k t) - D cos(k t))],
    2 G u_r = r^lambda [-m (A cos(m t) + B sin(m t)) + (kappa - lambda) (C cos(k t) + D sin(k t))],
    2 G u_t = r^lambda [m (A sin(m t) - B cos(m t)) + (kappa + lambda) (C sin(k t) - D cos(k t))],
m = lambda + 1, k = lambda - 1, kappa = 3 - 4 nu. Exponents are zeros of the determinant of the
eight conditions on the three rays. Sources: Williams (1952), J. Appl. Mech. 19, 526-528; Bogy
(1971), J. Appl. Mech. 38, 377-386 (bonded); Gdoutos and Theocaris (1975), J. Appl. Mech. 42,
688-692, and Comninou (1976), ZAMP 27, 493-499 (friction).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from contactopt.checks import check_number
from contactopt.errors import InputError
from contactopt.material import Material

DEGREE = 24  # of the Chebyshev interpolant of the determinant, an entire function of lambda
INTERVAL = 0.05, 0.95  # of interpolation, away from the zeros of rigid motions at 0 and 1
WEAKEST = 0.999  # exponent that still counts as singular


@dataclass(frozen=True)
class Corner:
    """The strongest field at a corner.

    exponent     Re lambda [-]: stress ~ r^(exponent - 1); errors of uniform meshes in the energy
                 norm ~ h^exponent. 1: no singularity
    oscillation  |Im lambda| [-]: the field changes sign with cos(oscillation ln r)
    ratio        shear traction over pressure on the interface [-], positive where the lower body is
                 pushed away from the contact's centre; nan without a singularity or with
                 oscillation
    """

    exponent: float
    oscillation: float = 0.0
    ratio: float = np.nan


def corner(
    upper: Material | None,
    lower: Material | None,
    mu: float | None = 0.0,
    angles: tuple[float, float] = (np.pi / 2, np.pi),
) -> Corner:
    """The strongest singular field where the edge of a body lies on another body; plane strain.

    Poisson's ratio enters through Dundurs' constants only. Equal materials give an exponent that
    does not depend on it.

    Parameters
    ----------
    upper, lower : Materials; None is a rigid body.
    mu : Shear traction over pressure on the sliding interface [-], positive where the lower body is
        pushed away from the centre of the contact; its sign follows the slip. 0 is frictionless,
        None is bonded.
    angles : Of the upper and of the lower body at the corner [rad], up to 2 pi.

    Returns
    -------
    Exponent, oscillation, and ratio of the tractions. Raises InputError for two rigid bodies.
    """
    if upper is None and lower is None:
        raise InputError("both bodies are rigid; at least one must be elastic.")
    if mu is not None:
        check_number("the friction coefficient mu", mu)
    for angle in angles:
        check_number("the angle of a body at the corner", angle, low=0.0, high=2 * np.pi + 1e-12)

    def conditions(exponent: complex) -> np.ndarray:
        return _conditions(exponent, (upper, lower), mu, angles)

    zeros = _zeros(lambda exponent: complex(np.linalg.det(conditions(exponent))))
    if not len(zeros):
        return Corner(1.0)
    first = zeros[np.argmin(zeros.real)]
    if abs(first.imag) > 1e-6:
        return Corner(float(first.real), float(abs(first.imag)))
    coefficients = np.linalg.svd(conditions(first.real))[2][-1]
    normal, shear = _tractions(first.real, 0.0) @ coefficients[-4:]  # of the lower body, if elastic
    with np.errstate(divide="ignore"):
        return Corner(float(first.real), 0.0, float((shear / normal).real))


def edge_stick_threshold(
    upper: Material | None, lower: Material | None, angles: tuple[float, float] = (np.pi / 2, np.pi)
) -> float:
    """Friction coefficient above which the edge of a body sticks under growing load.

    This is the ratio |q / p| of the tractions of the bonded field.

    Parameters
    ----------
    upper, lower : Materials; None is a rigid body.
    angles : Of the upper and of the lower body at the corner [rad], up to 2 pi.

    Returns
    -------
    [-]; inf where the bonded field oscillates, because the edge slips for every mu then, and nan
    where it is bounded.
    """
    bonded = corner(upper, lower, None, angles)
    return float("inf") if bonded.oscillation else abs(bonded.ratio)


def _zeros(determinant: Callable[[complex], complex]) -> np.ndarray:
    """Complex zeros near (0, 1), without those of rigid motions: 1, and several at 0."""
    step = 1e-3
    order = round(np.log2(abs(determinant(2 * step) / determinant(step))))

    def reduced(x: complex) -> complex:
        return determinant(x) / x**order

    low, high = INTERVAL
    points = low + (high - low) * (1 + chebyshev.chebpts1(DEGREE + 1)) / 2
    fit = chebyshev.Chebyshev.fit(
        points, [reduced(x).real for x in points], DEGREE, domain=INTERVAL
    )
    roots = np.asarray(fit.roots(), dtype=complex).tolist()
    guesses = [z for z in roots if 0 < z.real < WEAKEST and abs(z.imag) < 0.5]
    newton = np.array(
        [2 * step * reduced(z) / (reduced(z + step) - reduced(z - step)) for z in guesses]
    )
    close = np.abs(newton) < 1e-4  # the others are rounding noise of the fit
    return (np.array(guesses) - newton)[close]


def _conditions(
    exponent: complex,
    bodies: tuple[Material | None, Material | None],
    mu: float | None,
    angles: tuple[float, float],
) -> np.ndarray:
    """Square matrix of the conditions, unknowns A, B, C, D of each elastic wedge."""
    stiffest = max(m.E / (1 + m.nu) for m in bodies if m is not None)
    free, tractions, displacements = [], [], []
    for body, end in zip(bodies, (angles[0], -angles[1])):
        if body is not None:
            free.append(_tractions(exponent, end))
            tractions.append(_tractions(exponent, 0.0))
            displacements.append(
                _displacements(exponent, 0.0, body) * stiffest * (1 + body.nu) / body.E
            )
    n = len(free)
    rows = [
        np.hstack([part if j == i else np.zeros((2, 4)) for j in range(n)])
        for i, part in enumerate(free)
    ]
    jump = np.hstack([displacements[0], -displacements[1]] if n == 2 else displacements)
    if n == 2:
        rows.append(np.hstack([tractions[0], -tractions[1]]))
    if mu is None:
        return np.vstack([*rows, jump])
    sliding = tractions[-1][1] - mu * tractions[-1][0]
    return np.vstack([*rows, jump[1:], np.append(np.zeros(4 * (n - 1)), sliding)[None]])


def _tractions(exponent: complex, t: float) -> np.ndarray:
    """(sigma_tt, sigma_rt) over lambda r^(lambda-1), as rows for A, B, C, D."""
    m, k = exponent + 1, exponent - 1
    cm, sm, ck, sk = np.cos(m * t), np.sin(m * t), np.cos(k * t), np.sin(k * t)
    return np.array([[m * cm, m * sm, m * ck, m * sk], [m * sm, -m * cm, k * sk, -k * ck]])


def _displacements(exponent: complex, t: float, body: Material) -> np.ndarray:
    """2 G (u_r, u_t) over r^lambda, as rows for A, B, C, D."""
    m, k, kappa = exponent + 1, exponent - 1, 3 - 4 * body.nu
    cm, sm, ck, sk = np.cos(m * t), np.sin(m * t), np.cos(k * t), np.sin(k * t)
    low, high = kappa - exponent, kappa + exponent
    return np.array(
        [[-m * cm, -m * sm, low * ck, low * sk], [m * sm, -m * cm, high * sk, -high * ck]]
    )
