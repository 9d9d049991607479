"""Whether a scene lies on itself after a reflection or a rotation: bodies, materials, supports, loads, laws, friction and gaps.

The image of a body may be another body, as in an arch. Nothing is read from names or from meshes: boundaries are compared by
where they lie (contactopt.analysis.simplest.regions), values by the matrix H of the reflection or rotation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt.analysis.simplest.planes import Plane, Turn
from contactopt.analysis.simplest.regions import NEAR, same
from contactopt.analysis.simplest.shapes import Shapes
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import BodyForce, Plate, Support, Traction

EQUAL = 1e-9  # relative difference of values that count as equal
SAMPLES = 200  # places at which gaps and friction that depend on the place are compared
Map = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Images:
    """How a scene lies on itself after a reflection or a rotation.

    bodies  name of each body -> name of its image;  pairs  name of each pair of surfaces -> name of its image
    own     (body, number of a load) of the plates that are their own images
    apart   by how much sampled boundaries miss their images [length]
    """

    bodies: Mapping[str, str]
    pairs: Mapping[str, str]
    own: frozenset[tuple[str, int]]
    apart: float


def images_under(shapes: Shapes, plane: Plane | Turn) -> Images | str | None:
    """How the scene lies on itself.

    Half a sentence if the bodies and the surfaces that may touch lie on themselves and the rest does not; None if they do not.
    """
    images: dict[str, str] = {}
    apart = 0.0
    for name in shapes.meshes:
        found = _image_of_body(shapes, name, plane)
        if found is None:
            return None
        images[name], apart = found[0], max(apart, found[1])
    if any(images[image] != name for name, image in images.items()) or not _surfaces_fit(shapes, images, plane):
        return None
    own: set[tuple[str, int]] = set()
    for name, image in images.items():
        reason = _parts_differ(shapes, name, image, plane)
        if reason:
            return reason
        for number, load in enumerate(shapes.parts[name].loads):
            if isinstance(load, Plate) and _image_of_plate(shapes, name, image, load, plane) is load:
                own.add((name, number))
    rigid = _images_of_rigid(shapes, images, plane)
    if isinstance(rigid, str):
        return rigid
    pairs = _images_of_pairs(shapes, images | rigid, plane)
    return pairs if isinstance(pairs, str) else Images(images | rigid, pairs, frozenset(own), apart)


def _surfaces_fit(shapes: Shapes, images: Mapping[str, str], plane: Plane | Turn) -> bool:
    """Whether every contact surface of every body has a contact surface as its image."""
    return all(
        any(
            _mirrored(shapes, name, surface, image, other, plane)
            for other in shapes.scene.surfaces_of(shapes.parts[image])
        )
        for name, image in images.items()
        for surface in shapes.scene.surfaces_of(shapes.parts[name])
    )


def _parts_differ(shapes: Shapes, name: str, image: str, plane: Plane | Turn) -> str:
    """Half a sentence if a body has another material, other supports, loads or curves than its image."""
    if shapes.parts[name].material != shapes.parts[image].material:
        return f"the bodies '{name}' and '{image}' have different materials"
    for load in shapes.parts[name].loads:
        if isinstance(load, Plate) and _image_of_plate(shapes, name, image, load, plane) is None:
            return f"the plate on {load.boundary!r} of body '{name}' has no mirror image"
    return (
        _supports_differ(shapes, name, image, plane)
        or _forces_differ(shapes, name, image, plane)
        or _curves_differ(shapes, name, image, plane)
    )


def _image_of_body(shapes: Shapes, name: str, plane: Plane | Turn) -> tuple[str, float] | None:
    """The body that lies where the image of this one lies, and how far their boundaries are apart."""
    for image in (name, *(other for other in shapes.meshes if other != name)):
        apart = same(shapes.wholes[name], shapes.wholes[image], plane.image, plane.back, shapes.size)
        if apart is not None:
            return image, apart
    return None


def _mirrored(shapes: Shapes, body: str, boundary: str, image: str, other: str, plane: Plane | Turn) -> bool:
    """Whether a boundary of a body has another boundary of its image as its mirror image."""
    key = (plane.key, body, boundary, image, other)
    if key not in shapes.fits:
        one, two = shapes.boundary(body, boundary), shapes.boundary(image, other)
        shapes.fits[key] = same(one, two, plane.image, plane.back, shapes.size) is not None
    return shapes.fits[key]


def held_space(components: tuple[str, ...], values: Mapping[str, float] | None) -> tuple[np.ndarray, np.ndarray]:
    """The projection (dim, dim) on the components that have values, and these values as a vector (dim,)."""
    values = dict.fromkeys(components, 0.0) if values is None else values
    mask = np.array([component in values for component in components])
    return np.diag(mask.astype(float)), np.array([float(values.get(component, 0.0)) for component in components])


def _same_values(
    components: tuple[str, ...], one: Mapping[str, float] | None, other: Mapping[str, float] | None, H: np.ndarray
) -> bool:
    """Whether H turns the values of some components into others."""
    (P, v), (Q, w) = held_space(components, one), held_space(components, other)
    scale = max(float(np.abs(v).max()), float(np.abs(w).max()))
    return bool(np.allclose(H @ P @ H.T, Q, atol=EQUAL) and np.all(np.abs(H @ v - w) <= EQUAL * scale))


def _supports_differ(shapes: Shapes, name: str, image: str, plane: Plane | Turn) -> str:
    components, H = shapes.scene.components, plane.reflection

    def is_image(one: Support, other: Support) -> bool:
        values = _same_values(components, one.displacement, other.displacement, H)
        return values and _mirrored(shapes, name, one.boundary, image, other.boundary, plane)

    for support in shapes.parts[name].supports:
        if not any(is_image(support, other) for other in shapes.parts[image].supports):
            return f"the support on {support.boundary!r} of body '{name}' has no mirror image"
    return ""


def _forces_differ(shapes: Shapes, name: str, image: str, plane: Plane | Turn) -> str:
    """Tractions and forces per volume."""
    H, parts = plane.reflection, shapes.parts

    def volume(body: str) -> np.ndarray:
        return sum(
            (np.array(load.value, float) for load in parts[body].loads if isinstance(load, BodyForce)), np.zeros(len(H))
        )

    if not _close(H @ volume(name), volume(image)):
        return f"the force per volume of body '{name}' is not symmetric"

    def is_image(one: Traction, other: Any) -> bool:
        if not isinstance(other, Traction) or not _close(H @ np.array(one.value), np.array(other.value)):
            return False
        return _mirrored(shapes, name, one.boundary, image, other.boundary, plane)

    for load in parts[name].loads:
        if isinstance(load, Traction) and not any(is_image(load, other) for other in parts[image].loads):
            return f"the traction on {load.boundary!r} of body '{name}' has no mirror image"
    return ""


def _curves_differ(shapes: Shapes, name: str, image: str, plane: Plane | Turn) -> str:
    """The surfaces for which the meshes stand."""
    one, two = shapes.parts[name], shapes.parts[image]
    for boundary in shapes.scene.surfaces_of(one):
        curve = one.curve_of(boundary)
        partners = [
            two.curve_of(other)
            for other in shapes.scene.surfaces_of(two)
            if _mirrored(shapes, name, boundary, image, other, plane)
        ]
        if curve is None and partners[0] is None:
            continue
        x, other = _few(shapes, name, boundary), partners[0]
        if curve is None or other is None:
            return f"the curve of body '{name}' is not symmetric"
        if np.abs(plane.image(curve(x)) - other(plane.image(x))).max() > NEAR * shapes.size:
            return f"the curve of body '{name}' is not symmetric"
    return ""


def _close(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(np.all(np.abs(one - other) <= EQUAL * max(np.abs(one).max(), np.abs(other).max())))


def _image_of_plate(shapes: Shapes, name: str, image: str, plate: Plate, plane: Plane | Turn) -> Plate | None:
    """The plate of the image that is this plate's mirror image, if there is one."""
    for other in shapes.parts[image].loads:
        if (
            isinstance(other, Plate)
            and other.glued == plate.glued
            and _same_values(shapes.scene.components, plate.force, other.force, plane.reflection)
            and _mirrored(shapes, name, plate.boundary, image, other.boundary, plane)
        ):
            return other
    return None


def _surfaces(shapes: Shapes, body: str) -> list[tuple[str, str]]:
    """The surfaces (elastic body, boundary) that may touch a rigid body."""
    found = []
    for pair in shapes.scene.pairs:
        if body in pair.bodies:
            side = 1 - pair.bodies.index(body)
            found.append((pair.bodies[side], surface_of(shapes, pair, side)))
    return found


def surface_of(shapes: Shapes, pair: Contact, side: int) -> str:
    """The name of the boundary of a side of a pair; empty for a rigid body."""
    part = shapes.parts.get(pair.bodies[side])
    return "" if part is None else pair.surfaces[side] or part.contact


def _images_of_rigid(shapes: Shapes, images: Mapping[str, str], plane: Plane | Turn) -> dict[str, str] | str:
    """The image of each rigid body: the one whose partners, forces, normal and gap are the images of its own."""
    found = {}
    for name, rigid in shapes.rigid.items():
        reason = ""
        for other in (name, *(another for another in shapes.rigid if another != name)):
            reason = reason or ""
            why = _rigid_differ(shapes, rigid.name, other, images, plane)
            if not why:
                found[name] = other
                break
            reason = reason or why
        if name not in found:
            return reason
    if any(found[image] != name for name, image in found.items()):
        return "rigid bodies are not each other's images"
    return found


def _rigid_differ(shapes: Shapes, name: str, other: str, images: Mapping[str, str], plane: Plane | Turn) -> str:
    one, two = shapes.rigid[name], shapes.rigid[other]
    H, components = plane.reflection, shapes.scene.components
    surfaces, partners = _surfaces(shapes, name), _surfaces(shapes, other)
    for body, boundary in surfaces:
        if not any(
            images[body] == image and _mirrored(shapes, body, boundary, image, there, plane)
            for image, there in partners
        ):
            return f"what rigid body '{name}' touches has no mirror image"
    for what, here, there in (("force", one.force, two.force), ("displacement", one.displacement, two.displacement)):
        if not _same_values(components, here or {}, there or {}, H):
            return f"the {what} of rigid body '{name}' is not symmetric"
    if (one.normal is None) != (two.normal is None):
        return f"the normal of rigid body '{name}' is not symmetric"
    if one.normal is not None and two.normal is not None and not _close(H @ _unit(one.normal), _unit(two.normal)):
        return f"the normal of rigid body '{name}' is not symmetric"
    if one.gap is None and two.gap is None:
        return ""
    if not callable(one.gap) or not callable(two.gap):
        return f"the gap of rigid body '{name}' is not a function of the place, and cannot be compared with its mirror image"
    for body, boundary in surfaces:
        x = _few(shapes, body, boundary)
        if not _equal_functions(one.gap, two.gap, x, plane.image(x)):
            return f"the gap of rigid body '{name}' is not symmetric"
    return ""


def _unit(vector: Any) -> np.ndarray:
    made = np.array(vector, dtype=float)
    return made / np.linalg.norm(made)


def _few(shapes: Shapes, body: str, boundary: str) -> np.ndarray:
    """Some places (dim, s) on a boundary."""
    points = shapes.boundary(body, boundary).samples[0]
    return points[:, :: max(1, points.shape[1] // SAMPLES)]


def _equal_functions(one: Map, other: Map, here: np.ndarray, there: np.ndarray) -> bool:
    """Whether one function here and the other function there have the same values, beside the range of both."""
    a, b = np.asarray(one(here), dtype=float), np.asarray(other(there), dtype=float)
    scale = max(float(np.abs(a).max()), float(np.abs(b).max()))
    return a.shape == b.shape and bool(np.all(np.abs(a - b) <= NEAR * scale))


def _images_of_pairs(shapes: Shapes, images: Mapping[str, str], plane: Plane | Turn) -> dict[str, str] | str:
    """The image of each pair of surfaces; half a sentence if one has none, or if it lies in the plane."""
    found = {}
    for pair in shapes.scene.pairs:
        reason = f"the contact '{pair.name}' has no mirror image"
        if images[pair.bodies[0]] == pair.bodies[1]:
            return f"the contact '{pair.name}' lies in this plane itself, between a body and its own mirror image"
        for other in shapes.scene.pairs:
            order = _facing(shapes, pair, other, images, plane)
            if order is None:
                continue
            reason = _law_differs(shapes, pair, other, plane)
            if not reason:
                found[pair.name] = other.name
            break
        if pair.name not in found:
            return reason
    return found


def _facing(
    shapes: Shapes, pair: Contact, other: Contact, images: Mapping[str, str], plane: Plane | Turn
) -> tuple[int, int] | None:
    """Which sides of the other pair are the images of the upper and the lower side of this one; None if they are not."""
    for order in ((0, 1), (1, 0)):
        if all(
            images[pair.bodies[side]] == other.bodies[there]
            and (
                pair.bodies[side] in shapes.rigid
                or _mirrored(
                    shapes,
                    pair.bodies[side],
                    surface_of(shapes, pair, side),
                    other.bodies[there],
                    surface_of(shapes, other, there),
                    plane,
                )
            )
            for side, there in enumerate(order)
        ):
            return order
    return None


def _law_differs(shapes: Shapes, pair: Contact, other: Contact, plane: Plane | Turn) -> str:
    """Half a sentence if two pairs have different laws or friction."""
    if pair.law != other.law:
        return f"the contact '{pair.name}' has another law than its mirror image"
    if pair.law in ("tied", "frictionless"):
        return ""
    if not callable(pair.mu) and not callable(other.mu):
        if np.ndim(pair.mu) or np.ndim(other.mu):
            return f"the friction of contact '{pair.name}' is given contact by contact, and cannot be compared with its mirror image"
        return (
            ""
            if pair.mu == other.mu
            else f"the friction of contact '{pair.name}' differs from that of its mirror image"
        )
    for side in (0, 1):
        boundary = surface_of(shapes, pair, side)
        if boundary:
            x = _few(shapes, pair.bodies[side], boundary)
            if not _equal_functions(_function(pair.mu), _function(other.mu), x, plane.image(x)):
                return f"the friction of contact '{pair.name}' is not symmetric"
    return ""


def _function(mu: Any) -> Map:
    def value(x: np.ndarray) -> np.ndarray:
        return np.broadcast_to(np.asarray(mu(x) if callable(mu) else mu, dtype=float), x.shape[1:])

    return value
