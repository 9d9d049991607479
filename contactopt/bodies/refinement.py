"""Meshes with all elements halved, curved contact boundaries kept curved."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.bodies.elements import is_curved
from contactopt.errors import InputError
from contactopt.scenes.scene import Part, Scene


def split(mesh: Any, *contacts: str) -> Any:
    """Halve all elements of a plane mesh, with new nodes of curved contact boundaries on cubic splines.

    The spline gives the height over the coordinate along which the boundary extends most, so that partners on
    two bodies stay partners.

    Parameters
    ----------
    mesh
        A plane scikit-fem mesh with straight elements.
    contacts
        Names of its contact boundaries.

    Returns
    -------
    Mesh
        The mesh of half the element size, with the same boundaries.

    Raises
    ------
    InputError
        For meshes of solids (scikit-fem drops their boundaries) and of curved elements.
    """
    from scipy.interpolate import CubicSpline

    if is_curved(mesh) or len(mesh.p) > 2:
        raise InputError(
            "a given mesh can be refined only if it is plane with straight elements; give the part a function "
            "(elements, zone) -> mesh instead."
        )
    fine = mesh.refined(1)
    p = fine.p.copy()
    for contact in contacts:
        old, new = (np.unique(m.facets[:, m.boundaries[contact]]) for m in (mesh, fine))
        along = int(np.argmax(np.ptp(mesh.p[:, old], axis=1)))
        order = old[np.argsort(mesh.p[along, old])]
        p[1 - along, new] = CubicSpline(mesh.p[along, order], mesh.p[1 - along, order])(p[along, new])
    return replace(fine, doflocs=p)


def split_scene(scene: Scene, elements: int, splits: int) -> Scene:
    """Put a scene on the meshes made for `elements` and then halved several times.

    Parameters
    ----------
    scene
        The scene, which stays as it is.
    elements
        Number across the contact half-width, for which the meshes are made.
    splits
        How often they are halved.

    Returns
    -------
    Scene
        The scene with these meshes, whatever number of elements it is asked for.
    """

    def finer(part: Any) -> Any:
        if not isinstance(part, Part):
            return part

        def mesh(_: int, zone: float | None) -> Any:
            made = part.build_mesh(elements, zone)
            for _ in range(splits):
                made = split(made, *scene.surfaces_of(part))
            return made

        return replace(part, mesh=mesh)

    return scene.with_parts(finer) if splits else scene
