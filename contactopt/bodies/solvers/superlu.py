"""Sparse factors by SuperLU, and how to use no more of them than a load reaches."""

from __future__ import annotations

import weakref
from concurrent.futures import ThreadPoolExecutor
from functools import cache, cached_property
from itertools import count
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.bodies.solvers.ordering import elimination_order
from contactopt.bodies.solvers.system import (
    Product,
    System,
    asked,
    block_product,
    inverse_block,
    triangle_inverse,
    triangle_product,
)


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
        return triangle_inverse(*self.trailing_triangle)

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """Two triangular solves with the trailing triangle: nothing of the interior is touched."""
        if self.trailing_triangle is None:
            return block_product(self, asked(self.last), len(self.order), load, rtol)
        return triangle_product(*self.trailing_triangle, load)

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
