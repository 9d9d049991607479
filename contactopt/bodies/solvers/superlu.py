"""Sparse factors by SuperLU, and how to use no more of them than a load reaches."""

import weakref
from _thread import start_new_thread
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.bodies.solvers.ordering import elimination_order
from contactopt.bodies.solvers.system import BodySolver, System, out_of_memory
from contactopt.linear.operators import Product


class FactorThread:
    """One thread that makes and frees factors: SuperLU returns memory only in the thread that took
    it.

    It ends when nobody refers to this object any more, which Python may find out while any thread
    holds locks; it is therefore told by a short thread that may wait for them.
    """

    def __init__(self) -> None:
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="superlu")
        self._held: list[Any] = []
        weakref.finalize(self, start_new_thread, _free, (self._executor, self._held)).atexit = False

    def factorise(self, A: sp.csc_matrix) -> int:
        """Factorise A in its own order and return the number under which [] finds the factors."""
        self._held.append(self._executor.submit(factorise, A).result())
        return len(self._held) - 1

    def __getitem__(self, number: int) -> Any:
        """SciPy's SuperLU object; whoever keeps it longer than this thread keeps its memory."""
        return self._held[number]


def _free(executor: ThreadPoolExecutor, held: list[Any]) -> None:
    with suppress(RuntimeError):  # Python is ending: there is nothing left to free
        executor.submit(held.clear)
    executor.shutdown(wait=False)


def factorise(A: sp.csc_matrix) -> Any:
    """Factors of a positive definite matrix in its order; MemoryError, RuntimeError if singular."""
    try:
        return splu(A, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except (MemoryError, RuntimeError) as error:
        if "singular" in str(error):
            raise
        raise out_of_memory(A.shape[0]) from error


class SuperLUSolver(BodySolver):
    """Factors L U = L D L' of A, `trailing` last, which give its Schur complement."""

    name = "superlu"

    def __init__(self, system: System):
        super().__init__(system)
        self._plane = len(system.points) == 2
        trailing = np.zeros(0, int) if system.trailing is None else system.trailing
        self._order = elimination_order(*system[:4], trailing)
        self._thread = FactorThread()
        self._thread.factorise(system.A[self._order][:, self._order].tocsc())

    @property
    def factors(self) -> Any:
        """SciPy's SuperLU object of the permuted matrix."""
        return self._thread[0]

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        out = np.zeros(load.shape)
        if load.size:
            out[self._order] = self.factors.solve(np.ascontiguousarray(load[self._order]))
        return out

    @cached_property
    def definite(self) -> bool:
        # A has as many negative eigenvalues as D has entries; U is made for `trailing` anyway
        if not self.complete or not np.array_equal(self.factors.perm_c, self.factors.perm_r):
            return False
        return bool(self.factors.U.diagonal().min(initial=1.0) > 0)

    @cached_property
    def trailing_triangle(self) -> tuple[np.ndarray, np.ndarray] | None:
        """None where pivots changed the order or are not positive."""
        factors, n = self.factors, self.n
        head = n - len(self._asked())
        symmetric = np.array_equal(factors.perm_c, factors.perm_r)
        if not symmetric or not np.array_equal(np.sort(factors.perm_c[head:]), np.arange(head, n)):
            return None
        L, pivots = factors.L[head:, head:].toarray(order="F"), factors.U.diagonal()[head:]
        if pivots.min(initial=1.0) <= 0:
            return None
        # L U = L D L' with D > 0 the pivots
        return L * np.sqrt(pivots), factors.perm_c[head:] - head

    def restricted(self, at: np.ndarray) -> Product:
        """Products by the rows and columns of L and D that `at` reaches in the plane."""
        factors = self.factors
        if not self._plane or not np.array_equal(factors.perm_c, factors.perm_r):
            return super().restricted(at)
        place = np.empty(self.n, int)
        place[self._order] = np.arange(self.n)
        first, L = factors.perm_c[place[at]], factors.L
        reached = _ancestors(L, first)
        inside, pivots = np.searchsorted(reached, first), factors.U.diagonal()[reached]
        thread, mine = self._thread, self._thread.factorise(L[:, reached][reached].tocsc())

        def product(load: np.ndarray, rtol: float | None) -> np.ndarray:
            x = np.zeros((len(reached), *load.shape[1:]))
            x[inside] = load
            x = thread[mine].solve(x)  # L y = x
            return np.asarray(thread[mine].solve((x.T / pivots).T, "T")[inside])  # L' x = y / D

        return product


def _ancestors(L: sp.csc_matrix, first: np.ndarray) -> np.ndarray:
    """Unknowns (sorted) that substitution from `first` on reaches, column by column."""
    reached = np.zeros(L.shape[0], dtype=bool)
    front = np.unique(first)
    while len(front):
        reached[front] = True
        below = np.unique(L[:, front].indices)
        front = below[~reached[below]]
    return np.flatnonzero(reached)
