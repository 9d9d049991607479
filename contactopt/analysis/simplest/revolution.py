"""Solids that need an axisymmetric section only: bodies of revolution.

They fit themselves after a turn by any angle about their axis. If loads and supports do too, the section on one side of the axis is
exact: the faces of the elements in a plane through the axis, along which the mesh is cut.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.analysis.simplest.clipping import Side, half_mesh
from contactopt.analysis.simplest.images import Images, images_under
from contactopt.analysis.simplest.planes import Turn
from contactopt.analysis.simplest.sections import face_mesh, flattened, to_axes
from contactopt.analysis.simplest.shapes import Shapes
from contactopt.analysis.simplest.turning import turned
from contactopt.scenes.scene import Part, Scene, Support

ANGLES = np.deg2rad([37.0, 101.0, 163.0])  # turns that no polygon with few sides survives
EVEN = 1e-6  # a direction across or along another one, but for so much


def revolution(shapes: Shapes) -> tuple[np.ndarray, np.ndarray, str] | None:
    """A point and the direction of the axis of a scene of revolution, and half a sentence if not everything fits the turn."""
    if shapes.scene.kind != "solid" or shapes.scene.copies != 1:
        return None
    centre, second = shapes.moments
    low, high = shapes.corners
    for axis in [*np.eye(3), *np.linalg.eigh(second)[1].T]:
        point = centre.copy()
        across = np.abs(axis) < EVEN
        if across.sum() == 2:
            point[across] = (low + high)[across] / 2
        made = images_under(shapes, Turn(_rotation(axis, ANGLES[0]), point))
        if made is None:
            continue
        others = [images_under(shapes, Turn(_rotation(axis, angle), point)) for angle in ANGLES[1:]]
        reason = next((each for each in (made, *others) if isinstance(each, str)), "")
        if None in others or any(isinstance(each, Images) and _swaps(each) for each in (made, *others)):
            continue
        return point, axis, reason
    return None


def _swaps(found: Images) -> bool:
    return any(name != image for name, image in found.bodies.items())


def _rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = axis / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K))


def axisymmetric(shapes: Shapes, point: np.ndarray, axis: np.ndarray) -> Scene:
    """The section of a scene of revolution; InputError if it cannot be turned, or if something acts around the axis."""
    scene = shapes.scene
    R = to_axes(axis) if np.abs(axis).max() < 1 - EVEN or np.argmax(np.abs(axis)) != 2 else np.eye(3)
    scene = turned(scene, R) if np.any(np.eye(3) != R) else scene
    point = R @ point
    across, side = Side(1, float(point[1])), Side(0, float(point[0]))

    def flat(mesh: Any) -> Any:
        half = half_mesh(across, "section", lambda name: None)(mesh)
        facets = half.boundaries["section"]
        plane = face_mesh(
            replace(half, _boundaries={n: f for n, f in half.boundaries.items() if n != "section"}), facets, [0, 2]
        )
        plane = half_mesh(side, "axis of revolution", lambda name: None)(plane)
        return replace(plane, doflocs=plane.doflocs - np.array([[point[0]], [0.0]]))

    def lift(x: np.ndarray) -> np.ndarray:
        return np.stack([x[0] + point[0], np.full_like(x[0], point[1]), x[1]])

    made = flattened(scene, "axisymmetric", {"x": "r", "y": None, "z": "z"}, [0, 2], flat, lift)

    def on_axis(part: Any) -> Any:
        if not isinstance(part, Part):
            return part
        mesh = part.build_mesh(scene.elements, scene.zone)
        held = (
            (Support("axis of revolution", {"r": 0.0}),) if len(mesh.boundaries.get("axis of revolution", ())) else ()
        )
        return replace(part, supports=(*part.supports, *held))

    return made.with_parts(on_axis)
