"""Round bodies that fit into each other: a pin in a hole with clearance, and the press fit."""

import numpy as np

from contactopt.analytic.reference import Reference
from contactopt.checks import check_number, check_positive
from contactopt.errors import InputError
from contactopt.material import Material


def pin_in_hole(
    force_per_length: float, radius: float, clearance: float, modulus: float
) -> Reference:
    """A pin in the hole of an infinite plate of the same material, plane strain, frictionless.

    With b = tan(eps / 2), eps the semi-angle of contact, y = tan(phi / 2) and E1* = E / (1 - nu^2)
    = 2 E*,

        E1* c / Q = [2 - ln(1 + b^2) - 2 b^4] / [pi b^2 (1 + b^2)],
        p = Q / (pi R) {2 sqrt(b^2 - y^2) / [sqrt(1 + b^2) (1 + y^2)]
                        + artanh[sqrt((b^2 - y^2) / (b^2 + 1))] / [b^2 (1 + b^2)]}.

    For small b this is Hertz. Positions are lengths of arc R phi from the middle of the contact.
    Sources: Persson (1964), On the stress distribution of cylindrical elastic bodies in contact
    (Chalmers); Ciavarella, Decuzzi (2001), Int. J. Solids Struct. 38, 4507-4523.

    Parameters
    ----------
    force_per_length : Q [force / length]
    radius : R of pin and hole [length]
    clearance : c, the difference of their radii [length], small against R
    modulus : E* of the pair [stress], from contact_modulus()

    Returns
    -------
    Reference : pressure over the place, half-width along the arc and peak
    """
    check_positive(
        force_per_length=force_per_length, radius=radius, clearance=clearance, modulus=modulus
    )
    b = _end_of_contact(2 * modulus * clearance / force_per_length, force_per_length)

    def pressure(x: np.ndarray) -> np.ndarray:
        angle = np.abs(np.asarray(x, dtype=float)) / radius
        y = np.tan(np.minimum(angle, 2 * np.arctan(b)) / 2)
        root = np.sqrt(np.maximum(b**2 - y**2, 0.0))
        first = 2 * root / (np.sqrt(1 + b**2) * (1 + y**2))
        second = np.arctanh(root / np.sqrt(1 + b**2)) / (b**2 * (1 + b**2))
        return np.asarray(force_per_length / (np.pi * radius) * (first + second))

    return Reference(
        "Persson", pressure, 2 * radius * float(np.arctan(b)), float(pressure(np.zeros(1))[0])
    )


def _end_of_contact(ratio: float, force: float) -> float:
    """b of pin_in_hole() for ratio = E1* c / Q."""
    from scipy.optimize import brentq

    def excess(s: float) -> float:
        b = np.exp(s)
        return float(2 - np.log1p(b**2) - 2 * b**4 - ratio * np.pi * b**2 * (1 + b**2))

    # with no clearance at all contact ends at the root of 2 = ln(1 + b^2) + 2 b^4
    full = brentq(lambda b: np.log1p(b**2) + 2 * b**4 - 2, 0.5, 1.0, xtol=1e-15)
    ends = np.log(1e-8), np.log(full)
    if not excess(ends[0]) > 0 > excess(ends[1]):
        much = "large" if excess(ends[0]) > 0 else "small"
        raise InputError(
            f"the force {force:g} per length is too {much} for this pin; take another force."
        )
    return float(np.exp(brentq(excess, *ends, xtol=1e-15)))


def press_fit(
    interference: float, bore: float, radius: float, outside: float, shaft: Material, hub: Material
) -> Reference:
    """A shaft pressed into a hub that is too narrow for it, plane strain: Lame's uniform pressure
    p.

        d / (R p) = [(c^2 + R^2) / (c^2 - R^2) + m_h] / M_h
                    + [(R^2 + a^2) / (R^2 - a^2) - m_s] / M_s,

    M = E / (1 - nu^2) and m = nu / (1 - nu) of each body. Source: Timoshenko, Goodier (1970),
    Theory of Elasticity, section 28.

    Parameters
    ----------
    interference : d, radius of the shaft less that of the hub before they are joined [length],
        small against R
    bore, radius, outside : a of the shaft (0: solid), R of the interface, c of the hub [length]
    shaft, hub : the materials

    Returns
    -------
    Reference : uniform pressure, half of the length of the circle and peak. Raises InputError if
        the radii do not grow from bore to radius to outside
    """
    check_positive(interference=interference, radius=radius, outside=outside)
    check_number("bore", bore, low=0.0, closed=True)
    if not bore < radius < outside:
        raise InputError(
            "the radii must grow from bore to radius to"
            f" outside; got {bore:g}, {radius:g}, {outside:g}."
        )

    def plane(material: Material) -> tuple[float, float]:
        return material.E / (1 - material.nu**2), material.nu / (1 - material.nu)

    (M_h, m_h), (M_s, m_s) = plane(hub), plane(shaft)
    compliance = ((outside**2 + radius**2) / (outside**2 - radius**2) + m_h) / M_h
    compliance += ((radius**2 + bore**2) / (radius**2 - bore**2) - m_s) / M_s
    p = interference / (radius * compliance)
    return Reference("Lame", lambda x: np.full(np.shape(x), p), np.pi * radius, p)
