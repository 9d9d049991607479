"""Whether a scene is its own mirror image: meshes, materials, supports, loads, laws, friction and gaps.

A mesh is its own image, or that of another body, if every node and every element has one. The solution of the whole scene is
then its own image, too, on this mesh and to the last digits. Boundaries are compared by their facets, and functions of the
place at the nodes and between them. Nothing is read from names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import BodyForce, Part, Plate, Support
from contactopt.simplification.constants import EQUAL, NEAR, ROUNDED
from contactopt.simplification.whole import Whole


@dataclass(frozen=True, eq=False)
class Plane:
    """The points x with normal' x = offset."""

    normal: np.ndarray
    offset: float

    @property
    def reflection(self) -> np.ndarray:
        """H (dim, dim)."""
        return np.eye(len(self.normal)) - 2 * np.outer(self.normal, self.normal)

    def image(self, points: np.ndarray) -> np.ndarray:
        """The mirror images of points (dim, k)."""
        return np.asarray(points - 2 * self.normal[:, None] * (self.normal @ points - self.offset))

    def height(self, points: np.ndarray) -> np.ndarray:
        """How far points (dim, ...) are on the positive side."""
        return np.asarray(np.tensordot(self.normal, points, 1) - self.offset)

    def words(self, components: tuple[str, ...]) -> str:
        """'x = 0', or '0.866 x + 0.5 y = 3'."""
        terms = [(value, component) for value, component in zip(self.normal, components) if abs(value) > NEAR]
        sign = np.sign(terms[0][0])
        offset = sign * self.offset if abs(self.offset) > 1e-12 else 0.0
        if len(terms) == 1:
            return f"{terms[0][1]} = {offset:g}"
        text = " + ".join(f"{sign * value:.4g} {component}" for value, component in terms).replace("+ -", "- ")
        return f"{text} = {offset:.4g}"


@dataclass(frozen=True, eq=False)
class Images:
    """How a scene lies on itself after a reflection.

    bodies   name of each body -> name of its image;  pairs  name of each pair of surfaces -> name of its image
    own      (body, number of a load) of the plates that are their own images
    swapped  names of the pairs whose image has the upper surface for its lower one
    """

    bodies: Mapping[str, str]
    pairs: Mapping[str, str]
    own: frozenset[tuple[str, int]]
    swapped: frozenset[str]


def images_under(whole: Whole, plane: Plane) -> Images | str | None:
    """How the scene lies on itself.

    Half a sentence if the meshes lie on themselves and the rest does not; None if they do not.
    """
    return _Comparison(whole, plane).images()


def equal_functions(one: Any, other: Any, here: np.ndarray, there: np.ndarray) -> bool:
    """Whether one function (or number) here and the other there are the same, each value beside itself."""
    a, b = (
        np.broadcast_to(np.asarray(f(x) if callable(f) else f, dtype=float), x.shape[1:])
        for f, x in ((one, here), (other, there))
    )
    size = np.maximum(np.abs(a), np.abs(b))
    return bool(np.all(np.abs(a - b) <= EQUAL * size + ROUNDED * size.max(initial=0.0)))


def held_space(components: tuple[str, ...], values: Mapping[str, float] | None) -> tuple[np.ndarray, np.ndarray]:
    """The projection (dim, dim) on the components that have values, and these values as a vector (dim,)."""
    values = dict.fromkeys(components, 0.0) if values is None else values
    mask = np.array([component in values for component in components])
    return np.diag(mask.astype(float)), np.array([float(values.get(component, 0.0)) for component in components])


def close(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two vectors are equal."""
    return bool(np.all(np.abs(one - other) <= EQUAL * max(np.abs(one).max(), np.abs(other).max())))


@dataclass(frozen=True, eq=False)
class _Comparison:
    """A scene beside its image under one reflection."""

    whole: Whole
    plane: Plane

    @cached_property
    def bodies(self) -> dict[str, tuple[str, np.ndarray]] | None:
        """The image of each elastic body, and where its nodes lie there; None if one has none."""
        found = {}
        for name, mesh in self.whole.meshes.items():
            for image in (name, *(other for other in self.whole.meshes if other != name)):
                nodes = self._nodes(mesh, self.whole.meshes[image])
                if nodes is not None:
                    found[name] = image, nodes
                    break
            else:
                return None
        return found if all(found[image][0] == name for name, (image, _) in found.items()) else None

    def _nodes(self, mesh: Any, image: Any) -> np.ndarray | None:
        """The node of a mesh on which the image of each node lies; None unless nodes and elements all have their images."""
        here, there = self.plane.image(mesh.doflocs), image.doflocs
        if here.shape != there.shape or mesh.t.shape != image.t.shape:
            return None
        near = NEAR * self.whole.size
        if np.abs(np.sort(here, axis=1)[:, [0, -1]] - np.sort(there, axis=1)[:, [0, -1]]).max() > near:
            return None
        distance, nodes = KDTree(there.T).query(here.T)
        fits = distance.max() <= near and np.array_equal(_cells(nodes[mesh.t]), _cells(image.t))
        return np.asarray(nodes) if fits else None

    def fits(self, body: str, boundary: str, other: str) -> bool:
        """Whether a boundary of a body has another boundary of its image as its mirror image."""
        assert self.bodies is not None
        image, nodes = self.bodies[body]
        mesh, there = self.whole.meshes[body], self.whole.meshes[image]
        own, facets = mesh.facets[:, mesh.boundaries[boundary]], there.facets[:, there.boundaries[other]]
        return own.shape == facets.shape and np.array_equal(_cells(nodes[own]), _cells(facets))

    def images(self) -> Images | str | None:
        """As images_under()."""
        if self.bodies is None or not all(map(self._surfaces_fit, self.bodies)):
            return None
        own: set[tuple[str, int]] = set()
        for name in self.bodies:
            reason = self._part_differs(name, own)
            if reason:
                return reason
        rigid = self._images_of_rigid()
        if isinstance(rigid, str):
            return rigid
        return self._images_of_pairs({name: image for name, (image, _) in self.bodies.items()} | rigid, own)

    def _surfaces_fit(self, name: str) -> bool:
        """Whether every contact surface of a body has a contact surface as its image."""
        scene, image = self.whole.scene, self._image(name)
        return all(
            any(self.fits(name, surface, other) for other in scene.surfaces_of(image))
            for surface in scene.surfaces_of(self.whole.parts[name])
        )

    def _image(self, name: str) -> Part:
        assert self.bodies is not None
        return self.whole.parts[self.bodies[name][0]]

    def _part_differs(self, name: str, own: set[tuple[str, int]]) -> str:
        """Half a sentence if a body has another material, other supports, loads or curves than its image."""
        part, image = self.whole.parts[name], self._image(name)
        if part.material != image.material:
            return f"the bodies '{name}' and '{image.name}' have different materials"
        for item in (*part.supports, *part.loads):
            found = [other for other in (*image.supports, *image.loads) if self._is_image(name, item, other)]
            if not found:
                where = f" on {item.boundary!r}" if hasattr(item, "boundary") else ""
                return f"the {_kind(item)}{where} of body '{name}' has no mirror image"
            if isinstance(item, Plate) and found[0] is item:
                own.add((name, part.loads.index(item)))
        for surface in self.whole.scene.surfaces_of(part):
            curve, x = part.curve_of(surface), self.whole.acting(name, surface)
            others = [
                image.curve_of(s) for s in self.whole.scene.surfaces_of(image) if self.fits(name, surface, s)
            ]
            if (curve is None) != (others[0] is None):
                return f"the curve of body '{name}' is not symmetric"
            if curve is not None and others[0] is not None:
                apart = np.abs(self.plane.image(curve(x)) - others[0](self.plane.image(x))).max()
                if not apart <= ROUNDED * self.whole.size:
                    return f"the curve of body '{name}' is not symmetric"
        return ""

    def _is_image(self, name: str, one: Any, other: Any) -> bool:
        """Whether one support or load of a body becomes the other one of its image."""
        if type(one) is not type(other) or getattr(one, "glued", 0) != getattr(other, "glued", 0):
            return False
        components = self.whole.scene.components
        if isinstance(one, (Support, Plate)):
            values = [item.displacement if isinstance(item, Support) else item.force for item in (one, other)]
            same = self._same_values(*values)
        else:
            same = close(self.plane.reflection @ np.array(one.value, float), np.array(other.value, float))
        assert len(components) == len(self.plane.normal)
        return same and (isinstance(one, BodyForce) or self.fits(name, one.boundary, other.boundary))

    def _same_values(self, one: Mapping[str, float] | None, other: Mapping[str, float] | None) -> bool:
        """Whether the reflection turns the values of some components into others."""
        components, H = self.whole.scene.components, self.plane.reflection
        (P, v), (Q, w) = held_space(components, one), held_space(components, other)
        return bool(np.allclose(H @ P @ H.T, Q, atol=EQUAL)) and close(H @ v, w)

    def _images_of_rigid(self) -> dict[str, str] | str:
        """The image of each rigid body: the one whose partners, forces, normal and gap are the images of its own."""
        found: dict[str, str] = {}
        for name in self.whole.rigid:
            reasons = []
            for other in (name, *(another for another in self.whole.rigid if another != name)):
                reasons.append(self._rigid_differ(name, other))
                if not reasons[-1]:
                    found[name] = other
                    break
            else:
                return reasons[0]
        if any(found[image] != name for name, image in found.items()):
            return "rigid bodies are not each other's images"
        return found

    def _partners(self, rigid: str) -> list[tuple[str, str]]:
        """The surfaces (elastic body, boundary) that may touch a rigid body."""
        pairs = [pair for pair in self.whole.scene.pairs if rigid in pair.bodies]
        sides = [1 - pair.bodies.index(rigid) for pair in pairs]
        return [(pair.bodies[side], self.whole.surface_of(pair, side)) for pair, side in zip(pairs, sides)]

    def _rigid_differ(self, name: str, other: str) -> str:
        assert self.bodies is not None
        one, two, surfaces = self.whole.rigid[name], self.whole.rigid[other], self._partners(name)
        for body, boundary in surfaces:
            there = [s for partner, s in self._partners(other) if partner == self.bodies[body][0]]
            if not any(self.fits(body, boundary, s) for s in there):
                return f"what rigid body '{name}' touches has no mirror image"
        for what in ("force", "displacement"):
            if not self._same_values(getattr(one, what) or {}, getattr(two, what) or {}):
                return f"the {what} of rigid body '{name}' is not symmetric"
        normals = [None if body.normal is None else np.array(body.normal, float) for body in (one, two)]
        if normals[0] is None or normals[1] is None:
            turned = normals[0] is not normals[1]
        else:
            a, b = (normal / np.linalg.norm(normal) for normal in normals)  # type: ignore[arg-type, type-var]
            turned = not close(self.plane.reflection @ a, b)
        if turned:
            return f"the normal of rigid body '{name}' is not symmetric"
        gaps = [0.0 if gap is None else gap for gap in (one.gap, two.gap)]
        if any(np.ndim(gap) for gap in gaps if not callable(gap)):
            return f"the gap of rigid body '{name}' is no function of the place, and has no image to compare it with"
        for x in (self.whole.acting(*surface) for surface in surfaces):
            if not equal_functions(*gaps, x, self.plane.image(x)):
                return f"the gap of rigid body '{name}' is not symmetric"
        return ""

    def _images_of_pairs(self, images: Mapping[str, str], own: set[tuple[str, int]]) -> Images | str:
        """With the image of each pair of surfaces; half a sentence if one has none, or if it lies in the plane."""
        found, swapped = {}, set()
        for pair in self.whole.scene.pairs:
            if images[pair.bodies[0]] == pair.bodies[1]:
                return f"the contact '{pair.name}' lies in this plane itself, between a body and its own mirror image"
            facing = [(o, self._facing(pair, o, images)) for o in self.whole.scene.pairs]
            facing = [(other, order) for other, order in facing if order is not None]
            if not facing:
                return f"the contact '{pair.name}' has no mirror image"
            other, order = facing[0]
            reason = self._law_differs(pair, other)
            if reason:
                return reason
            found[pair.name] = other.name
            if order == (1, 0):
                swapped.add(pair.name)
        return Images(images, found, frozenset(own), frozenset(swapped))

    def _facing(self, pair: Contact, other: Contact, images: Mapping[str, str]) -> tuple[int, int] | None:
        """Which sides of the other pair are the images of the upper and the lower side of this one; None if they are not."""
        for order in ((0, 1), (1, 0)):
            named = [images[pair.bodies[side]] == other.bodies[there] for side, there in enumerate(order)]
            if all(named) and all(
                pair.bodies[side] in self.whole.rigid
                or self.fits(pair.bodies[side], self.whole.surface_of(pair, side), self.whole.surface_of(other, there))
                for side, there in enumerate(order)
            ):
                return order
        return None

    def _law_differs(self, pair: Contact, other: Contact) -> str:
        """Half a sentence if two pairs have different laws or friction."""
        if (pair.law, pair.coupling) != (other.law, other.coupling):
            return f"the contact '{pair.name}' has another law or coupling than its mirror image"
        if any(np.ndim(mu) for mu in (pair.mu, other.mu) if not callable(mu)):
            return f"the friction of contact '{pair.name}' is given contact by contact"
        for side in (0, 1):
            if pair.bodies[side] in self.whole.parts:
                x = self.whole.acting(pair.bodies[side], self.whole.surface_of(pair, side))
                if not equal_functions(pair.mu, other.mu, x, self.plane.image(x)):
                    return f"the friction of contact '{pair.name}' differs from that of its mirror image"
        return ""


def _cells(cells: np.ndarray) -> np.ndarray:
    """Elements or facets (corners, m) by their corners alone, in an order of their own."""
    made = np.sort(cells, axis=0)
    return np.asarray(made[:, np.lexsort(made)])


def _kind(item: Any) -> str:
    return {"BodyForce": "force per volume"}.get(type(item).__name__, type(item).__name__.lower())


