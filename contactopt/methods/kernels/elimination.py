"""Newton's steps go round in circles where a few contacts of one summit turn their slip about. They
are solved by themselves, with the forces of all others held, and leave Newton's method a problem
without them.

Sources: Lanzkron, Rose, Wilkes (1996), An analysis of approximate nonlinear elimination, SIAM J.
Sci. Comput. 17, 538-559; Hwang, Su, Cai (2015), A parallel adaptive nonlinear elimination
preconditioned inexact Newton method for transonic full potential equation.
"""

from itertools import islice

import numpy as np

from contactopt.methods import constants, find_method
from contactopt.methods.kernels.alart_curnier import coulomb_equations
from contactopt.methods.kernels.levels import Evaluation, Level
from contactopt.problem import InterfaceProblem


def eliminated(level: Level, at: Evaluation) -> Evaluation:
    """Solve alone the contacts with most of the residual; returns errors and forces."""
    some = _worst(level, at)
    if not len(some) or len(level.components) < level.kernel.dim:
        return at
    (r, lam), Q = at.point, level.kernel.entries(some)
    moved = at.moved[:, some].T
    begin = np.ascontiguousarray(r[:, some].T)
    q = moved - (Q @ begin.ravel()).reshape(begin.shape)
    found = _solution(InterfaceProblem(Q, q, level.law.select(some)), begin)
    other = r.copy()
    other[:, some] = found.T
    new = level.evaluate(other, lam)
    return new if new.residual < at.residual else at


def _worst(level: Level, at: Evaluation) -> np.ndarray:
    """The contacts with most of the error and those around; none if these are many."""
    size = np.sum(at.error**2, axis=0)
    most = min(constants.MOST_LOCAL, int(constants.FEW_OF_ALL * len(at.closed)))
    if not most:
        return np.zeros(0, dtype=int)
    largest = np.argpartition(-size, most - 1)[:most]
    largest = largest[np.argsort(-size[largest])]
    count = int(np.searchsorted(np.cumsum(size[largest]), constants.LOCAL_SHARE * size.sum())) + 1
    if count > most:
        return largest[:0]
    marked = np.zeros(len(size), dtype=bool)
    marked[largest[:count]] = True
    from scipy.ndimage import binary_dilation  # late, since it takes long to import

    wide = binary_dilation(marked.reshape(level.kernel.grid), iterations=constants.AROUND).ravel()
    return np.flatnonzero(wide if np.count_nonzero(wide) <= most else marked)


def _solution(problem: InterfaceProblem, begin: np.ndarray) -> np.ndarray:
    """The best forces (m, dim) that the default method finds."""
    evaluate = coulomb_equations(problem).evaluate
    best, none = begin, np.zeros(0)
    least = first = evaluate(best, none)[0]
    for r, *_ in islice(find_method("auto").iterate(problem, (begin, none)), constants.LOCAL_TRIES):
        residual = evaluate(r, none)[0]
        if residual < least:
            best, least = r, residual
        if least <= constants.LOCAL_ENOUGH * first:
            break
    return best
