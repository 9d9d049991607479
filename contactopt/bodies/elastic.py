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

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from contactopt.bodies.assembly import Assembly, Matrices
from contactopt.bodies.motions import work
from contactopt.bodies.protocol import Body, FreeMotions, Seen, Way
from contactopt.bodies.solvers import make_solver, solver_type
from contactopt.bodies.solvers.system import BodySolver, Submatrix, System
from contactopt.bodies.thin import is_thin, on_ground
from contactopt.defaults import EQUAL
from contactopt.linear.operators import Product
from contactopt.linear.saddle_point import BodyTerm
from contactopt.scenes.scene import Part, Scene

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class ElasticBody(Body):
    """Matrices with a solver of its linear system.

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

    body: Matrices
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

    @cached_property
    def name(self) -> str:
        return self.body.name

    @property
    def _stiffness(self) -> sp.csr_matrix:
        """What the solver solves with, on all unknowns."""
        return self.body.A if self.ground is None else self.body.A + self.ground

    @cached_property
    def unknowns(self) -> int:
        return len(self.body.free)

    @property
    def view(self) -> Matrices:  # type: ignore[override]
        return self.body

    @property
    def way(self) -> Way:  # type: ignore[override]
        return Way(self.solver.iterative, self.solver.complete, self.solver.releases_lock)

    @cached_property
    def motions(self) -> FreeMotions:
        """Those of plates first."""
        own, rigid = self.modes[0], self.body.rigid_motions
        alone = np.abs(own).sum(axis=1) == 1.0
        leading = [int(np.argmax(alone & (column == 1.0))) for column in own.T]
        names = (*(self.body.driven[i] for i in leading), *rigid.names)
        fields = np.concatenate([self.extended @ own, rigid.fields], axis=1)
        return FreeMotions(fields, names, self.resultants)

    @cached_property
    def elastic_modes(self) -> np.ndarray:
        """(n, j - p) displacement fields of the plate motions that supports resist."""
        return np.asarray(self.extended @ self.modes[1])

    @cached_property
    def _restricted(self) -> Product:
        """Products with the block of A_ff^-1 on `interface`."""
        if self.solver.complete:
            return self.solver.trailing_product
        return self.solver.restricted(np.searchsorted(self.kept, self.interface))

    def _low_rank(self, T: sp.csr_matrix) -> tuple[np.ndarray, np.ndarray]:
        """L, R (rows, j) with T C T' = T G T' + L R'."""
        # C = G + E E' - Z Y' - Y Z' (contactopt.bodies.motions), seen through T.
        E, Z, Y = T @ self.elastic_modes, T @ self.body.rigid_motions.fields, T @ self.relief
        if not Z.shape[1]:
            return E, E  # one array, so that their product is symmetric to the last digit
        return np.concatenate([E, -Z, -Y], axis=1), np.concatenate([E, Y, Z], axis=1)

    def through(self, T: sp.csr_matrix) -> Seen:
        local, act, (left, right) = T[:, self.interface], self._restricted, self._low_rank(T)
        back = local.T.tocsr()

        def product(X: np.ndarray, accuracy: float | None) -> np.ndarray:
            return np.asarray(local @ act(back @ X, accuracy) + left @ (right.T @ X))

        def entries() -> np.ndarray:
            # T G T' from the block of G on the contact unknowns, and what is of low rank
            C, added = local @ (local @ self.solver.trailing_inverse()).T, left @ right.T
            return np.asarray((C + C.T) / 2 + (added + added.T) / 2)

        size = np.asarray(abs(local).sum(axis=1)).ravel() + np.abs(right).sum(axis=1)
        return Seen(product, entries, size > 0, None, self._term(T, (left, right)))

    def _term(self, T: sp.csr_matrix, low_rank: tuple[np.ndarray, np.ndarray]) -> BodyTerm | None:
        if not self.solver.iterative or self.solver.iteration is None:
            return None
        entries = self.body.A.diagonal()[self.kept]
        return BodyTerm(T[:, self.kept], *self.solver.iteration, entries, low_rank)

    def displacement(
        self, force: np.ndarray, multipliers: np.ndarray, free: np.ndarray | None = None
    ) -> np.ndarray:
        """U of all unknowns, eq (13) of the paper."""
        if free is not None:
            left, right = self._low_rank(sp.identity(len(force), format="csr"))
            U = self.at_rest + self.motions.fields @ multipliers + left @ (right.T @ force)
            U[self.kept] += free
            return np.asarray(U)
        # One solve for loads and contact forces together: in a thin body each alone moves it far.
        return np.asarray(self._under(force) + self.motions.fields @ multipliers)

    def _under(self, force: np.ndarray) -> np.ndarray:
        """Displacement (n,) under loads and nodal forces (n,), with multipliers of zero."""
        body = self.body
        missing = body.load + force + self.pull - self._stiffness @ body.prescribed
        resisted = body.plate_forces + self.extended.T @ missing
        return np.asarray(
            body.prescribed
            + self.elastic_modes @ (self.modes[1].T @ resisted)
            + self.relieved(missing)
        )

    def relieved(self, force: np.ndarray) -> np.ndarray:
        """Displacements (n,) or (n, j) under forces on free unknowns, plates at rest."""
        U, Z = np.zeros(force.shape), self.body.rigid_motions.fields
        U[self.kept] = self.solver.solve(force[self.kept])
        return np.asarray(U - Z @ (self.relief.T @ force) - self.relief @ (Z.T @ force))

    def carried(self, component: int) -> tuple[np.ndarray, np.ndarray]:
        weights, E = self.body.carried(component), self.elastic_modes
        return weights, np.asarray(E @ (E.T @ weights))

    def material_change(
        self, constant: str, U: np.ndarray, force: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        missing = -self.body.stiffness_change(constant, U)  # acts like a load
        return (
            self.elastic_modes @ (self.elastic_modes.T @ missing) + self.relieved(missing),
            self.motions.fields.T @ missing,
        )

    def internal_forces(self, U: np.ndarray, force: np.ndarray) -> np.ndarray:
        return np.asarray(self.body.A @ U)

    def loaded(self, scene: Scene, part: Part) -> ElasticBody:
        return _at_rest(self, self.body.reload(self.body, scene, part))


def on_soft_ground(body: Body, modulus: float) -> Body:
    """An elastic body on a soft ground if it is so thin that rounding moves it
    (contactopt.bodies.thin), beside bodies whose softest has Young's modulus `modulus` [stress];
    else the body itself.
    """
    if not isinstance(body, ElasticBody) or not isinstance(body.body, Assembly):
        return body
    told = body.ground is None and not body.solver.iterative
    if not (told and is_thin(body.body, body.relieved)):
        return body
    held, ground = on_ground(body.body, modulus)
    return condense(held, body.solver.name, body.solver.complete, sp.diags(ground, format="csr"))


def pulled(body: Body, U: np.ndarray) -> Body:
    """A body with its ground pulling it towards a displacement (n,); itself without a ground."""
    if not isinstance(body, ElasticBody) or body.ground is None:
        return body
    motions = body.body.rigid_motions
    pull = body.ground @ (U - motions.fields @ (motions.forces.T @ U))
    return _at_rest(replace(body, pull=pull), body.body)


def condense(
    body: Matrices, solver: str = "auto", entries: bool = True, ground: sp.csr_matrix | None = None
) -> ElasticBody:
    """Make one body's linear system solvable, by a `solver`, and condense its plates.

    With `entries` the contact unknowns are eliminated last, so that the factors hold their Schur
    complement, which makes the entries of the compliance cheap. A stiffness `ground` (n, n) is
    added.
    """
    whole = body.A if ground is None else sp.csr_matrix(body.A + ground)
    kept = body.free if ground is not None else np.setdiff1d(body.free, body.rigid_motions.fixing)
    interface = np.intersect1d(body.contact_dofs, kept)
    made = _solver(body, solver, whole, kept, interface if entries else None)
    extended = _extended(body, made, whole, kept)
    # The stiffness of the plates, Z' A Z. Its kernel moves freely; the rest are the elastic modes
    # E = Z v / stiffness^1/2.
    K = extended.T @ (whole @ extended)
    stiffness, vectors = np.linalg.eigh((K + K.T) / 2)
    own = np.sum(body.motion * (whole @ body.motion), axis=0)
    moves = stiffness <= 1e-10 * np.max(own, initial=0.0)  # of the stiffness: the plate is free
    # one multiplier per plate component that moves freely, whatever the others do
    free = vectors[:, moves]
    leading = np.sort(la.qr(free.T, pivoting=True, mode="r")[1][: free.shape[1]])
    free = np.asarray(free @ np.linalg.inv(free[leading]))
    free[leading] = np.eye(len(leading))
    modes = free, vectors[:, ~moves] / np.sqrt(stiffness[~moves])
    relief, load = _relief(body, made, kept), body.plate_forces
    parts = (body, made, kept, interface, body.prescribed, relief, extended, modes, load, ground)
    return _at_rest(ElasticBody(*parts), body)


def _solver(
    body: Matrices, name: str, whole: sp.csr_matrix, kept: np.ndarray, trailing: np.ndarray | None
) -> BodySolver:
    """A solver for the matrix on the kept unknowns, some of which may be eliminated last."""
    dofs, n = body.unknowns, len(body.load)
    node, component, place = np.zeros(n, int), np.zeros(n, int), np.full(n, -1)
    node[dofs], component[dofs] = np.arange(dofs.shape[1]), np.arange(len(dofs))[:, None]
    place[kept] = np.arange(len(kept))
    # Factors of A on these unknowns, or multigrid, which needs no copy of A.
    iterative = solver_type(name, len(kept), len(dofs)).iterative
    A = Submatrix(whole, kept) if iterative else whole[kept][:, kept]
    last = None if trailing is None else place[trailing]
    system = System(A, node[kept], component[kept], body.locations, last)
    made = body.solver(system) or make_solver(name, system)
    log.info("body '%s': %d unknowns, solver %s", body.name, A.shape[0], made.name)
    return made


def _extended(
    body: Matrices, solver: BodySolver, whole: sp.csr_matrix, kept: np.ndarray
) -> np.ndarray:
    """The plate motions M extended into the body, Z = M - A_ff^-1 A_f: M (n, p)."""
    # A plate that alone holds a body along itself moves it as a rigid whole, for which there is
    # nothing to solve.
    extended = _rigid_extension(body)
    lacking, forces = (
        np.abs((whole @ motion)[kept]).max(axis=0, initial=0.0)
        for motion in (extended, body.motion)
    )
    strained = lacking > EQUAL * forces
    if strained.any():
        extended[np.ix_(kept, strained)] -= solver.solve((whole @ extended[:, strained])[kept])
    # Rigid motions are multipliers of their own, so that plate motions have no part along them.
    if len(body.rigid_motions.names):
        extended -= body.rigid_motions.fields @ (body.rigid_motions.forces.T @ extended)
    return extended


def _relief(body: Matrices, solver: BodySolver, kept: np.ndarray) -> np.ndarray:
    """Y = G S - Z (S' G S) / 2 of contactopt.bodies.motions, (n, i), for floating bodies."""
    Z, S = body.rigid_motions.fields, body.rigid_motions.forces
    Y = np.zeros(Z.shape)
    if Z.shape[1]:
        Y[kept] = solver.solve(S[kept])
        Y -= Z @ (S.T @ Y) / 2
    return Y


def _rigid_extension(body: Matrices) -> np.ndarray:
    """The unit motions of plates (n, p), with the free unknowns of their component moved along."""
    extended, fixed = body.motion.copy(), np.ones(len(body.load), dtype=bool)
    fixed[body.free] = False
    for column in extended.T:
        component = next(row for row in body.unknowns if column[row].any())
        if np.all(column[component][fixed[component]] == 1.0):
            column[component] = 1.0
    return np.asarray(extended)


def _at_rest(old: ElasticBody, body: Matrices) -> ElasticBody:
    """The body `old` under the loads of `body`."""
    # With the prescribed displacements put in, loads act on the free unknowns and on the plates: p
    # + Z' (f - A g).
    resisted = body.plate_forces + old.extended.T @ (
        body.load + old.pull - old._stiffness @ body.prescribed
    )
    free = work(body.rigid_motions.fields, body.load)
    resultants = np.concatenate([old.modes[0].T @ resisted, free])
    new = replace(old, body=body, resultants=resultants)
    return replace(new, at_rest=new._under(np.zeros(len(body.load))))
