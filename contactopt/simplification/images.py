"""Whether a scene is its own mirror image, and so its solution to the last digits: every node and
every element must have an image, in its own mesh or in that of another body. Boundaries are
compared by their facets, functions at the nodes and between them; nothing is read from names.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.spatial import KDTree
from skfem import Mesh

from contactopt.defaults import EQUAL, ROUNDED
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Part
from contactopt.simplification.whole import Whole

if TYPE_CHECKING:
    from contactopt.meshes.given_curves import Curve
    from contactopt.scenes.body_kinds import Rigid, Support
    from contactopt.scenes.loads import Load


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
        terms = [(value, component) for value, component in pairs if abs(value) > EQUAL]
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
    own: set[tuple[str, int]]
    swapped: set[str]


class _Differs(Exception):
    """Half a sentence that says what has no mirror image; empty where that is a surface."""


def images_under(whole: Whole, plane: Plane) -> Images | str | None:
    """How the scene lies on itself; half a sentence if only its meshes do, None if they do not."""
    nodes = _images_of_meshes(whole, plane)
    if nodes is None:
        return None
    try:
        return _Comparison(whole, plane, nodes).images()
    except _Differs as reason:
        return str(reason) or None


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
            nodes = _nodes(mesh, whole.meshes[image], plane, EQUAL * whole.size)
            if nodes is not None:
                found[name] = image, nodes
                break
        else:
            return None
    return found if all(found[image][0] == name for name, (image, _) in found.items()) else None


def _nodes(mesh: Mesh, image: Mesh, plane: Plane, near: float) -> np.ndarray | None:
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


class _Condition(NamedTuple):
    """A support, load, force or normal by words, boundary, projection (dim, dim), values (dim,),
    and a number that no reflection changes.
    """

    kind: str
    where: str
    space: np.ndarray
    values: np.ndarray
    item: Support | Load | None
    number: float = 0.0


def _conditions(part: Part | Rigid, components: tuple[str, ...]) -> Iterator[_Condition]:
    """All of a body."""
    whole = np.eye(len(components))
    if not part.meshed:
        for what in ("force", "displacement"):
            yield _Condition(what, "", *held_space(components, getattr(part, what) or {}), None)
        normal = np.zeros(len(components)) if part.normal is None else np.array(part.normal, float)
        yield _Condition("normal", "", whole, normal / (np.linalg.norm(normal) or 1.0), None)
        return
    holders: tuple[Support | Load, ...] = (*part.supports, *part.loads)
    for item in holders:
        kind = item.what + ("" if getattr(item, "glued", True) else " that slides")
        kind += "" if getattr(item, "tilting", True) else " that stays parallel"
        values = item.values(components)
        space = held_space(components, values)
        if (way := getattr(item, "direction", None)) is not None:
            space = np.outer(way, way) / np.dot(way, way), space[1]
        yield _Condition(kind, item.boundary, *space, item, values.get("", 0.0))


@dataclass(frozen=True, eq=False)
class _Comparison:
    """A scene beside its image; each function raises _Differs where something has none."""

    whole: Whole
    plane: Plane
    nodes: Mapping[str, tuple[str, np.ndarray]]

    def fits(self, body: str, boundary: str, other: str) -> bool:
        """Whether a boundary of a body has another boundary of its image as its mirror image."""
        image, nodes = self.nodes[body]
        mesh, there = self.whole.meshes[body], self.whole.meshes[image]
        own = mesh.facets[:, mesh.boundaries[boundary]]
        return np.array_equal(_cells(nodes[own]), _cells(there.facets[:, there.boundaries[other]]))

    def images(self) -> Images:
        own: set[tuple[str, int]] = set()
        for name, (image, _) in self.nodes.items():
            part, other = self.whole.parts[name], self.whole.parts[image]
            twins = self._surfaces(part, other)
            if part.material != other.material:
                raise _Differs(f"the bodies '{name}' and '{image}' have different materials")
            own |= self._plates(part, other)
            for surface, twin in twins.items():
                self._compare_curves(part, surface, other.curve_of(twin))
        return self._with_pairs({name: image for name, (image, _) in self.nodes.items()}, own)

    def _surfaces(self, part: Part, image: Part) -> dict[str, str]:
        """The image of each surface that contacts use."""
        twins = {}
        for surface in self.whole.scene.surfaces_of(part):
            others = self.whole.scene.surfaces_of(image)
            found = [other for other in others if self.fits(part.name, surface, other)]
            if not found:
                raise _Differs
            twins[surface] = found[0]
        return twins

    def _plates(self, part: Any, image: Part | Rigid) -> set[tuple[str, int]]:
        """Plates that are their own images, if all conditions have images."""
        components, H, found = self.whole.scene.components, self.plane.reflection, set()
        others = list(_conditions(image, components))
        for one in _conditions(part, components):
            for two in others:
                size = max(np.abs(one.values).max(), np.abs(two.values).max())
                same = one.kind == two.kind and bool(
                    np.allclose(H @ one.space @ H, two.space, atol=EQUAL)
                    and np.all(np.abs(H @ one.values - two.values) <= EQUAL * size)
                    and np.isclose(one.number, two.number, EQUAL, 0.0)
                )
                if same and (not one.where or self.fits(part.name, one.where, two.where)):
                    if one.item is two.item and getattr(one.item, "total", False):
                        found.add((part.name, part.loads.index(one.item)))
                    break
            else:
                place = f" on {one.where!r}" if one.where else ""
                raise _Differs(f"the {one.kind}{place} of body '{part.name}' has no mirror image")
        return found

    def _compare_curves(self, part: Part, surface: str, other: Curve | None) -> None:
        curve, x = part.curve_of(surface), self.whole.acting(part.name, surface)
        if curve is None and other is None:
            return
        if curve is not None and other is not None:
            apart = np.abs(self.plane.image(curve(x)) - other(self.plane.image(x)))
            if apart.max() <= ROUNDED * self.whole.size:
                return
        raise _Differs(f"the curve of body '{part.name}' is not symmetric")

    def _with_pairs(self, images: dict[str, str], own: set[tuple[str, int]]) -> Images:
        """With the images of pairs and rigid bodies, none of which may be cut."""
        found: dict[str, str] = {}
        swapped: set[str] = set()
        for pair in self.whole.scene.pairs:
            if images.get(pair.bodies[0]) == pair.bodies[1]:
                raise _Differs(
                    f"the contact '{pair.name}' lies in this plane"
                    " itself, between a body and its own mirror image"
                )
            other, order = self._image_of(pair, images)
            found[pair.name] = other.name
            images |= {pair.bodies[side]: other.bodies[there] for side, there in enumerate(order)}
            if order == (1, 0):
                swapped.add(pair.name)
        if any(images[image] != name for name, image in images.items()):
            raise _Differs("rigid bodies are not each other's images")
        return Images(images, found, own, swapped)

    def _image_of(
        self, pair: Contact, images: Mapping[str, str]
    ) -> tuple[Contact, tuple[int, int]]:
        """The image of a pair, and which of its sides are those of the upper and the lower one."""
        reason = None
        for other, order in product((pair, *self.whole.scene.pairs), ((0, 1), (1, 0))):
            if all(self._faces(pair, side, other, order[side], images) for side in (0, 1)):
                try:
                    self._compare_pairs(pair, other, order)
                    return other, order
                except _Differs as found:
                    reason = reason or found
        raise reason or _Differs(f"the contact '{pair.name}' has no mirror image")

    def _faces(
        self, pair: Contact, side: int, other: Contact, there: int, images: Mapping[str, str]
    ) -> bool:
        """Whether a side of one pair may be the image of a side of the other one."""
        body, image = pair.bodies[side], other.bodies[there]
        if images.get(body, image) != image or (body in self.nodes) != (image in self.nodes):
            return False
        surface = self.whole.surface_of(pair, side)
        return not surface or self.fits(body, surface, self.whole.surface_of(other, there))

    def _compare_pairs(self, pair: Contact, other: Contact, order: tuple[int, int]) -> None:
        """Laws, friction, gaps and rigid bodies."""
        if (pair.law, pair.coupling) != (other.law, other.coupling):
            raise _Differs(
                f"the contact '{pair.name}' has another law or coupling than its mirror image"
            )
        functions: list[tuple[str, Any, Any]] = []
        functions.append((f"friction of contact '{pair.name}'", pair.mu, other.mu))
        for side, there in enumerate(order):
            one = self.whole.rigid.get(pair.bodies[side])
            two = self.whole.rigid.get(other.bodies[there])
            if one is not None and two is not None:
                self._plates(one, two)
                gap, image = (0.0 if each.gap is None else each.gap for each in (one, two))
                functions.append((f"gap of rigid body '{one.name}'", gap, image))
        surfaces = [self.whole.acting(*surface) for surface in self.whole.surfaces(pair)]
        x = np.concatenate(surfaces, axis=1)
        for what, here, twin in functions:
            if any(np.ndim(each) for each in (here, twin) if not callable(each)):
                raise _Differs(
                    f"the {what} is no function of the place, and has no image to compare it with"
                )
            if not equal_functions(here, twin, x, self.plane.image(x)):
                raise _Differs(f"the {what} is not symmetric")
