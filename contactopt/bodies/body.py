"""One elastic body made into matrices: stiffness, loads, held and driven unknowns, contact nodes.

Finite elements of scikit-fem on the mesh that a Part gives, of the scene's degree. Every integral
carries the weight of the scene's kind (thickness, 2 pi r, mirror images), so that forces and areas
are those of the whole body.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np
import skfem
from skfem import Mesh

from contactopt.bodies.assembly import Assembly
from contactopt.bodies.corners import copies
from contactopt.bodies.elements import (
    Weight,
    contact_trace,
    face_integrals,
    make_basis,
    nodal_forces,
    node_unknowns,
    nodes_on,
    surface_load,
)
from contactopt.bodies.motions import check_free, free_motions
from contactopt.bodies.stiffness import isotropic_stiffness
from contactopt.bodies.thickness import thin_facets
from contactopt.cards import count
from contactopt.checks import check_size, place_words
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.meshes.cells import SHAPES, joined, overlapping, split_twice, straight
from contactopt.problem.laws import find_law
from contactopt.scenes.loads import Load
from contactopt.scenes.loads.bolt import stiff_faces
from contactopt.scenes.loads.load import Face
from contactopt.scenes.scene import Part, Scene

if TYPE_CHECKING:
    from contactopt.scenes.body_kinds import Part
    from contactopt.scenes.matrix_part import MatrixPart


def build_body(scene: Scene, part: Part, elements: int, zone: float | None) -> Assembly:
    """Mesh and assemble an elastic part, with `elements` across the contact half-width and the
    half-width `zone` resolved. InputError for a mesh, supports or loads that do not fit.
    """
    mesh = part.build_mesh(elements, zone)
    check_mesh(scene, part, mesh)
    kind = scene.analysis
    weight = (kind.measure(scene.thickness) * scene.copies, kind.revolved)
    basis = make_basis(straight(mesh) if scene.degree == 1 else mesh, scene.degree, kind.revolved)
    part = placed(scene, part, basis, weight)
    A = isotropic_stiffness(basis, kind.constants(part.material), weight)
    fixed = _constraints(scene, part, basis).add_all()
    if fixed.held.all():
        raise InputError(
            f"body '{part.name}' is held at all its nodes, so that nothing of it deforms; hold"
            " fewer, or make it a rigid body."
        )
    rigid_motions = free_motions(kind, basis, fixed.held, weight)
    check_free(part.name, A, rigid_motions)
    traces = {}
    for name in scene.surfaces_of(part):
        laws = [find_law(law) for law in scene.laws_of(part, name)]
        tied = bool(laws) and not any(law.bounded for law in laws)
        facets = np.asarray(mesh.boundaries[name])
        every = tied or bool(thin_facets(basis.mesh, facets).any())
        copied = copies(basis, scene.degree, facets, mesh, part.curve_of(name))
        try:
            traces[name] = contact_trace(basis, scene.degree, facets, weight, every, copied)
        except InputError as error:
            raise InputError(f"body '{part.name}', boundary '{name}': {error}") from None
    return Assembly(
        part.name,
        A,
        _load(part, basis, weight),
        fixed.prescribed,
        np.flatnonzero(~fixed.held),
        fixed.motion,
        np.array(fixed.plate_forces, dtype=float),
        rigid_motions,
        tuple(fixed.driven),
        fixed.holders,
        reload_body,
        kind,
        part.material,
        basis,
        weight,
        traces,
        _mirrored_nodes(scene, part, basis, fixed.held),
    )


def reload_body(body: Assembly, scene: Scene, part: Part) -> Assembly:
    """The body with the loads of another scene; InputError if other unknowns are held or driven."""
    part = placed(scene, part, body.basis, body.weight)
    fixed = _constraints(scene, part, body.basis).add_all()
    held = np.array_equal(np.flatnonzero(~fixed.held), body.free)
    if not held or not np.array_equal(fixed.motion, body.motion):
        raise InputError(
            f"body '{part.name}': supports or plates hold other unknowns than before; reduce it"
            " again."
        )
    return replace(
        body,
        load=_load(part, body.basis, body.weight),
        prescribed=fixed.prescribed,
        plate_forces=np.array(fixed.plate_forces, dtype=float),
        mirrored=_mirrored_nodes(scene, part, body.basis, fixed.held),
    )


def check_mesh(scene: Scene, part: Part, mesh: skfem.Mesh) -> None:
    """Check that a part's mesh fits the kind of the scene and has all boundaries that are named.

    InputError if it has another dimension, elements that are not known or lie over each other,
    numbers that are not finite, points on the wrong side of an axis of revolution, or lacks a named
    boundary.
    """
    if (
        not isinstance(mesh, skfem.Mesh)
        or mesh.p.shape[0] != scene.dim
        or mesh.refdom.__name__ not in SHAPES
    ):
        shapes = ("triangles or quadrilaterals", "tetrahedra or hexahedra")[scene.dim - 2]
        raise InputError(
            f"body '{part.name}': a {scene.kind} scene needs a scikit-fem mesh of dimension"
            f" {scene.dim}, of {shapes}; got {_words(mesh)}."
        )
    if not np.all(np.isfinite(mesh.p)):
        raise InputError(
            f"body '{part.name}': the mesh has a node whose coordinates are not finite numbers."
        )
    check_size(f"the largest coordinate of body '{part.name}'", float(np.abs(mesh.p).max()))
    for length in np.ptp(mesh.p, axis=1):
        check_size(f"the length of body '{part.name}'", float(length))
    if (middle := split_twice(mesh)) is not None:
        place = place_words(middle)
        raise InputError(
            f"body '{part.name}': tetrahedra split a quadrilateral along different diagonals, at"
            f" ({place}), and share no side there; mesh this place again."
        )
    _check_pieces(part, mesh)
    if (over := overlapping(mesh)) is not None:
        place = place_words(mesh.p[:, mesh.t[:, over]].mean(axis=1))
        raise InputError(
            f"body '{part.name}': an element of the mesh lies over its neighbour, at ({place});"
            " move its nodes apart, or mesh this place again."
        )
    if scene.analysis.revolved and mesh.p[0].min() < -1e-12 * np.ptp(mesh.p[0]):
        raise InputError(
            f"body '{part.name}': an axisymmetric mesh lies in r >= 0; its least r is"
            f" {mesh.p[0].min():g}."
        )
    known = mesh.boundaries or {}
    names = [*scene.surfaces_of(part), *(name for s in part.supports for name in s.faces(known))]
    names += [load.boundary for load in part.loads if load.boundary]
    filled = sorted(boundary for boundary, facets in known.items() if len(facets))
    for name in names:
        if name not in filled:
            wrong = (
                f"boundary {name!r} has no facets in this mesh"
                if name in known
                else f"the mesh has no boundary named {name!r}"
            )
            raise InputError(f"body '{part.name}': {wrong}; it has {', '.join(filled) or 'none'}.")


def _words(mesh: Mesh) -> str:
    """What a mesh that does not fit is."""
    if not isinstance(mesh, skfem.Mesh):
        return type(mesh).__name__
    where = {1: "on a line", 2: "in a plane", 3: "in space"}[mesh.p.shape[0]]
    return f"one of {count(mesh.nelements, 'element')} {where}"


def _check_pieces(part: Part, mesh: skfem.Mesh) -> None:
    """InputError unless facets connect all elements, and every node belongs to one."""
    inner = mesh.f2t[:, mesh.f2t[1] >= 0]
    piece = joined(inner, mesh.nelements)
    pieces = len(np.unique(piece))
    lost = mesh.nvertices - len(np.unique(mesh.t))
    if pieces + lost == 1:
        return
    nodes = [np.unique(mesh.t[:, piece == own]) for own in np.unique(piece)]
    shared = np.flatnonzero(np.bincount(np.concatenate(nodes)) > 1)
    if len(shared):
        place = place_words(mesh.p[:, shared[0]])
        raise InputError(
            f"body '{part.name}': its mesh falls into {pieces} pieces that share nodes but no side"
            f" of an element, such as the node at ({place}), around which they turn as around a"
            " hinge; let them share a side, or model each piece as a body of its own."
        )
    raise InputError(
        f"body '{part.name}': its mesh falls into {pieces + lost} pieces; remove nodes that belong"
        " to no element, merge duplicated nodes, or model each piece as a body of its own."
    )


def face_of(
    scene: Scene, part: Part, basis: skfem.CellBasis, weight: Weight, boundary: str
) -> Face:
    """A face of a body. InputError if its normals have no mean."""
    area, normal, centre = face_integrals(basis, basis.mesh.boundaries[boundary], weight)
    if scene.analysis.revolved:  # all around the axis
        normal, centre = normal * [0.0, 1.0], centre * [0.0, 1.0]
    length = float(np.linalg.norm(normal))
    if length < 1e-3 * area:  # a closed surface has no mean normal
        raise InputError(
            f"body '{part.name}': the normals of {boundary!r} have no mean along which a bolt could"
            " pull, because the boundary is closed; name a face with one side."
        )
    held = _constraints(scene, part, basis)
    held.add_supports()
    fast = {c for c in scene.components if held.held[held.unknowns(boundary, c)].any()}
    fast |= {scene.components[0]} if scene.analysis.revolved else set()
    return Face(normal / length, area, centre / area, scene.components, frozenset(fast))


def placed(scene: Scene, part: Part, basis: skfem.CellBasis, weight: Weight) -> Part:
    """The part with its loads as they act on the faces of this mesh."""
    if not any(load.shared for load in part.loads):
        return part
    loads = (
        load.on(face_of(scene, part, basis, weight, load.boundary)) if load.shared else load
        for load in part.loads
    )
    return replace(part, loads=tuple(loads))


def _load(part: Part, basis: skfem.CellBasis, weight: Weight) -> np.ndarray:
    total = np.zeros(basis.N)
    for load in part.loads:
        if load.level:
            continue
        if load.boundary:
            total += surface_load(basis, basis.mesh.boundaries[load.boundary], load.density, weight)
            continue
        x = np.asarray(basis.global_coordinates())
        total += nodal_forces(basis, np.asarray(load.density(x, x)), weight)
    return total


def _mirrored_nodes(
    scene: Scene, part: Part, basis: skfem.CellBasis, held: np.ndarray
) -> np.ndarray:
    """(dim, nodes) whether a node lies in a plane across that axis on which nothing else than the
    displacement along it is held (n,), and no traction acts; none where the scene has no copies.

    Beyond such a plane the mirror image of the body goes on. No shear acts there, whatever the
    elements on the one side show.
    """
    mesh, unknowns = basis.mesh, node_unknowns(basis)
    names = list(scene.surfaces_of(part))
    names += [
        load.boundary
        for load in part.loads
        if load.boundary and not load.level and any(load.values(scene.components).values())
    ]
    loaded = [np.asarray(mesh.boundaries[name]) for name in names]
    facets = np.setdiff1d(mesh.boundary_facets(), np.concatenate([np.zeros(0, dtype=int), *loaded]))
    made, fixed = np.zeros(unknowns.shape, dtype=bool), held[unknowns]
    facets = facets[np.any(np.all(fixed[:, mesh.facets[:, facets]], axis=1), axis=0)]
    if scene.copies == 1 or not len(facets):
        return made
    nodes = nodes_on(basis, scene.degree, facets).T  # (nodes of a facet, facets)
    places, fixed = basis.doflocs[:, unknowns[0]][:, nodes], fixed[:, nodes]
    size = float(np.ptp(mesh.p, axis=1).max())
    for axis in range(len(unknowns)):
        others = np.delete(fixed, axis, axis=0)
        plane = np.all(fixed[axis], axis=0) & (np.ptp(places[axis], axis=0) < EQUAL * size)
        made[axis, np.unique(nodes[:, plane & ~np.any(np.all(others, axis=1), axis=0)])] = True
    return made


@dataclass
class Constraints:
    """What supports and plates do to the n unknowns of a body, one after the other.

    numbers  (dim, nodes) the unknowns of each node
    known    the boundaries, and nodes, the function from the name of one to the nodes on it
    held     (n,) mask of the unknowns that are not free
    columns  (n,) unit motion of each plate component that moves. The others are as in Assembly.
    """

    scene: Scene
    part: Part | MatrixPart
    numbers: np.ndarray
    known: Mapping[str, Any]
    nodes: Callable[[str], np.ndarray]
    prescribed: np.ndarray
    held: np.ndarray
    columns: list[np.ndarray] = field(default_factory=list)
    plate_forces: list[float] = field(default_factory=list)
    driven: list[str] = field(default_factory=list)
    holders: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def motion(self) -> np.ndarray:
        """(n, p) of the p columns."""
        return np.stack(self.columns, axis=1) if self.columns else np.zeros((len(self.held), 0))

    def unknowns(self, boundary: str, component: str) -> np.ndarray:
        """Those of one component on a boundary."""
        own = self.numbers[self.scene.components.index(component)]
        return np.unique(own[self.nodes(boundary)])

    def hold(self, name: str, where: np.ndarray) -> None:
        """Let the support or plate of that name hold unknowns that nobody else holds."""
        self.held[where] = True
        known = np.concatenate([np.zeros(0, dtype=int), *self.holders.values()])
        own = self.holders.get(name, known[:0])
        self.holders[name] = np.union1d(own, np.setdiff1d(where, known))

    def add_supports(self) -> None:
        for support in self.part.supports:
            values = support.displacement
            if values is None:
                values = dict.fromkeys(self.scene.components, 0.0)
            for component, value in values.items():
                faces = support.faces(self.known)
                where = reduce(np.intersect1d, (self.unknowns(f, component) for f in faces))
                if not len(where):
                    raise InputError(
                        f"body '{self.part.name}': the boundaries of the support on"
                        f" {support.boundary!r} share no node; name boundaries that meet."
                    )
                if np.any(self.held[where] & (self.prescribed[where] != value)):
                    raise InputError(
                        f"body '{self.part.name}': the support on {support.boundary!r} prescribes"
                        f" {component} = {value:g} at a node where another support prescribes a"
                        " different value."
                    )
                self.prescribed[where] = value
                self.hold(f"support '{support.boundary}'", where)

    def add_plate(self, plate: Load) -> None:
        others = self.held.copy()
        for component in self.scene.components:
            where = self.unknowns(plate.boundary, component)
            if component in plate.force:
                if np.any(others[where]):
                    raise self._held_twice(plate.boundary, component, where[others[where]])
                self.columns.append(np.zeros(len(self.held)))
                self.columns[-1][where] = 1.0
                self.plate_forces.append(plate.force[component])
                self.driven.append(f"plate '{plate.boundary}' along {component}")
            elif not plate.glued:
                continue
            elif np.any(self.prescribed[where] != 0):
                raise InputError(
                    f"body '{self.part.name}': a support moves the plate on {plate.boundary!r},"
                    f" which holds {component}; drop the plate or the support."
                )
            self.hold(f"plate '{plate.boundary}'", where)

    def _held_twice(self, boundary: str, component: str, where: np.ndarray) -> InputError:
        """The error for a plate, or the stiff face of a bolt, that moves what another one holds."""
        bolts = stiff_faces(self.scene.bolt_ends, self.part.name)
        own = f"plate '{boundary}'"
        other = next(n for n, held in self.holders.items() if np.isin(where, held).any())
        tilt = "let a bolt tilt (tilting = true), or " if own in bolts or other in bolts else ""
        return InputError(
            f"body '{self.part.name}': the {bolts.get(own, own)} moves in {component}, but the"
            f" {bolts.get(other, other) if other != own else 'same face'} holds one of its nodes"
            f" in that component; {tilt}name faces that share no node."
        )

    def add_all(self) -> Constraints:
        """Those of all supports and plates of the part."""
        self.add_supports()
        for load in self.part.loads:
            if load.level:
                self.add_plate(load)
        return self


def _constraints(scene: Scene, part: Part, basis: skfem.CellBasis) -> Constraints:
    def nodes(boundary: str) -> np.ndarray:
        return nodes_on(basis, scene.degree, np.asarray(basis.mesh.boundaries[boundary]))

    none = np.zeros(basis.N), np.zeros(basis.N, dtype=bool)
    return Constraints(scene, part, node_unknowns(basis), basis.mesh.boundaries, nodes, *none)
