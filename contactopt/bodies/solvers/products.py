"""Products of a sparse matrix with a vector, by oneMKL where pypardiso has installed it and by SciPy elsewhere.

One oneMKL product of single precision is several times faster than SciPy's (`python -m experiments.body_solvers
--products`). Neither holds Python's lock.
"""

from __future__ import annotations

import ctypes
import weakref
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.solvers.mkl import library

_TRIED = 1000  # products announced to oneMKL, so that it analyses the matrix
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
        self._handle = _handle(matrix)
        if self._handle is not None:
            weakref.finalize(self, library().mkl_sparse_destroy, self._handle).atexit = False

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """A @ x for one vector x (k,) of the precision of A."""
        if self._handle is None:
            return np.asarray(self.matrix @ x)
        x = np.ascontiguousarray(x, dtype=self.matrix.dtype)
        y = np.empty(self.matrix.shape[0], dtype=self.matrix.dtype)
        letter, number = _kind(self.matrix)
        act = getattr(library(), f"mkl_sparse_{letter}_mv")
        before = library().MKL_Set_Num_Threads_Local(
            1
        )  # more would spin between products; bodies have threads of their own
        failed = act(_PLAIN, number(1.0), self._handle, _Description(_GENERAL, 0, 0), _at(x), number(0.0), _at(y))
        library().MKL_Set_Num_Threads_Local(before)
        return y if not failed else np.asarray(self.matrix @ x)


def _kind(A: sp.csr_matrix) -> tuple[str, Any]:
    """oneMKL's letter of the precision of A, and the C type of its numbers."""
    return ("s", ctypes.c_float) if A.dtype == np.float32 else ("d", ctypes.c_double)


def _at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _handle(A: sp.csr_matrix | sp.bsr_matrix) -> ctypes.c_void_p | None:
    """oneMKL's view of A, or None where it has none: no library, 64-bit indices, blocks that are not square."""
    square = A.format == "csr" or A.blocksize[0] == A.blocksize[1]
    if library() is None or not square or A.indices.dtype != np.int32 or A.nnz == 0:
        return None
    handle = ctypes.c_void_p()
    letter, _ = _kind(A)
    arrays = _at(A.indptr), _at(A.indptr[1:]), _at(A.indices), _at(A.data)
    if A.format == "csr":
        create = getattr(library(), f"mkl_sparse_{letter}_create_csr")
        failed = create(ctypes.byref(handle), 0, *A.shape, *arrays)
    else:
        size = A.blocksize[0]
        create = getattr(library(), f"mkl_sparse_{letter}_create_bsr")
        failed = create(ctypes.byref(handle), 0, _ROWS, A.shape[0] // size, A.shape[1] // size, size, *arrays)
        if not failed:
            library().mkl_sparse_set_mv_hint(handle, _PLAIN, _Description(_GENERAL, 0, 0), _TRIED)
            library().mkl_sparse_optimize(handle)
    return None if failed else handle
