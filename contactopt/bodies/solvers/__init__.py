"""The linear system A x = b of one elastic body: sparse factors or multigrid, each a BodySolver.

A solver is a class in a module of its own and a line of SOLVERS. It is made from a
contactopt.bodies.solvers.system.System.
"""

import logging
from importlib import import_module
from importlib.util import find_spec

from contactopt.bodies.solvers.constants import FACTORS_UP_TO, PARDISO_FROM
from contactopt.bodies.solvers.system import BodySolver, System
from contactopt.errors import InputError

# name -> (module, class, what it is)
ROOM = "contactopt.bodies.solvers"
SOLVERS = {
    "superlu": (f"{ROOM}.superlu", "SuperLUSolver", "sparse factors of SciPy's SuperLU"),
    "pardiso": (f"{ROOM}.pardiso", "PardisoSolver", "sparse factors of oneMKL PARDISO (pypardiso)"),
    "multigrid": (
        f"{ROOM}.multigrid",
        "MultigridSolver",
        "conjugate gradients with a V-cycle of smoothed aggregation (pyamg)",
    ),
}


def make_solver(name: str, system: System) -> BodySolver:
    """Make the solver of a body's linear system, with its factors or its multigrid levels: a key of
    SOLVERS, or 'auto' for the cheapest one (see `choose`).

    InputError for a name that is not in the table, or a package that is not installed.
    """
    n, dim = system.A.shape[0], len(system.points)
    kind = solver_type(name, n, dim)
    logging.getLogger(__name__).info("body of %d unknowns in %dD: solver %s", n, dim, kind.name)
    return kind(system)


def solver_type(name: str, n: int, dim: int) -> type[BodySolver]:
    """The class of the solver that `make_solver` would make of n unknowns in `dim` dimensions.

    Its attributes `iterative` and `releases_lock` are known before there is a matrix. InputError
    for a name that is not in SOLVERS.
    """
    if isinstance(name, str) and name == "auto":
        name = choose(n, dim, find_spec("pypardiso") is not None)
    if not isinstance(name, str) or name not in SOLVERS:
        raise InputError(f"unknown body solver {name!r}; choose from auto, {', '.join(SOLVERS)}.")
    module, cls, _ = SOLVERS[name]
    kind: type[BodySolver] = getattr(import_module(module), cls)
    return kind


def solvers_there() -> tuple[str, ...]:
    """The names of the solvers whose packages are installed."""
    return tuple(name for name in SOLVERS if name != "pardiso" or find_spec("pypardiso"))


def choose(n: int, dim: int, pardiso: bool = False) -> str:
    """Choose the cheapest solver, a name in SOLVERS, of a body of n unknowns in `dim` dimensions.

    Sparse factors have about n log n entries in the plane and n^(4/3) in space, and take n^(3/2)
    and n^2 operations. The work and the memory of multigrid grow with n. The limits stand in
    contactopt.bodies.solvers.constants. Where a scene is at hand, contactopt.coupling.costs knows
    more.
    """
    factors = "pardiso" if pardiso and n > PARDISO_FROM else "superlu"
    return factors if dim == 2 or n <= FACTORS_UP_TO[factors] else "multigrid"
