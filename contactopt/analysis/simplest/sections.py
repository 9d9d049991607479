"""Solids whose answer is that of a plane section: prisms whose ends are held along the axis, and bodies of revolution.

A prism has sides along one axis and ends on two planes across it. If the ends are held along the axis, on rollers, and nothing
else changes along the axis or acts along it, then strain is plane and the section is exact. A body of revolution fits itself
after a turn by any angle about its axis; if loads and supports do too, the section on one side of the axis is exact.

The section is made of faces of the elements: those on one end of the prism, or those in a plane through the axis, along which the
mesh is cut.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import skfem

from contactopt.analysis.simplest.cutting import Side, half_mesh
from contactopt.analysis.simplest.mirrors import Images, Turn, held_space, images_under, side_normals
from contactopt.analysis.simplest.regions import NEAR, inside
from contactopt.analysis.simplest.shapes import Shapes, shapes_of
from contactopt.analysis.simplest.turning import of_mesh, turned
from contactopt.scenes.scene import BodyForce, Part, Plate, Rigid, Scene, Support

ANGLES = np.deg2rad([37.0, 101.0, 163.0])  # turns that no polygon with few sides survives
EVEN = 1e-6  # a direction across or along another one, but for so much

Lift = Callable[[np.ndarray], np.ndarray]


# ---------------------------------------------------------------------------------------------------------------- prisms


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
        scene = turned(scene, _to_axes(axis))
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
    made = _flattened(scene, "plane-strain", drop, axes, flat, lift)
    return replace(made, thickness=scene.thickness * (high - low))


def _to_axes(axis: np.ndarray) -> np.ndarray:
    """A rotation that takes the axis to the third one; as much of the others as possible stays."""
    z = axis / np.linalg.norm(axis)
    x = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


# -------------------------------------------------------------------------------------------------- bodies of revolution


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
    R = _to_axes(axis) if np.abs(axis).max() < 1 - EVEN or np.argmax(np.abs(axis)) != 2 else np.eye(3)
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

    made = _flattened(scene, "axisymmetric", {"x": "r", "y": None, "z": "z"}, [0, 2], flat, lift)

    def on_axis(part: Any) -> Any:
        if not isinstance(part, Part):
            return part
        mesh = part.build_mesh(scene.elements, scene.zone)
        held = (
            (Support("axis of revolution", {"r": 0.0}),) if len(mesh.boundaries.get("axis of revolution", ())) else ()
        )
        return replace(part, supports=(*part.supports, *held))

    return made.with_parts(on_axis)


# ---------------------------------------------------------------------------------------------------------------- both


def face_mesh(mesh: Any, facets: np.ndarray, axes: list[int]) -> Any:
    """Some faces of a solid's elements in one plane as a mesh of the plane, with the names of the boundaries they end on.

    Parameters
    ----------
    mesh
        Of tetrahedra or hexahedra.
    facets
        Numbers of the faces (m,).
    axes
        The two coordinates that stay.

    Returns
    -------
    MeshTri or MeshQuad
        Its edges bear the names of the boundaries whose faces end on them.
    """
    corners = mesh.facets[:, facets]
    nodes, cells = np.unique(corners, return_inverse=True)
    cells = cells.reshape(corners.shape)
    points = mesh.p[np.ix_(np.array(axes), nodes)]
    ahead, far = points[:, cells[1]] - points[:, cells[0]], points[:, cells[2]] - points[:, cells[0]]
    turns = ahead[0] * far[1] - ahead[1] * far[0] < 0
    cells[1:, turns] = cells[:0:-1, turns]
    made = (skfem.MeshTri if len(cells) == 3 else skfem.MeshQuad)(points, cells)
    outer = made.boundary_facets()
    ends = np.sort(nodes[made.facets[:, outer]], axis=0)
    names = {}
    for name, members in (mesh.boundaries or {}).items():
        rims = mesh.facets[:, np.setdiff1d(members, facets)]
        edges = np.concatenate([np.sort(rims[[i, i - 1]], axis=0) for i in range(len(rims))], axis=1)
        width = mesh.p.shape[1] + 1
        own = np.isin(ends[0] * width + ends[1], edges[0].astype(np.int64) * width + edges[1])
        if own.any():
            names[name] = outer[own]
    return made.with_boundaries(names)


def _flattened(
    scene: Scene,
    kind: str,
    names: Mapping[str, str | None],
    axes: list[int],
    flat: Callable[[Any], Any],
    lift: Lift,
) -> Scene:
    """The scene on sections: components by their new names, vectors without the component that is left out."""

    def values(old: Mapping[str, float] | None) -> dict[str, float] | None:
        return None if old is None else {str(names[c]): v for c, v in old.items() if names[c] is not None}

    def below(function: Any) -> Any:
        return (lambda x: function(lift(x))) if callable(function) else function

    def curve(function: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
        shift = lift(np.zeros((2, 1)))[axes]
        return lambda x: function(lift(x))[axes] - shift

    def part_of(part: Any) -> Any:
        if isinstance(part, Rigid):
            normal = None if part.normal is None else tuple(part.normal[axis] for axis in axes)
            force, displacement = values(part.force), values(part.displacement)
            return replace(part, normal=normal, gap=below(part.gap), force=force, displacement=displacement)
        mesh = of_mesh(part.mesh, flat)
        there = part_boundaries(mesh, scene)
        supports = tuple(
            replace(support, displacement=values(support.displacement))
            for support in part.supports
            if support.boundary in there and values(support.displacement) != {}
        )
        loads: list[Any] = []
        for load in part.loads:
            if isinstance(load, Plate):
                loads.append(replace(load, force=values(load.force) or {}))
            else:
                loads.append(replace(load, value=tuple(load.value[axis] for axis in axes)))
        found = {name: part.curve_of(name) for name in scene.surfaces_of(part)}
        curves = {name: curve(function) for name, function in found.items() if function is not None}
        return replace(part, mesh=mesh, supports=supports, loads=tuple(loads), curve=curves or None)

    pairs = tuple(replace(pair, mu=below(pair.mu)) for pair in scene.pairs)
    parts = tuple(part_of(part) for part in scene.parts)
    if scene.contacts:
        return replace(scene, kind=kind, bodies=parts, contacts=pairs)
    return replace(scene, kind=kind, upper=parts[0], lower=parts[1], mu=pairs[0].mu)


def part_boundaries(mesh: Any, scene: Scene) -> set[str]:
    """Names of the boundaries that a mesh has, made at the scene's own number of elements if it is a function."""
    made = mesh(scene.elements, scene.zone) if callable(mesh) else mesh
    return {name for name, facets in (made.boundaries or {}).items() if len(facets)}
