"""One half of a scene that is its own mirror image across a plane normal to an axis: bodies, supports, loads and contacts.

`Scene.copies` doubles, so that forces, reactions and areas stay those of the whole. What the plane cuts keeps the half on the
positive side and is held there along the normal. Of two bodies, contacts or plates that are each other's images the one on
the positive side stays, and stands for both: its forces are those of both together.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from contactopt.analysis.simplest.clipping import NEAR, Side, half_mesh
from contactopt.analysis.simplest.images import Images
from contactopt.analysis.simplest.planes import Plane
from contactopt.analysis.simplest.shapes import Shapes
from contactopt.analysis.simplest.turning import of_mesh, with_pairs
from contactopt.scenes.scene import Part, Plate, Rigid, Scene, Support


def half_of(shapes: Shapes, plane: Plane, images: Images) -> Scene:
    """The half of a scene on the positive side of a plane of symmetry that is normal to an axis."""
    scene = shapes.scene
    side = side_of(plane)
    component = scene.components[side.axis]
    heights = {name: float(np.mean(side.height(mesh.p))) for name, mesh in shapes.meshes.items()}
    kept = {name for name, image in images.bodies.items() if name in heights and (image == name or heights[name] > 0)}
    pairs = tuple(pair for pair in scene.pairs if _keeps(pair, shapes, images, kept, side))
    rigid = {name for pair in pairs for name in pair.bodies if name in shapes.rigid}
    bodies: list[Any] = []
    for part in scene.parts:
        if isinstance(part, Part) and part.name in kept:
            bodies.append(_half_part(shapes, images, part, side, component))
        elif isinstance(part, Rigid) and part.name in rigid:
            bodies.append(_half_rigid(images, part, component))
    if scene.contacts or len(pairs) != 1 or len(bodies) != 2:
        whole = replace(scene, upper=None, lower=None, mu=None, law="coulomb", bodies=tuple(bodies), contacts=pairs)
        return replace(whole, copies=2 * scene.copies)
    return with_pairs(replace(scene, upper=bodies[0], lower=bodies[1], copies=2 * scene.copies), pairs)


def side_of(plane: Plane) -> Side:
    """The positive side of a plane that is normal to an axis."""
    axis = int(np.argmax(np.abs(plane.normal)))
    return Side(axis, float(plane.offset * np.sign(plane.normal[axis])))


def roller(shapes: Shapes) -> str:
    """The name of a support that holds one component of contacts in a plane across it; empty if there is none.

    In a scene of mirror images such a support is a plane of symmetry (contactopt.interface.charts), in a whole scene it is not.
    """
    for name, part in shapes.parts.items():
        mesh = shapes.meshes[name]
        contacts = np.unique(
            np.concatenate([mesh.facets[:, mesh.boundaries[s]].ravel() for s in shapes.scene.surfaces_of(part)])
        )
        for support in part.supports:
            nodes = np.unique(mesh.facets[:, mesh.boundaries[support.boundary]])
            for component in support.displacement or {}:
                row = mesh.p[shapes.scene.components.index(component), nodes]
                if np.ptp(row) < NEAR * shapes.size and len(np.intersect1d(nodes, contacts)):
                    return f"the support on {support.boundary!r} of body '{name}'"
    return ""


def _keeps(pair: Any, shapes: Shapes, images: Images, kept: set[str], side: Side) -> bool:
    """Whether a pair belongs to the half: those whose images are other pairs stay on one side only."""
    elastic = [name for name in pair.bodies if name in shapes.meshes]
    if any(name not in kept for name in elastic):
        return False
    if images.pairs[pair.name] == pair.name:
        return True
    if any(images.bodies[name] != name for name in elastic):
        return True  # the image is a pair of the body on the other side
    heights = []
    for name, surface in zip(pair.bodies, pair.surfaces):
        if name in shapes.parts:
            where = shapes.boundary(name, surface or shapes.parts[name].contact)
            heights.append(float(side.height(where.corners.mean(axis=1)) @ where.areas / where.areas.sum()))
    farthest = max(heights, key=abs)
    return farthest > 0 if abs(farthest) > NEAR * shapes.size else bool(pair.name < images.pairs[pair.name])


def _half_rigid(images: Images, part: Rigid, component: str) -> Rigid:
    """A rigid body that the plane cuts is held along the normal; one that stands for two takes the force of both."""
    if part.force is None and part.displacement is None:
        return part
    if images.bodies[part.name] != part.name:
        return replace(part, force=_doubled(part.force))
    return replace(part, force=_without(part.force, component), displacement=_without(part.displacement, component))


def _without(values: Any, component: str) -> Any:
    return {name: value for name, value in values.items() if name != component} if values else values


def _doubled(values: Any) -> Any:
    return {name: 2 * value for name, value in values.items()} if values else values


def _half_part(shapes: Shapes, images: Images, part: Part, side: Side, component: str) -> Part:
    name = part.name
    if images.bodies[name] != name:
        doubled = tuple(
            replace(load, force=_doubled(load.force)) if isinstance(load, Plate) else load for load in part.loads
        )
        return replace(part, loads=doubled)
    mesh = shapes.meshes[name]
    cut = f"symmetry {component}"
    while cut in (mesh.boundaries or {}):
        cut += "'"

    def there(boundary: str) -> bool:
        where = shapes.boundary(name, boundary).corners
        return bool(side.height(where.reshape(len(where), -1)).max() > NEAR * shapes.size)

    supports = [item for item in part.supports if there(item.boundary)] + [Support(cut, {component: 0.0})]
    loads: list[Any] = []
    for number, load in enumerate(part.loads):
        if not isinstance(load, Plate):
            if not hasattr(load, "boundary") or there(load.boundary):
                loads.append(load)
        elif (name, number) in images.own:
            loads.append(replace(load, force=_without(load.force, component)))
            if component in load.force and not load.glued:
                supports.append(Support(load.boundary, {component: 0.0}))
        elif there(load.boundary):
            loads.append(replace(load, force=_doubled(load.force)))
    contact = part.contact
    surfaces = [surface for surface in shapes.scene.surfaces_of(part) if there(surface)]
    if contact not in surfaces:
        contact = surfaces[0]
    return replace(
        part,
        mesh=of_mesh(part.mesh, half_mesh(side, cut, part.curve_of)),
        supports=tuple(supports),
        loads=tuple(loads),
        contact=contact,
        curve=_curves(part, surfaces),
    )


def _curves(part: Part, surfaces: list[str]) -> Any:
    found = {surface: part.curve_of(surface) for surface in surfaces}
    return {surface: curve for surface, curve in found.items() if curve is not None} or None


def matches(shapes: Shapes) -> bool:
    """Whether the coupling of all pairs is blind to a cut: that of quadratic elements is, and that of matching nodes.

    A mortar coupling of linear elements rounds off kinks by the nodes around (contactopt.interface.kinks), of which a plane of
    symmetry hides one half.
    """
    if shapes.scene.degree == 2:
        return True
    for pair in shapes.scene.pairs:
        nodes = []
        for name, surface in zip(pair.bodies, pair.surfaces):
            if name in shapes.parts:
                mesh = shapes.meshes[name]
                facets = mesh.boundaries[surface or shapes.parts[name].contact]
                nodes.append(mesh.p[:, np.unique(mesh.facets[:, facets])])
        if len(nodes) == 2 and nodes[0].shape != nodes[1].shape:
            return False
        if len(nodes) == 2 and KDTree(nodes[0].T).query(nodes[1].T)[0].max() > NEAR * shapes.size:
            return False
    return True
