"""Small problems of the default method by one compiled call: scaling, the first sweeps and the
certificate (`small` in kernels/sweeps.c), by the formulas of contactopt.problem.scaling,
contactopt.problem.certificate and contactopt.methods.auto. What it does not solve goes on as
without it, and so does everything where the package was installed without a compiler.
"""

from __future__ import annotations

import time

import numpy as np
import scipy.sparse as sp

from contactopt.methods import constants
from contactopt.methods.auto import Auto
from contactopt.methods.kernels import gauss_seidel
from contactopt.methods.notes import FEW
from contactopt.problem import InterfaceProblem, Solution, Status
from contactopt.problem.laws.coulomb import Coulomb

NAME = repr(Auto())


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
    if sp.issparse(Q):
        rows = Q.indptr.astype(np.int64), Q.indices.astype(np.int64), Q.data
    elif isinstance(Q, np.ndarray):
        rows = gauss_seidel.NONE, gauss_seidel.NONE, Q
    else:
        return None, None
    begin, (k, dim) = time.perf_counter(), problem.q.shape
    r = np.zeros((k, dim))
    cost = rows[2].size + constants.LOCAL * k
    if cost > constants.QUICK:
        return None, None
    # all digits cost less than the condition of few contacts (contactopt.methods.notes)
    look = np.inf if k <= FEW else constants.LOOK / cost
    arrays = *(np.ascontiguousarray(a) for a in (rows[2], law.coefficient, problem.q)), r
    given = constants.SWEEPS_KEPT, constants.FIRST_SWEEPS
    enough = constants.NEARLY_SWEPT, constants.SWEPT
    residual = compiled(dim, *rows[:2], *arrays, *given, *enough, look, tol)
    if not residual <= tol:
        return None, r
    seconds = time.perf_counter() - begin
    row = {"residual": residual, "change": float(np.any(r[:, 1:])), "seconds": seconds}
    phases = {"solve": seconds, "certificate": 0.0, "checks": 0.0}  # it is all one call
    status = Status.SOLVED
    return Solution(
        r, np.zeros(0), status, residual, 1, NAME, (row,), phases, status.sentence
    ), None
