"""What a kind of analysis is: what its bodies stand for, and what follows from that."""

from types import SimpleNamespace
from typing import Any, ClassVar, NamedTuple

from contactopt.material import Material, lame

STEP = 1e-30  # into the complex plane, whose square is rounding: no difference is taken


class Constants(NamedTuple):
    """stress = lam tr(strain) 1 + 2 shear strain in the mesh's axes; across a section, in the third
    axis, it is across tr(strain) + 2 shear strain, where only bodies of revolution have a strain.
    """

    lam: float
    shear: float
    across: float


class Kind:
    """A kind of analysis; what is not overridden is that of a section of the plane.

    name        in scenes and files
    components  of a displacement, in the order of the mesh coordinates
    stresses    components of a stress, in the order of files
    revolved    whether the bodies are those that the section makes around an axis, its second one
    stretches   whether a body strains across the plane
    deck        names of elements in a deck of CalculiX begin so
    """

    name: ClassVar[str]
    components: ClassVar[tuple[str, ...]] = ("x", "y")
    stresses: ClassVar[tuple[str, ...]] = ("xx", "yy", "zz", "xy")
    revolved: ClassVar[bool] = False
    stretches: ClassVar[bool] = False
    deck: ClassVar[str] = ""

    @property
    def dim(self) -> int:
        """Number of coordinates of its meshes."""
        return len(self.components)

    def measure(self, thickness: float) -> float:
        """The factor of integrals over the mesh, without r: thickness, 2 pi or 1."""
        return thickness

    def constants(self, material: Material) -> Constants:
        """Those of Hooke's law in the mesh's axes [stress]."""
        lam, shear = lame(material)
        return Constants(lam, shear, lam)

    def constants_by_poisson(self, material: Material) -> Constants:
        """The derivatives of `constants`, which is analytic, by Poisson's ratio [stress]."""
        moved: Any = SimpleNamespace(E=material.E, nu=material.nu + STEP * 1j)
        return Constants(*(complex(value).imag / STEP for value in self.constants(moved)))

    def half_width(self, area: float, thickness: float) -> float:
        """The half-width [length] of a zone of this area: a strip, a disc or a square."""
        return area / (2 * thickness)

    def area(self, half_width: float, thickness: float) -> float:
        """The area [length^2] of a contact zone of this half-width: the inverse of `half_width`."""
        return 2 * half_width * thickness
