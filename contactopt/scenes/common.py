"""What several named scenes share: material, units, grading."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from contactopt.material import Material
from contactopt.scenes.scene import Part, Scene

RUBBER = Material(E=5.0, nu=0.3)  # MPa, the material of all the paper's bodies
UNITS = ("mm", "MPa")
GROWTH = {2: 1.2, 3: 1.3}  # ratio of neighbouring elements away from the contact, by dimension
MARGIN = 1.25  # candidate contact zone of round bodies, over the half-width its mesh resolves


def with_elements(scene: Scene, degree: int | None = None, simplices: bool = False) -> Scene:
    """Give a scene other elements.

    Parameters
    ----------
    scene : The scene, which stays as it is.
    degree : Degree of the displacement, 1 or 2; by default the scene's own.
    simplices : Whether quadrilaterals and hexahedra are cut into triangles and tetrahedra.

    Returns
    -------
    The scene with these elements.
    """

    def cut(part: Any) -> Any:
        if not simplices or not isinstance(part, Part):
            return part

        def mesh(elements: int, zone: float | None) -> Any:
            from contactopt.meshes.structured import simplices

            return simplices(part.build_mesh(elements, zone))

        return replace(part, mesh=mesh)

    return replace(scene.with_parts(cut), degree=scene.degree if degree is None else degree)
