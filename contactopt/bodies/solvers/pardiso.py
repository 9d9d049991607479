"""Sparse factors by Intel's oneMKL PARDISO.

One factorisation gives all that is asked for. Let A = [A_hh, A_ht; A_th, A_tt] with the unknowns
`trailing` last. PARDISO eliminates them last if it is told so, and hands out their Schur complement
S = A_tt - A_th A_hh^-1 A_ht while it keeps the factors of the whole matrix. The block of the
inverse on these unknowns is S^-1.

Source: oneMKL Developer Reference, pardiso and pardiso iparm Parameter (iparm(36) = 2).
"""

from __future__ import annotations

import ctypes
import weakref
from functools import cached_property
from importlib.util import find_spec
from threading import Lock
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from contactopt.bodies.solvers.mkl import library
from contactopt.bodies.solvers.system import BodySolver, System, out_of_memory
from contactopt.errors import InputError

_POSITIVE = 2  # PARDISO's type of a real symmetric positive definite matrix
_FACTORISE, _SOLVE, _FREE = 12, 33, -1  # its phases
_NO_MEMORY = -2, -9  # its errors
# Entries of iparm, which PARDISO's documentation counts from 1: no defaults; METIS; indices from 0.
_OPTIONS = {1: 1, 2: 2, 35: 1}
_SCHUR = 36  # the entry that asks for a Schur complement beside the factors where it is 2


class PardisoSolver(BodySolver):
    """Cholesky factors of oneMKL PARDISO in its own nested dissection order, with `trailing`
    eliminated last (pip install pypardiso).
    """

    name = "pardiso"
    releases_lock = True

    def __init__(self, system: System):
        mkl = library() if find_spec("pypardiso") is not None else None
        if mkl is None:
            raise InputError(
                "the body solver 'pardiso' needs the package pypardiso: pip install pypardiso."
            )
        super().__init__(system)
        upper = sp.triu(system.A, format="csr")
        upper.sort_indices()
        chosen = np.zeros(0, int) if system.trailing is None else system.trailing
        self._factors = _Factors(mkl, upper, chosen)
        # MKL's memory is not Python's
        weakref.finalize(self, self._factors.free)

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        return self._factors.solve(load) if load.size else np.zeros(load.shape)

    @cached_property
    def trailing_triangle(self) -> tuple[np.ndarray, np.ndarray] | None:
        """None where rounding left the Schur complement not positive definite."""
        trailing = self._asked()
        S = self._factors.take_schur()  # in the order of the sorted unknowns
        R, failed = la.lapack.dpotrf(S.T, lower=True, overwrite_a=True) if S.size else (S, 0)
        return None if failed else (R, np.argsort(np.argsort(trailing)))


class _Factors:
    """PARDISO's handle of one matrix, given by the rows of its upper triangle in CSR, and the Schur
    complement of the others in the unknowns `trailing` (m,).
    """

    def __init__(self, mkl: Any, upper: sp.csr_matrix, trailing: np.ndarray):
        self._pardiso, self._busy = mkl["pardiso"], Lock()
        self._pardiso.restype = None
        self._n, self._values = upper.shape[0], np.asarray(upper.data, dtype=float)
        self._rows = np.asarray(upper.indptr, dtype=np.int32)
        self._columns = np.asarray(upper.indices, dtype=np.int32)
        self._handle, self._iparm = np.zeros(64, dtype=np.int64), np.zeros(64, dtype=np.int32)
        self._last = np.zeros(self._n, dtype=np.int32)
        self._last[trailing] = 1
        options = _OPTIONS | ({_SCHUR: 2} if len(trailing) else {})
        for entry, value in options.items():
            self._iparm[entry - 1] = value
        self._schur = np.zeros((len(trailing), len(trailing)))
        self._call(_FACTORISE, np.zeros(self._n), self._schur)

    def solve(self, load: np.ndarray) -> np.ndarray:
        """The solution (n,) or (n, j) under `load` of that shape."""
        load = np.asfortranarray(load, dtype=float)
        x = np.empty_like(load)
        self._call(_SOLVE, load, x, load.size // self._n)
        return x

    def take_schur(self) -> np.ndarray:
        """The Schur complement (m, m), which is given away and not kept."""
        schur, self._schur = self._schur, np.zeros((0, 0))
        return schur

    def free(self) -> None:
        """Give MKL's memory back."""
        self._call(_FREE, np.zeros(1), np.zeros(1))

    def _call(self, phase: int, load: np.ndarray, out: np.ndarray, count: int = 1) -> None:
        error = ctypes.c_int32(0)
        one, phase_, n, count_, kind, silent = (
            ctypes.byref(ctypes.c_int32(value))
            for value in (1, phase, self._n, count, _POSITIVE, 0)
        )
        matrix = self._values, self._rows, self._columns, self._last
        with self._busy:  # one at a time: PARDISO writes to its handle
            self._pardiso(
                _at(self._handle), one, one, kind, phase_, n, *map(_at, matrix), count_,
                _at(self._iparm), silent, _at(load), _at(out), ctypes.byref(error),
            )  # fmt: skip
        if error.value in _NO_MEMORY:
            raise out_of_memory(self._n)
        if error.value:
            raise RuntimeError(f"PARDISO ended with its error {error.value}.")


def _at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
