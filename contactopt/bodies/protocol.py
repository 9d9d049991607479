"""What the interface asks of a body, whatever the body is made of.

A body comes in two stages. An AssembledBody knows its contact surface and its size, so that bodies can be coupled and
mistakes be reported before any expensive work. Its `prepare` makes the Body, which moves under contact forces. Finite
elements (contactopt.bodies.elastic), rigid bodies (contactopt.bodies.rigid) and half-spaces (contactopt.bodies.half_space) are the present kinds; the table BODIES
of contactopt.bodies says which kind models which part of a scene.

Every body has n displacement unknowns U. Under nodal forces F (n,) of the contact and multipliers lambda (p,) it moves by

    U = at_rest + C F + motions lambda,

where C (n, n) is its compliance: symmetric, positive semidefinite and never formed. `resultants` (p,) is the work of the
loads in each free motion, which the contact forces have to balance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import scipy.sparse as sp

from contactopt.problem.coupled import BodyTerm, LocalTerm

if TYPE_CHECKING:
    from contactopt.bodies.fields import Fields
    from contactopt.bodies.recovery import StressMap
    from contactopt.problem.chart import Chart
    from contactopt.problem.convolution import Kernel
    from contactopt.problem.operators import Product


@dataclass(frozen=True, eq=False)
class Mesh:
    """The finite elements behind a contact surface, for couplings that integrate over it.

    kind       name of the reference element, a key of contactopt.bodies.elements.FACES;  degree  of the displacement, 1 or 2
    faces      (f, j) nodes of the faces that make up the surface: corners in cyclic order, then those on edges, then the centre
    outward    (dim, f) their mean outward normals
    measure    factor of all integrals (thickness, mirror images), and whether they also carry the radius r
    locations  (dim, nodes) positions of the nodes [length];  unknowns (dim, nodes) their displacement unknowns
    held       (n,) mask of the unknowns that are not free
    curve      function (dim, j) -> (dim, j) that puts points of the facets on the surface that the mesh stands for; None:
               the facets are this surface
    """

    kind: str
    degree: int
    faces: np.ndarray
    outward: np.ndarray
    measure: tuple[float, bool]
    locations: np.ndarray
    unknowns: np.ndarray
    held: np.ndarray
    curve: Callable[[np.ndarray], np.ndarray] | None


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The linear system of a body that is solved by iteration, by what each iteration needs.

    With E (n, j) the columns of the identity for the unknowns `free`, the compliance is C = E A^-1 E' + L R', whose second term is symmetric as well.

    stiffness  x (j,) -> A x [force]
    cycle      f (j,) -> B f, symmetric positive definite and close to A^-1 f [length]
    diagonal   (j,) diagonal of A
    free       (j,) numbers of the displacement unknowns that A has
    low_rank   L and R (n, i): plates that supports resist, free motions of a body that floats
    """

    stiffness: Callable[[np.ndarray], np.ndarray]
    cycle: Callable[[np.ndarray], np.ndarray]
    diagonal: np.ndarray
    free: np.ndarray
    low_rank: tuple[np.ndarray, np.ndarray]

    def term(self, T: sp.csr_matrix) -> LocalTerm:
        """The part of T C T' for a map T (rows, n) of the contact unknowns, before condensation."""
        left, right = self.low_rank
        return LocalTerm(T[:, self.free], self.stiffness, self.cycle, self.diagonal, (T @ left, T @ right))


@dataclass(frozen=True)
class Region:
    """Where in a body: on a named boundary, at a point, in the circle or ball around a point, or everywhere.

    boundary  its name;   point  coordinates [length];   radius  around the point [length]
    """

    boundary: str = ""
    point: tuple[float, ...] = ()
    radius: float | None = None


class Equilibrated(Protocol):
    """The linear system of a body that is solved by iteration, wherever the body is: Equilibrium is that of a body here."""

    def term(self, T: sp.csr_matrix) -> BodyTerm:
        """The part of T C T' for a map T (rows, n) of the contact unknowns, before condensation."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A candidate contact surface of one body: k contacts and m nodes.

    The contacts are the points that may carry a contact force. The nodes are those whose displacements move them. Both
    are the same for linear elements; quadratic triangles and tetrahedra have more nodes.

    body      name of the body, for messages
    points    (dim, k) positions of the contacts on the mesh [length]
    normals   (dim, k) outward unit normals
    areas     (k,) nodal areas [length^2]
    weights   (k, m) displacement of the contacts in terms of the displacements of the nodes
    places    (dim, m) positions of the nodes on the surface that the mesh stands for: the initial gap comes from these
    traces    for each of the dim components the sparse matrix (k, n) that takes the body's unknowns to the displacement
              of its contacts in that component
    held      (dim, k) whether that component of the contact's displacement is prescribed
    cells     (v, c) contacts at the corners of the c linear cells that cover the surface
    mesh      the finite elements behind it; None for a body that has none
    chart     places of the contacts on the surface, where the body knows them and its normals are all the same
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
    mesh: Mesh | None = None
    chart: Chart | None = None


class AssembledBody(Protocol):
    """A body whose surface and size are known, before its linear system is made solvable.

    name                its name in the scene
    unknowns            number of its free displacement unknowns
    interface_unknowns  number of those on its contact surface
    meshed              whether it has contacts of its own; if not, it follows the contacts of the other body
    """

    @property
    def name(self) -> str: ...

    @property
    def unknowns(self) -> int: ...

    @property
    def interface_unknowns(self) -> int: ...

    @property
    def meshed(self) -> bool: ...

    def surface(self, name: str | None = None) -> Surface:
        """The contact surface of that name, by default the one that its part of the scene names."""

    def facing(self, other: Surface, normals: np.ndarray) -> tuple[Surface, np.ndarray]:
        """The surface of a body without a mesh at the contacts of another body, and the initial gap (k,) there [length].

        `normals` (dim, k) are the contact normals that the other body suggests. The surface returned holds the contact
        normals to be used, which may be the body's own.
        """

    def iterates(self, solver: str) -> bool:
        """Whether that solver of linear systems, a name or 'auto', works by iteration on this body."""

    def prepare(self, solver: str, entries: bool) -> Body:
        """The body with its linear system made solvable; `entries` makes the entries of its compliance cheap."""


class Body(Protocol):
    """A body that moves under contact forces, as in the head of this module.

    name        its name in the scene
    unknowns    number of its free displacement unknowns, for tables
    at_rest     (n,) displacement at F = 0, lambda = 0 [length]
    motions     (n, p) free motions, and motion_names, what each of them is, for messages
    resultants  (p,) work of the loads in the free motions [force]
    iterative   whether products cost iterations, so that a lower accuracy makes them cheaper
    complete    whether the entries of the compliance are cheap
    parallel    whether a product is expensive and leaves Python's lock, so that other bodies can work at the same time
    """

    @property
    def name(self) -> str: ...

    @property
    def unknowns(self) -> int: ...

    @property
    def at_rest(self) -> np.ndarray: ...

    @property
    def motions(self) -> np.ndarray: ...

    @property
    def motion_names(self) -> tuple[str, ...]: ...

    @property
    def resultants(self) -> np.ndarray: ...

    @property
    def iterative(self) -> bool: ...

    @property
    def complete(self) -> bool: ...

    @property
    def parallel(self) -> bool: ...

    @property
    def equilibrium(self) -> Equilibrated | None:
        """Its linear system where it is solved by iteration; None where products are direct."""

    def product(self, T: sp.csr_matrix) -> Product:
        """Products with T C T', for a sparse map T (rows, n) of the contact unknowns; what they need is prepared once."""

    def convolution(self, T: sp.csr_matrix) -> Kernel | None:
        """T C T' as a convolution over a grid of the contacts, if it is one; None if not."""

    def compliance(self, T: sp.csr_matrix) -> np.ndarray:
        """T C T' (rows, rows) as an array, symmetric to the last digit [length / force]."""

    def moved(self, T: sp.csr_matrix) -> np.ndarray:
        """Mask (rows,) of the rows of T C T' that are not zero: what the body's compliance moves."""

    def displacement(self, force: np.ndarray, multipliers: np.ndarray, free: Any = None) -> np.ndarray:
        """U (n,) under contact forces (n,) and multipliers (p,).

        `free` are the unknowns of `equilibrium` under these forces, where they are known; they are not solved for again then.
        """

    def material_change(self, constant: str, U: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of U (n,) and of the balance of the free motions (p,) by the material's constant 'E' or 'nu'.

        The contact forces `force` (n,) and the multipliers stay as they are.
        """

    def material_work(self, constant: str, U: np.ndarray, force: np.ndarray, dual: np.ndarray, W: np.ndarray) -> float:
        """The product of `material_change` with `dual` (n,) and with the weights of the balance, without a solve.

        W (n,) is the displacement under the forces `dual` and these weights as multipliers, without loads.
        """

    def load_work(self, scene: Any, part: Any, dual: np.ndarray, weights: np.ndarray, W: np.ndarray) -> float:
        """The product of dual (n,) and weights (p,) with what the loads of `part` change in at_rest and resultants, without a solve.

        W as in `material_work`.
        """

    def energy_gradient(self, U: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the elastic energy by U (n,) and, as far as it is no function of U, by the forces (n,)."""

    def energy_change(self, constant: str, U: np.ndarray, force: np.ndarray) -> float:
        """Derivative of the elastic energy by the material's constant 'E' or 'nu' at fixed U and forces."""

    def energy(self, U: np.ndarray) -> float:
        """Elastic energy at the displacement U (n,) [force length]."""

    def external_forces(self, U: np.ndarray) -> np.ndarray:
        """Forces (n,) of loads, supports and plates on the body in equilibrium at the displacement U (n,)."""

    def held_by(self, U: np.ndarray, force: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """For each support and plate its positions (dim, m) and the forces (dim, m) with which it acts on the body there.

        U (n,) is the displacement under the contact forces `force` (n,).
        """

    def recovery_errors(self, U: np.ndarray, *others: np.ndarray) -> tuple[np.ndarray, ...]:
        """For each other field the products (elements,) of its stress errors with those of U (contactopt.bodies.fields)."""

    def on_elements(self, values: np.ndarray) -> np.ndarray:
        """Values of the displacement unknowns (n,) dealt out evenly to the elements that have each; (0,) without elements."""

    def stress_map(self, region: Region, by_poisson: bool = False) -> StressMap | None:
        """The recovered stress in a region as a linear map of U (contactopt.bodies.recovery); None where it cannot be read."""

    def fields(self, U: np.ndarray) -> Fields | None:
        """Displacement and stress at the displacement U (n,); None for a body without any."""

    def loaded(self, scene: Any, part: Any) -> Body:
        """The same body under the loads of `part` in another scene; InputError if more than load values differ."""
