"""Sparse factors by Intel's oneMKL PARDISO."""

from __future__ import annotations

import weakref

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from contactopt.bodies.solvers.mkl import library
from contactopt.bodies.solvers.system import BodySolver, System
from contactopt.errors import InputError

SETTINGS = {1: 1, 2: 2}  # iparm: own settings; nested dissection by METIS
FACTORISE, SOLVE = 12, 33  # phases


class PardisoSolver(BodySolver):
    """Cholesky factors of oneMKL PARDISO in its own nested dissection order (pip install
    pypardiso).

    One factorisation gives both the factors and the Schur complement of the unknowns `trailing`,
    which are eliminated last (iparm(36) = 2, perm = 1 at these unknowns).
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
        trailing = np.zeros(0, int) if self.trailing is None else self.trailing
        m = len(trailing)
        self.upper = sp.triu(system.A, format="csr")
        self.upper.sort_indices()
        self.factors = PyPardisoSolver(mtype=2, phase=FACTORISE)  # symmetric positive definite
        # MKL's memory is not Python's
        weakref.finalize(self, self.factors.free_memory, everything=True)
        for index, value in (SETTINGS | ({36: 2} if m else {})).items():
            self.factors.set_iparm(index, value)
        self.factors.perm = np.zeros(self.n, dtype=np.int32)
        self.factors.perm[trailing] = 1
        # what comes back is the Schur complement, in the order of the sorted unknowns
        schur = self.factors._call_pardiso(self.upper, np.zeros((m, m) if m else (self.n, 1)))
        triangle = la.cholesky(schur.T, lower=True, overwrite_a=True) if m else np.zeros((0, 0))
        self._triangle = triangle, np.argsort(np.argsort(trailing))
        self.factors.set_phase(SOLVE)

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        if not load.size:
            return np.zeros(load.shape)
        # the public method of pypardiso compares the whole matrix with that of the factors
        return np.asarray(
            self.factors._call_pardiso(self.upper, np.asfortranarray(load, dtype=float))
        )

    @property
    def trailing_triangle(self) -> tuple[np.ndarray, np.ndarray]:
        self._asked()
        return self._triangle
