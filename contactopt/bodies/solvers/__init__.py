"""The linear system A x = b of one elastic body behind one seam: sparse factors (contactopt.bodies.solvers.system) or multigrid.

A is the stiffness on the free displacement unknowns, symmetric positive definite. Every solver is made by a function
of SOLVERS from a System.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from contactopt.bodies.solvers.system import BodySolver, System
from contactopt.errors import InputError

# name -> (module, class, what it is)
SOLVERS = {
    "superlu": ("contactopt.bodies.solvers.superlu", "SuperLUSolver", "sparse factors of SciPy's SuperLU"),
    "pardiso": ("contactopt.bodies.solvers.pardiso", "PardisoSolver", "sparse factors of oneMKL PARDISO (pypardiso)"),
    "multigrid": (
        "contactopt.bodies.solvers.multigrid",
        "MultigridSolver",
        "conjugate gradients with a V-cycle of smoothed aggregation (pyamg)",
    ),
}
SMALL = 20_000  # unknowns of a 3D body for which PARDISO is not worth its start
LARGEST = {"superlu": 100_000, "pardiso": 200_000}  # unknowns of a 3D body that is factorised


def make_solver(name: str, system: System) -> BodySolver:
    """The solver `name`, a key of SOLVERS or 'auto', of a body.

    Raises InputError for an unknown name or a missing package.
    """
    if name == "auto":
        name = choose(system.A.shape[0], len(system.points), find_spec("pypardiso") is not None)
    if name not in SOLVERS:
        raise InputError(f"unknown body solver {name!r}; choose from auto, {', '.join(SOLVERS)}.")
    module, cls, _ = SOLVERS[name]
    made: BodySolver = getattr(import_module(module), cls)(system)
    return made


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
