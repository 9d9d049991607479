"""What a kind of analysis is: what its bodies stand for, and what follows from that."""

from typing import ClassVar

from contactopt.material import Material, lame, lame_by_poisson


class Kind:
    """A kind of analysis; what is not overridden is that of a section of the plane.

    name        in scenes and files
    components  of a displacement, in the order of the mesh coordinates
    stresses    components of a stress, in the order of files
    revolved    whether the bodies are those that the section makes around an axis, its second one
    stretches   whether a body is free to strain across the plane, where it then has no stress
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

    def constants(self, material: Material) -> tuple[float, float]:
        """lambda and G of stress = lambda tr(strain) 1 + 2 G strain in the mesh's axes [stress]."""
        return lame(material)

    def constants_by_poisson(self, material: Material) -> tuple[float, float]:
        """The derivatives of `constants` by Poisson's ratio [stress]."""
        return lame_by_poisson(material)

    def half_width(self, area: float, thickness: float) -> float:
        """The half-width [length] of a zone of this area: a strip, a disc or a square."""
        return area / (2 * thickness)

    def area(self, half_width: float, thickness: float) -> float:
        """The area [length^2] of a contact zone of this half-width: the inverse of `half_width`."""
        return 2 * half_width * thickness
