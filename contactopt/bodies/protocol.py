"""What the interface asks of a body, whatever the body is made of.

A body comes in two stages. An AssembledBody (contactopt.bodies.assembled) knows its contact surface
and its size, so that bodies can be coupled and mistakes be reported before any expensive work. Its
`prepare` makes the Body, which moves under contact forces. The table BODIES of contactopt.bodies
says which kind of body models which part of a scene.

Every body has n displacement unknowns U. Under nodal forces F (n,) of the contact and multipliers
lambda (p,) it moves by

    U = at_rest + C F + motions lambda,

where C (n, n) is its compliance: symmetric, positive semidefinite and never formed. The resultants
(p,) are the work of the loads in each free motion, which the contact forces have to balance.

Stresses, errors of elements, resultants of supports and derivatives with respect to loads are
functions of a `view` of its matrices and of its mesh (contactopt.bodies.views).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.sparse as sp

if TYPE_CHECKING:
    from contactopt.bodies.assembly import Matrices
    from contactopt.linear.convolution import Kernel
    from contactopt.linear.operators import Product
    from contactopt.linear.saddle_point import BodyTerm
    from contactopt.scenes.scene import Scene


class FreeMotions(NamedTuple):
    """How a body moves freely.

    fields      (n, p) displacements;   names  what each of them is, for messages
    resultants  (p,) work of the loads in them [force]
    """

    fields: np.ndarray
    names: tuple[str, ...]
    resultants: np.ndarray


class Way(NamedTuple):
    """How a body is solved.

    iterative  whether products cost iterations, so that a lower accuracy makes them cheaper
    complete   whether the entries of the compliance are cheap
    parallel   whether a product is expensive and leaves Python's lock, so that other bodies can
               work at the same time
    """

    iterative: bool = False
    complete: bool = True
    parallel: bool = False


@dataclass(frozen=True, eq=False)
class Seen:
    """T C T', the compliance of a body seen through a map T (rows, n).

    product  function of X (rows, j) [force] and a relative accuracy, or None for the best there is,
             to the product (rows, j) [length]
    entries  function without arguments to it as an array (rows, rows), symmetric to the last digit
             [length / force]
    moved    (rows,) which rows of it are not zero: what the compliance moves
    kernel   it as a convolution over a grid of the contacts; None if it is none
    term     the part of it before condensation; None where products are direct
    """

    product: Product
    entries: Callable[[], np.ndarray]
    moved: np.ndarray
    kernel: Kernel | None = None
    term: BodyTerm | None = None


class Body(ABC):
    """A body that moves under contact forces, as at the top of this module.

    name      its name in the scene
    unknowns  number of its free displacement unknowns, for tables
    at_rest   (n,) displacement at F = 0, lambda = 0 [length]
    motions   its free motions
    way       how it is solved
    view      its matrices, if they are known: loads, supports, plates and mesh
    """

    way = Way()
    view: Matrices | None = None

    if TYPE_CHECKING:  # for classes whose fields they are, and for those that compute them

        @property
        def name(self) -> str: ...
        @property
        def unknowns(self) -> int: ...
        @property
        def at_rest(self) -> np.ndarray: ...
        @property
        def motions(self) -> FreeMotions: ...

    @abstractmethod
    def through(self, T: sp.csr_matrix) -> Seen:
        """The compliance seen through a sparse map T (rows, n) of the contact unknowns."""

    @abstractmethod
    def displacement(
        self, force: np.ndarray, multipliers: np.ndarray, free: np.ndarray | None = None
    ) -> np.ndarray:
        """The displacement U (n,) [length] under contact forces (n,) [force] and multipliers (p,)
        of the free motions [length].

        `free` are the unknowns of its `term` under these forces, where they are known; they are not
        solved for again then.
        """

    @abstractmethod
    def internal_forces(self, U: np.ndarray, force: np.ndarray) -> np.ndarray:
        """The forces (n,) with which the body resists a displacement U (n,) under contact forces
        (n,). The elastic energy is U' times them over 2; less `force` they are the forces of loads,
        supports and plates.
        """

    @abstractmethod
    def loaded(self, scene: Scene, part: Any) -> Body:
        """The same body under another scene's loads; InputError if more than load values differ."""

    @abstractmethod
    def carried(self, component: int) -> tuple[np.ndarray, np.ndarray]:
        """Weights w (n,) of the displacements whose sum w' U is the motion of the body along a
        component, read where plates or supports move it, and C w (n,).
        """

    def material_change(
        self, constant: str, U: np.ndarray, force: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The derivatives of U (n,), and of the balance of the free motions (p,), by a constant of
        the material, 'E' or 'nu', at fixed forces and multipliers.
        """
        return np.zeros(len(U)), np.zeros(len(self.motions.resultants))
