"""Quadratic programs through qpsolvers."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from contactopt.errors import BackendError
from contactopt.linear.deadline import TimeUp, check_time
from contactopt.methods.backends import QP, Backend, find
from contactopt.methods.backends.child import Child


@dataclass(eq=False)
class BoxQP:
    """min x'Px/2 + c'x subject to A x = b, low <= x <= high, for one P (n, n) and A (p, n)."""

    backend: Backend
    P: np.ndarray
    A: np.ndarray
    child: Child = field(default_factory=Child)  # for backends that take no time limit

    @classmethod
    def using(cls, name: str, P: np.ndarray, A: np.ndarray) -> BoxQP:
        return cls(find(name, QP), np.ascontiguousarray((P + P.T) / 2), np.ascontiguousarray(A))

    def solve(
        self,
        c: np.ndarray,
        b: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
        start: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """x (n,) and the multipliers y (p,) of A x = b, both checked; BackendError on failure."""
        import qpsolvers

        form = sp.csc_matrix if self.backend.sparse else np.asarray
        arguments = {"P": form(self.P), "q": c}
        arguments |= {"A": form(self.A), "b": b} if len(b) else {}
        for name, bound in (("lb", low), ("ub", high)):
            arguments[name] = bound if np.any(np.isfinite(bound)) else None
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                if Child.needed(self.backend, len(c)):
                    settings = self.backend.timed()
                    x, y = self.child.solve(arguments, self.backend.name, start, settings)
                else:
                    problem, name = qpsolvers.Problem(**arguments), self.backend.name
                    for settings in self.backend.rounds():
                        answer = qpsolvers.solve_problem(problem, name, initvals=start, **settings)
                        if answer.found:
                            break
                    x, y = answer.x, answer.y
            check_time()
        except TimeUp:
            raise
        except Exception as error:  # any backend may raise anything: it must not end a campaign
            raise BackendError(f"QP backend '{self.backend.name}' failed: {error}") from error
        if x is None or not np.all(np.isfinite(x)):
            raise BackendError(
                f"QP backend '{self.backend.name}' gave no answer; the problem may be infeasible."
            )
        y = y if y is not None and np.size(y) == len(b) else np.zeros(len(b))
        return np.asarray(x), np.nan_to_num(np.asarray(y, dtype=float))
