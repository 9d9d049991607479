"""Small problems of the default method in one call: the first sweeps of contactopt.methods.auto and
the certificate, compiled and in the units of the problem (`solved` in kernels/sweeps.c). Sweeps
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
from contactopt.methods.notes import EXACT, FEW, Notes
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
    k, dense = len(problem.q), not given[1][0].size
    if given[1][2].size + constants.LOCAL * k > constants.QUICK:
        return None, None
    few = dense and k <= FEW  # more digits cost little, and leave less doubt
    enough = min(tol, EXACT) if few else tol
    first = None if start is None else checked_start(start, problem)[0]
    residual, rubs, r = certified(given, constants.FIRST_SWEEPS, enough, first)
    if not residual <= tol:
        return None, r
    seconds = time.perf_counter() - begin
    phases = {"solve": seconds, "certificate": 0.0, "checks": 0.0}
    row = {"residual": residual, "change": rubs, "seconds": seconds}
    none = np.zeros(0)
    notes = Notes((), problem, r, none, residual) if few else ()
    end = Status.SOLVED, residual, 1, NAME, (row,), phases, Status.SOLVED.sentence, notes
    return Solution(r, none, *end), None


def arrays_of(problem: InterfaceProblem) -> tuple[int, list[np.ndarray]] | None:
    """Dimension, rows of Q, friction and q for the compiled code; None if it cannot take them."""
    Q, q, law = problem.Q, problem.q, problem.law
    if type(law) is not Coulomb or not len(q) or len(problem.s):
        return None
    kind = form(Q)
    if gauss_seidel.compiled("solved") is None or kind not in ("array", "sparse"):
        return None
    if kind == "sparse":
        rows = Q.indptr.astype(np.int64), Q.indices.astype(np.int64), Q.data
    else:
        rows = gauss_seidel.NONE, gauss_seidel.NONE, np.ascontiguousarray(Q)
    return q.shape[1], [*rows, np.ascontiguousarray(law.mu), np.ascontiguousarray(q)]


def certified(
    given: tuple[int, list[np.ndarray]],
    most: int,
    enough: float,
    r: np.ndarray | None = None,
) -> tuple[float, float, np.ndarray]:
    """The certificate after sweeps from r (k, dim), infinite if they diverge; 1 if there is
    friction; the forces.
    """
    dim, arrays = given
    r = np.zeros(arrays[-1].shape) if r is None else np.array(r, float, order="C")
    numbers = constants.NEARLY_SWEPT, constants.SWEPT, enough
    kept = constants.SWEEPS_KEPT, constants.FIRST_BETWEEN
    compiled = gauss_seidel.compiled("solved")
    assert compiled is not None
    return *compiled(dim, *arrays, r, *kept, most, *numbers), r
