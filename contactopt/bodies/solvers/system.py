"""The linear system of one elastic body: what its solvers are made from and what they all offer."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from contactopt.errors import InputError
from contactopt.linear.operators import COLUMNS, Product

Act = Callable[[np.ndarray], np.ndarray]
INDEFINITE = "the stiffness is not positive definite"  # in what a solver raises where it is not


@dataclass(frozen=True, eq=False)
class Submatrix:
    """The rows and columns `kept` (n,) of a matrix `whole` (N, N), which are not copied."""

    whole: sp.csr_matrix
    kept: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.kept), len(self.kept)

    def diagonal(self) -> np.ndarray:
        return np.asarray(self.whole.diagonal()[self.kept])


class System(NamedTuple):
    """What the solvers of one body are made from; the matrix must not change afterwards.

    A          (n, n) stiffness on the free displacement unknowns, symmetric positive definite
               [force / length]; a Submatrix is for iterative solvers, which then share the entries
               with the body
    node       (n,) mesh node of each unknown;   component  (n,) its component, 0 .. dim - 1
    points     (dim, nodes) coordinates of the mesh nodes [length]
    trailing   (m,) unknowns whose block of the inverse is asked for (the contact unknowns), or None
    """

    A: sp.csr_matrix
    node: np.ndarray
    component: np.ndarray
    points: np.ndarray
    trailing: np.ndarray | None = None


def out_of_memory(n: int) -> MemoryError:
    """What to raise where the factors of a body of n unknowns do not fit."""
    return MemoryError(
        f"the factors of a body of {n:,} unknowns do not fit into memory; take a coarser mesh, or"
        " the solver 'multigrid'."
    )


class BodySolver(ABC):
    """Solves A x = b. Several solvers may work at the same time in different threads.

    A solver needs a name and `solve`; all else is made from these, and may be done with less work.

    name           its name in contactopt.bodies.solvers.SOLVERS, for messages and records only
    iterative      whether a lower accuracy costs less; the others ignore `rtol` and solve to
                   rounding
    releases_lock  whether a solve leaves Python's lock to other threads, so that two solvers at
                   once are faster than one after the other
    trailing, n    the unknowns System.trailing, and the number of all unknowns
    """

    name: str
    iterative = False
    releases_lock = False

    def __init__(self, system: System):
        self.trailing, self.n = system.trailing, system.A.shape[0]

    @abstractmethod
    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """Solve A x = load.

        Parameters
        ----------
        load : (n,) or (n, j) forces.
        rtol : Error in the energy norm, relative to that of the solution, at which an iterative
            solver may stop; None stands for contactopt.bodies.solvers.constants.RTOL.

        Returns
        -------
        Displacements of the shape of `load`.
        """

    @property
    def iteration(self) -> tuple[Act, Act] | None:
        """What it repeats, for those who iterate on several bodies at once: x (n,) -> A x, and
        f (n,) -> B f, symmetric positive definite and close to A^-1 f; None for factors.
        """
        return None

    @property
    def complete(self) -> bool:
        """Whether the block of the inverse on the unknowns `trailing` was provided for."""
        return self.trailing is not None

    @property
    def definite(self) -> bool:
        """Whether factors that are at hand prove that A is positive definite; False if unknown."""
        return False

    @property
    def trailing_triangle(self) -> tuple[np.ndarray, np.ndarray] | None:
        """R (m, m) lower triangular and the place (m,) of each of `trailing`: R R' is the Schur
        complement of the others there. None where a solve would be needed.
        """
        return None

    def _asked(self) -> np.ndarray:
        if self.trailing is None:
            raise InputError(
                "no unknowns were named whose block of the inverse is asked for; give `trailing`."
            )
        return self.trailing

    def trailing_inverse(self) -> np.ndarray:
        """The block (m, m) of A^-1 on `trailing`, exactly symmetric; InputError if incomplete."""
        at, triangle = self._asked(), self.trailing_triangle
        if triangle is not None:
            R, place = triangle
            C = la.lapack.dpotri(R, lower=True)[0] if R.size else R.copy()  # its lower triangle
            for start in range(0, len(C), COLUMNS):  # now its upper triangle
                here, after = slice(start, start + COLUMNS), slice(start + COLUMNS, None)
                C[here, after] = C[after, here].T
                C[here, here] += np.tril(C[here, here], -1).T
            return C if np.all(np.diff(place) == 1) else np.asarray(C[place][:, place])
        C = np.empty((len(at), len(at)))
        for start in range(0, len(at), COLUMNS):
            chosen = at[start : start + COLUMNS]
            unit = np.zeros((self.n, len(chosen)))
            unit[chosen, np.arange(len(chosen))] = 1.0
            C[:, start : start + COLUMNS] = self.solve(unit)[at]
        return np.asarray((C + C.T) / 2)

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """That block times `load`, which is (m,) or (m, j)."""
        at, triangle = self._asked(), self.trailing_triangle
        if triangle is None:
            return BodySolver.restricted(self, at)(load, rtol)
        R, place = triangle
        x = np.empty(load.shape)
        x[place] = load
        return np.asarray(la.cho_solve((R, True), x, check_finite=False))[place]

    def restricted(self, at: np.ndarray) -> Product:
        """Prepare products with the block of the inverse of A on some unknowns.

        Parameters
        ----------
        at : (m,) the unknowns.

        Returns
        -------
        A function (load, rtol) of loads (m,) or (m, j) to the product of that shape.
        """

        def product(load: np.ndarray, rtol: float | None) -> np.ndarray:
            full = np.zeros((self.n, *load.shape[1:]))
            full[at] = load
            return np.asarray(self.solve(full, rtol)[at])

        return product
