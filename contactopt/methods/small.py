"""Small problems of the default method in one call: the first sweeps of contactopt.methods.auto and
the certificate, compiled and in the units of the problem (`certified` in kernels/sweeps.c). Sweeps
need no scaling. What they do not solve goes on as without them, and so does everything where the
package was installed without a compiler.
"""

import time

import numpy as np

from contactopt.linear.operators import form
from contactopt.methods import constants
from contactopt.methods.auto import Auto
from contactopt.methods.kernels import gauss_seidel
from contactopt.methods.method import checked_start
from contactopt.methods.notes import FEW
from contactopt.problem import InterfaceProblem, Solution, Status
from contactopt.problem.laws.coulomb import Coulomb

NAME = repr(Auto())


def solve_small(
    problem: InterfaceProblem, tol: float, start: Solution | None = None
) -> tuple[Solution | None, np.ndarray | None]:
    """The certified solution; or None, and where the sweeps ended, None if they were not made."""
    begin = time.perf_counter()
    if (given := arrays_of(problem)) is None:
        return None, None
    cost = given[1][2].size + constants.LOCAL * problem.contacts
    if cost > constants.QUICK:
        return None, None
    # all digits cost less than the condition of few contacts (contactopt.methods.notes)
    look = np.inf if problem.contacts <= FEW else constants.LOOK / cost
    first = None if start is None else checked_start(start, problem)[0]
    residual, r = certified(given, constants.FIRST_SWEEPS, look, tol, first)
    if not residual <= tol:
        return None, r
    seconds = time.perf_counter() - begin
    phases = {"solve": seconds, "certificate": 0.0, "checks": 0.0}
    row = {"residual": residual, "change": float(r[:, 1:].any()), "seconds": seconds}
    end = Status.SOLVED, residual, 1, NAME, (row,), phases, Status.SOLVED.sentence
    return Solution(r, np.zeros(0), *end), None


def arrays_of(problem: InterfaceProblem) -> tuple[int, list[np.ndarray]] | None:
    """Dimension, rows of Q, friction and q for the compiled code; None if it cannot take them."""
    if type(problem.law) is not Coulomb or not problem.q.size or len(problem.s):
        return None
    kind, Q, none = form(problem.Q), problem.Q, gauss_seidel.NONE
    if gauss_seidel.compiled("certified") is None or kind not in ("array", "sparse"):
        return None
    if kind == "sparse":
        rows = Q.indptr.astype(np.int64), Q.indices.astype(np.int64), Q.data
    else:
        rows = none, none, np.ascontiguousarray(Q)
    both = np.ascontiguousarray(problem.law.coefficient), np.ascontiguousarray(problem.q)
    return problem.dim, [*rows, *both]


def certified(
    given: tuple[int, list[np.ndarray]],
    most: int,
    look: float,
    tol: float,
    r: np.ndarray | None = None,
) -> tuple[float, np.ndarray]:
    """The certificate after sweeps from r (k, dim), infinite if they diverge, and their forces."""
    dim, arrays = given
    r = np.zeros(arrays[-1].shape) if r is None else np.array(r, float, order="C")
    numbers = constants.NEARLY_SWEPT, constants.SWEPT, look, tol
    kept = constants.SWEEPS_KEPT, constants.FIRST_BETWEEN
    compiled = gauss_seidel.compiled("certified")
    assert compiled is not None
    return float(compiled(dim, *arrays, r, *kept, most, *numbers)), r
