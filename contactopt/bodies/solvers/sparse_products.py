"""Products of a sparse matrix with a vector, by oneMKL where pypardiso has installed it and by
SciPy elsewhere.

Neither holds Python's lock, so that the pieces of one product can be made in several threads.
oneMKL's functions are called here rather than through the package sparse_dot_mkl, because that
package makes a new handle of the matrix for each product.
"""

import ctypes
import weakref
from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.solvers.constants import GALERKIN, LARGE, SHARE
from contactopt.bodies.solvers.mkl import library
from contactopt.bodies.solvers.system import Submatrix
from contactopt.linear.concurrency import Crew

# oneMKL's names: A itself, no structure, blocks stored row by row
_PLAIN, _GENERAL, _ROWS = 10, 20, 101


class _Description(ctypes.Structure):
    """oneMKL's struct matrix_descr."""

    _fields_ = (("type", ctypes.c_int), ("mode", ctypes.c_int), ("diag", ctypes.c_int))


class SparseProduct:
    """x -> A @ x for a matrix (n, k) in CSR or in BSR with square blocks, of single or double
    precision, which is not copied and must not change.

    Where a crew of several threads is given, a large matrix is cut into pieces of rows with about
    as many entries, which they multiply at the same time. The result is the same to the last digit.
    """

    def __init__(self, matrix: sp.csr_matrix | sp.bsr_matrix, crew: Crew | None = None):
        self.matrix, self.crew = matrix, crew
        alone = crew is None or crew.size < 2 or matrix.nnz < LARGE
        count = 1 if crew is None or alone else min(SHARE * crew.size, 4 * matrix.nnz // LARGE)
        self._pieces = [_Piece(rows, part) for rows, part in _pieces(matrix, count)]

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """A @ x for one vector x (k,) of the precision of A."""
        x = np.ascontiguousarray(x, dtype=self.matrix.dtype)
        y = np.empty(self.matrix.shape[0], dtype=self.matrix.dtype)
        acts = [partial(piece.multiply, x, y) for piece in self._pieces]
        if self.crew is None or len(acts) < 2:
            acts[0]()
        else:
            self.crew.each(acts)
        return y


class BlockProduct:
    """x (n,) -> A @ x for a Submatrix A, by products with the whole matrix."""

    def __init__(self, block: Submatrix, crew: Crew | None = None):
        self.block, self.whole = block, SparseProduct(block.whole, crew)

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        full = np.zeros(self.block.whole.shape[0])
        full[self.block.kept] = x
        return np.asarray((self.whole @ full)[self.block.kept])


class _Piece:
    """Some rows of a matrix, and oneMKL's view of them if it has one."""

    def __init__(self, rows: slice, matrix: sp.csr_matrix | sp.bsr_matrix):
        self.rows, self.matrix = rows, matrix
        self._mkl: Any = library()
        self._handle = None if self._mkl is None else _handle(self._mkl, matrix)
        if self._mkl is not None and self._handle is not None:
            weakref.finalize(self, self._mkl.mkl_sparse_destroy, self._handle).atexit = False

    def multiply(self, x: np.ndarray, y: np.ndarray) -> None:
        """Put the product with x into its rows of y."""
        own = y[self.rows]
        if self._handle is None or self._multiply(x, own):
            own[:] = self.matrix @ x

    def _multiply(self, x: np.ndarray, y: np.ndarray) -> int:
        """The product by oneMKL; 0 if it succeeded. Its own threads would spin between products."""
        letter, number = _kind(self.matrix)
        multiply = getattr(self._mkl, f"mkl_sparse_{letter}_mv")
        before = self._mkl.MKL_Set_Num_Threads_Local(1)
        plain = _PLAIN, number(1.0), self._handle, _Description(_GENERAL, 0, 0)
        failed = multiply(*plain, _at(x), number(0.0), _at(y))
        self._mkl.MKL_Set_Num_Threads_Local(before)
        return int(failed)


def galerkin(P: sp.bsr_matrix, A: sp.bsr_matrix, crew: Crew) -> sp.bsr_matrix:
    """P' A P (m, m) in blocks, from pieces of rows of A, each in a thread of its own."""
    height = P.blocksize[0]
    found: dict[int, sp.bsr_matrix] = {}

    def part(number: int, rows: slice, own: sp.bsr_matrix) -> None:
        found[number] = sp.bsr_matrix(
            _rows(P, rows.start // height, rows.stop // height).T @ (own @ P)
        )

    pieces = _pieces(A, GALERKIN if A.nnz >= LARGE else 1)
    crew.each([partial(part, number, *piece) for number, piece in enumerate(pieces)])
    total = found.pop(0)
    for number in sorted(found):  # in an order that does not depend on the threads
        total = total + found.pop(number)
    return sp.bsr_matrix(total)


def _pieces(
    A: sp.csr_matrix | sp.bsr_matrix, count: int
) -> Iterator[tuple[slice, sp.csr_matrix | sp.bsr_matrix]]:
    """Consecutive rows of A with about as many entries each; their entries are not copied."""
    height = A.blocksize[0] if A.format == "bsr" else 1
    inner = np.searchsorted(A.indptr, np.arange(1, count) * (int(A.indptr[-1]) / count))
    for first, stop in pairwise([0, *inner.tolist(), len(A.indptr) - 1]):
        if first < stop or count == 1:
            yield slice(first * height, stop * height), _rows(A, first, stop)


def _rows(A: sp.csr_matrix | sp.bsr_matrix, first: int, stop: int) -> sp.csr_matrix | sp.bsr_matrix:
    """Rows of A, or of its blocks, from `first` to before `stop`, without a copy."""
    if (first, stop) == (0, len(A.indptr) - 1):
        return A
    entries = slice(int(A.indptr[first]), int(A.indptr[stop]))
    size = {"blocksize": A.blocksize} if A.format == "bsr" else {}
    height = A.blocksize[0] if size else 1
    part = type(A)(((stop - first) * height, A.shape[1]), **size, dtype=A.dtype)
    # Given to the constructor, parts of arrays would be copied.
    part.data, part.indices = A.data[entries], A.indices[entries]
    part.indptr = A.indptr[first : stop + 1] - A.indptr[first]
    return part


def _kind(A: sp.csr_matrix) -> tuple[str, Any]:
    """oneMKL's letter of the precision of A, and the C type of its numbers."""
    return ("s", ctypes.c_float) if A.dtype == np.float32 else ("d", ctypes.c_double)


def _at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _handle(mkl: ctypes.CDLL, A: sp.csr_matrix | sp.bsr_matrix) -> ctypes.c_void_p | None:
    """oneMKL's view of A, not optimised, or None: 64-bit indices, blocks that are not square."""
    square = A.format == "csr" or A.blocksize[0] == A.blocksize[1]
    if not square or A.indices.dtype != np.int32 or A.nnz == 0:
        return None
    handle = ctypes.c_void_p()
    letter, _ = _kind(A)
    arrays = _at(A.indptr), _at(A.indptr[1:]), _at(A.indices), _at(A.data)
    shape = A.shape
    if A.format == "bsr":
        size = A.blocksize[0]
        shape = (_ROWS, A.shape[0] // size, A.shape[1] // size, size)
    create = getattr(mkl, f"mkl_sparse_{letter}_create_{A.format}")
    return None if create(ctypes.byref(handle), 0, *shape, *arrays) else handle
