"""A body before its linear system is made solvable: its contact surfaces, its size, its guides."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.protocol import Body, FreeMotions
from contactopt.errors import InputError

if TYPE_CHECKING:
    from contactopt.problem.chart import Chart
    from contactopt.scenes.body_kinds import HalfSpace, Rigid


@dataclass(frozen=True, eq=False)
class Mesh:
    """The finite elements behind a contact surface with s nodes, for couplings that integrate over
    it.

    kind       name of the reference element, a key of contactopt.bodies.elements.FACES;  degree  of
               the displacement, 1 or 2
    faces      (f, j) nodes of the faces that make up the surface: corners in cyclic order, then
               those on edges, then the centre
    outward    (dim, f) their mean outward normals
    measure    factor of all integrals (thickness, mirror images), and whether they also carry the
               radius r
    locations  (dim, s) positions of the nodes [length]
    held       (dim, s) whether their displacement is not free
    picked     for each component the sparse matrix (s, n) that takes the body's unknowns to it
    curve      function (dim, j) -> (dim, j) that puts points of the facets on the surface that the
               mesh stands for; None: the facets are this surface
    thin       (f,) faces beneath which the body is thin (contactopt.bodies.thickness)
    """

    kind: str
    degree: int
    faces: np.ndarray
    outward: np.ndarray
    measure: tuple[float, bool]
    locations: np.ndarray
    held: np.ndarray
    picked: tuple[sp.csr_matrix, ...]
    curve: Callable[[np.ndarray], np.ndarray] | None
    thin: np.ndarray


@dataclass(frozen=True, eq=False)
class Surface:
    """A candidate contact surface of one body: k contacts and m nodes.

    The contacts are the points that may carry a contact force. The nodes are those whose
    displacements move them. Both are the same for linear elements; quadratic triangles and
    tetrahedra have more nodes.

    body      name of the body, for messages
    points    (dim, k) positions of the contacts on the mesh [length]
    normals   (dim, k) outward unit normals
    areas     (k,) nodal areas [length^2]
    weights   (k, m) displacement of the contacts in terms of the displacements of the nodes
    places    (dim, m) positions of the nodes on the surface that the mesh stands for: the initial
              gap comes from these
    traces    for each of the dim components the sparse matrix (k, n) that takes the body's unknowns
              to the displacement of its contacts in that component
    held      (dim, k) whether that component of the contact's displacement is prescribed
    cells     (v, c) contacts at the corners of the c linear cells that cover the surface
    alone     as the traces, of the nodes at the contacts by themselves; None where the traces are
              these
    mesh      the finite elements behind it; None for a body that has none
    chart     places of the contacts on the surface, where the body knows them and its normals are
              all the same
    """

    body: str
    points: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    weights: sp.csr_matrix
    places: np.ndarray
    traces: tuple[sp.csr_matrix, ...]
    held: np.ndarray
    cells: np.ndarray
    alone: tuple[sp.csr_matrix, ...] | None = None
    mesh: Mesh | None = None
    chart: Chart | None = None


class Guides(NamedTuple):
    """Where a body is, and which planes guide it.

    extent  (dim, 2) least and largest coordinates [length]
    planes  axis, place [length] and the side (1 or -1) on which the body lies, of each plane across
            a coordinate axis on which a support holds the displacement along this axis alone, at
            zero
    """

    extent: np.ndarray
    planes: tuple[tuple[int, float, float], ...] = ()


class Work(NamedTuple):
    """How large the linear system of a body is; nothing for a body without one.

    stiffness  number of the entries of its stiffness;  contact  of its contact unknowns
    factors, factors_contact_last  entries and operations of its factors, in an order of few entries
               and in one that ends with the contact unknowns (contactopt.bodies.solvers.ordering)
    """

    stiffness: int = 0
    contact: int = 0
    factors: tuple[float, float] = (0.0, 0.0)
    factors_contact_last: tuple[float, float] = (0.0, 0.0)


class AssembledBody(ABC):
    """A body whose surface and size are known, before its linear system is made solvable.

    name      its name in the scene
    unknowns  number of its free displacement unknowns
    meshed    whether it has contacts of its own; if not, it follows those of the other body
    """

    if TYPE_CHECKING:  # for classes whose fields they are, and for those that compute them

        @property
        def name(self) -> str: ...
        @property
        def unknowns(self) -> int: ...
        @property
        def meshed(self) -> bool: ...

    else:
        meshed = True

    @abstractmethod
    def surface(self, name: str | None = None) -> Surface:
        """Find a contact surface of the body.

        Parameters
        ----------
        name : The name of a boundary; by default the one that its part of the scene names.

        Returns
        -------
        The surface with its contacts.

        Raises
        ------
        InputError : If there is no such surface.
        """

    def facing(self, other: Surface, normals: np.ndarray) -> tuple[Surface, np.ndarray]:
        """Make the surface of a body without a mesh at the contacts of another body.

        Parameters
        ----------
        other : The surface of the other body, with k contacts.
        normals : (dim, k) contact normals that the other body suggests.

        Returns
        -------
        The surface, which holds the contact normals to be used (they may be the body's own), and
        the initial gap (k,) [length].
        """
        raise InputError(f"body '{self.name}' has its own contact surfaces; couple one of them.")

    @property
    def work(self) -> Work:
        """What its linear system takes."""
        return Work()

    def guides(self) -> Guides | None:
        """Its extent, and planes that may be planes of symmetry; None for a body without nodes."""
        return None

    @property
    def held(self) -> np.ndarray:
        """Numbers (p,) of its displacement unknowns that are prescribed."""
        return np.zeros(0, dtype=int)

    def iterates(self, solver: str) -> bool:
        """Whether a solver (a name in SOLVERS, or 'auto') works by iteration on this body."""
        return False

    @abstractmethod
    def prepare(self, solver: str, entries: bool) -> Body:
        """Make the linear system of the body solvable.

        Parameters
        ----------
        solver : A name in contactopt.bodies.solvers.SOLVERS, or 'auto'.
        entries : Whether the entries of the compliance shall be cheap.

        Returns
        -------
        The body, which moves under contact forces.
        """


class UndividedBody(AssembledBody, Body):
    """A body without a linear system, which needs no preparation. It moves freely as a whole in the
    components of its part that have a total force. In the others it is moved as given.

    whole   (dim,) numbers of the unknowns that are its motion as a whole
    fields  (n, p) displacements of its free motions
    """

    part: Rigid | HalfSpace
    components: tuple[str, ...]
    whole: range
    if TYPE_CHECKING:

        @property
        def fields(self) -> np.ndarray: ...

    @cached_property
    def name(self) -> str:
        return str(self.part.name)

    @cached_property
    def motions(self) -> FreeMotions:
        force = self.part.force or {}
        names = tuple(f"translation along {name}" for name in force)
        return FreeMotions(self.fields, names, np.array(list(force.values()), dtype=float))

    @property
    def given(self) -> np.ndarray:
        """(dim,) displacement of the body as a whole [length]."""
        values = self.part.displacement or {}
        return np.array([float(values.get(name, 0.0)) for name in self.components])

    @property
    def shifts(self) -> np.ndarray:
        """(dim, p) unit translations in the components with a force."""
        columns = [self.components.index(name) for name in self.part.force or {}]
        return np.eye(len(self.components))[:, columns]

    def carried(self, component: int) -> tuple[np.ndarray, np.ndarray]:
        made = np.zeros(len(self.at_rest))
        made[self.whole[component]] = 1.0
        return made, 0 * made

    def prepare(self, solver: str, entries: bool) -> Self:
        return self
