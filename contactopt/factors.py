"""Sparse factors of the linear system A x = b of one elastic body, and how to use no more of them than a load reaches."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache, cached_property
from itertools import count
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.dissection import elimination_order
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


class SuperLUSolver:
    """Factors of A in an order of nested dissection, `last` eliminated last: their triangles give its Schur complement."""

    name = "superlu"
    iterations = 0

    def __init__(self, system: System):
        self.last, self.plane = system.last, len(system.points) == 2
        last = np.zeros(0, int) if system.last is None else system.last
        self.order = elimination_order(*system[:4], last)
        ordered = system.A[self.order][:, self.order].tocsc()
        self._home = _homes()[next(_TURN) % 2]
        self._held = [self._home.submit(_factors, ordered).result()]
        weakref.finalize(self, self._home.submit, self._held.clear).atexit = False

    @property
    def factors(self) -> Any:
        """SciPy's SuperLU object."""
        return self._held[0]

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        out = np.zeros(load.shape)
        if load.size:
            out[self.order] = self.factors.solve(np.ascontiguousarray(load[self.order]))
        return out

    @cached_property
    def trailing_triangle(self) -> tuple[np.ndarray, np.ndarray] | None:
        """R (m, m) lower triangular and the place (m,) of each of `last`: R R' is the Schur complement in these places.

        None where SuperLU changed the order for its pivots.
        """
        factors, m = self.factors, len(asked(self.last))
        n = factors.shape[0]
        head = n - m
        symmetric = np.array_equal(factors.perm_c, factors.perm_r)
        if not symmetric or not np.array_equal(np.sort(factors.perm_c[head:]), np.arange(head, n)):
            return None
        L, pivots = factors.L[head:, head:].toarray(order="F"), factors.U.diagonal()[head:]
        return L * np.sqrt(pivots), factors.perm_c[head:] - head  # L U = L D L' with D > 0 the pivots

    def trailing_inverse(self) -> np.ndarray:
        if self.trailing_triangle is None:
            return inverse_block(self, len(self.order))
        return _triangle_inverse(*self.trailing_triangle)

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """Two triangular solves with the trailing triangle: nothing of the interior is touched."""
        if self.trailing_triangle is None:
            return block_product(self, asked(self.last), len(self.order), load, rtol)
        return _triangle_product(*self.trailing_triangle, load)

    def restricted(self, at: np.ndarray) -> Product:
        """By the part of L D L' that a load on `at` reaches: these unknowns and their ancestors in the elimination tree.

        In the plane few separators touch the contact; in 3D those that do hold most of the entries, and to copy them costs
        more than it saves.
        """
        factors, n = self.factors, len(self.order)
        if not self.plane or not np.array_equal(factors.perm_c, factors.perm_r):
            return lambda load, rtol: block_product(self, at, n, load, rtol)
        place = np.empty(n, int)
        place[self.order] = np.arange(n)
        first, L = factors.perm_c[place[at]], factors.L
        reached = _ancestors(L, first)
        inside, pivots, mine = np.searchsorted(reached, first), factors.U.diagonal()[reached], len(self._held)
        self._held.append(self._home.submit(_factors, L[:, reached][reached].tocsc()).result())

        def product(load: np.ndarray, rtol: float | None) -> np.ndarray:
            x = np.zeros((len(reached), *load.shape[1:]))
            x[inside] = load
            x = self._held[mine].solve(x)
            return np.asarray(self._held[mine].solve((x.T / pivots).T, "T")[inside])

        return product


_TURN = count()


@cache
def _homes() -> tuple[ThreadPoolExecutor, ThreadPoolExecutor]:
    """Two threads that make and free factors: SuperLU frees its memory only in the thread that took it."""
    return ThreadPoolExecutor(1), ThreadPoolExecutor(1)


def _factors(A: sp.csc_matrix) -> Any:
    return splu(A, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def _ancestors(L: sp.csc_matrix, first: np.ndarray) -> np.ndarray:
    """Unknowns (sorted) that substitution from `first` on reaches: those in the columns of L of those reached before."""
    reached = np.zeros(L.shape[0], dtype=bool)
    front = np.unique(first)
    while len(front):
        reached[front] = True
        below = np.unique(L[:, front].indices)
        front = below[~reached[below]]
    return np.flatnonzero(reached)


class PardisoSolver:
    """Cholesky factors of Intel's oneMKL PARDISO in its own nested dissection order (pip install pypardiso)."""

    name = "pardiso"
    iterations = 0

    def __init__(self, system: System):
        try:
            from pypardiso import PyPardisoSolver
        except ImportError as error:
            raise InputError("the body solver 'pardiso' needs the package pypardiso: pip install pypardiso.") from error
        self.last = system.last
        self.upper = sp.triu(system.A, format="csr")
        self.factors = PyPardisoSolver(mtype=2)  # real, symmetric positive definite
        self.factors.factorize(self.upper)
        weakref.finalize(self, self.factors.free_memory, everything=True)  # MKL's memory is not Python's

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        if not load.size:
            return np.zeros(load.shape)
        return np.asarray(self.factors.solve(self.upper, np.asfortranarray(load, dtype=float)))

    @cached_property
    def trailing_triangle(self) -> tuple[np.ndarray, np.ndarray]:
        """As SuperLUSolver's; from a factorisation that ends at the Schur complement."""
        from pypardiso import PyPardisoSolver

        last, n = asked(self.last), self.upper.shape[0]
        if not len(last):
            return np.zeros((0, 0)), np.zeros(0, int)
        partial = PyPardisoSolver(mtype=2, phase=12)
        for index, value in {1: 1, 2: 2, 10: 13, 21: 1, 36: 1}.items():  # own values; METIS; defaults; Schur complement
            partial.set_iparm(index, value)
        partial.perm = np.zeros(n, dtype=np.int32)
        partial.perm[last] = 1
        S = partial._call_pardiso(self.upper, np.zeros((len(last), len(last))))  # in the order of sorted unknowns
        partial.free_memory(everything=True)
        return np.linalg.cholesky(S), np.argsort(np.argsort(last))

    def trailing_inverse(self) -> np.ndarray:
        return _triangle_inverse(*self.trailing_triangle)

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        return _triangle_product(*self.trailing_triangle, load)

    def restricted(self, at: np.ndarray) -> Product:
        return lambda load, rtol: block_product(self, at, self.upper.shape[0], load, rtol)


def asked(last: np.ndarray | None) -> np.ndarray:
    if last is None:
        raise InputError("no unknowns were named whose block of the inverse is asked for; give `last`.")
    return last


def _triangle_inverse(R: np.ndarray, place: np.ndarray) -> np.ndarray:
    X = la.solve_triangular(R, np.eye(len(R)), lower=True, check_finite=False)
    C = X.T @ X  # NumPy keeps it symmetric
    return np.asarray(C[np.ix_(place, place)])


def _triangle_product(R: np.ndarray, place: np.ndarray, load: np.ndarray) -> np.ndarray:
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
