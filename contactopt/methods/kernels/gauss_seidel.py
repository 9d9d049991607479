"""Sweeps of the nonsmooth Gauss-Seidel method by compiled code, where the package was installed
with a compiler.

The formulas are those of contactopt.methods.nsgs, which does the same in Python, much more slowly.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from contactopt.methods.kernels.sparse_blocks import blocks_of
from contactopt.problem import InterfaceProblem

try:
    from contactopt.methods.kernels import sweeps  # type: ignore[attr-defined]
except ImportError:  # installed without a compiler
    sweeps = None
NONE = np.zeros(0, dtype=np.int64)


class Sweeps:
    """Sweeps over the contacts of a problem without plates, whose Q is an array or sparse."""

    def __init__(self, problem: InterfaceProblem):
        Q, (k, dim) = problem.Q, problem.q.shape
        if sp.issparse(Q):
            rows, columns, blocks, home = blocks_of(Q, dim)
            places = np.searchsorted(rows, np.arange(k + 1)), columns, home
        else:
            blocks, places = np.asarray(Q), (NONE, NONE, NONE)
        both = (problem.law.lowest != 0).astype(np.uint8)
        integers = [np.ascontiguousarray(place, dtype=np.int64) for place in places]
        reals = [np.ascontiguousarray(array, float) for array in (blocks, problem.mu, problem.q)]
        self.fixed = dim, *integers, reals[0], reals[1], both, reals[2]

    @staticmethod
    def can(problem: InterfaceProblem) -> bool:
        """Whether there is compiled code, and the problem has no plates."""
        return not len(problem.s) and sweeps is not None

    def __call__(self, r: np.ndarray, count: int, share: float = 1.0) -> float:
        """Sweep `count` times, and change r (k, dim) in place.

        share  fraction of each local change that is taken

        Returns the change of the last sweep over the forces.
        """
        return float(sweeps.sweep(*self.fixed, r, count, share))
