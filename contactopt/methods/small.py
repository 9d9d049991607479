"""Small problems of the default method in a few calls: the first sweeps of
contactopt.methods.auto, compiled and in the units of the problem (`small` in kernels/sweeps.c), and
the certificate. Sweeps need no scaling. What they do not solve goes on as without them, and so does
everything where the package was installed without a compiler.
"""

from __future__ import annotations

import time

import numpy as np

from contactopt.linear.operators import form
from contactopt.methods import constants
from contactopt.methods.auto import Auto
from contactopt.methods.kernels import gauss_seidel
from contactopt.methods.notes import FEW
from contactopt.problem import InterfaceProblem, Solution, Status, natural_map_residual
from contactopt.problem.laws.coulomb import Coulomb

NAME, NONE = repr(Auto()), np.zeros(0)


def solve_small(problem: InterfaceProblem, tol: float) -> tuple[Solution | None, np.ndarray | None]:
    """The certified solution; None and where the sweeps ended, or None twice where they were not
    made.
    """
    Q, law = problem.Q, problem.law
    compiled = gauss_seidel.compiled("small")
    if compiled is None or not gauss_seidel.Sweeps.can(problem):
        return None, None
    if type(law) is not Coulomb or not problem.q.size:
        return None, None
    if form(Q) == "sparse":
        rows = Q.indptr.astype(np.int64), Q.indices.astype(np.int64), Q.data
    elif form(Q) == "array":
        rows = gauss_seidel.NONE, gauss_seidel.NONE, Q
    else:
        return None, None
    begin, (k, dim) = time.perf_counter(), problem.q.shape
    cost = rows[2].size + constants.LOCAL * k
    if cost > constants.QUICK:
        return None, None
    # all digits cost less than the condition of few contacts (contactopt.methods.notes)
    look = np.inf if k <= FEW else constants.LOOK / cost
    r = np.zeros((k, dim))
    arrays = *(np.ascontiguousarray(a) for a in (rows[2], law.coefficient, problem.q)), r
    given = dim, *rows[:2], *arrays, constants.SWEEPS_KEPT
    nearly, swept = constants.NEARLY_SWEPT, constants.SWEPT
    done, there = compiled(*given, constants.FIRST_SWEEPS, nearly, swept, look)
    if not there:
        return None, r
    swept_at = time.perf_counter()
    residual = natural_map_residual(problem, r, NONE)
    if not residual <= tol and done > look:
        compiled(*given, 2 * done, swept, swept, 0.0)
        residual = natural_map_residual(problem, r, NONE)
    if not residual <= tol:
        return None, None
    sweeping, certifying = swept_at - begin, time.perf_counter() - swept_at
    phases = {"solve": sweeping, "certificate": certifying, "checks": 0.0}
    row = {"residual": residual, "change": float(np.any(r[:, 1:])), "seconds": sweeping}
    end = Status.SOLVED, residual, 1, NAME, (row,), phases, Status.SOLVED.sentence
    return Solution(r, np.zeros(0), *end), None
