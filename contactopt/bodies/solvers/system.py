"""The linear system of one elastic body: what its solvers are made from and what they all offer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from contactopt.errors import InputError


class System(NamedTuple):
    """What the solvers of one body are made from.

    A          (n, n) sparse [force / length]
    node       (n,) mesh node of each unknown;   component  (n,) its component, 0 .. dim - 1
    points     (dim, nodes) coordinates of the mesh nodes
    last       (m,) unknowns whose block of the inverse is asked for (the contact unknowns), or None
    """

    A: sp.csr_matrix
    node: np.ndarray
    component: np.ndarray
    points: np.ndarray
    last: np.ndarray | None = None


Product = Callable[[np.ndarray, float | None], np.ndarray]


class BodySolver(Protocol):
    """Solves A x = b. Different solvers may work in different threads; one solver serves one thread at a time.

    name        its name in SOLVERS
    last        unknowns whose block of the inverse can be asked for, or None
    iterations  conjugate gradient iterations of the last call of `solve`, the most of any column; 0 for factors
    """

    name: str
    last: np.ndarray | None
    iterations: int

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """A^-1 load; load (n,) or (n, j). `rtol` (None: 1e-10) bounds an iterative solver's error, see there."""

    def trailing_inverse(self) -> np.ndarray:
        """The block of A^-1 on the unknowns `last`, in their order, (m, m) symmetric; InputError without `last`."""

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """That block times `load`, (m,) or (m, j)."""

    def restricted(self, at: np.ndarray) -> Product:
        """Products with the block of A^-1 on the unknowns `at` (m,): load (m,) or (m, j), rtol -> as load."""


def asked(last: np.ndarray | None) -> np.ndarray:
    if last is None:
        raise InputError("no unknowns were named whose block of the inverse is asked for; give `last`.")
    return last


def triangle_inverse(R: np.ndarray, place: np.ndarray) -> np.ndarray:
    X = la.solve_triangular(R, np.eye(len(R)), lower=True, check_finite=False)
    C = X.T @ X  # NumPy keeps it symmetric
    return np.asarray(C[np.ix_(place, place)])


def triangle_product(R: np.ndarray, place: np.ndarray, load: np.ndarray) -> np.ndarray:
    x = np.empty(load.shape)
    x[place] = load
    return np.asarray(la.cho_solve((R, True), x, check_finite=False))[place]


def inverse_block(solver: Any, n: int, columns: int = 64) -> np.ndarray:
    """The block of the inverse on solver.last by solves with unit loads, some columns at a time."""
    last = asked(solver.last)
    C = np.empty((len(last), len(last)))
    for start in range(0, len(last), columns):
        chosen = last[start : start + columns]
        unit = np.zeros((n, len(chosen)))
        unit[chosen, np.arange(len(chosen))] = 1.0
        C[:, start : start + columns] = solver.solve(unit)[last]
    return np.asarray((C + C.T) / 2)


def block_product(solver: Any, at: np.ndarray, n: int, load: np.ndarray, rtol: float | None) -> np.ndarray:
    """The block of the inverse on `at` times load (m,) or (m, j), by a solve."""
    full = np.zeros((n, *load.shape[1:]))
    full[at] = load
    return np.asarray(solver.solve(full, rtol)[at])
