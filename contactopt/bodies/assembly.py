"""One elastic body as matrices: stiffness, loads, held and driven unknowns, contact nodes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
import skfem

from contactopt.bodies.elements import Trace, Weight, node_unknowns, nodes_on
from contactopt.bodies.motions import Motions
from contactopt.bodies.solvers.system import BodySolver, System
from contactopt.bodies.stiffness import isotropic_stiffness
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.scenes.kinds import Kind
from contactopt.scenes.scene import Scene


@dataclass(frozen=True, eq=False)
class Matrices:
    """A body of n displacement unknowns as matrices; those in `free` are not prescribed.

    A              (n, n) sparse stiffness; singular on the free unknowns if there are free motions
    load           (n,) nodal forces of tractions and body forces
    prescribed     (n,) prescribed displacements of the supports, 0 elsewhere
    motion         (n, p) unit motions of the p plate components that may move, zero on free
                   unknowns
    plate_forces   (p,) total forces on them;   driven  what each column of `motion` is
    rigid_motions  rigid motions that no support and no plate holds
    holders        name of each support and plate -> the unknowns that it holds or drives, each
                   unknown with one of them
    reload         function (body, scene, part) -> the body with the loads of another scene;
                   InputError if other unknowns are held or driven
    unknowns       (dim, nodes) those of every node;   locations  (dim, nodes) its coordinates
    surface_nodes  (m,) all nodes of the contact boundaries
    facets         name of each contact boundary -> (f, j) nodes of its facets, corners first
    """

    name: str
    A: sp.csr_matrix
    load: np.ndarray
    prescribed: np.ndarray
    free: np.ndarray
    motion: np.ndarray
    plate_forces: np.ndarray
    rigid_motions: Motions
    driven: tuple[str, ...]
    holders: Mapping[str, np.ndarray]
    reload: Callable[[Any, Scene, Any], Any]

    if TYPE_CHECKING:  # for classes whose fields they are, and for those that compute them

        @property
        def unknowns(self) -> np.ndarray: ...
        @property
        def locations(self) -> np.ndarray: ...
        @property
        def surface_nodes(self) -> np.ndarray: ...
        @property
        def facets(self) -> Mapping[str, np.ndarray]: ...

    @property
    def contact_dofs(self) -> np.ndarray:
        """Displacement unknowns (m, dim) of all nodes of the contact boundaries."""
        return np.asarray(self.unknowns[:, self.surface_nodes].T)

    def solver(self, system: System) -> BodySolver | None:
        """Its own solver on free unknowns; None: one of contactopt.bodies.solvers."""
        return None

    def stiffness_change(self, constant: str, U: np.ndarray) -> np.ndarray:
        """The derivative (n,) of the elastic forces by 'E' or 'nu' at fixed U."""
        raise InputError(
            f"body '{self.name}' is given by its matrices, which have no material constants to"
            " differentiate by; make it a Part with a mesh and a material."
        )

    def carried(self, component: int) -> np.ndarray:
        """Weights (n,) of the displacements that give the motion along a component: that of the
        plates that move along it; else of the supports that move along it, or hold it if none
        does; else the mean displacement.
        """
        own, n = self.unknowns[component], len(self.load)
        moving = [column for column in self.motion.T if column[own].any()]
        if not moving:
            along, driven = np.zeros(n), self.prescribed != 0
            along[own] = 1.0
            supports = [own for name, own in self.holders.items() if name.startswith("support")]
            for counts in (along * driven, along):
                parts = [np.bincount(own, counts[own], n) for own in supports]
                moving = moving or [part for part in parts if part.any()]
        if moving:
            return np.asarray(sum(column / column.sum() for column in moving) / len(moving))
        fields, forces = self.rigid_motions.fields, self.rigid_motions.forces
        others = np.delete(np.arange(n), own)
        free = np.all(fields[own] == 1.0, axis=0) & ~np.any(fields[others], axis=0)
        return np.asarray(forces[:, free].sum(axis=1))


@dataclass(frozen=True, eq=False)
class Assembly(Matrices):
    """A discretised Part: matrices with the finite elements behind them.

    traces    name of each candidate contact boundary -> trace of the displacement there
    mirrored  (dim, n / dim) nodes in planes across an axis beyond which the body goes on as its
              mirror image
    """

    kind: Kind
    material: Material
    basis: skfem.CellBasis
    weight: Weight
    traces: Mapping[str, Trace]
    mirrored: np.ndarray

    @property
    def trace(self) -> Trace:
        """That of the first contact boundary, which in a scene of two bodies is the only one."""
        return next(iter(self.traces.values()))

    @property
    def nodes(self) -> np.ndarray:
        return self.trace.nodes

    @property
    def degree(self) -> int:
        """The degree of the displacement in every element, 1 or 2."""
        return 1 if self.unknowns.shape[1] == self.basis.mesh.nvertices else 2

    @cached_property
    def unknowns(self) -> np.ndarray:
        """Displacement unknowns of every node, (dim, n / dim); the mesh's vertices come first."""
        return node_unknowns(self.basis)

    @cached_property
    def by_poisson(self) -> sp.csr_matrix:
        """(n, n) derivative of the stiffness A by Poisson's ratio."""
        constants = self.kind.constants_by_poisson(self.material)
        return isotropic_stiffness(self.basis, constants, self.weight)

    def stiffness_change(self, constant: str, U: np.ndarray) -> np.ndarray:
        return np.asarray(self.A @ U / self.material.E if constant == "E" else self.by_poisson @ U)

    @property
    def locations(self) -> np.ndarray:
        """Coordinates of every node, (dim, n / dim)."""
        return np.asarray(self.basis.doflocs[:, self.unknowns[0]])

    @property
    def points(self) -> np.ndarray:
        """Coordinates of the contact nodes, (dim, k)."""
        return self.locations[:, self.nodes]

    @property
    def facets(self) -> Mapping[str, np.ndarray]:
        known = self.basis.mesh.boundaries
        return {
            name: nodes_on(self.basis, self.degree, np.asarray(known[name])) for name in self.traces
        }

    @cached_property
    def surface_nodes(self) -> np.ndarray:
        """All nodes of the contact boundaries, (m,)."""
        return np.unique(np.concatenate([trace.weights.indices for trace in self.traces.values()]))
