"""What the interface asks of a body, whatever the body is made of.

A body comes in two stages. An AssembledBody (contactopt.bodies.assembled) knows its contact surface
and its size, so that bodies can be coupled and mistakes be reported before any expensive work. Its
`prepare` makes the Body, which moves under contact forces. The table BODIES of contactopt.bodies
says which kind of body models which part of a scene.

Every body has n displacement unknowns U. Under nodal forces F (n,) of the contact and multipliers
lambda (p,) it moves by

    U = at_rest + C F + motions lambda,

where C (n, n) is its compliance: symmetric, positive semidefinite and never formed. `resultants`
(p,) is the work of the loads in each free motion, which the contact forces have to balance.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.fields import Fields, Region, Validity
from contactopt.linear.saddle_point import BodyTerm

if TYPE_CHECKING:
    from contactopt.bodies.stress_recovery import StressMap
    from contactopt.linear.convolution import Kernel
    from contactopt.linear.operators import Product


class Equilibrated(Protocol):
    """The linear system of a body that is solved by iteration, wherever the body is."""

    def term(self, T: sp.csr_matrix) -> BodyTerm:
        """The part of T C T' for a map T (rows, n) of the contact unknowns, before condensation."""


class Body(ABC):
    """A body that moves under contact forces, as in the head of this module.

    The least body has the first six of these and the methods that are abstract. All others are
    those of a body without elements, without elastic energy and without a solver.

    name        its name in the scene
    unknowns    number of its free displacement unknowns, for tables
    at_rest     (n,) displacement at F = 0, lambda = 0 [length]
    motions     (n, p) free motions, and motion_names, what each of them is, for messages
    resultants  (p,) work of the loads in the free motions [force]
    iterative   whether products cost iterations, so that a lower accuracy makes them cheaper
    complete    whether the entries of the compliance are cheap
    parallel    whether a product is expensive and leaves Python's lock, so that other bodies can
                work at the same time
    equilibrium its linear system where it is solved by iteration; None where products are direct
    """

    if TYPE_CHECKING:  # for classes whose fields they are, and for those that compute them

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
        def equilibrium(self) -> Equilibrated | None: ...

    else:
        iterative, complete, parallel, equilibrium = False, True, False, None

    @abstractmethod
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
        return None

    @abstractmethod
    def compliance(self, T: sp.csr_matrix) -> np.ndarray:
        """Compute T C T' as an array.

        Parameters
        ----------
        T : (rows, n) sparse map of the contact unknowns.

        Returns
        -------
        (rows, rows), symmetric to the last digit [length / force].
        """

    @abstractmethod
    def moved(self, T: sp.csr_matrix) -> np.ndarray:
        """Tell which rows of T C T' are not zero: what the body's compliance moves.

        Parameters
        ----------
        T : (rows, n) sparse map of the contact unknowns.

        Returns
        -------
        (rows,) mask.
        """

    @abstractmethod
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

    @abstractmethod
    def external_forces(self, U: np.ndarray) -> np.ndarray:
        """Compute the forces of loads, supports and plates on the body in equilibrium.

        Parameters
        ----------
        U : (n,) displacement of the body [length].

        Returns
        -------
        (n,) forces [force].
        """

    @abstractmethod
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

    def material_change(
        self, constant: str, U: np.ndarray, force: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate displacement and balance by a constant of the material, at fixed forces and
        multipliers.

        Parameters
        ----------
        constant : 'E' or 'nu'.
        U, force : (n,) displacement of the body [length] and contact forces on it [force].

        Returns
        -------
        The derivatives of U (n,), and those of the balance of the free motions (p,).
        """
        return np.zeros(len(U)), np.zeros(len(self.resultants))

    def material_work(
        self, constant: str, U: np.ndarray, force: np.ndarray, dual: np.ndarray, W: np.ndarray
    ) -> float:
        """Multiply `material_change` with weights, without a solve.

        Parameters
        ----------
        constant, U, force : As for `material_change`.
        dual : (n,) weights of the displacement.
        W : (n,) displacement under the forces `dual` and the weights of the balance as multipliers,
            without loads.

        Returns
        -------
        The product of both derivatives with their weights.
        """
        return float(dual @ self.material_change(constant, U, force)[0])

    def load_work(
        self, scene: Any, part: Any, dual: np.ndarray, weights: np.ndarray, W: np.ndarray
    ) -> float:
        """Multiply what other loads change in at_rest and resultants with weights, without a solve.

        Parameters
        ----------
        scene, part : The scene with the other loads, and the part of it that stands for this body.
        dual, weights : (n,) weights of the displacement and (p,) of the resultants.
        W : (n,) displacement as for `material_work`.

        Returns
        -------
        The product of both changes with their weights.
        """
        new = self.loaded(scene, part)
        return float(
            dual @ (new.at_rest - self.at_rest) + weights @ (new.resultants - self.resultants)
        )

    def energy(self, U: np.ndarray) -> float:
        """Compute the elastic energy.

        Parameters
        ----------
        U : (n,) displacement of the body [length].

        Returns
        -------
        The energy [force length].
        """
        return 0.0

    def energy_gradient(self, U: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate the elastic energy.

        Parameters
        ----------
        U, force : (n,) displacement of the body [length] and contact forces on it [force].

        Returns
        -------
        The derivatives (n,) by U and, as far as the energy is no function of U, those (n,) by the
        forces.
        """
        return np.zeros(len(U)), np.zeros(len(U))

    def energy_change(self, constant: str, U: np.ndarray, force: np.ndarray) -> float:
        """Differentiate the elastic energy by a constant of the material, at fixed U and forces.

        Parameters
        ----------
        constant, U, force : As for `material_change`.

        Returns
        -------
        The derivative.
        """
        return 0.0

    def held_by(self, U: np.ndarray, force: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Compute with which forces each support and each plate acts on the body.

        Parameters
        ----------
        U, force : (n,) displacement under the contact forces [length], and these forces [force].

        Returns
        -------
        For the name of each support and plate its positions (dim, m) [length] and the forces (dim,
        m) there [force].
        """
        return {}

    def recovery_errors(self, U: np.ndarray, *others: np.ndarray) -> tuple[np.ndarray, ...]:
        """Compute for each element the products of the stress errors of displacements
        (contactopt.bodies.element_stress).

        Parameters
        ----------
        U, others : (n,) displacements of the body [length].

        Returns
        -------
        For each of the others its (elements,) products with U [force length]; (0,) for a body
        without elements.
        """
        return (np.zeros(0),) * len(others)

    def on_elements(self, values: np.ndarray) -> np.ndarray:
        """Deal values of the displacement unknowns out evenly to the elements that have each.

        Parameters
        ----------
        values : (n,) one number for each displacement of the body.

        Returns
        -------
        (elements,); (0,) for a body without elements.
        """
        return np.zeros(0)

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
        return None

    def fields(self, U: np.ndarray) -> Fields | None:
        """Compute displacement and stress inside the body.

        Parameters
        ----------
        U : (n,) displacement of the body [length].

        Returns
        -------
        The fields; None for a body without any.
        """
        return None

    def limits(self, U: np.ndarray, force: np.ndarray) -> Validity:
        """Tell how far the body is from equilibrium, strained and turned.

        Parameters
        ----------
        U, force : (n,) displacement of the body [length] and contact forces on it [force].

        Returns
        -------
        Zeros for a body that has no equations of its own.
        """
        return Validity()

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
        return self

    def pulled(self, U: np.ndarray) -> Body:
        """Let the ground pull the body towards a displacement.

        Parameters
        ----------
        U : (n,) displacement [length].

        Returns
        -------
        The body in other forces of its ground; its own self without one.
        """
        return self
