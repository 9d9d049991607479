"""Exact solutions of contact mechanics: closed forms where they exist, else integral equations
solved to many digits.

reference   the record of a solution; E*, Gs, Dundurs' constants
normal      Hertz; rigid flat punches, frictionless and bonded
friction    rigid flat punches and Hertz's geometry with Coulomb friction between dissimilar
            materials (spence, panels)
mindlin     Cattaneo-Mindlin: tangential loading, unloading, cyclic loss
conforming  a pin in a hole with clearance (Persson), the press fit (Lame)

Half-spaces are elastic, isotropic, homogeneous; strains and slopes small. Any consistent units.
InputError tells of arguments that are out of range.
"""

from contactopt.analytic.conforming import pin_in_hole, press_fit
from contactopt.analytic.friction import (
    flat_punch_axisymmetric_friction,
    flat_punch_line_friction,
    hertz_line_friction,
    hertz_point_friction,
)
from contactopt.analytic.mindlin import (
    cycle_loss_line,
    cycle_loss_point,
    hertz_line_tangential,
    hertz_point_tangential,
)
from contactopt.analytic.normal import (
    flat_punch_axisymmetric,
    flat_punch_axisymmetric_bonded,
    flat_punch_line,
    flat_punch_line_bonded,
    hertz_line,
    hertz_point,
)
from contactopt.analytic.reference import Reference, contact_modulus, dundurs, tangential_modulus
from contactopt.analytic.spence import stick_ratio

__all__ = [
    "Reference",
    "contact_modulus",
    "cycle_loss_line",
    "cycle_loss_point",
    "dundurs",
    "flat_punch_axisymmetric",
    "flat_punch_axisymmetric_bonded",
    "flat_punch_axisymmetric_friction",
    "flat_punch_line",
    "flat_punch_line_bonded",
    "flat_punch_line_friction",
    "hertz_line",
    "hertz_line_friction",
    "hertz_line_tangential",
    "hertz_point",
    "hertz_point_friction",
    "hertz_point_tangential",
    "pin_in_hole",
    "press_fit",
    "stick_ratio",
    "tangential_modulus",
]
