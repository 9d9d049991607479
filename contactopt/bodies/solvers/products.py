"""Products of a sparse matrix with a vector, by oneMKL where pypardiso has installed it and by SciPy elsewhere.

One oneMKL product of single precision is faster than one of SciPy (`python -m experiments.questions.solver_constants`).
Neither holds Python's lock.
"""

from __future__ import annotations

import ctypes
import weakref
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.solvers.mkl import library

_PLAIN, _GENERAL, _ROWS = 10, 20, 101  # oneMKL's names: A itself, no structure, blocks stored row by row


class _Description(ctypes.Structure):
    """oneMKL's struct matrix_descr."""

    _fields_ = (("type", ctypes.c_int), ("mode", ctypes.c_int), ("diag", ctypes.c_int))


class SparseProduct:
    """x -> A @ x for a matrix (n, k) in CSR or in BSR with square blocks, of single or double precision.

    matrix  A in SciPy's form; it is not copied and must not change
    """

    def __init__(self, matrix: sp.csr_matrix | sp.bsr_matrix):
        self.matrix = matrix
        self._mkl: Any = library()
        self._handle = None if self._mkl is None else _handle(self._mkl, matrix)
        if self._mkl is not None and self._handle is not None:
            weakref.finalize(self, self._mkl.mkl_sparse_destroy, self._handle).atexit = False

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """A @ x for one vector x (k,) of the precision of A."""
        if self._handle is None:
            return np.asarray(self.matrix @ x)
        x = np.ascontiguousarray(x, dtype=self.matrix.dtype)
        y = np.empty(self.matrix.shape[0], dtype=self.matrix.dtype)
        letter, number = _kind(self.matrix)
        multiply = getattr(self._mkl, f"mkl_sparse_{letter}_mv")
        before = self._mkl.MKL_Set_Num_Threads_Local(
            1
        )  # more would spin between products; bodies have threads of their own
        failed = multiply(_PLAIN, number(1.0), self._handle, _Description(_GENERAL, 0, 0), _at(x), number(0.0), _at(y))
        self._mkl.MKL_Set_Num_Threads_Local(before)
        return np.asarray(self.matrix @ x) if failed else y


def _kind(A: sp.csr_matrix) -> tuple[str, Any]:
    """oneMKL's letter of the precision of A, and the C type of its numbers."""
    return ("s", ctypes.c_float) if A.dtype == np.float32 else ("d", ctypes.c_double)


def _at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _handle(mkl: Any, A: sp.csr_matrix | sp.bsr_matrix) -> ctypes.c_void_p | None:
    """oneMKL's view of A, or None where it has none: 64-bit indices, blocks that are not square.

    oneMKL is not asked to optimise the view: it would copy the matrix and gain little.
    """
    square = A.format == "csr" or A.blocksize[0] == A.blocksize[1]
    if not square or A.indices.dtype != np.int32 or A.nnz == 0:
        return None
    handle = ctypes.c_void_p()
    letter, _ = _kind(A)
    arrays = _at(A.indptr), _at(A.indptr[1:]), _at(A.indices), _at(A.data)
    if A.format == "csr":
        failed = getattr(mkl, f"mkl_sparse_{letter}_create_csr")(ctypes.byref(handle), 0, *A.shape, *arrays)
    else:
        size = A.blocksize[0]
        shape = (A.shape[0] // size, A.shape[1] // size, size)
        failed = getattr(mkl, f"mkl_sparse_{letter}_create_bsr")(ctypes.byref(handle), 0, _ROWS, *shape, *arrays)
    return None if failed else handle
