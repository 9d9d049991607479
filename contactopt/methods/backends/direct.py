"""Clarabel without a modelling language: set up once, then only the linear term changes."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from contactopt.errors import BackendError
from contactopt.linear.deadline import check_time, time_left
from contactopt.methods.backends import CONIC, find
from contactopt.methods.backends.conic import check_semidefinite

if TYPE_CHECKING:
    import clarabel  # type: ignore[import-untyped]


@dataclass(eq=False)
class CoulombSOCP:
    """min r' Q r / 2 + c' r subject to |r_t| <= mu r_n at each contact, V' r + s = 0, for many c.

    In the rows A r + y = b, y is zero for the balance and where mu = 0, y >= 0 for normal forces,
    and y lies in second-order cones for the others.
    """

    solver: clarabel.DefaultSolver
    multipliers: int

    @classmethod
    def using(cls, Q: np.ndarray, mu: np.ndarray, V: np.ndarray, s: np.ndarray) -> CoulombSOCP:
        """BackendError if Q is not semidefinite, InputError if clarabel is not installed."""
        backend = find("clarabel", CONIC)
        import clarabel

        Q = (Q + Q.T) / 2
        check_semidefinite(Q)
        k, p = len(mu), V.shape[1]
        dim, rough = len(Q) // k, mu > 0
        blocks, smooth = np.arange(k * dim).reshape(k, dim), ~rough
        scale = np.ones((k, dim))
        scale[rough, 0] = mu[rough]
        rows = -sp.diags(scale.ravel()).tocsr()
        order = blocks[smooth, 1:].ravel(), blocks[smooth, 0], blocks[rough].ravel()
        A = sp.vstack([sp.csr_matrix(V.T), *(rows[own] for own in order)], format="csc")
        equal, above = p + int(smooth.sum()) * (dim - 1), int(smooth.sum())
        cones = [clarabel.ZeroConeT(equal)] if equal else []
        cones += [clarabel.NonnegativeConeT(above)] if above else []
        cones += [clarabel.SecondOrderConeT(dim)] * int(rough.sum())
        settings = clarabel.DefaultSettings()
        fixed = {"verbose": False, "max_threads": 1, "presolve_enable": False}  # it forbids updates
        for name, value in (dict(backend.settings) | fixed).items():
            setattr(settings, name, value)
        b = np.concatenate([-s, np.zeros(A.shape[0] - p)])
        P = sp.triu(sp.csc_matrix(Q), format="csc")
        return cls(clarabel.DefaultSolver(P, np.zeros(len(Q)), A, b, cones, settings), p)

    def solve(self, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """r (k dim,) and multipliers (p,) of the balance; BackendError without an answer."""
        self.solver.update(q=np.ascontiguousarray(c))
        check_time()
        left = time_left()
        if isfinite(left):
            settings = self.solver.get_settings()
            settings.time_limit = left
            self.solver.update(settings=settings)
        answer = self.solver.solve()
        check_time()
        r, status = np.asarray(answer.x), str(answer.status)
        if "Infeasible" in status or not np.all(np.isfinite(r)):
            raise BackendError(f"conic backend 'clarabel' gave no answer: {status}.")
        return r, np.nan_to_num(np.asarray(answer.z)[: self.multipliers])
