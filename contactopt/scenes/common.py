"""What several named scenes share: material, units, grading, the check of sizes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.errors import InputError
from contactopt.scene import Material, Part, Scene, check_number

RUBBER = Material(E=5.0, nu=0.3)  # MPa, the material of all the paper's bodies
UNITS = ("mm", "MPa")
GROWTH = {2: 1.2, 3: 1.3}  # ratio of neighbouring elements away from the contact, by dimension
MARGIN = 1.25  # candidate contact zone of round bodies, over the half-width its mesh resolves


def check_positive(**sizes: float) -> None:
    """Raise InputError unless every size is a positive finite number."""
    for name, value in sizes.items():
        check_number(name, value, low=0.0)


def check_count(name: str, value: int) -> None:
    """Raise InputError unless the value is a whole number of at least 1."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{name} must be a whole number of at least 1; got {value!r}.")


def with_elements(scene: Scene, degree: int | None = None, simplices: bool = False) -> Scene:
    """The scene with displacements of that degree (None: its own), its quadrilaterals or hexahedra cut into simplices or not."""

    def cut(part: Any) -> Any:
        if not simplices or not isinstance(part, Part):
            return part

        def mesh(elements: int, zone: float | None) -> Any:
            from contactopt.mesh import simplices

            return simplices(part.build_mesh(elements, zone))

        return replace(part, mesh=mesh)

    return replace(
        scene, degree=scene.degree if degree is None else degree, upper=cut(scene.upper), lower=cut(scene.lower)
    )
