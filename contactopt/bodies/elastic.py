"""One elastic body condensed to its contact unknowns and free motions.

A rigid plate on the body moves it: the plate's unit motion M, extended into the body by the
stiffness A, is the displacement field Z = M - A_ff^-1 A_f: M. Contact forces F and loads f meet in
the balance of the plates,

    Z' A Z lambda = p + Z' (f - A g) + Z' F,

with the total forces p on the plates and the displacements g that supports prescribe.

Motions that no support resists, the kernel of Z' A Z, become multipliers of the interface problem.
The others add to the compliance: C = A_ff^-1 + E E', where each column of E, the elastic modes, is
one of them divided by the square root of its stiffness.

Rigid motions that neither supports nor plates hold are multipliers, too. A_ff^-1 is then the
generalised inverse of contactopt.bodies.motions, the inverse G on the unknowns `kept` with a
correction of low rank.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.body import Assembly, build_body, guides_of, reload_body
from contactopt.bodies.elements import face_nodes
from contactopt.bodies.fields import Fields, Validity, fields_of, limits_of, recovery_errors
from contactopt.bodies.protocol import Equilibrium, Guides, Mesh, Region, Surface
from contactopt.bodies.solvers import make_solver, solver_type
from contactopt.bodies.solvers.system import Block, BodySolver, System
from contactopt.bodies.stress_recovery import StressMap, stress_map
from contactopt.bodies.thin import is_thin, on_ground
from contactopt.errors import InputError
from contactopt.linear.operators import Product
from contactopt.meshes.given_curves import check_curve
from contactopt.scenes.scene import Part, Scene

log = logging.getLogger(__name__)
RIGID = 1e-9  # forces below this fraction of those of a plate's motion are rounding
KERNEL = 1e-10  # a plate motion resisted by less than this fraction of the body's stiffness is free


@dataclass(frozen=True, eq=False)
class ElasticBody:
    """An Assembly with a solver of its linear system, as contactopt.bodies.protocol.Body asks.

    kept        free unknowns without the fixing unknowns of a body that floats
    interface   (m,) kept unknowns of the contact surfaces, on which contact forces act
    at_rest     (n,) displacement without contact forces and multipliers [length]
    relief      (n, i) the fields Y of the i free rigid motions (contactopt.bodies.motions)
    extended    (n, j) displacement fields Z of all plate motions
    modes       (j, p) and (j, j - p) combinations of them that move freely, and those with elastic
                resistance, scaled so that the elastic modes E = Z modes[1] add E E' to the
                compliance
    resultants  (p + i,) resultants s of the loads in the free motions, those of plates first
    ground      (n, n) stiffness of a ground that holds the body meanwhile, and pull (n,) its forces
                (contactopt.bodies.thin)
    """

    body: Assembly
    solver: BodySolver
    kept: np.ndarray
    interface: np.ndarray
    at_rest: np.ndarray
    relief: np.ndarray
    extended: np.ndarray
    modes: tuple[np.ndarray, np.ndarray]
    resultants: np.ndarray
    ground: sp.csr_matrix | None = None
    pull: np.ndarray | float = 0.0

    @property
    def name(self) -> str:
        return self.body.name

    @property
    def _stiffness(self) -> sp.csr_matrix:
        """What the solver solves with, on all unknowns."""
        return self.body.A if self.ground is None else self.body.A + self.ground

    @property
    def unknowns(self) -> int:
        return len(self.body.free)

    @property
    def iterative(self) -> bool:
        return self.solver.iterative

    @property
    def complete(self) -> bool:
        return self.solver.complete

    @property
    def parallel(self) -> bool:
        return self.solver.releases_lock

    @cached_property
    def equilibrium(self) -> Equilibrium | None:
        iteration = self.solver.iteration if self.solver.iterative else None
        if iteration is None:
            return None
        kept, everywhere = self.kept, sp.identity(len(self.body.load), format="csr")
        return Equilibrium(
            *iteration, self.body.A.diagonal()[kept], kept, self._low_rank(everywhere)
        )

    @property
    def interface_compliance(self) -> np.ndarray:
        """(m, m) block of A_ff^-1 on `interface` [length / force]; InputError if the body was not
        prepared for it.
        """
        return self.solver.trailing_inverse()

    @cached_property
    def motions(self) -> np.ndarray:
        """(n, p + i) displacement fields of the free motions, those of plates first."""
        return np.concatenate(
            [self.extended @ self.modes[0], self.body.rigid_motions.fields], axis=1
        )

    @property
    def motion_names(self) -> tuple[str, ...]:
        strongest = np.argmax(np.abs(self.modes[0]), axis=0) if self.modes[0].size else []
        return (*(self.body.driven[i] for i in strongest), *self.body.rigid_motions.names)

    @cached_property
    def elastic_modes(self) -> np.ndarray:
        """(n, j - p) displacement fields of the plate motions that supports resist."""
        return np.asarray(self.extended @ self.modes[1])

    @cached_property
    def _restricted(self) -> Product:
        """Products with the block of A_ff^-1 on `interface`."""
        if self.complete:
            return self.solver.trailing_product
        return self.solver.restricted(np.searchsorted(self.kept, self.interface))

    def _low_rank(self, T: sp.csr_matrix) -> tuple[np.ndarray, np.ndarray]:
        """L, R (rows, j) with T C T' = T G T' + L R'."""
        # C = G + E E' - Z Y' - Y Z' (contactopt.bodies.motions), seen through T.
        E, Z, Y = T @ self.elastic_modes, T @ self.body.rigid_motions.fields, T @ self.relief
        if not Z.shape[1]:
            return E, E  # one array, so that their product is symmetric to the last digit
        return np.concatenate([E, -Z, -Y], axis=1), np.concatenate([E, Y, Z], axis=1)

    def product(self, T: sp.csr_matrix) -> Product:
        local, act, (left, right) = T[:, self.interface], self._restricted, self._low_rank(T)
        back = local.T.tocsr()

        def product(X: np.ndarray, accuracy: float | None) -> np.ndarray:
            return np.asarray(local @ act(back @ X, accuracy) + left @ (right.T @ X))

        return product

    def convolution(self, T: sp.csr_matrix) -> None:
        return None

    def compliance(self, T: sp.csr_matrix) -> np.ndarray:
        # T G T' from the block of G on the contact unknowns, and T C T' with what is of low rank;
        # both made symmetric.
        local, (left, right) = T[:, self.interface], self._low_rank(T)
        C, added = local @ (local @ self.interface_compliance).T, left @ right.T
        return np.asarray((C + C.T) / 2 + (added + added.T) / 2)

    def moved(self, T: sp.csr_matrix) -> np.ndarray:
        size = np.asarray(abs(T[:, self.interface]).sum(axis=1)).ravel() + np.abs(
            self._low_rank(T)[1]
        ).sum(axis=1)
        return np.asarray(size > 0)

    def displacement(
        self, force: np.ndarray, multipliers: np.ndarray, free: Any = None
    ) -> np.ndarray:
        """U of all unknowns, eq (13) of the paper."""
        if free is not None and self.equilibrium is not None:
            left, right = self.equilibrium.low_rank
            U = self.at_rest + self.motions @ multipliers + left @ (right.T @ force)
            U[self.equilibrium.free] += free
            return np.asarray(U)
        # One solve for loads and contact forces together: in a thin body each alone moves it far.
        return np.asarray(self._under(force) + self.motions @ multipliers)

    def _under(self, force: np.ndarray) -> np.ndarray:
        """Displacement (n,) under the loads, supports, plates and nodal forces (n,), with
        multipliers of zero.
        """
        body = self.body
        missing = body.load + force + self.pull - self._stiffness @ body.prescribed
        resisted = body.plate_forces + self.extended.T @ missing
        return np.asarray(
            body.prescribed
            + self.elastic_modes @ (self.modes[1].T @ resisted)
            + self.relieved(missing)
        )

    def relieved(self, force: np.ndarray) -> np.ndarray:
        """Displacements (n,) or (n, j) under nodal forces on the free unknowns, with plates at
        rest.
        """
        U, Z = np.zeros(force.shape), self.body.rigid_motions.fields
        U[self.kept] = self.solver.solve(force[self.kept])
        return np.asarray(U - Z @ (self.relief.T @ force) - self.relief @ (Z.T @ force))

    def material_change(
        self, constant: str, U: np.ndarray, force: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        missing = -self.body.stiffness_change(constant, U)  # acts like a load
        return (
            self.elastic_modes @ (self.elastic_modes.T @ missing) + self.relieved(missing),
            self.motions.T @ missing,
        )

    def material_work(
        self, constant: str, U: np.ndarray, force: np.ndarray, dual: np.ndarray, W: np.ndarray
    ) -> float:
        return -float(W @ self.body.stiffness_change(constant, U))

    def load_work(
        self, scene: Scene, part: Part, dual: np.ndarray, weights: np.ndarray, W: np.ndarray
    ) -> float:
        old, new = self.body, reload_body(self.body, scene, part)
        prescribed, plates = new.prescribed - old.prescribed, self.modes[0].shape[1]
        driven = self.modes[1] @ (self.elastic_modes.T @ dual) + self.modes[0] @ weights[:plates]
        loads = new.load - old.load - old.A @ prescribed
        return float(dual @ prescribed + W @ loads + driven @ (new.plate_forces - old.plate_forces))

    def energy_gradient(self, U: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.body.A @ U, np.zeros(len(U))

    def energy_change(self, constant: str, U: np.ndarray, force: np.ndarray) -> float:
        return float(U @ self.body.stiffness_change(constant, U)) / 2

    def energy(self, U: np.ndarray) -> float:
        return float(U @ (self.body.A @ U)) / 2

    def external_forces(self, U: np.ndarray) -> np.ndarray:
        """Loads on free unknowns, reactions of supports, and on the unknowns of each plate its
        total force, shared out.
        """
        body, F = self.body, self.body.A @ U
        F[body.free] = body.load[body.free]
        total = body.plate_forces + body.motion.T @ body.load
        return np.asarray(F + body.motion @ ((total - body.motion.T @ F) / body.motion.sum(axis=0)))

    def held_by(self, U: np.ndarray, force: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        body, table = self.body, self.body.unknowns
        F = body.A @ U - body.load - force
        found = {}
        for name, unknowns in body.holders.items():
            own = np.zeros(len(F))
            own[unknowns] = F[unknowns]
            found[name] = body.locations, own[table]
        return found

    def fields(self, U: np.ndarray) -> Fields:
        return fields_of(self.body, U)

    def seen(self, T: sp.csr_matrix, U: np.ndarray) -> np.ndarray:
        return np.asarray(T @ U)

    def limits(self, U: np.ndarray, force: np.ndarray) -> Validity:
        return limits_of(self.body, U, force)

    def recovery_errors(self, U: np.ndarray, *others: np.ndarray) -> tuple[np.ndarray, ...]:
        return recovery_errors(self.body, U, *others)

    def on_elements(self, values: np.ndarray) -> np.ndarray:
        dofs = self.body.basis.element_dofs
        return np.asarray(
            (values / np.maximum(np.bincount(dofs.ravel(), minlength=len(values)), 1))[dofs].sum(
                axis=0
            )
        )

    def stress_map(self, region: Region, by_poisson: bool = False) -> StressMap:
        return stress_map(self.body, region, by_poisson)

    def loaded(self, scene: Scene, part: Part) -> ElasticBody:
        return _at_rest(self, reload_body(self.body, scene, part))

    def grounded(self, modulus: float) -> ElasticBody:
        if self.ground is not None or self.solver.iterative:
            return self
        if not is_thin(self.body, self.relieved):
            return self
        body, ground = on_ground(self.body, modulus)
        return condense(body, self.solver.name, self.complete, sp.diags(ground, format="csr"))

    def pulled(self, U: np.ndarray) -> ElasticBody:
        if self.ground is None:
            return self
        motions = self.body.rigid_motions
        pull = self.ground @ (U - motions.fields @ (motions.forces.T @ U))
        return _at_rest(replace(self, pull=pull), self.body)


@dataclass(frozen=True, eq=False)
class AssembledElastic:
    """An Assembly with its part of the scene, as contactopt.bodies.protocol.AssembledBody asks."""

    body: Assembly
    part: Part
    meshed = True

    @property
    def name(self) -> str:
        return self.body.name

    @property
    def unknowns(self) -> int:
        return len(self.body.free)

    @property
    def interface_unknowns(self) -> int:
        return self.body.contact_dofs.size

    def iterates(self, solver: str) -> bool:
        return solver_type(solver, self.unknowns, len(self.body.unknowns)).iterative

    def surface(self, name: str | None = None) -> Surface:
        """The contact surface, with the places of its nodes on the curve that the part gives."""
        name = name or self.part.contact
        if name not in self.body.traces:
            raise InputError(
                f"body '{self.name}' has no contact surface {name!r}; it has"
                f" {', '.join(sorted(self.body.traces))}."
            )
        return self._surfaces[name]

    @cached_property
    def _surfaces(self) -> dict[str, Surface]:
        """All of them, made once: a surface may take part in several pairs."""
        return {name: self._surface(name) for name in self.body.traces}

    def _surface(self, name: str) -> Surface:
        body = self.body
        trace, unknowns = body.traces[name], body.unknowns
        nodes = np.unique(trace.weights.indices)
        places = body.locations[:, nodes]
        curve = self.part.curve_of(name)
        if curve is not None:
            check_curve(curve, body.basis.mesh, name)
            places = curve(places)
        held = np.ones(len(body.load), dtype=bool)
        held[body.free] = False
        kind, facets = body.basis.mesh.refdom.__name__, np.asarray(body.basis.mesh.boundaries[name])
        faces, outward = face_nodes(body.basis, body.degree, facets)
        return Surface(
            body.name,
            body.locations[:, trace.nodes],
            trace.normals,
            trace.areas,
            trace.weights[:, nodes],
            places,
            tuple(_trace(trace.weights, trace.nodes, row, held) for row in unknowns),
            held[unknowns[:, trace.nodes]],
            trace.cells,
            Mesh(
                kind,
                body.degree,
                faces,
                outward,
                body.weight,
                body.locations,
                unknowns,
                held,
                curve,
            ),
        )

    def guides(self) -> Guides:
        return guides_of(self.body, self.part)

    def facing(self, other: Surface, normals: np.ndarray) -> tuple[Surface, np.ndarray]:
        raise InputError(f"body '{self.name}' has contacts of its own; couple it by them.")

    def prepare(self, solver: str, entries: bool) -> ElasticBody:
        return condense(self.body, solver, entries)


def _trace(
    weights: sp.csr_matrix, nodes: np.ndarray, unknowns: np.ndarray, held: np.ndarray
) -> sp.csr_matrix:
    """One component of the displacement of the contacts (k,) in terms of all unknowns (n,).

    In general the neighbours of a contact node take part, by its row of the weights. Where the
    component is prescribed at the contact node itself, as on a plane of symmetry, its displacement
    is that of the node alone: the weights of a neighbour and of its mirror image, which the model
    leaves out, cancel each other there.
    """
    k = len(nodes)
    alone = sp.csr_matrix((np.ones(k), (np.arange(k), nodes)), weights.shape)
    prescribed = sp.diags(held[unknowns[nodes]].astype(float))
    part = sp.coo_matrix(weights - prescribed @ (weights - alone))
    trace = sp.csr_matrix((part.data, (part.row, unknowns[part.col])), (k, len(held)))
    trace.eliminate_zeros()
    return trace


def assemble_elastic(
    scene: Scene, part: Part, elements: int, zone: float | None
) -> AssembledElastic:
    """Assemble an elastic part of a scene.

    Parameters
    ----------
    scene, part : The scene and one of its parts.
    elements, zone : Number of elements across the contact half-width, and the half-width that the
        mesh resolves [length].

    Returns
    -------
    The body as matrices, whose linear system is not solved yet.

    Raises
    ------
    InputError : For a part that cannot be modelled.
    """
    return AssembledElastic(build_body(scene, part, elements, zone), part)


def condense(
    body: Assembly, solver: str = "auto", entries: bool = True, ground: sp.csr_matrix | None = None
) -> ElasticBody:
    """Make one body's linear system solvable and condense its plates.

    Parameters
    ----------
    body : The assembled body.
    solver : 'auto' or a name in contactopt.bodies.solvers.SOLVERS.
    entries : Whether to eliminate the contact unknowns last, so that the factors hold their Schur
        complement: this makes the entries of the compliance cheap, and serves an explicit Q.
    ground : (n, n) stiffness that is added (contactopt.bodies.thin), if any.

    Returns
    -------
    The body, which moves under contact forces.
    """
    # The free unknowns without the fixing ones, with node and component of each, and those of the
    # contact surfaces.
    dofs, n = body.unknowns, len(body.load)
    node, component, place = np.empty(n, int), np.empty(n, int), np.full(n, -1)
    node[dofs], component[dofs] = np.arange(dofs.shape[1]), np.arange(len(dofs))[:, None]
    whole = body.A if ground is None else sp.csr_matrix(body.A + ground)
    kept = body.free if ground is not None else np.setdiff1d(body.free, body.rigid_motions.fixing)
    place[kept] = np.arange(len(kept))
    interface = np.intersect1d(body.contact_dofs, kept)
    # Factors of A on these unknowns, or multigrid, which needs no copy of A.
    iterative = solver_type(solver, len(kept), len(dofs)).iterative
    A = Block(whole, kept) if iterative else whole[kept][:, kept]
    trailing = place[interface] if entries else None
    made = make_solver(solver, System(A, node[kept], component[kept], body.locations, trailing))
    log.info("body '%s': %d unknowns, solver %s", body.name, A.shape[0], made.name)
    # Y, with which the generalised inverse of a floating body is G - Z Y' - Y Z'.
    relief = _relief(body, made, kept)
    # A plate that alone holds a body along itself moves it as a rigid whole, for which there is
    # nothing to solve.
    extended = _rigid_extension(body)
    lacking, forces = (
        np.abs((whole @ motion)[kept]).max(axis=0, initial=0.0)
        for motion in (extended, body.motion)
    )
    strained = lacking > RIGID * forces
    # The extension of the other plate motions M into the body: Z = M - A_ff^-1 A_f: M.
    if strained.any():
        extended[np.ix_(kept, strained)] -= made.solve((whole @ extended[:, strained])[kept])
    # Rigid motions are multipliers of their own, so that plate motions have no part along them.
    if len(body.rigid_motions.names):
        extended -= body.rigid_motions.fields @ (body.rigid_motions.forces.T @ extended)
    # The stiffness of the plates, Z' A Z. Its kernel moves freely; the rest are the elastic modes E
    # = Z v /
    # stiffness^1/2.
    K = extended.T @ (whole @ extended)
    stiffness, vectors = np.linalg.eigh((K + K.T) / 2)
    moves = stiffness <= KERNEL * np.max(
        np.sum(body.motion * (whole @ body.motion), axis=0), initial=0.0
    )
    # keep one multiplier per plate component
    free = np.eye(len(K)) if moves.all() else vectors[:, moves]
    modes = free, vectors[:, ~moves] / np.sqrt(stiffness[~moves])
    parts = (
        body,
        made,
        kept,
        interface,
        body.prescribed,
        relief,
        extended,
        modes,
        body.plate_forces,
        ground,
    )
    return _at_rest(ElasticBody(*parts), body)


def _relief(body: Assembly, solver: BodySolver, kept: np.ndarray) -> np.ndarray:
    """Y = G S - Z (S' G S) / 2 of contactopt.bodies.motions, (n, i)."""
    Z, S = body.rigid_motions.fields, body.rigid_motions.forces
    Y = np.zeros(Z.shape)
    if Z.shape[1]:
        Y[kept] = solver.solve(S[kept])
        Y -= Z @ (S.T @ Y) / 2
    return Y


def _rigid_extension(body: Assembly) -> np.ndarray:
    """The unit motions of the plates (n, p) with the unknowns of the same component moved along by
    as much.

    These are translations of the body where no support holds another part of it in that component.
    The free unknowns of a body that is held elsewhere stay at rest.
    """
    extended, fixed = body.motion.copy(), np.ones(len(body.load), dtype=bool)
    fixed[body.free] = False
    for column in extended.T:
        component = next(row for row in body.unknowns if column[row].any())
        if np.all(column[component][fixed[component]] == 1.0):
            column[component] = 1.0
    return np.asarray(extended)


def _at_rest(old: ElasticBody, body: Assembly) -> ElasticBody:
    """The body `old` under the loads of `body`."""
    # With the prescribed displacements put in, loads act on the free unknowns and on the plates: p
    # + Z' (f - A g).
    resisted = body.plate_forces + old.extended.T @ (
        body.load + old.pull - old._stiffness @ body.prescribed
    )
    resultants = np.concatenate(
        [old.modes[0].T @ resisted, body.rigid_motions.fields.T @ body.load]
    )
    new = replace(old, body=body, resultants=resultants)
    return replace(new, at_rest=new._under(np.zeros(len(body.load))))
