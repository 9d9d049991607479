"""The linear system A x = b of one elastic body behind one seam: sparse factors (contactopt.factors) or multigrid.

A is the stiffness on the free displacement unknowns, symmetric positive definite. Every solver is made by a function
of SOLVERS from a System.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Protocol

import numpy as np

from contactopt.errors import InputError
from contactopt.factors import PardisoSolver, Product, SuperLUSolver, System, asked, block_product, inverse_block
from contactopt.multigrid import VCycle, conjugate_gradients
from contactopt.scene import check_number

RTOL = 1e-10  # default accuracy of an iterative solve
SMALL = 20_000  # unknowns of a 3D body for which PARDISO is not worth its start
LARGEST = {"superlu": 100_000, "pardiso": 200_000}  # unknowns of a 3D body that is factorised


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

    def restricted(self, at: np.ndarray) -> Product:
        """Products with the block of A^-1 on the unknowns `at` (m,): load (m,) or (m, j), rtol -> as load."""


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
        return inverse_block(self, len(self.cycle.scale))

    def trailing_product(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        return block_product(self, asked(self.last), len(self.cycle.scale), load, rtol)

    def restricted(self, at: np.ndarray) -> Product:
        return lambda load, rtol: block_product(self, at, len(self.cycle.scale), load, rtol)


SOLVERS: dict[str, Callable[[System], BodySolver]] = {
    "superlu": SuperLUSolver,
    "pardiso": PardisoSolver,
    "multigrid": MultigridSolver,
}
