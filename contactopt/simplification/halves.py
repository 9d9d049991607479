"""One half of a scene that is its own mirror image across a plane normal to an axis.

`Scene.copies` doubles, so that forces and areas stay those of the whole. What the plane cuts is
held there along the normal; of two images the one on the positive side stays, with the forces of
both. No element is cut.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from skfem import Mesh

from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.meshes.cells import is_curved, straight
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Part, Rigid, Scene, Support
from contactopt.simplification.images import Images, Plane
from contactopt.simplification.proof import Fold, Key
from contactopt.simplification.whole import Whole, of_mesh, with_pairs

if TYPE_CHECKING:
    from contactopt.scenes.loads.load import Load


def half_of(whole: Whole, plane: Plane, images: Images) -> tuple[Scene, Fold]:
    """The positive half, and how the whole lies on it; InputError if elements are cut."""
    scene, near = whole.scene, EQUAL * whole.size
    component = scene.components[int(np.argmax(np.abs(plane.normal)))]
    heights = {name: float(np.mean(plane.height(mesh.p))) for name, mesh in whole.meshes.items()}
    kept = {name for name in heights if images.bodies[name] == name or heights[name] > 0}
    pairs = tuple(pair for pair in scene.pairs if _keeps(pair, whole, images, kept, plane))
    rigid = {name for pair in pairs for name in pair.bodies if name in whole.rigid}
    bodies: list[Any] = []
    for name in (part.name for part in scene.parts):
        if name in whole.parts and name in kept:
            bodies.append(_half_part(whole, images, whole.parts[name], plane, component))
        elif name in rigid:
            bodies.append(_half_rigid(images, whole.rigid[name], component))
    made = with_pairs(scene, tuple(bodies), pairs, copies=2 * scene.copies)
    there = {("body", name) for name in kept | rigid} | {("pair", pair.name) for pair in pairs}
    partner = {("body", name): ("body", image) for name, image in images.bodies.items()}
    partner |= {("pair", name): ("pair", image) for name, image in images.pairs.items()}
    turned_over = {("pair", name) for name in images.swapped}

    def fold(key: Key, x: np.ndarray) -> tuple[Key, np.ndarray, np.ndarray]:
        own = plane.height(x) >= -near if partner[key] == key else np.full(x.shape[1], key in there)
        turns = np.where(own[:, None, None], np.eye(len(x)), plane.reflection)
        sign = -1.0 if key not in there and key in turned_over else 1.0
        return key if key in there else partner[key], np.where(own, x, plane.image(x)), sign * turns

    return made, fold


def half_mesh(plane: Plane, cut: str) -> Callable[[Any], Any]:
    """The function that takes the elements above a plane, with a boundary of that name in it."""

    def change(mesh: Mesh) -> Any:
        near = EQUAL * float(np.ptp(mesh.p, axis=1).max())
        height = plane.height(mesh.p)[mesh.t]
        if np.any((height.min(axis=0) < -near) & (height.max(axis=0) > near)):
            raise InputError(
                "the plane of symmetry runs through elements; make meshes with edges in it."
            )
        elements = np.flatnonzero(height.mean(axis=0) > 0)
        own = _restricted(mesh, elements)
        kept = {name: facets for name, facets in (own.boundaries or {}).items() if len(facets)}
        inside = np.abs(plane.height(own.p)[own.facets]).max(axis=0) < near
        flat = np.intersect1d(own.boundary_facets(), np.flatnonzero(inside))
        return replace(own, _boundaries=None, _subdomains=None).with_boundaries(kept | {cut: flat})

    return change


def _restricted(mesh: Mesh, elements: np.ndarray) -> Any:
    """The mesh of some elements; those of second order keep their curved sides."""
    own = straight(mesh).restrict(elements)
    if not is_curved(mesh):
        return own
    made = type(mesh).from_mesh(replace(own, _boundaries=None, _subdomains=None))
    points = made.doflocs.copy()
    points[:, made.dofs.element_dofs] = mesh.doflocs[:, mesh.dofs.element_dofs[:, elements]]
    return replace(made, doflocs=points, _boundaries=own.boundaries)


def roller(whole: Whole) -> str:
    """A support that holds a component of contacts in a plane across it, or none."""
    for name, part in whole.parts.items():
        mesh = whole.meshes[name]
        facets = [mesh.boundaries[surface] for surface in whole.scene.surfaces_of(part)]
        contacts = mesh.facets[:, np.concatenate(facets)]
        for support in part.supports:
            nodes = np.unique(mesh.facets[:, mesh.boundaries[support.boundary]])
            for component in support.displacement or {}:
                row = mesh.p[whole.scene.components.index(component), nodes]
                if np.ptp(row) < EQUAL * whole.size and np.isin(nodes, contacts).any():
                    return f"the support on {support.boundary!r} of body '{name}'"
    return ""


def _keeps(pair: Contact, whole: Whole, images: Images, kept: set[str], plane: Plane) -> bool:
    """Whether a pair belongs to the half: of two images one stays, on the positive side."""
    elastic = [name for name in pair.bodies if name in whole.meshes]
    if any(name not in kept for name in elastic):
        return False
    if images.pairs[pair.name] == pair.name or any(images.bodies[name] != name for name in elastic):
        return True  # cut by the plane, or the image is a pair of the body on the other side
    middles = [
        float(plane.height(whole.corners(*surface)).mean()) for surface in whole.surfaces(pair)
    ]
    farthest = max(middles, key=abs)
    if abs(farthest) > EQUAL * whole.size:
        return farthest > 0
    return bool(pair.name < images.pairs[pair.name])


def _half_rigid(images: Images, part: Rigid, component: str) -> Rigid:
    """Held along the normal if the plane cuts it, with both forces if it stands for two."""
    if images.bodies[part.name] != part.name:
        return replace(part, force=_doubled(part.force))
    force, displacement = (
        values and _without(values, component) for values in (part.force, part.displacement)
    )
    return replace(part, force=force, displacement=displacement)


def _without(values: Mapping[str, float], component: str) -> dict[str, float]:
    return {name: value for name, value in values.items() if name != component}


def _doubled(values: Any) -> Any:
    return {name: 2 * value for name, value in values.items()} if values else values


def _of_both(load: Load, components: tuple[str, ...]) -> Load:
    """A load that stands for two: a plate and a bolt have the force of all images."""
    return load.with_values(_doubled(load.values(components))) if load.total else load


def _half_part(whole: Whole, images: Images, part: Part, plane: Plane, component: str) -> Part:
    name, own = part.name, whole.meshes[part.name].boundaries or {}
    components = whole.scene.components
    if images.bodies[name] != name:
        return replace(part, loads=tuple(_of_both(load, components) for load in part.loads))
    cut = f"symmetry {component}"
    while cut in own:
        cut += "'"

    def there(boundary: str) -> bool:
        return bool(plane.height(whole.corners(name, boundary)).max() > EQUAL * whole.size)

    supports = [item for item in part.supports if there(item.boundary)]
    supports.append(Support(cut, {component: 0.0}))
    loads: list[Any] = []
    for number, load in enumerate(part.loads):
        if (name, number) not in images.own:
            if not load.boundary or there(load.boundary):
                loads.append(_of_both(load, components))
        elif not load.level:
            loads.append(load)
        else:
            loads.append(load.with_values(_without(load.force, component)))
            if component in load.force and not load.glued:
                supports.append(Support(load.boundary, {component: 0.0}))
    surfaces = [surface for surface in whole.scene.surfaces_of(part) if there(surface)]
    curves = {surface: part.curve_of(surface) for surface in surfaces}
    return replace(
        part,
        mesh=of_mesh(part.mesh, half_mesh(plane, cut)),
        supports=tuple(supports),
        loads=tuple(loads),
        contact=part.contact if part.contact in surfaces else surfaces[0],
        curve={surface: curve for surface, curve in curves.items() if curve is not None} or None,
    )
