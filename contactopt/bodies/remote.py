"""A body on another rank, where it stays with its mesh, stiffness and solver. So does all that is
as long as its unknowns: here it is a Field. Maps and forces of contacts travel; they have few
entries.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import AssembledBody
from contactopt.bodies.assembled_elastic import AssembledElastic, assemble_elastic
from contactopt.bodies.elastic import ElasticBody
from contactopt.bodies.fields import Region
from contactopt.bodies.protocol import Body
from contactopt.bodies.ranks import Kept, RemotePart, Shipped, Team, values_of
from contactopt.bodies.solvers import SOLVERS
from contactopt.linear.operators import Product
from contactopt.linear.stacked import dot
from contactopt.scenes.scene import Part, Scene


def _sent(scene: Scene, part: Part) -> Shipped:
    """A scene as the rank of a part needs it: without the meshes of the other bodies."""

    def change(other: Any) -> Any:
        if not other.meshed:
            return other
        without = {} if other.name == part.name else {"mesh": None, "curve": None}
        return Part(**values_of(other) | without)

    return Shipped(replace(scene.with_parts(change), reference=None))


# What a rank does, with an object that it keeps


def call(owner: Any, member: str, *arguments: Any) -> Any:
    """What the member of that name is or returns."""
    found = getattr(owner, member)
    return found(*arguments) if callable(found) else found


def _shipped(owner: Any, member: str, *arguments: Any) -> Shipped:
    return Shipped(call(owner, member, *arguments))


def _in_scene(body: ElasticBody, member: str, scene: Scene, *arguments: Any) -> Any:
    """What a member returns of a scene and its part that stands for the body."""
    return getattr(body, member)(scene, scene.meshed[body.name], *arguments)


def _assembled(scene: Scene, name: str, elements: int, zone: float | None) -> AssembledElastic:
    return assemble_elastic(scene, scene.meshed[name], elements, zone)


def _prepared(
    body: AssembledElastic, solver: str, row: tuple[str, str, str] | None, entries: bool
) -> ElasticBody:
    """The body with its linear system made solvable; row is that of rank 0 in SOLVERS."""
    if row is not None:
        SOLVERS[solver] = row
    return body.prepare(solver, entries)


def _trace(term: Any, X: np.ndarray) -> np.ndarray:
    return np.asarray(term.started_trace(X)())


def _filled(size: int, places: np.ndarray, values: np.ndarray) -> np.ndarray:
    made = np.zeros(size)
    made[places] = values
    return made


@dataclass(frozen=True, eq=False)
class _Few:
    """A vector that travels by its few entries other than zero."""

    vector: np.ndarray

    def __reduce__(self) -> tuple[Any, ...]:
        places = np.flatnonzero(self.vector)
        return _filled, (len(self.vector), places, self.vector[places])


def _sendable(value: Any) -> Any:
    """An argument as it travels: what is on the rank by its number, forces by their entries."""
    if isinstance(value, Remote):
        return value.kept
    few = isinstance(value, np.ndarray) and value.ndim == 1
    return _Few(value) if few and 2 * np.count_nonzero(value) < len(value) else value


# What stands for it here


@dataclass(frozen=True, eq=False)
class Remote:
    """What stands for an object on another rank."""

    team: Team
    kept: Kept

    def _ask(self, member: str, *arguments: Any) -> Any:
        """What a member of the object is or returns."""
        return self.team.ask(self.kept.rank, call, self.kept, member, *map(_sendable, arguments))

    def _keep(self, member: str, *arguments: Any) -> Kept:
        """What stands for it, where it stays on its rank."""
        return self.team.keep(self.kept.rank, call, self.kept, member, *map(_sendable, arguments))

    def _field(self, member: str, *arguments: Any) -> Field:
        """The same for a vector."""
        return Field(self.team, self._keep(member, *arguments))


def _fact(member: str) -> Any:
    """A member that is asked for once."""
    return cached_property(lambda self: self._ask(member))


def _fetched(member: str) -> Callable[..., Any]:
    """A member whose result comes here."""
    return lambda self, *arguments: self._ask(member, *arguments)


def _staying(member: str) -> Callable[..., Any]:
    """A member whose result, a vector, stays on its rank."""
    return lambda self, *arguments: self._field(member, *arguments)


def _operator(function: Callable[..., Any]) -> Callable[..., Any]:
    """An operator of a Field whose result stays on its rank."""

    def act(self: Field, other: Any) -> Field:
        kept = self.team.keep(self.kept.rank, function, self.kept, _sendable(other))
        return Field(self.team, kept)

    return act


@dataclass(frozen=True, eq=False)
class Field(Remote):
    """An array of the unknowns of a body, on its rank, with the operators that callers use."""

    elsewhere = True
    __array_ufunc__ = None  # NumPy's arrays leave the operators to this class

    __add__ = __radd__ = _operator(operator.add)
    __sub__ = _operator(operator.sub)
    __mul__ = __rmul__ = _operator(operator.mul)
    __truediv__ = _operator(operator.truediv)
    __pow__ = _operator(operator.pow)
    astype = _operator(np.ndarray.astype)
    __matmul__ = _fetched("__matmul__")

    def __rmatmul__(self, T: Any) -> np.ndarray:
        """A map (rows, n) applied to the vector."""
        return np.asarray(self.team.ask(self.kept.rank, operator.matmul, _sendable(T), self.kept))

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

    elsewhere = True
    size = _fact("size")
    diagonal = _staying("diagonal")
    stiffness = _staying("stiffness")
    cycle = _staying("cycle")

    @cached_property
    def low_rank(self) -> tuple[np.ndarray, np.ndarray]:
        narrow = np.stack(self._ask("low_rank"))
        wide = np.zeros((2, self.length, narrow.shape[2]))
        wide[:, self.rows] = narrow
        return wide[0], wide[1]

    def pulled(self, r: np.ndarray) -> Field:
        return self._field("pulled", r[self.rows])

    def started_trace(self, X: Field) -> Callable[[], np.ndarray]:
        own = self.team.start(self.kept.rank, _trace, self.kept, X.kept)

        def end() -> np.ndarray:
            u = np.zeros(self.length)
            u[self.rows] = own()
            return u

        return end


class RemoteBody(Remote, Body):
    """A body on another rank."""

    parallel = True
    name = _fact("name")
    unknowns = _fact("unknowns")
    motion_names = _fact("motion_names")
    resultants = _fact("resultants")
    iterative = _fact("iterative")
    complete = _fact("complete")
    at_rest = cached_property(_staying("at_rest"))
    motions = cached_property(_staying("motions"))

    compliance = _fetched("compliance")
    moved = _fetched("moved")
    material_work = _fetched("material_work")
    energy = _fetched("energy")
    energy_change = _fetched("energy_change")
    recovery_errors = _fetched("recovery_errors")
    added_work = _fetched("added_work")
    on_elements = _fetched("on_elements")
    held_by = _fetched("held_by")
    plates = _fetched("plates")
    acting = _fetched("acting")
    fields = _fetched("fields")
    limits = _fetched("limits")
    displacement = _staying("displacement")
    external_forces = _staying("external_forces")

    def term(self, T: sp.csr_matrix) -> RemoteTerm | None:
        rows = np.flatnonzero(np.diff(T.indptr))
        own = self._keep("term", T[rows]) if self.iterative else None
        if own is None or self.team.ask(own.rank, operator.is_, own, None):
            return None
        return RemoteTerm(self.team, own, rows, T.shape[0])

    def convolution(self, T: sp.csr_matrix) -> None:
        return None  # an elastic body has none

    def product(self, T: sp.csr_matrix) -> Product:
        made = Remote(self.team, self._keep("product", T))
        return lambda X, accuracy: made._ask("__call__", X, accuracy)

    def material_change(self, constant: str, U: Any, force: np.ndarray) -> tuple[Any, np.ndarray]:
        both = Remote(self.team, self._keep("material_change", constant, U, force))
        return both._field("__getitem__", 0), both._ask("__getitem__", 1)

    def carried(self, component: int) -> tuple[Any, Any]:
        both = Remote(self.team, self._keep("carried", component))
        return both._field("__getitem__", 0), both._field("__getitem__", 1)

    def energy_gradient(self, U: Any, force: np.ndarray) -> tuple[Any, Any]:
        both = Remote(self.team, self._keep("energy_gradient", U, force))
        return both._field("__getitem__", 0), both._field("__getitem__", 1)

    def load_work(self, scene: Scene, part: Part, *weights: Any) -> float:
        own = _sent(scene, part), *map(_sendable, weights)
        return float(self.team.ask(self.kept.rank, _in_scene, self.kept, "load_work", *own))

    def loaded(self, scene: Scene, part: Part) -> RemoteBody:
        own = self.kept, "loaded", _sent(scene, part)
        return RemoteBody(self.team, self.team.keep(self.kept.rank, _in_scene, *own))

    def stress_map(self, region: Region, by_poisson: bool = False) -> Any:
        return RemoteStressMap(self.team, self._keep("stress_map", region, by_poisson))

    def _changed(self, member: str, argument: Any) -> RemoteBody:
        made = self._keep(member, argument)
        same = self.team.ask(made.rank, operator.is_, self.kept, made)
        return self if same else RemoteBody(self.team, made)

    def grounded(self, modulus: float) -> RemoteBody:
        return self._changed("grounded", modulus)

    def pulled(self, U: Any) -> RemoteBody:
        return self._changed("pulled", U)


class RemoteStressMap(Remote):
    """A StressMap on the rank of its body."""

    places = _fact("places")
    sources = _fact("sources")
    stress = _fetched("stress")
    deviation = _fetched("deviation")
    elements = _fetched("elements")
    size = _fetched("size")
    transposed = _staying("transposed")

    @property
    def mesh(self) -> Any:
        return self.team.ask(self.kept.rank, _shipped, self.kept, "mesh")


@dataclass(frozen=True, eq=False)
class AssembledRemote(Remote, AssembledBody):
    """An assembled body on another rank."""

    name: str

    unknowns = _fact("unknowns")
    work = _fact("work")
    guides = _fetched("guides")
    iterates = _fetched("iterates")

    def surface(self, name: str | None = None) -> Any:
        return self.team.ask(self.kept.rank, _shipped, self.kept, "surface", name)

    def prepare(self, solver: str, entries: bool) -> RemoteBody:
        order = _prepared, self.kept, solver, SOLVERS.get(solver), entries
        return RemoteBody(self.team, self.team.keep(self.kept.rank, *order))


def assemble_remote(
    scene: Scene, part: RemotePart, elements: int, zone: float | None
) -> AssembledRemote:
    """What stands for a body that is assembled on its rank."""
    team = part.team
    assert team is not None
    kept = team.keep(part.rank, _assembled, _sent(scene, part), part.name, elements, zone)
    return AssembledRemote(team, kept, part.name)
