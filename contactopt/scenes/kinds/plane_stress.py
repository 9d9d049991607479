"""Plane stress: sheets that are thin across the plane, where nothing keeps them from straining.

sigma_zz = lambda (e_xx + e_yy + e_zz) + 2 G e_zz = 0 gives e_zz, and with it

    sigma = lambda* tr(e) 1 + 2 G e    in the plane,    lambda* = 2 lambda G / (lambda + 2 G)
                                                                = E nu / (1 - nu^2).

Source: Timoshenko, Goodier (1970), Theory of elasticity, chapter 2.
"""

from contactopt.material import Material, lame
from contactopt.scenes.kinds.kind import Constants, Kind


class PlaneStress(Kind):
    """Thin sheets that are loaded in their plane."""

    name = "plane-stress"
    stretches = True
    deck = "CPS"

    def constants(self, material: Material) -> Constants:
        return Constants(material.E * material.nu / (1 - material.nu**2), lame(material)[1], 0.0)
