"""Meshes that see contacts which are much smaller than their bodies.

A mesh from a CAD program may not see such a contact: one node touches, and neither its pressure nor
any estimate of an error means anything. Hertz's theory tells where the contact is and how wide
(contactopt.readings.hertz_size), and elements there are divided before anything is solved.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from contactopt.accuracy.marking import Shapes
from contactopt.checks import overheard
from contactopt.coupling.posed import free_problem, posed
from contactopt.errors import InputError
from contactopt.meshes.mesh_refinement import graded
from contactopt.readings.hertz_size import Hertz, hertz
from contactopt.scenes.scene import Scene

SLENDER = 100.0  # length over width from which a contact takes too many elements
GROWTH = 1.0  # by how much elements grow with the distance from the contact


def unseen(scene: Scene) -> dict[str, list[Hertz]]:
    """By body the contacts whose predicted half-width is smaller than an element there."""
    found: dict[str, list[Hertz]] = {}
    try:
        with overheard():  # what it remarks is said of the first mesh that is solved
            made = posed(scene)
            predicted = hertz(scene, made, free_problem(scene, made))
    except InputError:  # raised again where the scene is solved
        return found
    for pair in scene.pairs:
        own = predicted.get(pair.name)
        if own is None or own.widths[0] > SLENDER * own.widths[-1]:
            continue
        if own.size > own.widths[-1]:
            for body in pair.bodies:
                found.setdefault(body, []).append(own)
    return found


def seeing(
    scene: Scene, contacts: Mapping[str, list[Hertz]], across: float, shapes: Shapes
) -> Scene:
    """The scene with `across` elements along the smallest half-width of contacts of `unseen`."""

    def divided(part: Any) -> Any:
        if part.name not in contacts or not hasattr(part, "mesh"):
            return part
        large = partial(_large, contacts[part.name], across)
        return replace(part, mesh=graded(part.mesh, large, shapes.of(part)))

    return scene.with_parts(divided)


def _large(contacts: list[Hertz], across: float, corners: np.ndarray) -> np.ndarray:
    """Whether elements with corners (dim, c, e) are too long for their distance from contacts."""
    count = corners.shape[1]
    edges = (corners - np.roll(corners, shift, axis=1) for shift in range(1, count // 2 + 1))
    size = np.max([np.linalg.norm(edge, axis=0).max(axis=0) for edge in edges], axis=0)
    large = np.zeros(len(size), dtype=bool)
    for own in contacts:
        away = own.away(corners.reshape(len(corners), -1)).reshape(count, -1).min(axis=0)
        large |= size > own.widths[-1] / across + GROWTH * away
    return large
