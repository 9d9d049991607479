"""Second-order cone programs through cvxpy."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as la

from contactopt.backends import CONIC, Backend, find
from contactopt.errors import BackendError


@dataclass(eq=False)
class DiscSOCP:
    """models.tangential_disc_program, compiled once and solved again with new parameters."""

    backend: Backend
    program: Any
    variable: Any
    parameters: dict[str, Any]

    @classmethod
    def using(cls, name: str, Q: np.ndarray, A: np.ndarray) -> DiscSOCP:
        from contactopt.models import tangential_disc_program

        backend = find(name, CONIC)
        Q = (Q + Q.T) / 2
        _check_semidefinite(Q)
        return cls(backend, *tangential_disc_program(Q, A))

    def solve(self, c: np.ndarray, b: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """t (2k,) and the multipliers (p,) of A t = b; BackendError, naming the backend, if there is no answer."""
        import cvxpy as cp

        self.parameters["c"].value, self.parameters["g"].value = c, radius
        if len(b):
            self.parameters["b"].value = b
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                self.program.solve(solver=self.backend.name.upper(), **self.backend.settings)
        except (cp.SolverError, ValueError, ArithmeticError) as error:
            raise BackendError(f"conic backend '{self.backend.name}' failed: {error}") from error
        t = self.variable.value
        if t is None or not np.all(np.isfinite(t)):
            raise BackendError(f"conic backend '{self.backend.name}' gave no answer: {self.program.status}.")
        y = self.program.constraints[-1].dual_value if len(b) else np.zeros(0)
        return np.asarray(t), np.asarray(y, dtype=float).reshape(len(b))


def _check_semidefinite(Q: np.ndarray) -> None:
    """Cholesky of Q plus rounding: cvxpy's own test of convexity fails at random and on small numbers."""
    try:
        la.cholesky(Q + 1e-10 * np.trace(Q) / max(1, len(Q)) * np.eye(len(Q)), check_finite=False)
    except la.LinAlgError as error:
        raise BackendError(
            "the tangential compliance is not positive semidefinite, so its program is not convex."
        ) from error
