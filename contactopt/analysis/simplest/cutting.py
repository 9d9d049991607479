"""One half of a scene that is its own mirror image across a plane normal to an axis: bodies, supports, loads and contacts.

`Scene.copies` doubles, so that forces, reactions and areas stay those of the whole. What the plane cuts keeps the half on the
positive side and is held there along the normal. Of two bodies, contacts or plates that are each other's images the one on
the positive side stays, and stands for both: its forces are those of both together.

Meshes of which no element crosses the plane are restricted to their elements on one side. Others are clipped: nodes near the
plane move onto it, edges that cross it are divided where they cross, and so are the triangles or tetrahedra along them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import skfem
from scipy.spatial import KDTree

from contactopt.analysis.simplest.mirrors import Images, Plane
from contactopt.analysis.simplest.shapes import Shapes
from contactopt.analysis.simplest.turning import of_mesh, with_pairs
from contactopt.bodies.elements import is_curved, straight
from contactopt.bodies.local_refinement import named_like, simplices
from contactopt.scenes.scene import Part, Plate, Rigid, Scene, Support

NEAR = 1e-9  # nodes lie in the plane within this fraction of the body's size
OFF = 1e-3  # of that edge: how far such a move may lead out of the boundary
SNAP = 0.3  # nodes nearer to the plane than this fraction of a crossing edge move onto it


@dataclass(frozen=True)
class Side:
    """The half x_axis >= place of space; `sense` is -1 for x_axis <= place."""

    axis: int
    place: float
    sense: float = 1.0

    def height(self, points: np.ndarray) -> np.ndarray:
        """(k,) how far points (dim, k) are on this side."""
        return np.asarray(self.sense * (points[self.axis] - self.place))


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


def half_mesh(side: Side, cut: str, curve_of: Callable[[str], Any]) -> Callable[[Any], Any]:
    """The function that cuts a mesh: its half with a boundary of that name in the plane."""

    def change(mesh: Any) -> Any:
        size = float(np.ptp(mesh.p, axis=1).max())
        if crosses(mesh, side):
            mesh = _clipped(mesh, side, curve_of)
        inside = side.height(mesh.p[:, mesh.t].mean(axis=1)) > 0
        own = _restricted(mesh, np.flatnonzero(inside))
        kept = {name: facets for name, facets in (own.boundaries or {}).items() if len(facets)}
        plane = own.facets_satisfying(lambda x: np.abs(side.height(x)) < NEAR * size, True)
        return replace(own, _boundaries=None, _subdomains=None).with_boundaries(kept | {cut: plane})

    return change


def _restricted(mesh: Any, elements: np.ndarray) -> Any:
    """The mesh of some elements; those of second order keep their curved sides."""
    own = straight(mesh).restrict(elements)
    if not is_curved(mesh):
        return own
    made = type(mesh).from_mesh(replace(own, _boundaries=None, _subdomains=None))
    points = made.doflocs.copy()
    points[:, made.dofs.element_dofs] = mesh.doflocs[:, mesh.dofs.element_dofs[:, elements]]
    return replace(made, doflocs=points, _boundaries=own.boundaries)


def crosses(mesh: Any, side: Side) -> bool:
    """Whether an element lies on both sides of the plane."""
    height = side.height(mesh.p)[mesh.t]
    near = NEAR * float(np.ptp(mesh.p, axis=1).max())
    return bool(np.any((height.min(axis=0) < -near) & (height.max(axis=0) > near)))


def is_mirrored(mesh: Any, image: Any, plane: Plane) -> bool:
    """Whether the nodes and the elements of a mesh have those of another one as their mirror images."""
    if mesh.p.shape != image.p.shape or mesh.t.shape != image.t.shape:
        return False
    near = NEAR * float(np.ptp(mesh.p, axis=1).max())
    middles, others = (each.p[:, each.t].mean(axis=1) for each in (mesh, image))
    pairs = ((mesh.p, image.p), (middles, others))
    return all(bool(KDTree(there.T).query(plane.image(here).T)[0].max() < near) for here, there in pairs)


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


def _clipped(mesh: Any, side: Side, curve_of: Callable[[str], Any]) -> Any:
    """Triangles or tetrahedra of which none crosses the plane, with the named boundaries of the mesh."""
    old = simplices(mesh)
    points, cells = old.p.copy(), old.t
    near = NEAR * float(np.ptp(points, axis=1).max())
    points = _snapped(old, points, side)
    height = side.height(points)
    height[np.abs(height) < near] = 0.0
    points[side.axis, height == 0.0] = side.place
    places, marks = list(points.T), list(height)
    rows: list[tuple[int, ...]] = [tuple(cell) for cell in cells.T]
    whole = [row for row in rows if not _spread(row, marks)]
    middle: dict[tuple[int, int], int] = {}
    for row in (row for row in rows if _spread(row, marks)):
        whole += _divided(row, places, marks, middle)
    kind = skfem.MeshTri if len(points) == 2 else skfem.MeshTet
    made = kind(np.ascontiguousarray(np.array(places).T), np.ascontiguousarray(np.array(whole).T))
    new = named_like(replace(old, doflocs=points), made)
    return _on_curves(new, len(cells) and points.shape[1], side, curve_of)


def _spread(row: tuple[int, ...], marks: list[float]) -> bool:
    heights = [marks[i] for i in row]
    return min(heights) < 0 < max(heights)


def _divided(
    row: tuple[int, ...], places: list[np.ndarray], marks: list[float], middle: dict[tuple[int, int], int]
) -> list[tuple[int, ...]]:
    """The pieces of a simplex: its crossing edges are divided one after the other, in the order of their nodes' numbers.

    All simplices along an edge divide a common face in the same order, hence in the same way.
    """
    for i, j in sorted((min(i, j), max(i, j)) for n, i in enumerate(row) for j in row[n + 1 :]):
        if marks[i] * marks[j] < 0:
            if (i, j) not in middle:
                share = marks[i] / (marks[i] - marks[j])
                middle[i, j] = len(places)
                places.append(places[i] + share * (places[j] - places[i]))
                marks.append(0.0)
            new = middle[i, j]
            pieces = [tuple(new if node == old else node for node in row) for old in (i, j)]
            return [piece for half in pieces for piece in _divided(half, places, marks, middle)]
    return [row]


def _snapped(mesh: Any, points: np.ndarray, side: Side) -> np.ndarray:
    """The nodes with those near the plane moved onto it, unless that would move them out of the boundary."""
    height = side.height(points)
    edges = mesh.facets if len(points) == 2 else mesh.edges
    crossing = edges[:, height[edges[0]] * height[edges[1]] < 0]
    length = np.abs(height[crossing[0]] - height[crossing[1]])
    nearest = np.full(points.shape[1], np.inf)
    for end in crossing:
        np.minimum.at(nearest, end, length)
    moves = np.abs(height) < SNAP * np.where(np.isfinite(nearest), nearest, 0.0)
    facets = mesh.facets[:, mesh.boundary_facets()]
    steep = np.zeros(points.shape[1])
    for corner in facets:
        np.maximum.at(steep, corner, _steepness(points[:, facets], side.axis))
    moves &= steep * np.abs(height) <= OFF * np.where(np.isfinite(nearest), nearest, 0.0)
    moved = points.copy()
    moved[side.axis, moves] = side.place
    volumes = [np.linalg.det(np.moveaxis(x[:, mesh.t[1:]] - x[:, mesh.t[:1]], 2, 0)) for x in (points, moved)]
    spoilt = volumes[1] * np.sign(volumes[0]) < 0.1 * np.abs(volumes[0])
    back = np.unique(mesh.t[:, spoilt])
    moved[:, back] = points[:, back]
    return moved


def _steepness(corners: np.ndarray, axis: int) -> np.ndarray:
    """(m,) by how much facets with these corners (dim, dim, m) turn away from the direction of the axis: 0 if they contain it."""
    edges = corners[:, 1:] - corners[:, :1]
    across = np.stack([edges[1, 0], -edges[0, 0]]) if len(corners) == 2 else np.cross(edges[:, 0], edges[:, 1], axis=0)
    sine = np.abs(across[axis]) / np.linalg.norm(across, axis=0)
    return np.asarray(np.where(sine < 1e-9, 0.0, sine))


def _on_curves(mesh: Any, first: int, side: Side, curve_of: Callable[[str], Any]) -> Any:
    """The mesh with its new nodes, from number `first` on, on the curves of its contact boundaries."""
    points = mesh.p.copy()
    for name, facets in (mesh.boundaries or {}).items():
        curve = curve_of(name)
        nodes = np.unique(mesh.facets[:, facets])
        nodes = nodes[nodes >= first]
        if curve is not None and len(nodes):
            points[:, nodes] = curve(points[:, nodes])
            points[side.axis, nodes] = side.place
    return replace(mesh, doflocs=points)
