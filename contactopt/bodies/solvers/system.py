"""The linear system of one elastic body: what its solvers are made from and what they all offer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from contactopt.errors import InputError
from contactopt.linear.operators import Product


@dataclass(frozen=True, eq=False)
class Block:
    """The rows and columns `kept` (n,) of a matrix `whole` (N, N), which are not copied."""

    whole: sp.csr_matrix
    kept: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.kept), len(self.kept)

    def diagonal(self) -> np.ndarray:
        return np.asarray(self.whole.diagonal()[self.kept])

    def __rmatmul__(self, S: sp.csr_matrix) -> sp.csr_matrix:
        """S A for a matrix S (m, n) with few rows."""
        n, N = len(self.kept), self.whole.shape[0]
        spread = sp.csr_matrix((np.ones(n), self.kept, np.arange(n + 1)), (n, N))
        return sp.csr_matrix(((S @ spread) @ self.whole)[:, self.kept])


class System(NamedTuple):
    """What the solvers of one body are made from.

    The matrix is not copied and must not change afterwards.

    A          (n, n) stiffness on the free displacement unknowns, symmetric positive definite
               [force / length]; a Block is for iterative solvers, which then share the entries with
               the body
    node       (n,) mesh node of each unknown;   component  (n,) its component, 0 .. dim - 1
    points     (dim, nodes) coordinates of the mesh nodes [length]
    trailing   (m,) unknowns whose block of the inverse is asked for (the contact unknowns), or None
    """

    A: sp.csr_matrix
    node: np.ndarray
    component: np.ndarray
    points: np.ndarray
    trailing: np.ndarray | None = None


class Iteration(NamedTuple):
    """What an iterative solver repeats.

    stiffness  x (n,) -> A x
    cycle      f (n,) -> B f, symmetric positive definite and close to A^-1 f
    """

    stiffness: Callable[[np.ndarray], np.ndarray]
    cycle: Callable[[np.ndarray], np.ndarray]


class BodySolver(Protocol):
    """Solves A x = b. Several solvers may work at the same time in different threads.

    name           its name in contactopt.bodies.solvers.SOLVERS, for messages and records only
    iterative      whether a lower accuracy costs less; the others ignore `rtol` and solve to
                   rounding
    releases_lock  whether a solve leaves Python's lock to other threads, so that two solvers at
                   once are faster than one after the other
    complete       whether the block of the inverse on System.trailing was provided for
    iteration      what it repeats, for those who iterate on several bodies at once; None for a
                   solver with factors
    """

    name: str
    iterative: bool
    releases_lock: bool

    @property
    def complete(self) -> bool: ...

    @property
    def iteration(self) -> Iteration | None: ...

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """Solution of A x = load.

        Parameters
        ----------
        load : (n,) or (n, j) forces
        rtol : error in the energy norm, relative to that of the solution, at which an iterative
            solver may stop; None stands for contactopt.bodies.solvers.constants.RTOL

        Returns
        -------
        Displacements of the shape of `load`.
        """

    def trailing_inverse(self) -> np.ndarray:
        """(m, m) symmetric block of the inverse of A on the unknowns `trailing`; InputError if it
        is not complete.
        """

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """That block times `load`, which is (m,) or (m, j)."""

    def restricted(self, at: np.ndarray) -> Product:
        """Prepare products with the block of the inverse of A on some unknowns.

        Parameters
        ----------
        at : (m,) the unknowns.

        Returns
        -------
        A function (load, rtol) of loads (m,) or (m, j) to the product of that shape.
        """


def asked(trailing: np.ndarray | None) -> np.ndarray:
    """Check that unknowns were named whose block of the inverse is asked for.

    Parameters
    ----------
    trailing : (m,) unknowns, or None.

    Returns
    -------
    The unknowns.

    Raises
    ------
    InputError : If there are none.
    """
    if trailing is None:
        raise InputError(
            "no unknowns were named whose block of the inverse is asked for; give `trailing`."
        )
    return trailing


def triangle_inverse(R: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Invert R R' from its triangular factor, in another order of the unknowns.

    Parameters
    ----------
    R : (m, m) lower triangular factor.
    place : (m,) a permutation: row and column place[i] of the inverse become row and column i.

    Returns
    -------
    (m, m) inverse, symmetric to the last digit.
    """
    X = la.solve_triangular(R, np.eye(len(R)), lower=True, check_finite=False)
    C = X.T @ X  # NumPy keeps it symmetric
    return np.asarray(C[np.ix_(place, place)])


def triangle_product(R: np.ndarray, place: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Multiply with the matrix of `triangle_inverse`, by two substitutions.

    Parameters
    ----------
    R, place : As for `triangle_inverse`.
    load : (m,) or (m, j).

    Returns
    -------
    The product, of the shape of `load`.
    """
    x = np.empty(load.shape)
    x[place] = load
    return np.asarray(la.cho_solve((R, True), x, check_finite=False))[place]


def inverse_block(solver: Any, at: np.ndarray, n: int, columns: int = 64) -> np.ndarray:
    """Compute a block of the inverse by solves with unit loads, some columns at a time.

    Parameters
    ----------
    solver : A BodySolver of n unknowns.
    at : (m,) the unknowns of the block.
    n : Number of unknowns.
    columns : How many loads are solved for at a time.

    Returns
    -------
    (m, m) block, symmetric to the last digit [length / force].
    """
    C = np.empty((len(at), len(at)))
    for start in range(0, len(at), columns):
        chosen = at[start : start + columns]
        unit = np.zeros((n, len(chosen)))
        unit[chosen, np.arange(len(chosen))] = 1.0
        C[:, start : start + columns] = solver.solve(unit)[at]
    return np.asarray((C + C.T) / 2)


def block_product(
    solver: Any, at: np.ndarray, n: int, load: np.ndarray, rtol: float | None
) -> np.ndarray:
    """Multiply with a block of the inverse, by one solve.

    Parameters
    ----------
    solver : A BodySolver of n unknowns.
    at : (m,) the unknowns of the block.
    n : Number of unknowns.
    load : (m,) or (m, j) [force].
    rtol : Relative accuracy that is asked of an iterative solver; None: its own.

    Returns
    -------
    The product, of the shape of `load` [length].
    """
    full = np.zeros((n, *load.shape[1:]))
    full[at] = load
    return np.asarray(solver.solve(full, rtol)[at])
