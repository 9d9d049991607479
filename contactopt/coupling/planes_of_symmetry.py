"""Planes of symmetry, recognised by what supports hold or named by the scene."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contactopt.bodies.assembled import Guides
from contactopt.bodies.corners import smooth_tilts
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.scenes.scene import Scene


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """What charts and planes of symmetry are found from: k contacts of the body that carries them.

    points   (dim, k) positions [length]
    normals  (dim, k) contact normals
    areas    (k,) nodal areas
    cells    (v, c) contacts at the corners of the cells of the surface
    held     (dim, k) whether both bodies are held there in that component
    gap      (k,) initial gap: where a chart could start at several places it starts where the gap
             is least
    """

    points: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    cells: np.ndarray
    held: np.ndarray
    gap: np.ndarray

    @property
    def size(self) -> float:
        """Largest extent [length]; 1 for a single point."""
        return float(np.ptp(self.points, axis=1).max(initial=0.0)) or 1.0


@dataclass(frozen=True)
class SymmetryPlane:
    """A plane that holds bodies along its normal only; `inward` (dim,) points to the contacts."""

    inward: np.ndarray
    offset: float

    def contains(self, points: np.ndarray, size: float) -> np.ndarray:
        """Which of the points (dim, k), on a surface of that size [length], lie in the plane."""
        return np.asarray(np.abs(self.inward @ points - self.offset) <= EQUAL * size)


def symmetry_planes(contacts: ContactPoints) -> list[SymmetryPlane]:
    """The planes at an end of the surface, at most one per component: between two there would be
    copies without end.
    """
    planes = end_planes(contacts)
    across = [int(np.argmax(np.abs(plane.inward))) for plane in planes]
    return [plane for plane, own in zip(planes, across) if across.count(own) == 1]


def end_planes(contacts: ContactPoints) -> list[SymmetryPlane]:
    """The planes at both ends of the surface, per component, where this component is held and the
    normal one is not, and which the surface crosses smoothly: a slanted one has an edge there, and
    each side its own normal. A plate or a clamp may hold the surface elsewhere, too.
    """
    planes, (points, normals, held) = [], (contacts.points, contacts.normals, contacts.held)
    if not held.any():
        return []
    tilts = smooth_tilts(normals, contacts.cells)
    for c, mask in enumerate(held):
        for side in (1.0, -1.0) if mask.any() else ():
            offset = float((side * points[c]).min())
            plane = side * points[c] - offset <= EQUAL * contacts.size
            tangential = np.all(np.abs(normals[c, plane]) <= tilts[plane])
            # along the normal, at least, but for ends that are clamped
            moves = np.any(~held[:, plane] & (np.abs(normals[:, plane]) > EQUAL), axis=0)
            if np.all(mask[plane]) and not np.all(plane) and tangential and np.mean(moves) > 0.5:
                planes.append(SymmetryPlane(side * np.eye(len(points))[c], offset))
    return planes


def normals_in_planes(contacts: ContactPoints) -> np.ndarray:
    """Unit normals (dim, k) that lie in the planes at their contacts, as with mirror images."""
    normals = contacts.normals
    for plane in end_planes(contacts):
        out = plane.inward @ normals
        straight = normals - plane.inward[:, None] * out
        straight = straight / np.linalg.norm(straight, axis=0).clip(EQUAL)
        tilted = plane.contains(contacts.points, contacts.size) & (np.abs(out) > EQUAL)
        normals = np.where(tilted, straight, normals)
    return normals


def mirror_planes(
    scene: Scene, guides: Sequence[Guides], cutting: Sequence[SymmetryPlane]
) -> tuple[SymmetryPlane, ...]:
    """The planes of symmetry, one for each direction, of a scene with two copies or more: those
    `cutting` a contact surface, those of the axes that the scene names, and those on which supports
    guide a body and which have all bodies on one side. If there are more of these than the copies
    ask for, as a floor on which one body stands, those count that guide every body.
    InputError if no such plane lies across an axis that the scene names.
    """
    found: list[SymmetryPlane] = []
    for plane in cutting:
        if not any(abs(plane.inward @ other.inward) > 0.5 for other in found):
            found.append(plane)

    def across(axis: int) -> bool:
        return any(abs(plane.inward[axis]) > 0.5 for plane in found)

    spare = {a: p for a, p in _guiding(guides, scene.dim).items() if not across(a)}
    for name in scene.mirror or "":
        axis = scene.components.index(name)
        if axis in spare:
            found.append(spare.pop(axis))
        elif not across(axis):
            raise InputError(
                f"scene '{scene.name}': mirror = {scene.mirror!r}, but no support holds {name}"
                " alone at zero in a plane that has all bodies on one side; add a Support on the"
                " plane of symmetry."
            )
    every = (*found, *spare.values())
    if 2 ** len(every) > scene.copies:
        every = (*found, *(plane for plane in spare.values() if _guides_all(plane, guides)))
    return every if 2 ** len(every) <= scene.copies else tuple(found)


def _guides_all(plane: SymmetryPlane, guides: Sequence[Guides]) -> bool:
    """Whether a plane is one of those that guide each body."""
    size = max(float(np.abs(own.extent).max()) for own in guides)
    return all(
        any(
            side * plane.inward[axis] > 0.5 and abs(side * place - plane.offset) <= EQUAL * size
            for axis, place, side in own.planes
        )
        for own in guides
    )


def _guiding(guides: Sequence[Guides], dim: int) -> dict[int, SymmetryPlane]:
    """For each axis the first plane across it that guides a body and has all bodies on one side."""
    extent = np.concatenate([own.extent for own in guides], axis=1)
    near = EQUAL * float(np.ptp(extent, axis=1).max(initial=0.0))
    planes = {}
    known = {plane for own in guides for plane in own.planes}
    for axis, place, side in sorted(known, reverse=True):
        if np.all(side * (extent[axis] - place) >= -near):
            planes[axis] = SymmetryPlane(side * np.eye(dim)[axis], side * place)
    return planes
