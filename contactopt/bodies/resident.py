"""An elastic body on its rank: what rank 0 orders of it (contactopt.bodies.remote). Its m contact
unknowns are those of the nodes of its contact surfaces, in the order of the body.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled_elastic import AssembledElastic
from contactopt.bodies.body import build_body
from contactopt.bodies.elastic import ElasticBody
from contactopt.bodies.ranks import shipped
from contactopt.bodies.solvers import SOLVERS
from contactopt.linear.operators import Product
from contactopt.linear.saddle_point import LocalTerm


def call(owner: Any, member: str, *arguments: Any) -> Any:
    """What the member of that name is or returns."""
    found = getattr(owner, member)
    return found(*arguments) if callable(found) else found


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces (m,) on the contact unknowns on their way to the rank of the body."""

    values: np.ndarray


@dataclass(frozen=True, eq=False)
class AssembledResident(AssembledElastic):
    """An assembled elastic body on its rank."""

    @cached_property
    def skin(self) -> np.ndarray:
        """(m,) the contact unknowns among those of the body."""
        return np.sort(self.body.contact_dofs, axis=None)

    def shipped_surface(self, name: str | None) -> bytes:
        """The surface and its mesh by the contact unknowns and nodes alone."""
        body, skin, whole = self.body, self.skin, self.surface(name)
        place = np.full(len(body.load), -1)
        place[skin] = np.arange(len(skin))
        traces = tuple(
            sp.csr_matrix((T.data, place[T.indices], T.indptr), (T.shape[0], len(skin)))
            for T in whole.traces
        )
        assert whole.mesh is not None
        nodes = body.surface_nodes
        number = np.full(whole.mesh.locations.shape[1], -1)
        number[nodes] = np.arange(len(nodes))
        mesh = replace(
            whole.mesh,
            faces=number[whole.mesh.faces],
            locations=whole.mesh.locations[:, nodes],
            unknowns=place[whole.mesh.unknowns[:, nodes]],
            held=whole.mesh.held[skin],
        )
        return shipped(replace(whole, traces=traces, mesh=mesh))

    def resident(self, solver: str, row: tuple[str, str, str] | None, entries: bool) -> Resident:
        """The body with its linear system made solvable; row is that of rank 0 in SOLVERS."""
        if row is not None:
            SOLVERS[solver] = row
        return Resident(self.prepare(solver, entries), self.skin)


def assembled(sent: bytes, elements: int, zone: float | None) -> AssembledResident:
    scene, part = pickle.loads(sent)
    return AssembledResident(build_body(scene, part, elements, zone), part)


@dataclass(frozen=True)
class Resident:
    """An elastic body on its rank, with the unknowns (m,) of its contact surfaces among its own."""

    body: ElasticBody
    skin: np.ndarray

    def wide(self, T: sp.csr_matrix) -> sp.csr_matrix:
        """A map (rows, m) of the contact unknowns as one (rows, n) of all unknowns."""
        shape = T.shape[0], len(self.body.at_rest)
        return sp.csr_matrix((T.data, self.skin[T.indices], T.indptr), shape)

    def force(self, F: np.ndarray) -> np.ndarray:
        """Forces (m,) on the contact unknowns as nodal forces (n,)."""
        full = np.zeros(len(self.body.at_rest))
        full[self.skin] = F
        return full

    def on_contacts(self, U: np.ndarray) -> np.ndarray:
        """The values (m,) of a vector (n,) on the contact unknowns."""
        return np.asarray(U[self.skin])

    def act(self, member: str, *arguments: Any) -> Any:
        """What a member of the body returns, with forces and maps made wide for it."""
        return call(self.body, member, *map(self._widened, arguments))

    def _widened(self, item: Any) -> Any:
        if isinstance(item, Forces):
            return self.force(item.values)
        return self.wide(item) if sp.issparse(item) else item

    @property
    def facts(self) -> dict[str, Any]:
        """What rank 0 knows of the body, by the fields of contactopt.bodies.remote.RemoteBody."""
        body = self.body
        known = ("name", "unknowns", "motion_names", "resultants", "iterative", "complete")
        facts = {name: getattr(body, name) for name in known}
        facts["equilibrated"] = body.equilibrium is not None
        facts["resting"], facts["motions"] = body.at_rest[self.skin], body.motions[self.skin]
        return facts

    def term(self, T: sp.csr_matrix) -> LocalTerm:
        assert self.body.equilibrium is not None
        return self.body.equilibrium.term(self.wide(T))

    def product(self, T: sp.csr_matrix) -> Product:
        return self.body.product(self.wide(T))

    def held_by(self, U: np.ndarray, F: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """As of the body, without the places on which no force acts."""
        found = {}
        for name, (points, forces) in self.body.held_by(U, self.force(F)).items():
            acting = forces.any(axis=0)
            found[name] = points[:, acting], forces[:, acting]
        return found

    def load_work(self, sent: bytes, dual: Any, weights: np.ndarray, W: np.ndarray) -> float:
        scene, part = pickle.loads(sent)
        return self.body.load_work(scene, part, self._widened(dual), weights, W)

    def loaded(self, sent: bytes) -> Resident:
        return replace(self, body=self.body.loaded(*pickle.loads(sent)))

    def changed(self, member: str, argument: Any) -> Resident:
        """With the body that a member of it returns; its own self where that is the same."""
        body = getattr(self.body, member)(argument)
        return self if body is self.body else replace(self, body=body)


def trace(term: LocalTerm, X: np.ndarray) -> np.ndarray:
    return term.started_trace(X)()


def shipped_mesh(found: Any) -> bytes:
    """That of a StressMap."""
    return shipped(found.mesh)
