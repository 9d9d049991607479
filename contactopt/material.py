"""Isotropic linear elasticity: the two constants of a material."""

from dataclasses import dataclass

from contactopt.checks import check_number, check_size


@dataclass(frozen=True)
class Material:
    """Isotropic linear elasticity: Young's modulus E [stress], Poisson's ratio nu [-]."""

    E: float
    nu: float

    def __post_init__(self) -> None:
        check_size("Young's modulus E", self.E, low=0.0)
        check_number("Poisson's ratio nu", self.nu, low=-1.0, high=0.5)


def lame(material: Material) -> tuple[float, float]:
    """Lame's parameters lambda = E nu / ((1 + nu) (1 - 2 nu)) and G = E / (2 (1 + nu)) [stress]."""
    E, nu = material.E, material.nu
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
