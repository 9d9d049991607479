"""The planes of symmetry beyond which mirror images make the bodies of a scene whole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from contactopt.bodies.assembled import Guides
from contactopt.coupling.charts import SymmetryPlane
from contactopt.coupling.coupling import Coupling
from contactopt.errors import InputError
from contactopt.scenes.scene import Scene

NEAR = 1e-9  # what counts as zero beside the extent of all bodies


def mirror_planes(
    scene: Scene, guides: Sequence[Guides], couplings: Sequence[Coupling]
) -> tuple[SymmetryPlane, ...]:
    """Find the planes of symmetry of a scene whose bodies are parts of the whole ones.

    These are the planes that cut a contact surface, those of the axes that the scene names, and
    those on which supports guide a body and which have all bodies on one side, unless there are
    more of these than the copies ask for.

    Parameters
    ----------
    scene : The scene, with two copies or more.
    guides : Of each of its bodies.
    couplings : Of each of its pairs.

    Returns
    -------
    The planes, one for each direction.

    Raises
    ------
    InputError : If the scene names an axis across which no such plane lies.
    """
    found: list[SymmetryPlane] = []
    for plane in (plane for made in couplings for plane in made.planes):
        if not any(abs(plane.inward @ other.inward) > 0.5 for other in found):
            found.append(plane)
    spare = {
        axis: plane
        for axis, plane in _guiding(guides, scene.dim).items()
        if not any(abs(other.inward[axis]) > 0.5 for other in found)
    }
    for name in scene.mirror or "":
        axis = scene.components.index(name)
        if axis in spare:
            found.append(spare.pop(axis))
        elif not any(abs(plane.inward[axis]) > 0.5 for plane in found):
            raise InputError(
                f"scene '{scene.name}': mirror = {scene.mirror!r}, but no support holds {name}"
                " alone at zero in a plane that has all bodies on one side; add a Support on the"
                " plane of symmetry."
            )
    return (
        (*found, *spare.values())
        if 2 ** (len(found) + len(spare)) <= scene.copies
        else tuple(found)
    )


def _guiding(guides: Sequence[Guides], dim: int) -> dict[int, SymmetryPlane]:
    """For each axis the first plane across it that guides a body and has all bodies on one side."""
    extent = np.concatenate([own.extent for own in guides], axis=1)
    near = NEAR * float(np.ptp(extent, axis=1).max(initial=0.0))
    planes = {}
    for axis, place, side in sorted(
        {plane for own in guides for plane in own.planes}, reverse=True
    ):
        if np.all(side * (extent[axis] - place) >= -near):
            planes[axis] = SymmetryPlane(side * np.eye(dim)[axis], side * place)
    return planes
