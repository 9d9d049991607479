"""The normal and the tangential problem from products with Q alone: semismooth Newton methods on r
= P(r - rho u), where P projects one kind of component on half-lines, intervals or discs and leaves
the other as it is given. Each step is one PCG of contactopt.methods.kernels.krylov.
"""

from itertools import islice

import numpy as np

from contactopt.errors import BackendError
from contactopt.linear.operators import diagonal
from contactopt.methods import constants
from contactopt.methods.kernels.krylov import Krylov
from contactopt.methods.kernels.newton_loop import newton_iterates
from contactopt.methods.kernels.semismooth import Equations, Evaluated, Projection, Steps
from contactopt.methods.method import Iterate
from contactopt.methods.preconditioners import Preconditioner
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import disc_derivative, half_line_derivative

EXACT = 1e-10  # residual relative to the size of the forces at which a subproblem is solved


class KrylovSubproblem:
    """One kind of components of a dimensionless problem, with the mask (p,) of its multipliers."""

    def __init__(
        self, problem: InterfaceProblem, P: Preconditioner, columns: np.ndarray, normal: bool
    ):
        self.problem, self.P, self.columns, self.normal = problem, P, columns, normal
        self.own = slice(0, 1) if normal else slice(1, None)
        compliance = diagonal(problem.Q).reshape(problem.q.shape)
        self.compliance = compliance[:, 0] if normal else compliance[:, 1:].mean(axis=1)

    def solve(self, r: np.ndarray, multipliers: np.ndarray) -> Iterate:
        """r with its own components new, and multipliers; BackendError far from a solution."""
        equations = self._equations(r, multipliers, 0.0, 0.0)
        point = r, multipliers[self.columns]
        if not r[:, self.own].any():
            point = self._glued(*point, equations)
        residual, point = self._active_sets(equations, *point)
        size, weight = max(1.0, float(np.linalg.norm(point[0]))), 1.0
        for _ in range(60):  # proximal steps
            if residual <= EXACT * size:
                return point
            left, new = self._active_sets(self._equations(r, multipliers, point[0], weight), *point)
            if left <= constants.SUCCESS * residual:
                point, weight = new, weight / constants.WEIGHT_FALL
                residual = equations.evaluate(*point)[0]
            else:
                weight *= constants.WEIGHT_RISE
        if residual > 1e-5 * size:  # then there is no answer
            kind = "normal" if self.normal else "tangential"
            raise BackendError(f"backend 'pcg' misses the {kind} problem by {residual / size:.1e}")
        return point

    def _equations(
        self, r: np.ndarray, multipliers: np.ndarray, center: np.ndarray | float, weight: float
    ) -> Equations:
        problem, own = self.problem, self.columns
        q = problem.q + (problem.V[:, ~own] @ multipliers[~own]).reshape(r.shape)
        V, s, rho = problem.V[:, own], problem.s[own], 1 / (self.compliance + weight)
        return Equations(problem.Q, q, V, s, self._projection(r), rho, center, weight)

    def _active_sets(
        self, equations: Equations, r: np.ndarray, lam: np.ndarray
    ) -> tuple[float, Iterate]:
        """The best of ACTIVE_SETS Newton iterates, and its residual."""
        best, point, last = np.inf, (r, lam), np.inf

        def accuracy(at: Evaluated) -> float:
            nonlocal last
            falls, last = min(0.1 * EXACT * size / at.residual, at.residual / last), at.residual
            return min(1e-2, max(1e-8, falls))

        system = Steps(equations, Krylov(self.P), accuracy)
        for at in islice(newton_iterates(system, system.evaluate(point)), constants.ACTIVE_SETS):
            if at.residual < best:
                best, point = at.residual, at.point
            size = max(1.0, float(np.linalg.norm(at.point[0])))
            if at.residual <= EXACT * size:
                break
        return best, point

    def _glued(self, r: np.ndarray, lam: np.ndarray, equations: Equations) -> Iterate:
        """All contacts held by whatever force it takes."""
        D = np.zeros((*r.shape, r.shape[1]))
        D[:, self.own, self.own] = np.eye(r.shape[1])[self.own, self.own]
        error = np.zeros(r.shape)
        u = equations.displacements(r, lam)[:, self.own]
        error[:, self.own] = -equations.rho[:, None] * u
        balance = equations.V.T @ r.ravel() + equations.s
        step = Krylov(self.P)(equations, Evaluated((r, lam), np.inf, error, balance, D), 1e-2)
        return (r, lam) if step is None else (r + step[0], lam + step[1])

    def _projection(self, given: np.ndarray) -> Projection:
        """The projection of the own components of y (k, dim) beside the `given`."""
        own, low, radius = self.own, self.problem.law.lowest, self.problem.law.bound(given[:, 0])

        def project(y: np.ndarray) -> Iterate:
            P, D = given.copy(), np.zeros((*y.shape, y.shape[1]))
            if not self.normal:
                P[:, own], D[:, own, own] = disc_derivative(y[:, own], radius)
            else:
                P[:, own], D[:, own, own] = half_line_derivative(y[:, own], low)
            return P, D

        return project
