"""Convex programs through cvxpy, compiled once and solved again with new parameters."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

from contactopt.errors import BackendError
from contactopt.linear.deadline import check_time
from contactopt.methods.backends import CONIC, Backend, find

if TYPE_CHECKING:
    import cvxpy as cp

    from contactopt.models import Program


@dataclass(eq=False)
class Conic:
    """One of contactopt.models' programs and the backend that solves it."""

    backend: Backend
    program: Program

    @classmethod
    def using(cls, name: str, program: Program, Q: np.ndarray) -> Conic:
        """Q is the quadratic form of the program; BackendError if it is not semidefinite."""
        backend = find(name, CONIC)
        check_semidefinite((Q + Q.T) / 2)
        return cls(backend, program)

    def solve(self, **parameters: np.ndarray) -> dict[str, np.ndarray]:
        """The variables and multipliers of the program by name; BackendError without an answer."""
        for name, value in parameters.items():
            self.program.parameters[name].value = value
        run(self.backend, self.program.problem)
        variables = {name: np.asarray(v.value) for name, v in self.program.variables.items()}
        return variables | {name: np.nan_to_num(m) for name, m in self.program.multipliers.items()}


def run(backend: Backend, problem: cp.Problem) -> None:
    """Solve a cvxpy problem; BackendError if the backend crashes or leaves no finite answer."""
    import cvxpy as cp

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for settings in backend.rounds():
                problem.solve(solver=backend.name.upper(), **settings)
                if problem.status == cp.OPTIMAL:
                    break
        check_time()
    except (cp.SolverError, ValueError, ArithmeticError) as error:
        raise BackendError(f"conic backend '{backend.name}' failed: {error}") from error
    answer = [variable.value for variable in problem.variables()]
    if any(value is None for value in answer):
        raise BackendError(f"conic backend '{backend.name}' gave no answer: {problem.status}.")
    if not all(np.all(np.isfinite(value)) for value in answer):
        raise BackendError(f"conic backend '{backend.name}' gave an answer that is not finite.")


def check_semidefinite(Q: np.ndarray) -> None:
    """BackendError unless Q is semidefinite but for rounding: cvxpy's test fails at random."""
    try:
        la.cholesky(Q + 1e-10 * np.trace(Q) / max(1, len(Q)) * np.eye(len(Q)), check_finite=False)
    except la.LinAlgError as error:
        raise BackendError(
            "the compliance is not positive semidefinite, so its program is not convex."
        ) from error
