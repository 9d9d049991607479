"""The linear system A x = b of one elastic body behind one seam: sparse factors or multigrid.

A is the stiffness on the free displacement unknowns, symmetric positive definite. Every solver is made by a function
of SOLVERS from a System.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache, cached_property
from importlib.util import find_spec
from itertools import count
from typing import Any, NamedTuple, Protocol

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.dissection import elimination_order
from contactopt.errors import InputError
from contactopt.multigrid import VCycle, conjugate_gradients
from contactopt.scene import check_number

RTOL = 1e-10  # default accuracy of an iterative solve
SMALL = 20_000  # unknowns of a 3D body for which PARDISO is not worth its start
LARGEST = {"superlu": 100_000, "pardiso": 200_000}  # unknowns of a 3D body that is factorised


class System(NamedTuple):
    """What the solvers of one body are made from.

    A          (n, n) sparse [force / length]
    node       (n,) mesh node of each unknown;   component  (n,) its component, 0 .. dim - 1
    points     (dim, nodes) coordinates of the mesh nodes
    last       (m,) unknowns whose block of the inverse is asked for (the contact unknowns), or None
    """

    A: sp.csr_matrix
    node: np.ndarray
    component: np.ndarray
    points: np.ndarray
    last: np.ndarray | None = None


class BodySolver(Protocol):
    """Solves A x = b. Different solvers may work in different threads; one solver serves one thread at a time.

    name        its name in SOLVERS
    last        unknowns whose block of the inverse can be asked for, or None
    iterations  conjugate gradient iterations of the last call of `solve`, the most of any column; 0 for factors
    """

    name: str
    last: np.ndarray | None
    iterations: int

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """A^-1 load; load (n,) or (n, j). `rtol` (None: 1e-10) bounds an iterative solver's error, see there."""

    def trailing_inverse(self) -> np.ndarray:
        """The block of A^-1 on the unknowns `last`, in their order, (m, m) symmetric; InputError without `last`."""

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """That block times `load`, (m,) or (m, j)."""


def make_solver(name: str, system: System) -> BodySolver:
    """The solver `name`, a key of SOLVERS or 'auto', of a body.

    Raises InputError for an unknown name or a missing package.
    """
    if name == "auto":
        name = choose(system.A.shape[0], len(system.points), find_spec("pypardiso") is not None)
    if name not in SOLVERS:
        raise InputError(f"unknown body solver {name!r}; choose from auto, {', '.join(SOLVERS)}.")
    return SOLVERS[name](system)


def choose(n: int, dim: int, pardiso: bool = False) -> str:
    """The cheapest solver for n unknowns in `dim` dimensions; `pardiso` only where it is installed.

    Factors in an order of nested dissection have about n log n entries in 2D, 45 n^(4/3) in 3D, and take n^(3/2) and n^2
    operations; the work of multigrid and its memory grow with n. At LARGEST in 3D the factors take 2 GB, and those of
    SuperLU as long to make as some 20 solves by multigrid (reports/body_solvers). PARDISO takes a second to start.
    """
    if dim == 2 or n <= SMALL:
        return "superlu"
    factors = "pardiso" if pardiso else "superlu"
    return factors if n <= LARGEST[factors] else "multigrid"


class SuperLUSolver:
    """Factors of A in an order of nested dissection, `last` eliminated last: their triangles give its Schur complement."""

    name = "superlu"
    iterations = 0

    def __init__(self, system: System):
        self.last = system.last
        last = np.zeros(0, int) if system.last is None else system.last
        self.order = elimination_order(*system[:4], last)
        ordered = system.A[self.order][:, self.order].tocsc()
        home = _homes()[next(_TURN) % 2]
        self._held = [home.submit(_factors, ordered).result()]
        weakref.finalize(self, home.submit, self._held.clear).atexit = False

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
        factors, m = self.factors, len(_asked(self.last))
        n = factors.shape[0]
        head = n - m
        symmetric = np.array_equal(factors.perm_c, factors.perm_r)
        if not symmetric or not np.array_equal(np.sort(factors.perm_c[head:]), np.arange(head, n)):
            return None
        L, pivots = factors.L[head:, head:].toarray(order="F"), factors.U.diagonal()[head:]
        return L * np.sqrt(pivots), factors.perm_c[head:] - head  # L U = L D L' with D > 0 the pivots

    def trailing_inverse(self) -> np.ndarray:
        if self.trailing_triangle is None:
            return _inverse_block(self, len(self.order))
        return _triangle_inverse(*self.trailing_triangle)

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        """Two triangular solves with the trailing triangle: nothing of the interior is touched."""
        if self.trailing_triangle is None:
            return _block_product(self, len(self.order), load, rtol)
        return _triangle_product(*self.trailing_triangle, load)


_TURN = count()


@cache
def _homes() -> tuple[ThreadPoolExecutor, ThreadPoolExecutor]:
    """Two threads that make and free factors: SuperLU frees its memory only in the thread that took it."""
    return ThreadPoolExecutor(1), ThreadPoolExecutor(1)


def _factors(A: sp.csc_matrix) -> Any:
    return splu(A, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


class PardisoSolver:
    """Cholesky factors of Intel's oneMKL PARDISO in its own nested dissection order (pip install pypardiso)."""

    name = "pardiso"
    iterations = 0

    def __init__(self, system: System):
        try:
            from pypardiso import PyPardisoSolver
        except ImportError as error:
            raise InputError("the body solver 'pardiso' needs the package pypardiso: pip install pypardiso.") from error
        self.last = system.last
        self.upper = sp.triu(system.A, format="csr")
        self.factors = PyPardisoSolver(mtype=2)  # real, symmetric positive definite
        self.factors.factorize(self.upper)
        weakref.finalize(self, self.factors.free_memory, everything=True)  # MKL's memory is not Python's

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        if not load.size:
            return np.zeros(load.shape)
        return np.asarray(self.factors.solve(self.upper, np.asfortranarray(load, dtype=float)))

    @cached_property
    def trailing_triangle(self) -> tuple[np.ndarray, np.ndarray]:
        """As SuperLUSolver's; from a factorisation that ends at the Schur complement."""
        from pypardiso import PyPardisoSolver

        last, n = _asked(self.last), self.upper.shape[0]
        if not len(last):
            return np.zeros((0, 0)), np.zeros(0, int)
        partial = PyPardisoSolver(mtype=2, phase=12)
        for index, value in {1: 1, 2: 2, 10: 13, 21: 1, 36: 1}.items():  # own values; METIS; defaults; Schur complement
            partial.set_iparm(index, value)
        partial.perm = np.zeros(n, dtype=np.int32)
        partial.perm[last] = 1
        S = partial._call_pardiso(self.upper, np.zeros((len(last), len(last))))  # in the order of sorted unknowns
        partial.free_memory(everything=True)
        return np.linalg.cholesky(S), np.argsort(np.argsort(last))

    def trailing_inverse(self) -> np.ndarray:
        return _triangle_inverse(*self.trailing_triangle)

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        return _triangle_product(*self.trailing_triangle, load)


class MultigridSolver:
    """Conjugate gradients preconditioned by contactopt.multigrid (pip install pyamg).

    solve() ends where (r' B r)^1/2, r the residual and B the V-cycle, has fallen by `rtol`: an estimate of the error in
    the energy norm, relative to the solution's. BackendError if it does not get there.
    """

    name = "multigrid"

    def __init__(self, system: System):
        self.last = system.last
        self.iterations = 0
        self.cycle = VCycle(*system[:4])

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        rtol = RTOL if rtol is None else rtol
        check_number("rtol", rtol, low=0.0, high=1.0)
        columns = load.reshape(len(load), -1)
        out = np.zeros(columns.shape)
        self.iterations = 0
        for b, x in zip(columns.T, out.T):
            answer, steps = conjugate_gradients(self.cycle, self.cycle.scale * b, rtol)
            x[:] = self.cycle.scale * answer
            self.iterations = max(self.iterations, steps)
        return out.reshape(load.shape)

    def trailing_inverse(self) -> np.ndarray:
        return _inverse_block(self, len(self.cycle.scale))

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        return _block_product(self, len(self.cycle.scale), load, rtol)


def _asked(last: np.ndarray | None) -> np.ndarray:
    if last is None:
        raise InputError("no unknowns were named whose block of the inverse is asked for; give `last`.")
    return last


def _triangle_inverse(R: np.ndarray, place: np.ndarray) -> np.ndarray:
    X = la.solve_triangular(R, np.eye(len(R)), lower=True, check_finite=False)
    C = X.T @ X  # NumPy keeps it symmetric
    return np.asarray(C[np.ix_(place, place)])


def _triangle_product(R: np.ndarray, place: np.ndarray, load: np.ndarray) -> np.ndarray:
    x = np.empty(load.shape)
    x[place] = load
    return np.asarray(la.cho_solve((R, True), x, check_finite=False))[place]


def _inverse_block(solver: Any, n: int, columns: int = 64) -> np.ndarray:
    """The block of the inverse on solver.last by solves with unit loads, some columns at a time."""
    last = _asked(solver.last)
    C = np.empty((len(last), len(last)))
    for start in range(0, len(last), columns):
        chosen = last[start : start + columns]
        unit = np.zeros((n, len(chosen)))
        unit[chosen, np.arange(len(chosen))] = 1.0
        C[:, start : start + columns] = solver.solve(unit)[last]
    return np.asarray((C + C.T) / 2)


def _block_product(solver: Any, n: int, load: np.ndarray, rtol: float | None) -> np.ndarray:
    """The block of the inverse on solver.last times load (m,) or (m, j), by a solve."""
    last = _asked(solver.last)
    full = np.zeros((n, *load.shape[1:]))
    full[last] = load
    return np.asarray(solver.solve(full, rtol)[last])


SOLVERS: dict[str, Callable[[System], BodySolver]] = {
    "superlu": SuperLUSolver,
    "pardiso": PardisoSolver,
    "multigrid": MultigridSolver,
}
