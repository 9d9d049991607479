"""Whether a scene is its own mirror image: meshes, materials, supports, loads, laws, friction and
gaps.

A mesh is its own image, or that of another body, if every node and every element has one. The
solution of the whole scene is then its own image, too, on this mesh and to the last digits.
Boundaries are compared by their facets, and functions of the place at the nodes and between them.
Nothing is read from names.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Part, Plate, Support
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
        return np.asarray(points - 2 * self.normal[:, None] * self.height(points))

    def height(self, points: np.ndarray) -> np.ndarray:
        """How far points (dim, ...) are on the positive side."""
        return np.asarray(np.tensordot(self.normal, points, 1) - self.offset)

    def words(self, components: tuple[str, ...]) -> str:
        """'x = 0', or '0.866 x + 0.5 y = 3'."""
        pairs = zip(self.normal, components)
        terms = [(value, component) for value, component in pairs if abs(value) > NEAR]
        sign = np.sign(terms[0][0])
        factors = ["" if len(terms) == 1 else f"{sign * value:.4g} " for value, _ in terms]
        text = " + ".join(factor + component for factor, (_, component) in zip(factors, terms))
        offset = sign * self.offset if abs(self.offset) > ROUNDED else 0.0
        return f"{text.replace('+ -', '- ')} = {offset:.4g}"


@dataclass(frozen=True, eq=False)
class Images:
    """How a scene lies on itself after a reflection.

    bodies   name of each body -> name of its image
    pairs    name of each pair of surfaces -> name of its image
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
    nodes = _images_of_meshes(whole, plane)
    return None if nodes is None else _Comparison(whole, plane, nodes).images()


def equal_functions(one: Any, other: Any, here: np.ndarray, there: np.ndarray) -> bool:
    """Whether one function (or number) here and the other there are the same at places (dim, s)."""
    a, b = (
        np.broadcast_to(np.asarray(f(x) if callable(f) else f, dtype=float), x.shape[1:])
        for f, x in ((one, here), (other, there))
    )
    size = np.maximum(np.abs(a), np.abs(b))
    return bool(np.all(np.abs(a - b) <= EQUAL * size + ROUNDED * size.max(initial=0.0)))


def held_space(
    components: tuple[str, ...], values: Mapping[str, float] | None
) -> tuple[np.ndarray, np.ndarray]:
    """The projection (dim, dim) on the components that have values, and these values (dim,)."""
    values = dict.fromkeys(components, 0.0) if values is None else values
    mask = np.array([component in values for component in components])
    return np.diag(mask * 1.0), np.array([float(values.get(c, 0.0)) for c in components])


def _images_of_meshes(whole: Whole, plane: Plane) -> dict[str, tuple[str, np.ndarray]] | None:
    """The image of each elastic body, and where its nodes lie there; None if one has none."""
    found: dict[str, tuple[str, np.ndarray]] = {}
    for name, mesh in whole.meshes.items():
        for image in (name, *whole.meshes):
            nodes = _nodes(mesh, whole.meshes[image], plane, NEAR * whole.size)
            if nodes is not None:
                found[name] = image, nodes
                break
        else:
            return None
    return found if all(found[image][0] == name for name, (image, _) in found.items()) else None


def _nodes(mesh: Any, image: Any, plane: Plane, near: float) -> np.ndarray | None:
    """The node of a mesh on which the image of each node lies; None unless all have images."""
    here, there = plane.image(mesh.doflocs), image.doflocs
    if here.shape != there.shape or mesh.t.shape != image.t.shape:
        return None
    if max(np.abs(f(here, 1) - f(there, 1)).max() for f in (np.min, np.max)) > near:
        return None
    distance, nodes = KDTree(there.T).query(here.T)
    fits = distance.max() <= near and np.array_equal(_cells(nodes[mesh.t]), _cells(image.t))
    return np.asarray(nodes) if fits else None


def _cells(cells: np.ndarray) -> np.ndarray:
    """Elements or facets (corners, m) by their corners alone, in an order of their own."""
    made = np.sort(cells, axis=0)
    return np.asarray(made[:, np.lexsort(made)])


def _conditions(part: Any, components: tuple[str, ...]) -> Iterator[tuple[str, str, Any, Any, Any]]:
    """Of a body: words, boundary, projection on components, values there, the object."""
    if not isinstance(part, Part):
        for what in ("force", "displacement"):
            yield what, "", *held_space(components, getattr(part, what) or {}), None
        normal = np.zeros(len(components)) if part.normal is None else np.array(part.normal, float)
        yield "normal", "", np.eye(len(components)), normal / (np.linalg.norm(normal) or 1.0), None
        return
    for item in (*part.supports, *part.loads):
        where, kind = getattr(item, "boundary", ""), type(item).__name__.lower()
        if isinstance(item, (Support, Plate)):
            values = item.displacement if isinstance(item, Support) else item.force
            kind += "" if getattr(item, "glued", True) else " that slides"
            yield kind, where, *held_space(components, values), item
        else:
            kind = kind.replace("bodyforce", "force per volume")
            yield kind, where, np.eye(len(components)), np.array(item.value, float), item


@dataclass(frozen=True, eq=False)
class _Comparison:
    """A scene beside its image under one reflection; `nodes` as _images_of_meshes()."""

    whole: Whole
    plane: Plane
    nodes: Mapping[str, tuple[str, np.ndarray]]

    def fits(self, body: str, boundary: str, other: str) -> bool:
        """Whether a boundary of a body has another boundary of its image as its mirror image."""
        image, nodes = self.nodes[body]
        mesh, there = self.whole.meshes[body], self.whole.meshes[image]
        own = mesh.facets[:, mesh.boundaries[boundary]]
        return np.array_equal(_cells(nodes[own]), _cells(there.facets[:, there.boundaries[other]]))

    def images(self) -> Images | str | None:
        """As images_under()."""
        own: set[tuple[str, int]] = set()
        for name, (image, _) in self.nodes.items():
            part, other = self.whole.parts[name], self.whole.parts[image]
            for surface in self.whole.scene.surfaces_of(part):
                if not any(
                    self.fits(name, surface, s) for s in self.whole.scene.surfaces_of(other)
                ):
                    return None
            if part.material != other.material:
                return f"the bodies '{name}' and '{image}' have different materials"
            reason = self._conditions_differ(part, other, own) or self._curves_differ(part, other)
            if reason:
                return reason
        return self._with_pairs({name: image for name, (image, _) in self.nodes.items()}, own)

    def _conditions_differ(self, part: Any, image: Any, own: set[tuple[str, int]]) -> str:
        """Half a sentence about a support, load, force or normal that has no image; fills `own`."""
        components, H = self.whole.scene.components, self.plane.reflection
        others = list(_conditions(image, components))
        for kind, where, P, v, item in _conditions(part, components):
            for other_kind, there, Q, w, other in others:
                size = max(np.abs(v).max(), np.abs(w).max())
                same = np.allclose(H @ P @ H, Q, atol=EQUAL) and np.all(
                    np.abs(H @ v - w) <= EQUAL * size
                )
                if (
                    kind == other_kind
                    and same
                    and (not where or self.fits(part.name, where, there))
                ):
                    if item is other and isinstance(item, Plate):
                        own.add((part.name, part.loads.index(item)))
                    break
            else:
                place = f" on {where!r}" if where else ""
                return f"the {kind}{place} of body '{part.name}' has no mirror image"
        return ""

    def _curves_differ(self, part: Part, image: Part) -> str:
        for surface in self.whole.scene.surfaces_of(part):
            surfaces = self.whole.scene.surfaces_of(image)
            other = next(image.curve_of(s) for s in surfaces if self.fits(part.name, surface, s))
            curve, x = part.curve_of(surface), self.whole.acting(part.name, surface)
            if curve is None and other is None:
                continue
            if curve is not None and other is not None:
                apart = np.abs(self.plane.image(curve(x)) - other(self.plane.image(x)))
                if apart.max() <= ROUNDED * self.whole.size:
                    continue
            return f"the curve of body '{part.name}' is not symmetric"
        return ""

    def _with_pairs(self, images: dict[str, str], own: set[tuple[str, int]]) -> Images | str:
        """With the images of pairs and rigid bodies; half a sentence if one has none or is cut."""
        found: dict[str, str] = {}
        swapped: set[str] = set()
        for pair in self.whole.scene.pairs:
            if images.get(pair.bodies[0]) == pair.bodies[1]:
                return (
                    f"the contact '{pair.name}' lies in this plane itself, between a body and its"
                    " own mirror image"
                )
            reasons = [f"the contact '{pair.name}' has no mirror image"]
            for other in (pair, *self.whole.scene.pairs):
                order = self._facing(pair, other, images)
                reason = "" if order is None else self._pair_differs(pair, other, order)
                if order is not None and not reason:
                    found[pair.name] = other.name
                    images |= {
                        pair.bodies[side]: other.bodies[there] for side, there in enumerate(order)
                    }
                    swapped |= {pair.name} if order == (1, 0) else set()
                    break
                reasons = [reason, *reasons] if reason and len(reasons) == 1 else reasons
            else:
                return reasons[0]
        if any(images[image] != name for name, image in images.items()):
            return "rigid bodies are not each other's images"
        return Images(images, found, frozenset(own), frozenset(swapped))

    def _facing(
        self, pair: Contact, other: Contact, images: Mapping[str, str]
    ) -> tuple[int, int] | None:
        """Which sides of the other pair are the images of the upper and the lower one."""
        for order in ((0, 1), (1, 0)):
            for side, there in enumerate(order):
                body, image = pair.bodies[side], other.bodies[there]
                if images.get(body, image) != image or (body in self.nodes) != (
                    image in self.nodes
                ):
                    break
                surfaces = self.whole.surface_of(pair, side), self.whole.surface_of(other, there)
                if body in self.nodes and not self.fits(body, *surfaces):
                    break
            else:
                return order
        return None

    def _pair_differs(self, pair: Contact, other: Contact, order: tuple[int, int]) -> str:
        """Half a sentence if two pairs have different laws, friction, gaps or rigid bodies."""
        if (pair.law, pair.coupling) != (other.law, other.coupling):
            return f"the contact '{pair.name}' has another law or coupling than its mirror image"
        functions: list[tuple[str, Any, Any]] = [
            (f"friction of contact '{pair.name}'", pair.mu, other.mu)
        ]
        for side, there in enumerate(order):
            one = self.whole.rigid.get(pair.bodies[side])
            two = self.whole.rigid.get(other.bodies[there])
            if one is not None and two is not None:
                reason = self._conditions_differ(one, two, set())
                if reason:
                    return reason
                gap, image = (0.0 if each.gap is None else each.gap for each in (one, two))
                functions.append((f"gap of rigid body '{one.name}'", gap, image))
        x = np.concatenate(
            [self.whole.acting(*surface) for surface in self.whole.surfaces(pair)], axis=1
        )
        for what, here, there_too in functions:
            if any(np.ndim(each) for each in (here, there_too) if not callable(each)):
                return (
                    f"the {what} is no function of the place, and has no image to compare it with"
                )
            if not equal_functions(here, there_too, x, self.plane.image(x)):
                return f"the {what} is not symmetric"
        return ""
