"""One elastic body condensed to its contact unknowns and plates.

A plate's motion, extended into the body by A (Z = M - A_ff^-1 A_f: M), meets the balance Z' A Z lambda = thrust +
Z' (f - A lift) + sigma (T Z)' r. Motions that no support resists (kernel of Z' A Z) become multipliers of the interface
problem; the others add to the compliance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.body import Body
from contactopt.bodies.solvers import make_solver
from contactopt.bodies.solvers.system import BodySolver, Product, System

KERNEL = 1e-10  # a plate motion resisted by less than this fraction of the body's stiffness is free


@dataclass(frozen=True, eq=False)
class ReducedBody:
    """A Body with a solver of its linear system; n unknowns, f of them free, m of these on the contact boundary.

    interface   (m,) unknowns of the compliance
    at_rest     (n,) displacement at r = 0, lambda = 0 [length]
    extended    (n, j) displacement fields Z of all plate motions
    modes       (j, p) and (j, j - p) combinations of them that move freely, and those with elastic resistance, scaled so
                that each field `soft` = Z modes[1] adds soft soft' to the compliance
    resultants  (p,) s
    """

    body: Body
    solver: BodySolver
    interface: np.ndarray
    at_rest: np.ndarray
    extended: np.ndarray
    modes: tuple[np.ndarray, np.ndarray]
    resultants: np.ndarray

    @property
    def compliance(self) -> np.ndarray:
        """(m, m) block of A_ff^-1 on `interface` [length / force]; InputError if it was not provided for (schur)."""
        return self.solver.trailing_inverse()

    @cached_property
    def _restricted(self) -> Product:
        return self.solver.restricted(np.searchsorted(self.body.free, self.interface))

    @cached_property
    def motions(self) -> np.ndarray:
        """(n, p) displacement fields of the free plate motions."""
        return np.asarray(self.extended @ self.modes[0])

    @cached_property
    def soft(self) -> np.ndarray:
        """(n, j - p) displacement fields of the others."""
        return np.asarray(self.extended @ self.modes[1])

    def elastic(self, force: np.ndarray, accuracy: float | None = None) -> np.ndarray:
        """Displacement (n,) or (n, j) under nodal forces with the free plates at rest; prescribed unknowns stay."""
        free = self.body.free
        out = np.asarray(self.soft @ (self.soft.T @ force))
        out[free] += self.solver.solve(force[free], accuracy)
        return out

    def contact_motion(self, force: np.ndarray, accuracy: float | None = None) -> np.ndarray:
        """As elastic() under forces on the interface alone, right there, zero elsewhere."""
        out = np.zeros(force.shape)
        act = self.solver.trailing_product if self.solver.complete else self._restricted
        out[self.interface] = act(force[self.interface], accuracy)
        if self.soft.shape[1]:
            out += self.soft @ (self.soft.T @ force)
        return out

    def displacement(self, force: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """Displacement of all unknowns under nodal contact forces (n,) and plate displacements (p,), eq (13)."""
        return np.asarray(self.at_rest + self.elastic(force) + self.motions @ multipliers)

    def contact_map(self, nodes: np.ndarray, frames: np.ndarray) -> sp.csr_matrix:
        """T (k dim, n): displacements -> their components in the frames (k, dim, dim) at the contact nodes (k,).

        A component that is held at a contact node is taken there alone, without its neighbours: on a plane of symmetry
        those of the mirror image cancel them.
        """
        body, (k, dim) = self.body, frames.shape[:2]
        held = np.ones(len(self.at_rest), dtype=bool)
        held[body.free] = False
        weights = body.weights[np.searchsorted(body.nodes, nodes)]
        alone = sp.csr_matrix((np.ones(k), (np.arange(k), nodes)), weights.shape)
        maps = []
        for c, unknowns in enumerate(body.unknowns):
            at_rest = sp.diags(held[unknowns[nodes]].astype(float))
            turn = sp.csr_matrix((frames[:, :, c].ravel(), (np.arange(k * dim), np.repeat(np.arange(k), dim))))
            part = sp.coo_matrix(turn @ (weights - at_rest @ (weights - alone)))
            maps.append(sp.csr_matrix((part.data, (part.row, unknowns[part.col])), (k * dim, len(held))))
        T = sp.csr_matrix(sum(maps[1:], maps[0]))
        T.eliminate_zeros()
        return T

    def contact_force(self, nodes: np.ndarray, frames: np.ndarray, reactions: np.ndarray) -> np.ndarray:
        """Forces (n,) on the free unknowns by reactions (k, dim) on this body at its contact nodes, in their frames."""
        force = self.contact_map(nodes, frames).T @ reactions.ravel()
        out = np.zeros(len(force))
        out[self.body.free] = force[self.body.free]
        return out


def reduce_body(body: Body, solver: str = "auto", schur: bool = True) -> ReducedBody:
    """Make one body's linear system solvable and condense its plates.

    schur  eliminate the contact unknowns last, so that the factors hold their Schur complement: for an explicit Q
    """
    dofs, n = body.unknowns, len(body.load)
    node, component, place = np.empty(n, int), np.empty(n, int), np.full(n, -1)
    node[dofs], component[dofs] = np.arange(dofs.shape[1]), np.arange(len(dofs))[:, None]
    place[body.free] = np.arange(len(body.free))
    interface = np.intersect1d(body.contact_dofs, body.free)
    A = body.A[body.free][:, body.free]
    last = place[interface] if schur else None
    made = make_solver(solver, System(A, node[body.free], component[body.free], body.locations, last))
    extended = body.motion.copy()
    extended[body.free] -= made.solve((body.A @ body.motion)[body.free])
    K = extended.T @ (body.A @ extended)
    stiffness, vectors = np.linalg.eigh((K + K.T) / 2)
    moves = stiffness <= KERNEL * np.max(np.sum(body.motion * (body.A @ body.motion), axis=0), initial=0.0)
    free = np.eye(len(K)) if moves.all() else vectors[:, moves]  # keep one multiplier per plate component
    modes = free, vectors[:, ~moves] / np.sqrt(stiffness[~moves])
    return loaded_body(ReducedBody(body, made, interface, body.lift, extended, modes, body.thrust), body)


def loaded_body(old: ReducedBody, body: Body) -> ReducedBody:
    """`old` under the loads of `body`."""
    residual = body.load - body.A @ body.lift
    thrust = body.thrust + old.extended.T @ residual
    at_rest = body.lift + old.soft @ (old.modes[1].T @ thrust)
    at_rest[body.free] += old.solver.solve(residual[body.free])
    return replace(old, body=body, at_rest=at_rest, resultants=old.modes[0].T @ thrust)
