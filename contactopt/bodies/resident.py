"""An elastic body on its rank: what rank 0 orders of it (contactopt.bodies.remote).

Its contact unknowns m are those of the nodes of its contact surfaces, in the order in which the
body numbers them.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.elastic import AssembledElastic, ElasticBody, assemble_elastic
from contactopt.bodies.ranks import shipped
from contactopt.bodies.stress_recovery import StressMap
from contactopt.linear.operators import Product
from contactopt.linear.saddle_point import LocalTerm


@dataclass(frozen=True)
class Resident:
    """An elastic body on its rank, with the unknowns (m,) of its contact surfaces among its own."""

    body: ElasticBody
    skin: np.ndarray

    def wide(self, T: sp.csr_matrix) -> sp.csr_matrix:
        """A map (rows, m) of the contact unknowns as one (rows, n) of all unknowns."""
        return sp.csr_matrix(
            (T.data, self.skin[T.indices], T.indptr), (T.shape[0], len(self.body.at_rest))
        )

    def force(self, F: np.ndarray) -> np.ndarray:
        """Forces (m,) on the contact unknowns as nodal forces (n,)."""
        full = np.zeros(len(self.body.at_rest))
        full[self.skin] = F
        return full

    def on_contacts(self, U: np.ndarray) -> np.ndarray:
        """The values (m,) of a vector (n,) on the contact unknowns."""
        return np.asarray(U[self.skin])

    def act(self, member: str, *arguments: Any) -> Any:
        """What a member of the body returns; forces on the contact unknowns are widened for it."""
        given = [
            self.force(item.values) if isinstance(item, Forces) else item for item in arguments
        ]
        return getattr(self.body, member)(*given)


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces (m,) on the contact unknowns on their way to the rank of the body."""

    values: np.ndarray


@dataclass(frozen=True)
class Facts:
    """What rank 0 knows of a body, as in contactopt.bodies.protocol.Body, on its contact unknowns."""

    name: str
    unknowns: int
    at_rest: np.ndarray
    motions: np.ndarray
    motion_names: tuple[str, ...]
    resultants: np.ndarray
    iterative: bool
    complete: bool
    equilibrated: bool


def _skin(assembled: AssembledElastic) -> np.ndarray:
    return np.sort(assembled.body.contact_dofs, axis=None)


def assembled(sent: bytes, elements: int, zone: float | None) -> AssembledElastic:
    scene, part = pickle.loads(sent)
    return assemble_elastic(scene, part, elements, zone)


def surface(assembled: AssembledElastic, name: str | None) -> bytes:
    """The surface in terms of the contact unknowns alone, and its mesh by the nodes of the contact
    surfaces alone.
    """
    body, skin, whole = assembled.body, _skin(assembled), assembled.surface(name)
    place = np.full(len(body.load), -1)
    place[skin] = np.arange(len(skin))
    traces = tuple(
        sp.csr_matrix((trace.data, place[trace.indices], trace.indptr), (trace.shape[0], len(skin)))
        for trace in whole.traces
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


def sizes(assembled: AssembledElastic) -> tuple[int, int]:
    return assembled.unknowns, assembled.interface_unknowns


def prepared(assembled: AssembledElastic, solver: str, entries: bool) -> Resident:
    return Resident(assembled.prepare(solver, entries), _skin(assembled))


def facts(own: Resident) -> Facts:
    body, skin, equilibrated = own.body, own.skin, own.body.solver.iteration is not None
    named, solved = (body.name, body.unknowns), (body.iterative, body.complete, equilibrated)
    return Facts(
        *named, body.at_rest[skin], body.motions[skin], body.motion_names, body.resultants, *solved
    )


def term(own: Resident, T: sp.csr_matrix) -> LocalTerm:
    assert own.body.equilibrium is not None
    return own.body.equilibrium.term(own.wide(T))


def size(term: LocalTerm) -> tuple[int, tuple[np.ndarray, np.ndarray]]:
    return term.size, term.low_rank


def trace(term: LocalTerm, X: np.ndarray) -> np.ndarray:
    return term.started_trace(X)()


def stiffness(term: LocalTerm, X: np.ndarray) -> np.ndarray:
    return term.stiffness(X)


def cycle(term: LocalTerm, F: np.ndarray) -> np.ndarray:
    return term.cycle(F)


def product(own: Resident, T: sp.csr_matrix) -> Product:
    return own.body.product(own.wide(T))


def act(product: Product, X: np.ndarray, accuracy: float | None) -> np.ndarray:
    return product(X, accuracy)


def compliance(own: Resident, T: sp.csr_matrix) -> np.ndarray:
    return own.body.compliance(own.wide(T))


def moved(own: Resident, T: sp.csr_matrix) -> np.ndarray:
    return own.body.moved(own.wide(T))


def seen(own: Resident, T: sp.csr_matrix, U: np.ndarray) -> np.ndarray:
    return own.body.seen(own.wide(T), U)


def held_by(
    own: Resident, U: np.ndarray, F: np.ndarray
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """As ElasticBody.held_by, without the places on which no force acts."""
    found = own.body.held_by(U, own.force(F))
    acting = {name: forces.any(axis=0) for name, (_, forces) in found.items()}
    return {
        name: (points[:, acting[name]], forces[:, acting[name]])
        for name, (points, forces) in found.items()
    }


def load_work(
    own: Resident, sent: bytes, dual: np.ndarray | Forces, weights: np.ndarray, W: np.ndarray
) -> float:
    scene, part = pickle.loads(sent)
    return float(own.act("load_work", scene, part, dual, weights, W))


def whole(own: Resident) -> np.ndarray:
    return own.body.at_rest


def map_facts(found: StressMap) -> tuple[np.ndarray, np.ndarray]:
    return found.places, found.sources


def mesh(found: StressMap) -> bytes:
    return shipped(found.mesh)


def loaded(own: Resident, sent: bytes) -> Resident:
    return replace(own, body=own.body.loaded(*pickle.loads(sent)))
