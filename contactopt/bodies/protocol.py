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
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.fields import Fields, Region, Validity

if TYPE_CHECKING:
    from contactopt.bodies.stress_recovery import StressMap
    from contactopt.linear.convolution import Kernel
    from contactopt.linear.operators import Product
    from contactopt.linear.saddle_point import BodyTerm


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

    Parameters of the methods
    -------------------------
    T : (rows, n) sparse map of the contact unknowns.
    U, force : (n,) displacement of the body [length] and contact forces on it [force].
    constant : 'E' or 'nu', of the material.
    dual : (n,) weights of the displacement, of which a derivative is wanted.
    W : (n,) displacement under the forces `dual`, and the weights of the balance as multipliers,
        without loads.
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

    else:
        iterative, complete, parallel = False, True, False

    @abstractmethod
    def product(self, T: sp.csr_matrix) -> Product:
        """Prepare products with T C T', the compliance seen through a map: a function of X (rows,
        j) [force] and a relative accuracy, or None for the best there is, to the product (rows, j)
        [length].
        """

    def convolution(self, T: sp.csr_matrix) -> Kernel | None:
        """T C T' as a convolution over a grid of the contacts; None if it is none."""
        return None

    def term(self, T: sp.csr_matrix) -> BodyTerm | None:
        """The part of T C T' before condensation; None where products are direct."""
        return None

    @abstractmethod
    def compliance(self, T: sp.csr_matrix) -> np.ndarray:
        """T C T' (rows, rows) as an array, symmetric to the last digit [length / force]."""

    @abstractmethod
    def moved(self, T: sp.csr_matrix) -> np.ndarray:
        """Which rows (rows,) of T C T' are not zero: what the body's compliance moves."""

    @abstractmethod
    def displacement(
        self, force: np.ndarray, multipliers: np.ndarray, free: Any = None
    ) -> np.ndarray:
        """The displacement U (n,) under contact forces and multipliers (p,) of the free motions
        [length].

        `free` are the unknowns of its `term` under these forces, where they are known; they are not
        solved for again then.
        """

    @abstractmethod
    def external_forces(self, U: np.ndarray) -> np.ndarray:
        """The forces (n,) of loads, supports and plates on the body in equilibrium [force]."""

    @abstractmethod
    def loaded(self, scene: Any, part: Any) -> Body:
        """The same body under the loads of another scene, whose part stands for it; InputError if
        more than load values differ.
        """

    @abstractmethod
    def carried(self, component: int) -> tuple[np.ndarray, np.ndarray]:
        """Weights w (n,) of the displacements whose sum w' U is the motion of the body along a
        component, read where plates or supports move it, and C w (n,).
        """

    def plates(self, U: np.ndarray) -> dict[str, float]:
        """How far each plate moves [length], by names as in `motion_names`."""
        return {}

    def material_change(
        self, constant: str, U: np.ndarray, force: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The derivatives of U (n,), and of the balance of the free motions (p,), by a constant of
        the material at fixed forces and multipliers.
        """
        return np.zeros(len(U)), np.zeros(len(self.resultants))

    def material_work(
        self, constant: str, U: np.ndarray, force: np.ndarray, dual: np.ndarray, W: np.ndarray
    ) -> float:
        """The sum of both derivatives of `material_change` times their weights, without a solve."""
        return float(dual @ self.material_change(constant, U, force)[0])

    def load_work(
        self, scene: Any, part: Any, dual: np.ndarray, weights: np.ndarray, W: np.ndarray
    ) -> float:
        """What the loads of another scene change in at_rest and resultants, times the weights
        `dual` and `weights` (p,), without a solve.
        """
        new = self.loaded(scene, part)
        return float(
            dual @ (new.at_rest - self.at_rest) + weights @ (new.resultants - self.resultants)
        )

    def energy(self, U: np.ndarray) -> float:
        """The elastic energy [force length]."""
        return 0.0

    def energy_gradient(self, U: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The derivatives (n,) of the elastic energy by U and, as far as it is no function of U,
        those (n,) by the forces.
        """
        return np.zeros(len(U)), np.zeros(len(U))

    def energy_change(self, constant: str, U: np.ndarray, force: np.ndarray) -> float:
        """The derivative of the elastic energy by a constant of the material at fixed U, force."""
        return 0.0

    def held_by(self, U: np.ndarray, force: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """With which forces each support and each plate acts on the body: for its name positions
        (dim, m) [length] and the forces (dim, m) there [force].
        """
        return {}

    def acting(self, force: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Where forces on the unknowns act: positions (dim, m) of nodes [length] and the forces
        (dim, m) there [force]; None for a body without nodes.
        """
        return None

    def recovery_errors(self, U: np.ndarray, *others: np.ndarray) -> tuple[np.ndarray, ...]:
        """For each of other displacements (n,) the products (elements,) of its stress errors with
        those of U [force length] (contactopt.bodies.element_stress); (0,) for a body without
        elements.
        """
        return (np.zeros(0),) * len(others)

    def added_work(
        self, volumes: np.ndarray, load: np.ndarray, U: np.ndarray, *others: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """For each of other displacements (n,) what volumes (elements,) [length^dim] with the force
        per volume `load` (dim,), added to the elements, would work in it beside the stress of U,
        (elements,) [force length] (contactopt.bodies.element_stress).
        """
        return (np.zeros(0),) * len(others)

    def on_elements(self, values: np.ndarray) -> np.ndarray:
        """Values (n,) of the displacement unknowns, dealt out evenly to the elements (elements,)
        that have each; (0,) for a body without elements.
        """
        return np.zeros(0)

    def stress_map(self, region: Region, by_poisson: bool = False) -> StressMap | None:
        """The recovered stress in a region as a linear map of the displacements
        (contactopt.bodies.stress_recovery), or its derivative by Poisson's ratio; None where the
        stress cannot be read.
        """
        return None

    def fields(self, U: np.ndarray) -> Fields | None:
        """Displacement and stress inside the body; None for a body without any."""
        return None

    def limits(self, U: np.ndarray, force: np.ndarray, least: float = 0.0) -> Validity:
        """How far it is from equilibrium, strained and turned; zeros without own equations. Forces
        on it whose sum is at most `least` are none.
        """
        return Validity()

    def grounded(self, modulus: float) -> Body:
        """The body on a soft ground if it is so thin that rounding moves it
        (contactopt.bodies.thin), beside bodies whose softest has Young's modulus `modulus`
        [stress]; else its own self.
        """
        return self

    def pulled(self, U: np.ndarray) -> Body:
        """The body with its ground pulling it towards a displacement; itself without a ground."""
        return self
