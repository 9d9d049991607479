"""Sweeps of the nonsmooth Gauss-Seidel method by compiled code, where the package was installed
with a compiler.

The formulas are those of contactopt.methods.nsgs, which does the same in Python, much more slowly.
Sweeps may be accelerated: some of them then start from the combination of the last results whose
changes would cancel best (Anderson's acceleration). In the plane the sweeps find the states of the
contacts, and elimination the forces that fit them, which the next sweep confirms or not.

Sources: Walker, Ni (2011), Anderson acceleration for fixed-point iterations; Pratapa,
Suryanarayana, Pask (2016) for the steps between.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from contactopt.linear.operators import form
from contactopt.problem import InterfaceProblem

try:
    from contactopt.methods.kernels import sweeps  # type: ignore[attr-defined]
except ImportError:  # installed without a compiler
    sweeps = None
NONE = np.zeros(0, dtype=np.int64)


def compiled(name: str) -> Callable[..., Any] | None:
    """A function of kernels/sweeps.c; None where there is none, or an older one."""
    return getattr(sweeps, name, None)


class Sweeps:
    """Sweeps over the contacts of a problem without plates, whose Q is an array or sparse.

    memory   number of last sweeps that one starts from, at most 32; 0: not accelerated
    between  number of sweeps between two that do so, after the first 50
    """

    def __init__(self, problem: InterfaceProblem, memory: int = 0, between: int = 1):
        Q, (k, dim) = problem.Q, problem.q.shape
        rows = (Q.indptr, Q.indices, Q.data) if form(Q) == "sparse" else (NONE, NONE, np.asarray(Q))
        both = (problem.law.lowest != 0).astype(np.uint8)
        places = [np.ascontiguousarray(place, dtype=np.int64) for place in rows[:2]]
        reals = [np.ascontiguousarray(array, float) for array in (rows[2], problem.mu)]
        work = np.zeros(5 + memory**2 + 2 * (memory + 1) * k * dim)
        q = np.ascontiguousarray(problem.q, float)
        self.fixed = dim, *places, *reals, both, q, work, memory
        self.between = between

    @staticmethod
    def can(problem: InterfaceProblem) -> bool:
        """Whether there is compiled code, and the problem has no plates."""
        return not len(problem.s) and sweeps is not None

    def __call__(
        self, r: np.ndarray, count: int, share: float = 1.0, enough: float = -1.0
    ) -> tuple[float, int]:
        """Sweep at most `count` times, and change r (k, dim) in place, by this `share` of each
        local change, until a sweep changes less than `enough` of the forces. Returns the change of
        the last sweep over the forces, and the number of sweeps.
        """
        change, done = sweeps.sweep(*self.fixed, r, count, share, enough, self.between)
        return float(change), int(done)
