"""Sparse factors by Intel's oneMKL PARDISO.

One factorisation gives all that is asked for. PARDISO eliminates the unknowns t, `trailing`, after
all others h if it is told so, and hands out their Schur complement S = A_tt - A_th A_hh^-1 A_ht
while it keeps the factors of the whole matrix. The block of the inverse on t is S^-1.

PARDISO keeps what it needs in the threads that call it, and crashes now and then in processes whose
calling threads have ended. All calls are therefore made by threads that last as long as the
process.

Source: oneMKL Developer Reference, pardiso iparm Parameter, iparm(36) = 2.
"""

from __future__ import annotations

import os
import weakref
from _thread import start_new_thread
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache, cached_property
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from contactopt.bodies.solvers.mkl import library
from contactopt.bodies.solvers.system import BodySolver, System, out_of_memory
from contactopt.errors import InputError
from contactopt.linear.concurrency import cores

if TYPE_CHECKING:
    from pypardiso import PyPardisoSolver

FACTORISE, SOLVE = 12, 33  # PARDISO's phases
NO_MEMORY, NO_PIVOT = (-2, -9), -4  # its errors
DEFINITE, INDEFINITE = 2, -2  # its kinds of symmetric matrices


@cache
def _threads() -> ThreadPoolExecutor:
    """The threads that call PARDISO, one for each core."""
    return ThreadPoolExecutor(cores(), thread_name_prefix="pardiso")


os.register_at_fork(after_in_child=_threads.cache_clear)


def _alone(lock: Lock, act: Callable[..., Any], *given: Any) -> Any:
    """What a call of PARDISO makes, which writes to its handle: one at a time."""
    with lock:
        return act(*given)


def _free(lock: Lock, factors: PyPardisoSolver) -> None:
    with suppress(RuntimeError):  # Python is ending: there is nothing left to free
        _threads().submit(_alone, lock, factors.free_memory, True)


class PardisoSolver(BodySolver):
    """Cholesky factors of oneMKL PARDISO with `trailing` eliminated last (needs pypardiso)."""

    name = "pardiso"
    releases_lock = True
    order = 2  # METIS; 0 is minimum degree

    def __init__(self, system: System):
        library()  # first, so that pypardiso need not search for it
        try:
            from pypardiso.pardiso_wrapper import PyPardisoError
        except ImportError as error:
            raise InputError(
                "the body solver 'pardiso' needs the package pypardiso: pip install pypardiso."
            ) from error
        super().__init__(system)
        self.upper = sp.triu(system.A, format="csr")
        self.upper.sort_indices()
        self._lock = Lock()
        trailing = np.zeros(0, int) if system.trailing is None else system.trailing
        try:
            self._schur = self._factorised(DEFINITE, trailing)
        except PyPardisoError as error:
            if error.value != NO_PIVOT:
                raise
            # rounding makes a pivot of a thin body negative
            self._schur = self._factorised(INDEFINITE, trailing)
        self.factors.set_phase(SOLVE)

    def _factorised(self, kind: int, trailing: np.ndarray) -> np.ndarray:
        """Factorise; the Schur complement on the trailing unknowns, as one column."""
        from pypardiso import PyPardisoSolver

        factors = self.factors = PyPardisoSolver(mtype=kind, phase=FACTORISE)
        # MKL's memory is not Python's; a thread of its own may wait for locks that are held here
        weakref.finalize(self, start_new_thread, _free, (self._lock, factors)).atexit = False
        factors.perm = np.zeros(self.n, dtype=np.int32)
        factors.perm[trailing] = 1
        # own values; order; pivots as they are; of blocks of one or two where some are negative;
        # the Schur complement beside the factors
        for index, value in {
            1: 1,
            2: self.order,
            10: 16,
            21: 1,
            36: 2 if len(trailing) else 0,
        }.items():
            factors.set_iparm(index, value)
        # as one column: asked for as many right-hand sides as S has columns, oneMKL crashes
        return self._call(np.zeros(max(len(trailing) ** 2, 1)))

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        if not load.size:
            return np.zeros(load.shape)
        return self._call(np.asfortranarray(load, dtype=float))

    @property
    def definite(self) -> bool:
        return bool(self.factors.mtype == DEFINITE)  # Cholesky's factors exist

    @cached_property
    def trailing_triangle(self) -> tuple[np.ndarray, np.ndarray] | None:
        """None where rounding left the Schur complement not positive definite."""
        trailing = self._asked()
        if not len(trailing):
            return np.zeros((0, 0)), trailing
        # in the order of the sorted unknowns; its memory becomes that of the triangle
        S, self._schur = self._schur.reshape(2 * trailing.shape, order="F"), np.zeros(0)
        R, failed = la.lapack.dpotrf(S, lower=True, overwrite_a=True)
        return None if failed else (R, np.argsort(np.argsort(trailing)))

    def _call(self, load: np.ndarray) -> np.ndarray:
        """What PARDISO makes of a load in the phase that is set."""
        from pypardiso.pardiso_wrapper import PyPardisoError

        try:
            call = self.factors._call_pardiso
            return np.asarray(
                _threads().submit(_alone, self._lock, call, self.upper, load).result()
            )
        except PyPardisoError as error:
            if error.value in NO_MEMORY:
                raise out_of_memory(self.n) from error
            raise
