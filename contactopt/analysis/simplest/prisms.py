"""Solids in plane strain: prisms whose ends are held along the axis.

A prism has sides along one axis and ends on two planes across it. If the ends are held along the axis, on rollers, and nothing else
changes along the axis or acts along it, then strain is plane and the section is exact: the faces of the elements on one end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.analysis.simplest.images import held_space
from contactopt.analysis.simplest.mirrors import side_normals
from contactopt.analysis.simplest.regions import NEAR, inside
from contactopt.analysis.simplest.sections import face_mesh, flattened, to_axes
from contactopt.analysis.simplest.shapes import Shapes, shapes_of
from contactopt.analysis.simplest.turning import turned
from contactopt.scenes.scene import BodyForce, Part, Plate, Scene

EVEN = 1e-6  # a direction across or along another one, but for so much
Lift = Callable[[np.ndarray], np.ndarray]


def prism(shapes: Shapes) -> tuple[np.ndarray, str] | None:
    """The axis of a scene of prisms, and half a sentence if something else than the bodies is in the way of plane strain."""
    if shapes.scene.kind != "solid":
        return None
    reasons: list[tuple[np.ndarray, str]] = []
    for axis in [*np.eye(3), *side_normals(shapes)]:
        ends = _ends(shapes, axis)
        if ends is None or any(abs(axis @ other) > 1 - EVEN for other, _ in reasons):
            continue
        reason = _changes_along(shapes, axis, ends)
        if not reason:
            return axis, ""
        reasons.append((axis, reason))
    if len(reasons) == 1:  # blocks are prisms along each of their edges: then there is nothing to say
        return reasons[0]
    return None


def _ends(shapes: Shapes, axis: np.ndarray) -> tuple[float, float] | None:
    """Where the two end planes of all bodies lie along the axis; None if the bodies are no prisms between such planes."""
    places = []
    for whole in shapes.wholes.values():
        along = np.abs(axis @ whole.normals)
        end = along > 1 - EVEN
        if np.any(~end & (along > EVEN)) or not end.any():
            return None
        places.append(axis @ whole.corners.mean(axis=1)[:, end])
    at = np.concatenate(places)
    low, high = float(at.min()), float(at.max())
    near = NEAR * shapes.size
    if any(np.ptp(own) < (high - low) - near for own in places):
        return None
    return (low, high) if np.all(np.minimum(at - low, high - at) < near) else None


def _changes_along(shapes: Shapes, axis: np.ndarray, ends: tuple[float, float]) -> str:
    """Half a sentence that says what is not the same all along the axis, or acts along it; empty if nothing does."""
    for name, part in shapes.parts.items():
        reason = _part_changes(shapes, name, part, axis, ends)
        if reason:
            return reason
    for name, rigid in shapes.rigid.items():
        for what, values in (("force", rigid.force), ("displacement", rigid.displacement)):
            if _along(shapes.scene, values or {}, axis):
                return f"the {what} of rigid body '{name}' acts along the axis"
        if rigid.normal is not None and abs(axis @ np.array(rigid.normal)) > EVEN:
            return f"the normal of rigid body '{name}' is not across the axis"
        if rigid.gap is not None and not callable(rigid.gap):
            return f"the gap of rigid body '{name}' is given contact by contact"
    shift = axis[:, None] * (ends[1] - ends[0])
    for pair in shapes.scene.pairs:
        if np.ndim(pair.mu) if not callable(pair.mu) else False:
            return f"the friction of contact '{pair.name}' is given contact by contact"
        gaps = [shapes.rigid[name].gap for name in pair.bodies if name in shapes.rigid]
        functions = [function for function in (pair.mu, *gaps) if callable(function)]
        for name, surface in zip(pair.bodies, pair.surfaces):
            if name in shapes.parts:
                x = shapes.boundary(name, surface or shapes.parts[name].contact).samples[0]
                flat = x - axis[:, None] * (axis @ x - ends[0])
                moved = [flat + share * shift for share in (0.0, 0.31, 1.0)]
                if not all(_constant([np.asarray(function(x)) for x in moved]) for function in functions):
                    return f"the gap or the friction of contact '{pair.name}' changes along the axis"
    return ""


def _constant(values: list[np.ndarray]) -> bool:
    return bool(all(np.all(np.abs(v - values[0]) <= NEAR * np.abs(values[0]).max()) for v in values))


def _along(scene: Scene, values: Mapping[str, float] | None, axis: np.ndarray) -> bool:
    """Whether values of components have a part along the axis."""
    v = held_space(scene.components, values)[1]
    return bool(abs(axis @ v) > EVEN * np.abs(v).max()) if np.any(v) else False


def _part_changes(shapes: Shapes, name: str, part: Part, axis: np.ndarray, ends: tuple[float, float]) -> str:
    scene, mesh = shapes.scene, shapes.meshes[name]
    outer = mesh.boundary_facets()
    normals = _facet_normals(mesh, outer)
    end = set(outer[np.abs(axis @ normals) > 1 - EVEN].tolist())

    def place(boundary: str) -> str:
        facets = set(np.asarray(mesh.boundaries[boundary]).tolist())
        return "end" if facets <= end else "" if facets & end else "side"

    rollers: set[int] = set()
    for support in part.supports:
        what = f"the support on {support.boundary!r} of body '{name}'"
        P, _ = held_space(scene.components, support.displacement)
        where = place(support.boundary)
        if _along(scene, support.displacement or {}, axis):
            return f"{what} moves it along the axis"
        if where == "end" and np.allclose(P, np.outer(axis, axis), atol=EVEN):
            rollers |= set(np.asarray(mesh.boundaries[support.boundary]).tolist())
        elif where != "side" or not _runs_through(shapes, name, support.boundary, axis, ends):
            return f"{what} does not run along the whole axis"
    for load in part.loads:
        if isinstance(load, BodyForce):
            if abs(axis @ np.array(load.value, float)) > EVEN * np.abs(load.value).max():
                return f"the force per volume of body '{name}' acts along the axis"
            continue
        what = f"the {'plate' if isinstance(load, Plate) else 'traction'} on {load.boundary!r} of body '{name}'"
        force = load.force if isinstance(load, Plate) else dict(zip(scene.components, load.value))
        if _along(scene, force, axis):
            return f"{what} acts along the axis"
        if place(load.boundary) != "side" or not _runs_through(shapes, name, load.boundary, axis, ends):
            return f"{what} does not run along the whole axis"
    for surface in scene.surfaces_of(part):
        if place(surface) != "side" or not _runs_through(shapes, name, surface, axis, ends):
            return f"the contact surface {surface!r} of body '{name}' does not run along the whole axis"
    if not end <= rollers:
        return f"the ends of body '{name}' are not held along the axis"
    return ""


def _facet_normals(mesh: Any, facets: np.ndarray) -> np.ndarray:
    corners = mesh.p[:, mesh.facets[:, facets]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
    return np.asarray(across / np.linalg.norm(across, axis=0))


def _runs_through(shapes: Shapes, body: str, boundary: str, axis: np.ndarray, ends: tuple[float, float]) -> bool:
    """Whether a boundary, moved along the axis between the ends, stays on itself."""
    where, (low, high) = shapes.boundary(body, boundary), ends

    def to(share: float) -> Lift:
        return lambda x: x + axis[:, None] * (low + share * (high - low) - axis @ x)

    return all(inside(where, where, to(share), shapes.size) for share in (0.013, 0.37, 0.5, 0.71, 0.987))


def plane_strain(shapes: Shapes, axis: np.ndarray) -> Scene:
    """The section of a scene of prisms; InputError if a support or plate cannot be turned with the axis."""
    scene = shapes.scene
    if np.abs(axis).max() < 1 - EVEN:
        scene = turned(scene, to_axes(axis))
        seen = shapes_of(scene)
        assert seen is not None
        shapes, axis = seen, np.array([0.0, 0.0, 1.0])
    number = int(np.argmax(np.abs(axis)))
    ends = _ends(shapes, np.eye(3)[number])
    assert ends is not None
    low, high = ends
    axes = [other for other in range(3) if other != number]

    def flat(mesh: Any) -> Any:
        at = mesh.p[number][mesh.facets]
        facets = np.flatnonzero(np.all(np.abs(at - low) < NEAR * (high - low), axis=0))
        return face_mesh(mesh, facets, axes)

    def lift(x: np.ndarray) -> np.ndarray:
        return np.insert(x, number, low, axis=0)

    drop = {scene.components[number]: None} | {scene.components[old]: new for old, new in zip(axes, ("x", "y"))}
    made = flattened(scene, "plane-strain", drop, axes, flat, lift)
    return replace(made, thickness=scene.thickness * (high - low))
