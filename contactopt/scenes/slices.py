"""One large body cut into slices that are tied to each other, so that each can live on its own
rank.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.checks import check_count
from contactopt.errors import InputError
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import BodyForce, Part, Plate, Scene

PLANE = 1e-9  # nodes lie in a plane within this fraction of the body's extent


def sliced(scene: Scene, name: str, count: int, axis: int = -1) -> Scene:
    """The scene with one elastic body, by its name, cut across a coordinate axis into `count`
    slices of about as many elements.

    Neighbouring slices are bodies of their own, tied by a pair of surfaces with the law 'tied' and
    matching nodes. The answer is that of the whole body. The slices are called 'name-1', 'name-2',
    ... along the axis; axis -1 is the last one. The mesh must have layers of elements across the
    axis, as structured meshes have, and every surface that contacts or plates use must lie in one
    slice. InputError for a body that cannot be cut like this.
    """
    check_count("the number of slices", count)
    found: list[Any] = [part for part in scene.parts if part.name == name and part.meshed]
    if not found:
        raise InputError(f"scene '{scene.name}' has no elastic body named '{name}' to be sliced.")
    (part,) = found
    if count == 1:
        return scene
    meshes = [_slice(part, count, axis, i)(scene.elements, scene.zone) for i in range(count)]
    slices = tuple(_sliced_part(part, count, axis, i, mesh) for i, mesh in enumerate(meshes))
    plates = {load.boundary for load in part.loads if isinstance(load, Plate)}
    used = plates | set(scene.surfaces_of(part))
    home = {boundary: _home(name, boundary, meshes) for boundary in used}

    def renamed(side: str) -> str:
        body, _, surface = side.partition(":")
        boundary = surface or part.contact
        return side if body != name else f"{slices[home[boundary]].name}:{boundary}"

    pairs = [
        replace(pair, upper=renamed(pair.upper), lower=renamed(pair.lower)) for pair in scene.pairs
    ]
    for i in range(1, count):
        upper, lower = (f"{slices[side].name}:cut {i}" for side in (i, i - 1))
        pairs.append(Contact(upper, lower, 0.0, "tied", "matching"))
    bodies = [own for other in scene.parts for own in (slices if other is part else (other,))]
    long: dict[str, Any] = {"bodies": tuple(bodies), "contacts": tuple(pairs)}
    return replace(scene, upper=None, lower=None, mu=None, law="coulomb", **long)


def _home(body: str, boundary: str, meshes: list[Any]) -> int:
    """The number of the slice in which a boundary lies."""
    found = [i for i, mesh in enumerate(meshes) if len(mesh.boundaries.get(boundary, ()))]
    if len(found) != 1:
        raise InputError(
            f"body '{body}' cannot be sliced along this axis: its boundary {boundary!r} lies in"
            f" {len(found)} slices; choose another axis, or fewer slices."
        )
    return found[0]


def _sliced_part(part: Part, count: int, axis: int, number: int, mesh: Any) -> Part:
    def there(item: Any) -> bool:
        return isinstance(item, BodyForce) or len(mesh.boundaries.get(item.boundary, ())) > 0

    supports = tuple(item for item in part.supports if there(item))
    loads = tuple(item for item in part.loads if there(item))
    here = len(mesh.boundaries.get(part.contact, ())) > 0
    return replace(
        part,
        name=f"{part.name}-{number + 1}",
        mesh=_slice(part, count, axis, number),
        supports=supports,
        loads=loads,
        contact=part.contact if here else f"cut {max(number, 1)}",
    )


def _slice(part: Part, count: int, axis: int, number: int) -> Any:
    """The function (elements, zone) -> mesh of a slice, with the boundaries 'cut i' towards its
    neighbours.
    """

    def mesh(elements: int, zone: float | None) -> Any:
        whole = part.build_mesh(elements, zone)
        layer, planes = _layers(part.name, whole, axis, count)
        ends = np.linspace(0, len(planes) - 1, count + 1).round().astype(int)
        own = whole.restrict(np.flatnonzero((layer >= ends[number]) & (layer < ends[number + 1])))
        near = PLANE * (planes[-1] - planes[0])
        cuts = {
            f"cut {i}": own.facets_satisfying(
                lambda x, at=planes[ends[i]]: np.abs(x[axis] - at) < near, True
            )
            for i in (number, number + 1)
            if 0 < i < count
        }
        kept = {name: facets for name, facets in (own.boundaries or {}).items() if len(facets)}
        return replace(own, _boundaries=None).with_boundaries(kept | cuts)

    return mesh


def _layers(name: str, mesh: Any, axis: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The layer (elements,) of each element across the axis, and the coordinates of the planes
    between layers.

    Raises InputError unless every element lies between two neighbouring planes of nodes.
    """
    at = mesh.p[axis, mesh.t]
    low, high = at.min(axis=0), at.max(axis=0)
    near = PLANE * (high.max() - low.min())
    starts = np.sort(low)
    planes = np.append(starts[np.append(True, np.diff(starts) > near)], high.max())
    layer = np.searchsorted(planes, low + near) - 1
    if np.any(np.abs(planes[layer + 1] - high) > near) or len(planes) <= count:
        raise InputError(
            f"body '{name}' cannot be sliced: its mesh needs at least {count} layers of elements"
            " across the axis, divided by planes of nodes."
        )
    return layer, planes
