"""Sparse factors by Intel's oneMKL PARDISO."""

from __future__ import annotations

import weakref
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.solvers.mkl import library
from contactopt.bodies.solvers.system import BodySolver, System
from contactopt.errors import InputError


class PardisoSolver(BodySolver):
    """Cholesky factors of oneMKL PARDISO in its own nested dissection order (pip install
    pypardiso).
    """

    name = "pardiso"
    releases_lock = True

    def __init__(self, system: System):
        try:
            from pypardiso import PyPardisoSolver
        except ImportError as error:
            raise InputError(
                "the body solver 'pardiso' needs the package pypardiso: pip install pypardiso."
            ) from error
        super().__init__(system)
        library()  # so that pypardiso need not search for it
        self.upper = sp.triu(system.A, format="csr")
        self.factors = PyPardisoSolver(mtype=2)  # real, symmetric positive definite
        self.factors.factorize(self.upper)
        # MKL's memory is not Python's
        weakref.finalize(self, self.factors.free_memory, everything=True)

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        if not load.size:
            return np.zeros(load.shape)
        return np.asarray(self.factors.solve(self.upper, np.asfortranarray(load, dtype=float)))

    @cached_property
    def trailing_triangle(self) -> tuple[np.ndarray, np.ndarray]:
        """A second factorisation, which stops before these unknowns, leaves it."""
        from pypardiso import PyPardisoSolver

        trailing = self._asked()
        if not len(trailing):
            return np.zeros((0, 0)), np.zeros(0, int)
        partial = PyPardisoSolver(mtype=2, phase=12)
        # own values; METIS; defaults; Schur complement
        for index, value in {1: 1, 2: 2, 10: 13, 21: 1, 36: 1}.items():
            partial.set_iparm(index, value)
        partial.perm = np.zeros(self.n, dtype=np.int32)
        partial.perm[trailing] = 1
        # the Schur complement in the order of the sorted unknowns
        S = partial._call_pardiso(self.upper, np.zeros((len(trailing), len(trailing))))
        partial.free_memory(everything=True)
        return np.linalg.cholesky(S), np.argsort(np.argsort(trailing))
