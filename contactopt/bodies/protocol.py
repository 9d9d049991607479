"""What the interface asks of a body, whatever the body is made of.

A body comes in two stages. An AssembledBody knows its contact surface and its size, so that bodies
can be coupled and mistakes be reported before any expensive work. Its `prepare` makes the Body,
which moves under contact forces. Finite elements (contactopt.bodies.elastic), rigid bodies
(contactopt.bodies.rigid) and half-spaces (contactopt.bodies.half_space) are the present kinds; the
table BODIES of contactopt.bodies says which kind models which part of a scene.

Every body has n displacement unknowns U. Under nodal forces F (n,) of the contact and multipliers
lambda (p,) it moves by

    U = at_rest + C F + motions lambda,

where C (n, n) is its compliance: symmetric, positive semidefinite and never formed. `resultants`
(p,) is the work of the loads in each free motion, which the contact forces have to balance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
import scipy.sparse as sp

from contactopt.linear.saddle_point import BodyTerm, LocalTerm

if TYPE_CHECKING:
    from contactopt.bodies.fields import Fields, Validity
    from contactopt.bodies.stress_recovery import StressMap
    from contactopt.linear.convolution import Kernel
    from contactopt.linear.operators import Product
    from contactopt.problem.chart import Chart


@dataclass(frozen=True, eq=False)
class Mesh:
    """The finite elements behind a contact surface, for couplings that integrate over it.

    kind       name of the reference element, a key of contactopt.bodies.elements.FACES;  degree  of
               the displacement, 1 or 2
    faces      (f, j) nodes of the faces that make up the surface: corners in cyclic order, then
               those on edges, then the centre
    outward    (dim, f) their mean outward normals
    measure    factor of all integrals (thickness, mirror images), and whether they also carry the
               radius r
    locations  (dim, nodes) positions of the nodes [length];  unknowns (dim, nodes) their
               displacement unknowns
    held       (n,) mask of the unknowns that are not free
    curve      function (dim, j) -> (dim, j) that puts points of the facets on the surface that the
               mesh stands for; None: the facets are this surface
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

    With E (n, j) the columns of the identity for the unknowns `free`, the compliance is C = E A^-1
    E' + L R', whose second term is symmetric as well.

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
        return LocalTerm(
            T[:, self.free], self.stiffness, self.cycle, self.diagonal, (T @ left, T @ right)
        )


@dataclass(frozen=True)
class Region:
    """Where in a body: on a named boundary, at a point, in the circle or ball around a point, or
    everywhere.

    boundary  its name;   point  coordinates [length];   radius  around the point [length]
    """

    boundary: str = ""
    point: tuple[float, ...] = ()
    radius: float | None = None


class Equilibrated(Protocol):
    """The linear system of a body that is solved by iteration, wherever the body is: Equilibrium is
    that of a body here.
    """

    def term(self, T: sp.csr_matrix) -> BodyTerm:
        """The part of T C T' for a map T (rows, n) of the contact unknowns, before condensation."""


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
    mesh: Mesh | None = None
    chart: Chart | None = None


class Guides(NamedTuple):
    """Where a body is, and which planes guide it.

    extent  (dim, 2) least and largest coordinates [length]; (dim, 0) for a body without nodes
    planes  axis, place [length] and the side (1 or -1) on which the body lies, of each plane across
            a coordinate axis on which a support holds the displacement along this axis alone, at
            zero
    """

    extent: np.ndarray
    planes: tuple[tuple[int, float, float], ...] = ()


class AssembledBody(Protocol):
    """A body whose surface and size are known, before its linear system is made solvable.

    name                its name in the scene
    unknowns            number of its free displacement unknowns
    interface_unknowns  number of those on its contact surface
    meshed              whether it has contacts of its own; if not, it follows the contacts of the
                        other body
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

    def guides(self) -> Guides:
        """Find where the body is and which planes guide it.

        Returns
        -------
        Its extent, and planes that may be planes of symmetry.
        """

    def iterates(self, solver: str) -> bool:
        """Say whether a solver of linear systems works by iteration on this body.

        Parameters
        ----------
        solver : A name in contactopt.bodies.solvers.SOLVERS, or 'auto'.

        Returns
        -------
        True for multigrid, False for factors.
        """

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


class Body(Protocol):
    """A body that moves under contact forces, as in the head of this module.

    name        its name in the scene
    unknowns    number of its free displacement unknowns, for tables
    at_rest     (n,) displacement at F = 0, lambda = 0 [length]
    motions     (n, p) free motions, and motion_names, what each of them is, for messages
    resultants  (p,) work of the loads in the free motions [force]
    iterative   whether products cost iterations, so that a lower accuracy makes them cheaper
    complete    whether the entries of the compliance are cheap
    parallel    whether a product is expensive and leaves Python's lock, so that other bodies can
                work at the same time
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
        """Prepare products with T C T', the compliance seen through a map.

        Parameters
        ----------
        T : (rows, n) sparse map of the contact unknowns.

        Returns
        -------
        A function of X (rows, j) [force] and a relative accuracy, or None for the best there is, to
        the product (rows, j) [length].
        """

    def convolution(self, T: sp.csr_matrix) -> Kernel | None:
        """Write T C T' as a convolution over a grid of the contacts.

        Parameters
        ----------
        T : (rows, n) sparse map of the contact unknowns.

        Returns
        -------
        The kernel; None if it is no convolution.
        """

    def compliance(self, T: sp.csr_matrix) -> np.ndarray:
        """Compute T C T' as an array.

        Parameters
        ----------
        T : (rows, n) sparse map of the contact unknowns.

        Returns
        -------
        (rows, rows), symmetric to the last digit [length / force].
        """

    def moved(self, T: sp.csr_matrix) -> np.ndarray:
        """Tell which rows of T C T' are not zero: what the body's compliance moves.

        Parameters
        ----------
        T : (rows, n) sparse map of the contact unknowns.

        Returns
        -------
        (rows,) mask.
        """

    def displacement(
        self, force: np.ndarray, multipliers: np.ndarray, free: Any = None
    ) -> np.ndarray:
        """Compute the displacement of the body under contact forces.

        Parameters
        ----------
        force : (n,) contact forces on its unknowns [force].
        multipliers : (p,) displacements along its free motions.
        free : The unknowns of `equilibrium` under these forces, where they are known; they are not
            solved for again then.

        Returns
        -------
        U (n,) [length].
        """

    def material_change(
        self, constant: str, U: np.ndarray, force: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate the displacement and the balance by a constant of the material, at fixed
        forces and
        multipliers.

        Parameters
        ----------
        constant : 'E' or 'nu'.
        U : (n,) displacement of the body [length].
        force : (n,) contact forces on it [force].

        Returns
        -------
        The derivatives of U (n,), and those of the balance of the free motions (p,).
        """

    def material_work(
        self, constant: str, U: np.ndarray, force: np.ndarray, dual: np.ndarray, W: np.ndarray
    ) -> float:
        """Multiply `material_change` with weights, without a solve.

        Parameters
        ----------
        constant : 'E' or 'nu'.
        U : (n,) displacement of the body [length].
        force : (n,) contact forces on it [force].
        dual : (n,) weights of the displacement.
        W : (n,) displacement under the forces `dual` and the weights of the balance as multipliers,
            without loads.

        Returns
        -------
        The product of both derivatives with their weights.
        """

    def load_work(
        self, scene: Any, part: Any, dual: np.ndarray, weights: np.ndarray, W: np.ndarray
    ) -> float:
        """Multiply what other loads change in at_rest and resultants with weights, without a solve.

        Parameters
        ----------
        scene, part : The scene with the other loads, and the part of it that stands for this body.
        dual : (n,) weights of the displacement.
        weights : (p,) weights of the resultants.
        W : (n,) displacement as for `material_work`.

        Returns
        -------
        The product of both changes with their weights.
        """

    def energy_gradient(self, U: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate the elastic energy.

        Parameters
        ----------
        U : (n,) displacement of the body [length].
        force : (n,) contact forces on it [force].

        Returns
        -------
        The derivatives (n,) by U and, as far as the energy is no function of U, those (n,) by the
        forces.
        """

    def energy_change(self, constant: str, U: np.ndarray, force: np.ndarray) -> float:
        """Differentiate the elastic energy by a constant of the material, at fixed U and forces.

        Parameters
        ----------
        constant : 'E' or 'nu'.
        U : (n,) displacement of the body [length].
        force : (n,) contact forces on it [force].

        Returns
        -------
        The derivative.
        """

    def energy(self, U: np.ndarray) -> float:
        """Compute the elastic energy at a displacement.

        Parameters
        ----------
        U : (n,) displacement of the body [length].

        Returns
        -------
        The energy [force length].
        """

    def external_forces(self, U: np.ndarray) -> np.ndarray:
        """Compute the forces of loads, supports and plates on the body in equilibrium at a
        displacement.

        Parameters
        ----------
        U : (n,) displacement of the body [length].

        Returns
        -------
        (n,) forces [force].
        """

    def held_by(self, U: np.ndarray, force: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Compute with which forces each support and each plate acts on the body.

        Parameters
        ----------
        U : (n,) displacement under the contact forces [length].
        force : (n,) these contact forces [force].

        Returns
        -------
        For the name of each support and plate its positions (dim, m) [length] and the forces (dim,
        m) there [force].
        """

    def recovery_errors(self, U: np.ndarray, *others: np.ndarray) -> tuple[np.ndarray, ...]:
        """Compute for each element the products of the stress errors of displacements
        (contactopt.bodies.fields).

        Parameters
        ----------
        U : (n,) displacements of the body [length].
        *others : Further displacements (n,).

        Returns
        -------
        For each of the others its (elements,) products with U [force length]; (0,) for a body
        without elements.
        """

    def on_elements(self, values: np.ndarray) -> np.ndarray:
        """Deal values of the displacement unknowns out evenly to the elements that have each.

        Parameters
        ----------
        values : (n,) one number for each displacement of the body.

        Returns
        -------
        (elements,); (0,) for a body without elements.
        """

    def stress_map(self, region: Region, by_poisson: bool = False) -> StressMap | None:
        """Make the recovered stress in a region a linear map of the displacements
        (contactopt.bodies.stress_recovery).

        Parameters
        ----------
        region : Where the stress is asked for.
        by_poisson : Whether the derivative of the map by Poisson's ratio is wanted instead.

        Returns
        -------
        None where the stress cannot be read.
        """

    def fields(self, U: np.ndarray) -> Fields | None:
        """Compute displacement and stress inside the body.

        Parameters
        ----------
        U : (n,) displacement of the body [length].

        Returns
        -------
        The fields; None for a body without any.
        """

    def seen(self, T: sp.csr_matrix, U: np.ndarray) -> np.ndarray:
        """Compute T U, the displacement of the contacts.

        Parameters
        ----------
        T : (rows, n) sparse map of the contact unknowns.
        U : (n,) displacement of the body [length].

        Returns
        -------
        (rows,) [length].
        """

    def limits(self, U: np.ndarray, force: np.ndarray) -> Validity:
        """Tell how far the body is from equilibrium, strained and turned
        (contactopt.bodies.fields).

        Parameters
        ----------
        U : (n,) displacement of the body [length].
        force : (n,) contact forces on it [force].

        Returns
        -------
        Zeros for a body that has no equations of its own.
        """

    def grounded(self, modulus: float) -> Body:
        """Put the body on a soft ground if it is so thin that rounding moves it
        (contactopt.bodies.thin).

        Parameters
        ----------
        modulus : Young's modulus of the softest body [stress].

        Returns
        -------
        Its own self where that is not needed, or where it cannot be told.
        """

    def pulled(self, U: np.ndarray) -> Body:
        """Let the ground pull the body towards a displacement.

        Parameters
        ----------
        U : (n,) displacement [length].

        Returns
        -------
        The body in other forces of its ground; its own self without one.
        """

    def loaded(self, scene: Any, part: Any) -> Body:
        """Put the loads of another scene on the body.

        Parameters
        ----------
        scene, part : The other scene, and its part that stands for this body.

        Returns
        -------
        The same body under these loads.

        Raises
        ------
        InputError : If more than load values differ.
        """
