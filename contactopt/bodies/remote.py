"""A body on another rank: what rank 0 knows of it are the displacement unknowns of its contact surfaces.

The body itself, its mesh, its stiffness and its solver stay on their rank. Here its unknowns are only those m of the nodes of
its contact surfaces, in the order in which the body itself numbers them. Contact forces go there, and displacements of
these unknowns come back. A displacement of the whole body is kept on its rank and stands here as a Field.
"""

from __future__ import annotations

import operator
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.elastic import AssembledElastic, ElasticBody, assemble_elastic
from contactopt.bodies.fields import Fields, Limits
from contactopt.bodies.protocol import Guides, Surface
from contactopt.bodies.ranks import Kept, RemotePart, Team, shipped, values_of
from contactopt.errors import InputError
from contactopt.problem.coupled import LocalTerm
from contactopt.problem.operators import Product
from contactopt.problem.stacked import dot
from contactopt.scenes.scene import Part, Scene


def _sent(scene: Scene, part: Part) -> bytes:
    """Scene and part as their rank needs them: without the meshes of the other bodies."""

    def change(other: Any) -> Any:
        if not isinstance(other, Part):
            return other
        values = values_of(other)
        return Part(**(values if other.name == part.name else values | {"mesh": None, "curve": None}))

    return shipped((replace(scene.with_parts(change), reference=None), Part(**values_of(part))))


@dataclass(frozen=True, eq=False)
class Field:
    """A vector of the unknowns of a body, on its rank, with the operators of an array that the callers of bodies use."""

    team: Team
    kept: Kept
    elsewhere = True

    def _make(self, function: Any, other: Any) -> Field:
        own = other.kept if isinstance(other, Field) else other
        return Field(self.team, self.team.keep(self.kept.rank, function, self.kept, own))

    def __add__(self, other: Field) -> Field:
        return self._make(operator.add, other)

    def __sub__(self, other: Field) -> Field:
        return self._make(operator.sub, other)

    def __mul__(self, other: Field | float) -> Field:
        return self._make(operator.mul, other)

    def __rmul__(self, factor: float) -> Field:
        return self._make(operator.mul, factor)

    def __truediv__(self, other: Field | float) -> Field:
        return self._make(operator.truediv, other)

    def __pow__(self, power: float) -> Field:
        return self._make(operator.pow, power)

    def __matmul__(self, other: Field) -> float:
        return float(self.team.ask(self.kept.rank, operator.matmul, self.kept, other.kept))

    def astype(self, kind: Any) -> Field:
        """The vector in another precision."""
        return self._make(np.ndarray.astype, kind)

    def started_dot(self, other: Field) -> Callable[[], float]:
        """The scalar product, when it is called; the work begins now."""
        return self.team.start(self.kept.rank, dot, self.kept, other.kept)


# ---- on the rank of the body ----


@dataclass(frozen=True)
class Resident:
    """An elastic body on its rank, with the unknowns (m,) of its contact surfaces among its own."""

    body: ElasticBody
    skin: np.ndarray

    def wide(self, T: sp.csr_matrix) -> sp.csr_matrix:
        """A map (rows, m) of the contact unknowns as one (rows, n) of all unknowns."""
        return sp.csr_matrix((T.data, self.skin[T.indices], T.indptr), (T.shape[0], len(self.body.at_rest)))

    def force(self, F: np.ndarray) -> np.ndarray:
        """Forces (m,) on the contact unknowns as nodal forces (n,)."""
        full = np.zeros(len(self.body.at_rest))
        full[self.skin] = F
        return full


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


def _assembled(sent: bytes, elements: int, zone: float | None) -> AssembledElastic:
    scene, part = pickle.loads(sent)
    return assemble_elastic(scene, part, elements, zone)


def _surface(assembled: AssembledElastic, name: str | None) -> bytes:
    """The surface in terms of the contact unknowns alone, and its mesh by the nodes of the contact surfaces alone."""
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


def _sizes(assembled: AssembledElastic) -> tuple[int, int]:
    return assembled.unknowns, assembled.interface_unknowns


def _prepared(assembled: AssembledElastic, solver: str, entries: bool) -> Resident:
    return Resident(assembled.prepare(solver, entries), _skin(assembled))


def _facts(own: Resident) -> Facts:
    body, skin, equilibrated = own.body, own.skin, own.body.solver.iteration is not None
    named, solved = (body.name, body.unknowns), (body.iterative, body.complete, equilibrated)
    return Facts(*named, body.at_rest[skin], body.motions[skin], body.motion_names, body.resultants, *solved)


def _term(own: Resident, T: sp.csr_matrix) -> LocalTerm:
    assert own.body.equilibrium is not None
    return own.body.equilibrium.term(own.wide(T))


def _size(term: LocalTerm) -> tuple[int, tuple[np.ndarray, np.ndarray]]:
    return term.size, term.low_rank


def _trace(term: LocalTerm, X: np.ndarray) -> np.ndarray:
    return term.started_trace(X)()


def _stiffness(term: LocalTerm, X: np.ndarray) -> np.ndarray:
    return term.stiffness(X)


def _cycle(term: LocalTerm, F: np.ndarray) -> np.ndarray:
    return term.cycle(F)


def _product(own: Resident, T: sp.csr_matrix) -> Product:
    return own.body.product(own.wide(T))


def _act(product: Product, X: np.ndarray, accuracy: float | None) -> np.ndarray:
    return product(X, accuracy)


def _compliance(own: Resident, T: sp.csr_matrix) -> np.ndarray:
    return own.body.compliance(own.wide(T))


def _moved(own: Resident, T: sp.csr_matrix) -> np.ndarray:
    return own.body.moved(own.wide(T))


def _displacement(own: Resident, F: np.ndarray, multipliers: np.ndarray, free: np.ndarray | None) -> np.ndarray:
    return own.body.displacement(own.force(F), multipliers, free)


def _energy(own: Resident, U: np.ndarray) -> float:
    return own.body.energy(U)


def _external_forces(own: Resident, U: np.ndarray) -> np.ndarray:
    return own.body.external_forces(U)


def _held_by(own: Resident, U: np.ndarray, F: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """As ElasticBody.held_by, without the places on which no force acts."""
    found = own.body.held_by(U, own.force(F))
    acting = {name: forces.any(axis=0) for name, (_, forces) in found.items()}
    return {name: (points[:, acting[name]], forces[:, acting[name]]) for name, (points, forces) in found.items()}


def _fields(own: Resident, U: np.ndarray) -> Fields:
    return own.body.fields(U)


def _seen(own: Resident, T: sp.csr_matrix, U: np.ndarray) -> np.ndarray:
    return own.body.seen(own.wide(T), U)


def _limits(own: Resident, U: np.ndarray, F: np.ndarray) -> Limits:
    return own.body.limits(U, own.force(F))


def _loaded(own: Resident, sent: bytes) -> Resident:
    return replace(own, body=own.body.loaded(*pickle.loads(sent)))


# ---- on rank 0 ----


@dataclass(frozen=True, eq=False)
class RemoteTerm:
    """The term of a body on another rank, as contactopt.problem.coupled.BodyTerm asks.

    rows  (m,) rows of u that the body moves, which alone travel;   length  number of all rows
    """

    team: Team
    kept: Kept
    rows: np.ndarray
    length: int
    size: int
    low_rank: tuple[np.ndarray, np.ndarray]
    elsewhere = True

    def _make(self, function: Any, *arguments: Any) -> Field:
        return Field(self.team, self.team.keep(self.kept.rank, function, self.kept, *arguments))

    def diagonal(self) -> Field:
        return self._make(LocalTerm.diagonal)

    def stiffness(self, X: Field) -> Field:
        return self._make(_stiffness, X.kept)

    def cycle(self, F: Field) -> Field:
        return self._make(_cycle, F.kept)

    def pulled(self, r: np.ndarray) -> Field:
        return self._make(LocalTerm.pulled, r[self.rows])

    def started_trace(self, X: Field) -> Callable[[], np.ndarray]:
        own = self.team.start(self.kept.rank, _trace, self.kept, X.kept)

        def end() -> np.ndarray:
            u = np.zeros(self.length)
            u[self.rows] = own()
            return u

        return end


@dataclass(frozen=True, eq=False)
class RemoteEquilibrium:
    """The linear system of a body on another rank, which is solved by iteration there."""

    body: RemoteBody

    def term(self, T: sp.csr_matrix) -> RemoteTerm:
        team, rows = self.body.team, np.flatnonzero(np.diff(T.indptr))
        kept = team.keep(self.body.kept.rank, _term, self.body.kept, T[rows])
        size, low_rank = team.ask(kept.rank, _size, kept)
        spread = sp.csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), (T.shape[0], len(rows)))
        return RemoteTerm(team, kept, rows, T.shape[0], size, (spread @ low_rank[0], spread @ low_rank[1]))


@dataclass(frozen=True, eq=False)
class RemoteBody:
    """A body on another rank, as contactopt.bodies.protocol.Body asks; its n unknowns are the m of its contact surfaces."""

    team: Team
    kept: Kept
    facts: Facts
    parallel = True

    def _ask(self, function: Any, *arguments: Any) -> Any:
        return self.team.ask(self.kept.rank, function, self.kept, *arguments)

    def _keep(self, function: Any, *arguments: Any) -> Kept:
        return self.team.keep(self.kept.rank, function, self.kept, *arguments)

    @property
    def name(self) -> str:
        return self.facts.name

    @property
    def unknowns(self) -> int:
        return self.facts.unknowns

    @property
    def at_rest(self) -> np.ndarray:
        return self.facts.at_rest

    @property
    def motions(self) -> np.ndarray:
        return self.facts.motions

    @property
    def motion_names(self) -> tuple[str, ...]:
        return self.facts.motion_names

    @property
    def resultants(self) -> np.ndarray:
        return self.facts.resultants

    @property
    def iterative(self) -> bool:
        return self.facts.iterative

    @property
    def complete(self) -> bool:
        return self.facts.complete

    @property
    def equilibrium(self) -> RemoteEquilibrium | None:
        return RemoteEquilibrium(self) if self.facts.equilibrated else None

    def product(self, T: sp.csr_matrix) -> Product:
        made = self._keep(_product, T)
        return lambda X, accuracy: self.team.ask(made.rank, _act, made, X, accuracy)

    def convolution(self, T: sp.csr_matrix) -> None:
        return None

    def compliance(self, T: sp.csr_matrix) -> np.ndarray:
        return np.asarray(self._ask(_compliance, T))

    def moved(self, T: sp.csr_matrix) -> np.ndarray:
        return np.asarray(self._ask(_moved, T))

    def displacement(self, force: np.ndarray, multipliers: np.ndarray, free: Any = None) -> Any:
        known = None if free is None else free.kept
        return Field(self.team, self._keep(_displacement, force, multipliers, known))

    def energy(self, U: Any) -> float:
        return float(self._ask(_energy, U.kept))

    def external_forces(self, U: Any) -> Any:
        return Field(self.team, self._keep(_external_forces, U.kept))

    def held_by(self, U: Any, force: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        found: dict[str, tuple[np.ndarray, np.ndarray]] = self._ask(_held_by, U.kept, force)
        return found

    def stress_map(self, region: object, by_poisson: bool = False) -> None:
        return None

    def fields(self, U: Any) -> Fields:
        found: Fields = self._ask(_fields, U.kept)
        return found

    def seen(self, T: sp.csr_matrix, U: Any) -> np.ndarray:
        return np.asarray(self._ask(_seen, T, U.kept))

    def limits(self, U: Any, force: np.ndarray) -> Limits:
        return Limits(*self._ask(_limits, U.kept, force))

    def grounded(self, modulus: float) -> RemoteBody:
        return self

    def pulled(self, U: Any) -> RemoteBody:
        return self

    def loaded(self, scene: Scene, part: Part) -> RemoteBody:
        return _known(self.team, self._keep(_loaded, _sent(scene, part)))


def _known(team: Team, kept: Kept) -> RemoteBody:
    return RemoteBody(team, kept, team.ask(kept.rank, _facts, kept))


@dataclass(frozen=True, eq=False)
class AssembledRemote:
    """An assembled body on another rank, as contactopt.bodies.protocol.AssembledBody asks."""

    team: Team
    kept: Kept
    name: str
    meshed = True

    def _ask(self, function: Any, *arguments: Any) -> Any:
        return self.team.ask(self.kept.rank, function, self.kept, *arguments)

    @cached_property
    def _sizes(self) -> Sequence[int]:
        found: tuple[int, int] = self._ask(_sizes)
        return found

    @property
    def unknowns(self) -> int:
        return self._sizes[0]

    @property
    def interface_unknowns(self) -> int:
        return self._sizes[1]

    def guides(self) -> Guides:
        return Guides(*self._ask(AssembledElastic.guides))

    def iterates(self, solver: str) -> bool:
        return bool(self._ask(AssembledElastic.iterates, solver))

    def surface(self, name: str | None = None) -> Surface:
        found: Surface = pickle.loads(self._ask(_surface, name))
        return found

    def facing(self, other: Surface, normals: np.ndarray) -> tuple[Surface, np.ndarray]:
        raise InputError(f"body '{self.name}' has contacts of its own; couple it by them.")

    def prepare(self, solver: str, entries: bool) -> RemoteBody:
        return _known(self.team, self.team.keep(self.kept.rank, _prepared, self.kept, solver, entries))


def assemble_remote(scene: Scene, part: RemotePart, elements: int, zone: float | None) -> AssembledRemote:
    """Assemble a body on its rank.

    Parameters
    ----------
    scene, part
        The scene and one of its remote parts.
    elements, zone
        Number of elements across the contact half-width, and the half-width that the mesh resolves [length].

    Returns
    -------
    AssembledRemote
        What stands for the body on this rank.
    """
    team = part.team
    assert team is not None
    kept = team.keep(part.rank, _assembled, _sent(scene, part), elements, zone)
    return AssembledRemote(team, kept, part.name)
