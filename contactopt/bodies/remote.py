"""A body on another rank: what rank 0 knows of it are the displacement unknowns of its contact
surfaces.

The body itself, its mesh, its stiffness and its solver stay on their rank. Here its unknowns are
only those m of the nodes of its contact surfaces, in the order in which the body itself numbers
them. Contact forces go there, and displacements of these unknowns come back. A displacement of the
whole body is kept on its rank and stands here as a Field.
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

from contactopt.bodies import resident
from contactopt.bodies.elastic import AssembledElastic
from contactopt.bodies.fields import Fields, Validity
from contactopt.bodies.protocol import Guides, Region, Surface
from contactopt.bodies.ranks import Kept, RemotePart, Team, shipped, values_of
from contactopt.bodies.stress_recovery import StressMap
from contactopt.errors import InputError
from contactopt.linear.operators import Product
from contactopt.linear.saddle_point import LocalTerm
from contactopt.linear.stacked import dot
from contactopt.scenes.scene import Part, Scene


def _sent(scene: Scene, part: Part) -> bytes:
    """Scene and part as their rank needs them: without the meshes of the other bodies."""

    def change(other: Any) -> Any:
        if not isinstance(other, Part):
            return other
        values = values_of(other)
        return Part(
            **(values if other.name == part.name else values | {"mesh": None, "curve": None})
        )

    return shipped((replace(scene.with_parts(change), reference=None), Part(**values_of(part))))


@dataclass(frozen=True, eq=False)
class Field:
    """A vector of the unknowns of a body, on its rank, with the operators of an array that the
    callers of bodies use.

    body   the Resident whose n unknowns these are; None for vectors of an iteration, which no map
           of contacts meets
    known  its values on the contact unknowns (m,) where they are known here
    """

    team: Team
    kept: Kept
    body: Kept | None = None
    known: np.ndarray | None = None
    elsewhere = True
    __array_ufunc__ = None  # NumPy's arrays leave the operators to this class

    def _make(self, function: Any, other: Any) -> Field:
        # forces on the contact unknowns
        if isinstance(other, np.ndarray) and self.body is not None:
            other = Field(
                self.team, self.team.keep(self.kept.rank, resident.Resident.force, self.body, other)
            )
        own = other.kept if isinstance(other, Field) else other
        return Field(self.team, self.team.keep(self.kept.rank, function, self.kept, own), self.body)

    def __add__(self, other: Field | np.ndarray) -> Field:
        return self._make(operator.add, other)

    __radd__ = __add__

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

    def __rmatmul__(self, T: sp.csr_matrix) -> np.ndarray:
        """A map (rows, m) of the contact unknowns applied to the vector."""
        known = self.known
        if known is None:
            known = self.team.ask(
                self.kept.rank, resident.Resident.on_contacts, self.body, self.kept
            )
        return np.asarray(T @ known)

    def any(self, axis: None = None, out: None = None) -> bool:
        """Whether an entry is not zero, as numpy.any asks."""
        return bool(self.team.ask(self.kept.rank, np.any, self.kept))

    def sum(self, axis: None = None, out: None = None, **more: Any) -> float:
        """The sum of all entries, as numpy.sum asks."""
        return float(self.team.ask(self.kept.rank, np.sum, self.kept))

    def astype(self, kind: Any) -> Field:
        """The vector in another precision."""
        return self._make(np.ndarray.astype, kind)

    def started_dot(self, other: Field) -> Callable[[], float]:
        """The scalar product, when it is called; the work begins now."""
        return self.team.start(self.kept.rank, dot, self.kept, other.kept)


@dataclass(frozen=True, eq=False)
class RemoteTerm:
    """The term of a body on another rank, as contactopt.linear.saddle_point.BodyTerm asks.

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
        return self._make(resident.stiffness, X.kept)

    def cycle(self, F: Field) -> Field:
        return self._make(resident.cycle, F.kept)

    def pulled(self, r: np.ndarray) -> Field:
        return self._make(LocalTerm.pulled, r[self.rows])

    def started_trace(self, X: Field) -> Callable[[], np.ndarray]:
        own = self.team.start(self.kept.rank, resident.trace, self.kept, X.kept)

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
        kept = team.keep(self.body.kept.rank, resident.term, self.body.kept, T[rows])
        size, low_rank = team.ask(kept.rank, resident.size, kept)
        spread = sp.csr_matrix(
            (np.ones(len(rows)), (rows, np.arange(len(rows)))), (T.shape[0], len(rows))
        )
        return RemoteTerm(
            team, kept, rows, T.shape[0], size, (spread @ low_rank[0], spread @ low_rank[1])
        )


@dataclass(frozen=True, eq=False)
class RemoteBody:
    """A body on another rank, as contactopt.bodies.protocol.Body asks; its n unknowns are the m of
    its contact surfaces.
    """

    team: Team
    kept: Kept
    facts: resident.Facts
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

    @cached_property
    def at_rest(self) -> Any:
        return Field(self.team, self._keep(resident.whole), self.kept, self.facts.at_rest)

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
        made = self._keep(resident.product, T)
        return lambda X, accuracy: self.team.ask(made.rank, resident.act, made, X, accuracy)

    def convolution(self, T: sp.csr_matrix) -> None:
        return None

    def compliance(self, T: sp.csr_matrix) -> np.ndarray:
        return np.asarray(self._ask(resident.compliance, T))

    def moved(self, T: sp.csr_matrix) -> np.ndarray:
        return np.asarray(self._ask(resident.moved, T))

    def _act(self, member: str, *arguments: Any) -> Any:
        """What the member of that name returns on the rank of the body."""
        return self._ask(resident.Resident.act, member, *map(_sendable, arguments))

    def _field(self, member: str, *arguments: Any) -> Field:
        """The same where it is a vector (n,), which stays there."""
        return Field(
            self.team,
            self._keep(resident.Resident.act, member, *map(_sendable, arguments)),
            self.kept,
        )

    def displacement(self, force: Any, multipliers: np.ndarray, free: Any = None) -> Any:
        known = None if free is None else free.kept
        own = self._keep(
            resident.Resident.act, "displacement", _sendable(force), multipliers, known
        )
        return Field(self.team, own, self.kept)

    def material_change(self, constant: str, U: Any, force: np.ndarray) -> tuple[Any, np.ndarray]:
        made = self._keep(
            resident.Resident.act, "material_change", constant, _sendable(U), _sendable(force)
        )
        return self._item(made, 0), self.team.ask(made.rank, operator.getitem, made, 1)

    def material_work(self, constant: str, U: Any, force: np.ndarray, dual: Any, W: Any) -> float:
        return float(self._act("material_work", constant, U, force, dual, W))

    def load_work(self, scene: Scene, part: Part, dual: Any, weights: np.ndarray, W: Any) -> float:
        sent = _sent(scene, part)
        return float(self._ask(resident.load_work, sent, _sendable(dual), weights, W.kept))

    def energy_gradient(self, U: Any, force: np.ndarray) -> tuple[Any, Any]:
        made = self._keep(resident.Resident.act, "energy_gradient", _sendable(U), _sendable(force))
        return self._item(made, 0), self._item(made, 1)

    def _item(self, made: Kept, number: int) -> Field:
        return Field(
            self.team, self.team.keep(made.rank, operator.getitem, made, number), self.kept
        )

    def energy_change(self, constant: str, U: Any, force: np.ndarray) -> float:
        return float(self._act("energy_change", constant, U, force))

    def energy(self, U: Any) -> float:
        return float(self._act("energy", U))

    def external_forces(self, U: Any) -> Any:
        return self._field("external_forces", U)

    def held_by(self, U: Any, force: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        found: dict[str, tuple[np.ndarray, np.ndarray]] = self._ask(resident.held_by, U.kept, force)
        return found

    def recovery_errors(self, U: Any, *others: Any) -> tuple[np.ndarray, ...]:
        return tuple(self._act("recovery_errors", U, *others))

    def on_elements(self, values: np.ndarray) -> np.ndarray:
        return np.asarray(self._act("on_elements", values))

    def stress_map(self, region: Region, by_poisson: bool = False) -> RemoteStressMap:
        made = self._keep(resident.Resident.act, "stress_map", region, by_poisson)
        return RemoteStressMap(self, made, *self.team.ask(made.rank, resident.map_facts, made))

    def fields(self, U: Any) -> Fields:
        found: Fields = self._act("fields", U)
        return found

    def seen(self, T: sp.csr_matrix, U: Any) -> np.ndarray:
        return np.asarray(self._ask(resident.seen, T, U.kept))

    def limits(self, U: Any, force: np.ndarray) -> Validity:
        return Validity(*self._act("limits", U, force))

    def grounded(self, modulus: float) -> RemoteBody:
        return self

    def pulled(self, U: Any) -> RemoteBody:
        return self

    def loaded(self, scene: Scene, part: Part) -> RemoteBody:
        return _known(self.team, self._keep(resident.loaded, _sent(scene, part)))


def _sendable(value: Any) -> Any:
    """An argument as its rank takes it: a vector that is there, forces on the contacts, or what it
    is.
    """
    if isinstance(value, Field):
        return value.kept
    return resident.Forces(value) if isinstance(value, np.ndarray) else value


@dataclass(frozen=True, eq=False)
class RemoteStressMap:
    """A contactopt.bodies.stress_recovery.StressMap on the rank of its body, with its places and
    sources here.
    """

    owner: RemoteBody
    kept: Kept
    places: np.ndarray
    sources: np.ndarray

    def _ask(self, function: Any, *arguments: Any) -> Any:
        return self.owner.team.ask(self.kept.rank, function, self.kept, *arguments)

    @property
    def mesh(self) -> Any:
        return pickle.loads(self._ask(resident.mesh))

    def stress(self, U: Field) -> np.ndarray:
        return np.asarray(self._ask(StressMap.stress, U.kept))

    def deviation(self, U: Field, slopes: np.ndarray) -> np.ndarray:
        return np.asarray(self._ask(StressMap.deviation, U.kept, slopes))

    def elements(self, places: np.ndarray) -> np.ndarray:
        return np.asarray(self._ask(StressMap.elements, places))

    def size(self, number: int) -> float:
        return float(self._ask(StressMap.size, number))

    def transposed(self, slopes: np.ndarray) -> Field:
        team = self.owner.team
        made = team.keep(self.kept.rank, StressMap.transposed, self.kept, slopes)
        return Field(team, made, self.owner.kept)


def _known(team: Team, kept: Kept) -> RemoteBody:
    return RemoteBody(team, kept, team.ask(kept.rank, resident.facts, kept))


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
        found: tuple[int, int] = self._ask(resident.sizes)
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
        found: Surface = pickle.loads(self._ask(resident.surface, name))
        return found

    def facing(self, other: Surface, normals: np.ndarray) -> tuple[Surface, np.ndarray]:
        raise InputError(f"body '{self.name}' has contacts of its own; couple it by them.")

    def prepare(self, solver: str, entries: bool) -> RemoteBody:
        return _known(
            self.team, self.team.keep(self.kept.rank, resident.prepared, self.kept, solver, entries)
        )


def assemble_remote(
    scene: Scene, part: RemotePart, elements: int, zone: float | None
) -> AssembledRemote:
    """Assemble a body on its rank.

    Parameters
    ----------
    scene, part : The scene and one of its remote parts.
    elements, zone : Number of elements across the contact half-width, and the half-width that the
        mesh resolves [length].

    Returns
    -------
    What stands for the body on this rank.
    """
    team = part.team
    assert team is not None
    kept = team.keep(part.rank, resident.assembled, _sent(scene, part), elements, zone)
    return AssembledRemote(team, kept, part.name)
