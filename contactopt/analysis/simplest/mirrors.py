"""Planes across which a scene is its own mirror image.

Candidates for the normal are the axes of space, the principal axes of the bodies, the normals of their flat sides and the lines
half-way between these; candidates for the place are the centre of volume and the middle between the outermost nodes, rounded and
as it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from contactopt.analysis.simplest.images import Images, images_under
from contactopt.analysis.simplest.planes import Plane
from contactopt.analysis.simplest.shapes import Shapes

SIDES = 8  # normals of flat sides among the candidates, those of the largest sides
ROUND = (
    0.01  # of the size: the middle of round bodies, which their meshes do not know, is taken for such a round number
)


class Mirror(NamedTuple):
    """A plane across which the whole scene is its own mirror image."""

    plane: Plane
    images: Images


def find_mirrors(shapes: Shapes) -> tuple[list[Mirror], list[str]]:
    """All planes of mirror symmetry, and sentences about planes that only loads, supports, laws or gaps spoil."""
    found: list[Mirror] = []
    spoilt: dict[str, Plane] = {}  # by the reason
    for plane in candidates(shapes):
        if any(_equal_planes(plane, mirror.plane, shapes.size) for mirror in found):
            continue
        made = images_under(shapes, plane)
        if isinstance(made, Images):
            found.append(Mirror(plane, made))
        elif made is not None:
            spoilt.setdefault(made, plane)
    notes = [
        f"The bodies are symmetric across the plane {plane.words(shapes.scene.components)}, but {reason}."
        for reason, plane in spoilt.items()
        if not any(_equal_planes(plane, mirror.plane, shapes.size) for mirror in found)
    ]
    return found, notes


def candidates(shapes: Shapes) -> Iterator[Plane]:
    """Planes that could be planes of symmetry; those across the axes of space come first."""
    dim = shapes.scene.dim
    centre, second = shapes.moments
    points = np.concatenate([mesh.p for mesh in shapes.meshes.values()], axis=1)
    axes = [1] if shapes.scene.kind == "axisymmetric" else range(dim)
    normals = [np.eye(dim)[axis] for axis in axes]
    if shapes.scene.kind != "axisymmetric":
        normals += [*np.linalg.eigh(second)[1].T, *side_normals(shapes)]
    known: list[np.ndarray] = []
    for normal in normals:
        if any(1 - abs(normal @ other) < 1e-14 for other in known):
            continue
        known.append(normal)
        along = normal @ points
        middle, step = float(along.min() + along.max()) / 2, ROUND * shapes.size
        places = (round(middle / step) * step, middle, float(normal @ centre))
        for place in dict.fromkeys(places):
            yield Plane(normal, place)


def side_normals(shapes: Shapes) -> list[np.ndarray]:
    """Normals of the largest flat sides, and the lines half-way between two of them."""
    normals = np.concatenate([whole.normals[:, whole.slack == 0] for whole in shapes.wholes.values()], axis=1)
    areas = np.concatenate([whole.areas[whole.slack == 0] for whole in shapes.wholes.values()])
    if not areas.size:
        return []
    leading = np.argmax(np.abs(normals) > 0.3, axis=0)
    normals = normals * np.sign(normals[leading, np.arange(len(areas))])
    keys, group = np.unique(np.round(normals, 6), axis=1, return_inverse=True)
    total = np.bincount(group.ravel(), areas, keys.shape[1])
    largest = np.argsort(-total)[:SIDES]
    exact = [normals[:, np.argmax(np.where(group.ravel() == number, areas, -1.0))] for number in largest]
    between = [sign * one + other for one, other in combinations(exact, 2) for sign in (1.0, -1.0)]
    return [*exact, *(line / np.linalg.norm(line) for line in between if np.linalg.norm(line) > 0.1)]


def _equal_planes(one: Plane, other: Plane, size: float) -> bool:
    cosine = float(one.normal @ other.normal)
    return abs(cosine) > 1 - 1e-6 and abs(one.offset - np.sign(cosine) * other.offset) < 1e-3 * size
