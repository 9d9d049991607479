"""Sparse factors by Intel's oneMKL PARDISO."""

from __future__ import annotations

import weakref
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.solvers.mkl import library
from contactopt.bodies.solvers.system import (
    System,
    asked,
    block_product,
    triangle_inverse,
    triangle_product,
)
from contactopt.errors import InputError
from contactopt.linear.operators import Product


class PardisoSolver:
    """Cholesky factors of Intel's oneMKL PARDISO in its own nested dissection order (pip install
    pypardiso).
    """

    name = "pardiso"
    iterative = False
    iteration = None
    releases_lock = True

    def __init__(self, system: System):
        try:
            from pypardiso import PyPardisoSolver
        except ImportError as error:
            raise InputError(
                "the body solver 'pardiso' needs the package pypardiso: pip install pypardiso."
            ) from error
        library()  # so that pypardiso need not search for it
        self.trailing = system.trailing
        self.upper = sp.triu(system.A, format="csr")
        self.factors = PyPardisoSolver(mtype=2)  # real, symmetric positive definite
        self.factors.factorize(self.upper)
        # MKL's memory is not Python's
        weakref.finalize(self, self.factors.free_memory, everything=True)

    @property
    def complete(self) -> bool:
        return self.trailing is not None

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        if not load.size:
            return np.zeros(load.shape)
        return np.asarray(self.factors.solve(self.upper, np.asfortranarray(load, dtype=float)))

    @cached_property
    def trailing_triangle(self) -> tuple[np.ndarray, np.ndarray]:
        """R (m, m) lower triangular and the place (m,) of each of `trailing`: R R' is the Schur
        complement in these places.

        A second factorisation, which stops before these unknowns, leaves the Schur complement.
        """
        from pypardiso import PyPardisoSolver

        trailing, n = asked(self.trailing), self.upper.shape[0]
        if not len(trailing):
            return np.zeros((0, 0)), np.zeros(0, int)
        partial = PyPardisoSolver(mtype=2, phase=12)
        # own values; METIS; defaults; Schur complement
        for index, value in {1: 1, 2: 2, 10: 13, 21: 1, 36: 1}.items():
            partial.set_iparm(index, value)
        partial.perm = np.zeros(n, dtype=np.int32)
        partial.perm[trailing] = 1
        S = partial._call_pardiso(
            self.upper, np.zeros((len(trailing), len(trailing)))
        )  # in the order of sorted unknowns
        partial.free_memory(everything=True)
        return np.linalg.cholesky(S), np.argsort(np.argsort(trailing))

    def trailing_inverse(self) -> np.ndarray:
        return triangle_inverse(*self.trailing_triangle)

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        return triangle_product(*self.trailing_triangle, load)

    def restricted(self, at: np.ndarray) -> Product:
        return lambda load, rtol: block_product(self, at, self.upper.shape[0], load, rtol)
