"""One elastic body as matrices: stiffness, loads, held and driven degrees of freedom, contact
nodes.

Finite elements of scikit-fem on the mesh that a Part gives, of the scene's degree. Every integral
carries the weight of the scene's kind (thickness, 2 pi r, mirror images), so that forces and areas
are those of the whole body.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
import skfem
from scipy.sparse.csgraph import connected_components
from skfem.helpers import dot

from contactopt.bodies.elements import Trace, contact_trace, make_basis, node_unknowns, weight_at
from contactopt.bodies.mirror_planes import mirrored_nodes
from contactopt.bodies.motions import Motions, check_free, free_motions
from contactopt.bodies.protocol import Guides
from contactopt.bodies.stiffness import isotropic_stiffness, stiffness
from contactopt.errors import InputError
from contactopt.material import Material, lame_by_poisson
from contactopt.meshes.cells import SHAPES, straight
from contactopt.scenes.scene import Part, Plate, Scene, Traction

PLANE = 1e-9  # nodes lie in a plane within this fraction of the body's extent


@dataclass(frozen=True, eq=False)
class Assembly:
    """A discretised Part with n displacement unknowns, of which those in `free` are not prescribed.

    A       (n, n) sparse stiffness; singular on the free unknowns if there are free motions
    load    (n,) nodal forces of tractions and body forces
    prescribed (n,) prescribed displacements of the supports, 0 elsewhere
    motion  (n, p) unit motions of the p plate components that may move; zero on free unknowns
    plate_forces (p,) total forces on them
    traces  name of each candidate contact boundary -> trace of the displacement there: nodes,
            areas, normals, weights, cells
    rigid_motions  rigid motions that no support and no plate holds
    driven  what each column of `motion` is, for messages
    holders name of each support and plate -> the unknowns that it holds or drives, each unknown
    with one of them mirrored (dim, n / dim) nodes in planes across an axis beyond which the body
    goes on as its mirror image
    """

    name: str
    kind: str
    material: Material
    basis: skfem.CellBasis
    weight: tuple[float, bool]
    A: sp.csr_matrix
    load: np.ndarray
    prescribed: np.ndarray
    free: np.ndarray
    motion: np.ndarray
    plate_forces: np.ndarray
    traces: Mapping[str, Trace]
    rigid_motions: Motions
    driven: tuple[str, ...]
    holders: Mapping[str, np.ndarray]
    mirrored: np.ndarray

    @property
    def trace(self) -> Trace:
        """That of the first contact boundary, which in a scene of two bodies is the only one."""
        return next(iter(self.traces.values()))

    @property
    def nodes(self) -> np.ndarray:
        """(k,) contact nodes."""
        return self.trace.nodes

    @property
    def areas(self) -> np.ndarray:
        """(k,) nodal areas."""
        return self.trace.areas

    @property
    def normals(self) -> np.ndarray:
        """(dim, k) outward unit normals at the contact nodes."""
        return self.trace.normals

    @property
    def weights(self) -> sp.csr_matrix:
        """(k, nodes) what the displacement of the nodes contributes to that of the contacts."""
        return self.trace.weights

    @property
    def degree(self) -> int:
        """Of the displacement in every element, 1 or 2."""
        return 1 if self.unknowns.shape[1] == self.basis.mesh.nvertices else 2

    @cached_property
    def unknowns(self) -> np.ndarray:
        """Displacement unknowns of every node, (dim, n / dim); the vertices of the mesh come first."""
        return node_unknowns(self.basis)

    @cached_property
    def by_poisson(self) -> sp.csr_matrix:
        """(n, n) derivative of the stiffness A by Poisson's ratio."""
        return isotropic_stiffness(self.basis, lame_by_poisson(self.material), self.weight)

    def stiffness_change(self, constant: str, U: np.ndarray) -> np.ndarray:
        """dA U (n,), the derivative of the elastic forces by the material's constant 'E' or 'nu' at
        fixed displacements U.
        """
        return np.asarray(self.A @ U / self.material.E if constant == "E" else self.by_poisson @ U)

    @property
    def locations(self) -> np.ndarray:
        """Coordinates of every node, (dim, n / dim)."""
        return np.asarray(self.basis.doflocs[:, self.unknowns[0]])

    @property
    def points(self) -> np.ndarray:
        """Coordinates of the contact nodes, (dim, k)."""
        return self.locations[:, self.nodes]

    @cached_property
    def surface_nodes(self) -> np.ndarray:
        """All nodes of the contact boundaries, (m,)."""
        return np.unique(np.concatenate([trace.weights.indices for trace in self.traces.values()]))

    @property
    def contact_dofs(self) -> np.ndarray:
        """Displacement unknowns of all nodes of the contact boundaries, (m, dim); m = k but for
        quadratic simplices.
        """
        return np.asarray(self.unknowns[:, self.surface_nodes].T)


def build_body(scene: Scene, part: Part, elements: int, zone: float | None) -> Assembly:
    """Mesh and assemble one elastic part of a scene.

    Parameters
    ----------
    scene, part : The scene and one of its parts.
    elements, zone : Number of elements across the contact half-width, and the half-width that the
        mesh resolves [length].

    Returns
    -------
    Stiffness [force / length], loads [force], held and driven unknowns, contact nodes and free
    motions.

    Raises
    ------
    InputError : For a mesh that cannot be used, such as one in several pieces, and for supports and
        loads that do not fit.
    """
    mesh = part.build_mesh(elements, zone)
    check_mesh(scene, part, mesh)
    axisymmetric = scene.kind == "axisymmetric"
    factor = {"plane-strain": scene.thickness, "axisymmetric": 2 * np.pi, "solid": 1.0}[
        scene.kind
    ] * scene.copies
    weight = (factor, axisymmetric)
    basis = make_basis(straight(mesh) if scene.degree == 1 else mesh, scene.degree, axisymmetric)
    A = stiffness(basis, part.material, weight)
    pieces = connected_components(A, directed=False)[0]
    if pieces > 1:
        raise InputError(
            f"body '{part.name}': its mesh falls into {pieces} pieces; remove nodes that belong to"
            " no element, merge duplicated nodes, or model each piece as a body of its own."
        )
    prescribed, held, motion, plate_forces, driven, holders = _constraints(scene, part, basis)
    rigid_motions = free_motions(
        scene.kind, scene.components, basis, node_unknowns(basis), held, weight
    )
    check_free(part.name, A, rigid_motions)
    contacts = {
        name: contact_trace(
            basis,
            scene.degree,
            mesh.boundaries[name],
            weight,
            scene.laws_of(part, name) == {"tied"},
        )
        for name in scene.surfaces_of(part)
    }
    return Assembly(
        part.name,
        scene.kind,
        part.material,
        basis,
        weight,
        A,
        _load(part, basis, weight),
        prescribed,
        np.flatnonzero(~held),
        motion,
        plate_forces,
        contacts,
        rigid_motions,
        driven,
        holders,
        mirrored_nodes(scene, part, basis, held),
    )


def guides_of(body: Assembly, part: Part) -> Guides:
    """Find the extent of a body and the planes on which supports hold it along the normal of the
    plane alone, at zero.

    Parameters
    ----------
    body : The assembled body.
    part : Its part of the scene.

    Returns
    -------
    The extent and the planes that lie across a coordinate axis and have the whole body on one side.
    """
    x = body.locations
    extent = np.stack([x.min(axis=1), x.max(axis=1)], axis=1)
    near = PLANE * float(np.ptp(extent, axis=1).max())
    planes = []
    names = {"plane-strain": "xy", "axisymmetric": "rz", "solid": "xyz"}[body.kind]
    for support in part.supports:
        given = support.displacement or {}
        if list(given.values()) != [0.0]:
            continue
        axis = names.index(next(iter(given)))
        nodes = body.basis.mesh.facets[:, np.asarray(body.basis.mesh.boundaries[support.boundary])]
        low, high = extent[axis]
        for place, sign in ((low, 1.0), (high, -1.0)):
            if np.all(np.abs(body.basis.mesh.p[axis, nodes] - place) <= near):
                planes.append((axis, float(place), sign))
    return Guides(extent, tuple(planes))


def reload_body(body: Assembly, scene: Scene, part: Part) -> Assembly:
    """Put the loads of another scene on a body.

    Parameters
    ----------
    body : The assembled body.
    scene, part : The other scene, and its part that stands for the same body.

    Returns
    -------
    The same body with other load values.

    Raises
    ------
    InputError : If other unknowns are held or driven there.
    """
    prescribed, held, motion, plate_forces, *_ = _constraints(scene, part, body.basis)
    if not np.array_equal(np.flatnonzero(~held), body.free) or not np.array_equal(
        motion, body.motion
    ):
        raise InputError(
            f"body '{part.name}': supports or plates hold other unknowns than before; reduce it"
            " anew."
        )
    mirrored = mirrored_nodes(scene, part, body.basis, held)
    load = _load(part, body.basis, body.weight)
    return replace(
        body, load=load, prescribed=prescribed, plate_forces=plate_forces, mirrored=mirrored
    )


def check_mesh(scene: Scene, part: Part, mesh: skfem.Mesh) -> None:
    """Check that a part's mesh fits the kind of the scene and has all boundaries that are named.

    Parameters
    ----------
    scene : The scene of the part.
    part : An elastic body of the scene.
    mesh : Its mesh.

    Raises
    ------
    InputError : If the mesh has another dimension, elements that are not known, numbers that are
        not finite, points on the wrong side of an axis of revolution, or lacks a boundary that the
        part names.
    """
    if (
        not isinstance(mesh, skfem.Mesh)
        or mesh.p.shape[0] != scene.dim
        or mesh.refdom.__name__ not in SHAPES
    ):
        raise InputError(
            f"body '{part.name}': a {scene.kind} scene needs a scikit-fem mesh of dimension"
            f" {scene.dim} made of triangles, quadrilaterals, tetrahedra or hexahedra; got"
            f" {type(mesh).__name__}."
        )
    if not np.all(np.isfinite(mesh.p)):
        raise InputError(
            f"body '{part.name}': the mesh has a node whose coordinates are not finite numbers."
        )
    if scene.kind == "axisymmetric" and mesh.p[0].min() < -1e-12 * np.ptp(mesh.p[0]):
        raise InputError(
            f"body '{part.name}': an axisymmetric mesh lies in r >= 0; its least r is"
            f" {mesh.p[0].min():g}."
        )
    known = mesh.boundaries or {}
    names = [*scene.surfaces_of(part), *(s.boundary for s in part.supports)]
    names += [load.boundary for load in part.loads if isinstance(load, (Traction, Plate))]
    filled = sorted(boundary for boundary, facets in known.items() if len(facets))
    for name in names:
        if name not in filled:
            wrong = (
                f"boundary {name!r} has no facets in this mesh"
                if name in known
                else f"the mesh has no boundary named {name!r}"
            )
            raise InputError(f"body '{part.name}': {wrong}; it has {', '.join(filled) or 'none'}.")


def _load(part: Part, basis: skfem.CellBasis, weight: tuple[float, bool]) -> np.ndarray:
    total = np.zeros(basis.N)
    for load in part.loads:
        if isinstance(load, Plate):
            continue
        value = np.asarray(load.value, dtype=float)

        @skfem.LinearForm
        def form(v, w, value=value):  # type: ignore[no-untyped-def]
            return dot(value.reshape((-1, 1, 1)) * np.ones_like(v), v) * weight_at(weight, w.x)

        where = basis.boundary(load.boundary) if isinstance(load, Traction) else basis
        total += form.assemble(where)
    return total


def _constraints(
    scene: Scene, part: Part, basis: skfem.CellBasis
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, tuple[str, ...], dict[str, np.ndarray]]:
    """Prescribed displacements, mask of unknowns that are not free, plate motions, forces and
    names, and who holds what.
    """
    prescribed, held = np.zeros(basis.N), np.zeros(basis.N, dtype=bool)
    table = node_unknowns(basis)

    def unknowns(boundary: str, component: str) -> np.ndarray:
        there = basis.get_dofs(facets=np.asarray(basis.mesh.boundaries[boundary])).flatten()
        return np.intersect1d(there, table[scene.components.index(component)])

    holders: dict[str, np.ndarray] = {}

    def holds(name: str, where: np.ndarray) -> None:
        known = np.concatenate([np.zeros(0, dtype=int), *holders.values()])
        holders[name] = np.union1d(holders.get(name, known[:0]), np.setdiff1d(where, known))

    for support in part.supports:
        values = (
            dict.fromkeys(scene.components, 0.0)
            if support.displacement is None
            else support.displacement
        )
        for component, value in values.items():
            where = unknowns(support.boundary, component)
            if np.any(held[where] & (prescribed[where] != value)):
                raise InputError(
                    f"body '{part.name}': the support on {support.boundary!r} prescribes"
                    f" {component} = {value:g} at a node where another support prescribes a"
                    " different value."
                )
            prescribed[where], held[where] = value, True
            holds(f"support '{support.boundary}'", where)
    columns, plate_forces, names = [], [], []
    supported = held.copy()
    for plate in (load for load in part.loads if isinstance(load, Plate)):
        for component in scene.components:
            where = unknowns(plate.boundary, component)
            if component in plate.force:
                if np.any(supported[where]):
                    raise InputError(
                        f"body '{part.name}': the plate on {plate.boundary!r} moves in {component},"
                        " but a support or another plate holds one of its nodes in that component."
                    )
                column = np.zeros(basis.N)
                column[where] = 1.0
                columns.append(column)
                plate_forces.append(plate.force[component])
                names.append(f"plate '{plate.boundary}' along {component}")
            elif not plate.glued:
                continue
            elif np.any(prescribed[where] != 0):
                raise InputError(
                    f"body '{part.name}': a support moves the plate on {plate.boundary!r}, which"
                    f" holds {component}; drop the plate or the support."
                )
            held[where] = True
            holds(f"plate '{plate.boundary}'", where)
        supported = held.copy()
    motion = np.stack(columns, axis=1) if columns else np.zeros((basis.N, 0))
    return prescribed, held, motion, np.array(plate_forces, dtype=float), tuple(names), holders
