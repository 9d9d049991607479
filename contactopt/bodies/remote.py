"""A body on another rank, where it stays with its mesh, stiffness and solver. Here its unknowns are
only those m of the nodes of its contact surfaces, in the order of the body. A displacement of the
whole body is kept on its rank and stands here as a Field.
"""

from __future__ import annotations

import operator
import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies import resident
from contactopt.bodies.assembled import AssembledBody, Guides, Surface, Work
from contactopt.bodies.fields import Region
from contactopt.bodies.protocol import Body
from contactopt.bodies.ranks import Kept, RemotePart, Team, shipped, values_of
from contactopt.bodies.solvers import SOLVERS
from contactopt.linear.operators import Product
from contactopt.linear.stacked import dot
from contactopt.scenes.scene import Part, Scene


def _sent(scene: Scene, part: Part) -> bytes:
    """Scene and part as their rank needs them: without the meshes of the other bodies."""

    def change(other: Any) -> Any:
        if not other.meshed:
            return other
        without = {} if other.name == part.name else {"mesh": None, "curve": None}
        return Part(**values_of(other) | without)

    return shipped((replace(scene.with_parts(change), reference=None), Part(**values_of(part))))


@dataclass(frozen=True, eq=False)
class Remote:
    """What stands for an object on another rank."""

    team: Team
    kept: Kept

    def _ask(self, member: str, *arguments: Any) -> Any:
        """What a member of the object is or returns."""
        return self.team.ask(self.kept.rank, resident.call, self.kept, member, *arguments)

    def _keep(self, member: str, *arguments: Any) -> Kept:
        """What stands for it, where it stays on its rank."""
        return self.team.keep(self.kept.rank, resident.call, self.kept, member, *arguments)


def _operator(function: Callable[..., Any]) -> Callable[..., Any]:
    """An operator of a Field whose result stays on its rank."""
    return lambda self, other: self._make(function, other)


@dataclass(frozen=True, eq=False)
class Field(Remote):
    """A vector of the unknowns of a body, on its rank, with the operators of an array that the
    callers of bodies use.

    body   the Resident whose n unknowns these are; None for vectors of an iteration, which no map
           of contacts meets
    known  its values on the contact unknowns (m,) where they are known here
    """

    body: Kept | None = None
    known: np.ndarray | None = None
    elsewhere = True
    __array_ufunc__ = None  # NumPy's arrays leave the operators to this class

    def _make(self, function: Any, other: Any) -> Field:
        rank = self.kept.rank
        if isinstance(other, np.ndarray) and self.body is not None:  # forces on the contacts
            other = self.team.keep(rank, resident.Resident.force, self.body, other)
        own = other.kept if isinstance(other, Field) else other
        return Field(self.team, self.team.keep(rank, function, self.kept, own), self.body)

    __add__ = __radd__ = _operator(operator.add)
    __sub__ = _operator(operator.sub)
    __mul__ = __rmul__ = _operator(operator.mul)
    __truediv__ = _operator(operator.truediv)
    __pow__ = _operator(operator.pow)
    astype = _operator(np.ndarray.astype)

    def __matmul__(self, other: Field) -> float:
        return float(self._ask("__matmul__", other.kept))

    def __rmatmul__(self, T: sp.csr_matrix) -> np.ndarray:
        """A map (rows, m) of the contact unknowns applied to the vector."""
        known, contacts = self.known, resident.Resident.on_contacts
        if known is None:
            known = self.team.ask(self.kept.rank, contacts, self.body, self.kept)
        return np.asarray(T @ known)

    def any(self, axis: None = None, out: None = None) -> bool:
        """Whether an entry is not zero, as numpy.any asks."""
        return bool(self._ask("any"))

    def sum(self, axis: None = None, out: None = None, **more: Any) -> float:
        """The sum of all entries, as numpy.sum asks."""
        return float(self._ask("sum"))

    def started_dot(self, other: Field) -> Callable[[], float]:
        """The scalar product, when it is called; the work begins now."""
        return self.team.start(self.kept.rank, dot, self.kept, other.kept)


@dataclass(frozen=True, eq=False)
class RemoteTerm(Remote):
    """The term of a body on another rank, as contactopt.linear.saddle_point.BodyTerm asks.

    rows  (m,) rows of u that the body moves, which alone travel;   length  number of all rows
    """

    rows: np.ndarray
    length: int
    size: int
    low_rank: tuple[np.ndarray, np.ndarray]
    elsewhere = True

    def _field(self, member: str, *arguments: Any) -> Field:
        return Field(self.team, self._keep(member, *arguments))

    def diagonal(self) -> Field:
        return self._field("diagonal")

    def stiffness(self, X: Field) -> Field:
        return self._field("stiffness", X.kept)

    def cycle(self, F: Field) -> Field:
        return self._field("cycle", F.kept)

    def pulled(self, r: np.ndarray) -> Field:
        return self._field("pulled", r[self.rows])

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
        rows = np.flatnonzero(np.diff(T.indptr))
        made = Remote(self.body.team, self.body._keep("term", T[rows]))
        narrow = np.stack(made._ask("low_rank"))
        wide = np.zeros((2, T.shape[0], narrow.shape[2]))
        wide[:, rows] = narrow
        return RemoteTerm(made.team, made.kept, rows, T.shape[0], made._ask("size"), tuple(wide))


def _sendable(value: Any) -> Any:
    """An argument as its rank takes it: a vector there, forces on contacts, or the same."""
    if isinstance(value, Field):
        return value.kept
    return resident.Forces(value) if isinstance(value, np.ndarray) else value


def _forwarded(member: str) -> Callable[..., Any]:
    """A member of a body whose result comes here."""

    def act(self: RemoteBody, *arguments: Any) -> Any:
        return self._ask("act", member, *map(_sendable, arguments))

    return act


@dataclass(frozen=True, eq=False)
class RemoteBody(Remote, Body):
    """A body on another rank; its n unknowns are the m of its contact surfaces.

    resting       at_rest (m,), where it is known here
    equilibrated  whether it is solved by iteration
    """

    name: str
    unknowns: int
    resting: np.ndarray
    motions: np.ndarray
    motion_names: tuple[str, ...]
    resultants: np.ndarray
    equilibrated: bool
    iterative: bool
    complete: bool
    parallel = True

    @cached_property
    def at_rest(self) -> Any:
        return Field(self.team, self._keep("act", "at_rest"), self.kept, self.resting)

    @cached_property
    def equilibrium(self) -> RemoteEquilibrium | None:
        return RemoteEquilibrium(self) if self.equilibrated else None

    compliance = _forwarded("compliance")
    moved = _forwarded("moved")
    material_work = _forwarded("material_work")
    energy = _forwarded("energy")
    energy_change = _forwarded("energy_change")
    recovery_errors = _forwarded("recovery_errors")
    on_elements = _forwarded("on_elements")
    fields = _forwarded("fields")
    limits = _forwarded("limits")

    def convolution(self, T: sp.csr_matrix) -> None:
        return None  # an elastic body has none

    def product(self, T: sp.csr_matrix) -> Product:
        made = Remote(self.team, self._keep("product", T))
        return lambda X, accuracy: made._ask("__call__", X, accuracy)

    def _items(self, member: str, *arguments: Any) -> tuple[Field, Remote]:
        """The first of the two vectors that a member returns, and both together."""
        both = Remote(self.team, self._keep("act", member, *map(_sendable, arguments)))
        return Field(self.team, both._keep("__getitem__", 0), self.kept), both

    def displacement(self, force: Any, multipliers: np.ndarray, free: Any = None) -> Any:
        known = None if free is None else free.kept
        own = self._keep("act", "displacement", _sendable(force), multipliers, known)
        return Field(self.team, own, self.kept)

    def external_forces(self, U: Any) -> Any:
        return Field(self.team, self._keep("act", "external_forces", U.kept), self.kept)

    def material_change(self, constant: str, U: Any, force: np.ndarray) -> tuple[Any, np.ndarray]:
        own, both = self._items("material_change", constant, U, force)
        return own, both._ask("__getitem__", 1)

    def energy_gradient(self, U: Any, force: np.ndarray) -> tuple[Any, Any]:
        own, both = self._items("energy_gradient", U, force)
        return own, Field(self.team, both._keep("__getitem__", 1), self.kept)

    def load_work(self, scene: Scene, part: Part, dual: Any, weights: np.ndarray, W: Any) -> float:
        sent = _sent(scene, part)
        return float(self._ask("load_work", sent, _sendable(dual), weights, W.kept))

    def held_by(self, U: Any, force: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        found: dict[str, tuple[np.ndarray, np.ndarray]] = self._ask("held_by", U.kept, force)
        return found

    def stress_map(self, region: Region, by_poisson: bool = False) -> Any:
        made = Remote(self.team, self._keep("act", "stress_map", region, by_poisson))
        return RemoteStressMap(
            self.team, made.kept, self.kept, made._ask("places"), made._ask("sources")
        )

    def _changed(self, member: str, argument: Any) -> RemoteBody:
        made = self._keep("changed", member, argument)
        same = self.team.ask(made.rank, operator.is_, self.kept, made)
        return self if same else _known(self.team, made)

    def grounded(self, modulus: float) -> RemoteBody:
        return self._changed("grounded", modulus)

    def pulled(self, U: Any) -> RemoteBody:
        return self._changed("pulled", U.kept)

    def loaded(self, scene: Scene, part: Part) -> RemoteBody:
        return _known(self.team, self._keep("loaded", _sent(scene, part)))


@dataclass(frozen=True, eq=False)
class RemoteStressMap(Remote):
    """A StressMap on the rank of its body, with its places and sources here."""

    body: Kept
    places: np.ndarray
    sources: np.ndarray

    @property
    def mesh(self) -> Any:
        return pickle.loads(self.team.ask(self.kept.rank, resident.shipped_mesh, self.kept))

    def stress(self, U: Field) -> np.ndarray:
        return np.asarray(self._ask("stress", U.kept))

    def deviation(self, U: Field, slopes: np.ndarray) -> np.ndarray:
        return np.asarray(self._ask("deviation", U.kept, slopes))

    def elements(self, places: np.ndarray) -> np.ndarray:
        return np.asarray(self._ask("elements", places))

    def size(self, number: int) -> float:
        return float(self._ask("size", number))

    def transposed(self, slopes: np.ndarray) -> Field:
        return Field(self.team, self._keep("transposed", slopes), self.body)


def _known(team: Team, kept: Kept) -> RemoteBody:
    return RemoteBody(team, kept, **Remote(team, kept)._ask("facts"))


@dataclass(frozen=True, eq=False)
class AssembledRemote(Remote, AssembledBody):
    """An assembled body on another rank."""

    name: str

    @cached_property
    def unknowns(self) -> int:
        return int(self._ask("unknowns"))

    @cached_property
    def work(self) -> Work:
        return Work(*self._ask("work"))

    def guides(self) -> Guides:
        return Guides(*self._ask("guides"))

    def iterates(self, solver: str) -> bool:
        return bool(self._ask("iterates", solver))

    def surface(self, name: str | None = None) -> Surface:
        found: Surface = pickle.loads(self._ask("shipped_surface", name))
        return found

    def prepare(self, solver: str, entries: bool) -> RemoteBody:
        made = self._keep("resident", solver, SOLVERS.get(solver), entries)
        return _known(self.team, made)


def assemble_remote(
    scene: Scene, part: RemotePart, elements: int, zone: float | None
) -> AssembledRemote:
    """What stands for a body that is assembled on its rank."""
    team = part.team
    assert team is not None
    kept = team.keep(part.rank, resident.assembled, _sent(scene, part), elements, zone)
    return AssembledRemote(team, kept, part.name)
