"""Scenes whose meshes are halved everywhere, with curved boundaries kept curved."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from skfem import Mesh

from contactopt.meshes.given_curves import Curve
from contactopt.meshes.mesh_refinement import Function, boundary_curves, split
from contactopt.scenes.scene import Part, Scene

if TYPE_CHECKING:
    from contactopt.scenes.matrix_part import AnyPart

STEPS = 8  # of the iteration that keeps a coordinate


def split_scene(scene: Scene, elements: int, splits: int) -> Scene:
    """Put a scene on the meshes made for `elements` across the contact half-width and then halved
    several times, whatever number of elements it is asked for later.

    New nodes lie on the `curve` of their part, or on the curve that the first mesh stands for.
    """

    def finer(part: AnyPart) -> AnyPart:
        if not part.meshed:
            return part

        def mesh(_: int, zone: float | None) -> Any:
            made = part.build_mesh(elements, zone)
            curves: dict[str, Function] = dict(part_curves(part, made))
            touching = {name: curves[name] for name in scene.surfaces_of(part) if name in curves}
            # what moves first stays where it is on other boundaries of the same curve
            if callable(part.mesh):
                kept = {name: _kept_partners(curve, made, name) for name, curve in touching.items()}
                curves = kept | {name: curve for name, curve in curves.items() if name not in kept}
            for _ in range(splits):
                made = split(made, curves)
            return made

        return replace(part, mesh=mesh)

    return scene.with_parts(finer) if splits else scene


def part_curves(part: Part, mesh: Mesh) -> dict[str, Curve]:
    """Find the curves of all curved boundaries of a part and its mesh: by the name of a boundary,
    or '' for what has no name, the curve that the part gives, or that of the mesh.
    """
    found = {name: part.curve_of(name) or curve for name, curve in boundary_curves(mesh).items()}
    return {name: curve for name, curve in found.items() if curve is not None}


def _kept_partners(curve: Function, mesh: Mesh, name: str) -> Function:
    """A curve along which points keep one coordinate, so that the nodes of two bodies match.

    Where the boundary turns away from this coordinate by more than 45 degrees the curve stays as it
    is.
    """
    if len(mesh.p) != 2:
        return curve
    ends = mesh.p[:, mesh.facets[:, mesh.boundaries[name]]]
    along = int(np.argmax(np.ptp(ends.reshape(2, -1), axis=1)))
    edge = np.abs(ends[:, 1] - ends[:, 0])
    if np.any(edge[1 - along] > edge[along]):
        return curve

    def place(points: np.ndarray) -> np.ndarray:
        here = points.copy()
        for _ in range(STEPS):
            found = curve(here)
            here[along] += points[along] - found[along]
        found[along] = points[along]
        return found

    return place
