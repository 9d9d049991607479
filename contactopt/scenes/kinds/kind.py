"""What a kind of analysis is: what its bodies stand for, and what follows from that."""

from __future__ import annotations

from typing import ClassVar

from contactopt.material import Material, lame, lame_by_poisson


class Kind:
    """A kind of analysis; what is not overridden is that of a section of the plane.

    name        in scenes and files
    components  of a displacement, in the order of the mesh coordinates
    stresses    components of a stress, in the order of files
    revolved    whether the bodies are those that the section makes around an axis, its second one
    stretches   whether a body is free to strain across the plane, where it then has no stress
    deck        names of elements in a deck of CalculiX begin so; empty: there are none that fit
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
        """Compute what integrals over the mesh are multiplied with; if revolved also with r.

        Parameters
        ----------
        thickness : Of the scene [length].

        Returns
        -------
        The thickness, 2 pi or 1.
        """
        return thickness

    def constants(self, material: Material) -> tuple[float, float]:
        """Compute lambda and G with stress = lambda tr(strain) 1 + 2 G strain in the mesh's axes.

        Parameters
        ----------
        material : Young's modulus and Poisson's ratio.

        Returns
        -------
        Both constants [stress].
        """
        return lame(material)

    def constants_by_poisson(self, material: Material) -> tuple[float, float]:
        """Differentiate `constants` by Poisson's ratio.

        Parameters
        ----------
        material : Young's modulus and Poisson's ratio.

        Returns
        -------
        Both derivatives [stress].
        """
        return lame_by_poisson(material)

    def half_width(self, area: float, thickness: float) -> float:
        """Compute the half-width of a contact zone of a simple shape: of a strip of the thickness,
        of a disc, or of a square.

        Parameters
        ----------
        area : Of the zone [length^2].
        thickness : Of the scene [length].

        Returns
        -------
        Half its width, or its radius [length].
        """
        return area / (2 * thickness)

    def area(self, half_width: float, thickness: float) -> float:
        """Invert `half_width`.

        Parameters
        ----------
        half_width : Of the zone [length].
        thickness : Of the scene [length].

        Returns
        -------
        The area of the zone [length^2].
        """
        return 2 * half_width * thickness
