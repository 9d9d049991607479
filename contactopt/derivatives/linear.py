"""The matrix M of Newton's last step and its transpose: solved by factors, by products with Q, or
with the bodies at once.

    M = [[I - D + D rho Q, D rho V], [V', 0]]

Where Q is an array or sparse, factors of M serve both (contactopt.derivatives.factors). Else the
transposed system is one of the same kind, with D' in place of D. Let M' (a, b) = (g, h) and z = rho
D' a. Multiply the first rows, (I - D') a + Q z + V b = g, by rho D', which commutes with I - D':

    [[I - D' + rho D' Q, rho D' V], [V', 0]] (z, b) = (rho D' g, h),   a = z / rho + g - Q z - V b.

Every form of Q has a function that makes the solution of such a system, the one of Newton's method
(contactopt.methods.kernels). Iterative solves are repeated on what is left of the right side until
it is small enough.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from contactopt.derivatives.constants import INNER, ROUND
from contactopt.derivatives.factors import UNIQUE, Factors, SparseFactors, dense_factors
from contactopt.errors import InputError
from contactopt.linear.operators import Interface, InterfaceOperator
from contactopt.linear.saddle_point import CoupledForm
from contactopt.linear.stacked import Stacked, norm
from contactopt.methods.kernels.alart_curnier import coulomb_equations
from contactopt.methods.kernels.coupled_newton import Coupled, fitted
from contactopt.methods.kernels.krylov import model_of
from contactopt.methods.kernels.linearised import Linearised
from contactopt.problem import InterfaceProblem, dimensionless

ACCURACY = 1e-11  # relative residual of an iterative solve
ROUNDS = 12  # of GMRES, which gain four digits each

# error (k d,), balance (p,) -> dr and dlambda of these shapes
Solve = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def transposed(Q: Interface) -> Interface:
    """Q'; an operator is symmetric."""
    return Q if isinstance(Q, InterfaceOperator) else Q.T


@dataclass(frozen=True, eq=False)
class Tangent:
    """M at a solution, in the units of its problem.

    problem  the interface problem, and V its motions without rounding
    rho      (k,) steps of the natural map [force / length]
    D        (k, d, d) derivative of the map P
    """

    problem: InterfaceProblem
    V: np.ndarray
    rho: np.ndarray
    D: np.ndarray

    def slope(self, moved: np.ndarray) -> np.ndarray:
        """D rho moved (k d,)."""
        blocks = moved.reshape(*self.D.shape[:2], 1)
        return np.asarray((self.D @ (self.rho[:, None, None] * blocks)).reshape(moved.shape))

    @cached_property
    def factors(self) -> Factors:
        """The factors of M, where Q is known by its entries."""
        make = SparseFactors if sp.issparse(self.problem.Q) else dense_factors
        return make(self.problem.Q, self.V, self.rho, self.D)

    @cached_property
    def transposed(self) -> Tangent:
        """The system for z and b of this module's head, for a symmetric Q."""
        return replace(self, D=self.D.transpose(0, 2, 1))

    def solve_transposed(
        self, by_r: np.ndarray, by_multipliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """z (k d,) and b (p,) of M' (a, b) = (by_r, by_multipliers)."""
        back = self.transposed
        if isinstance(self.problem.Q, InterfaceOperator):
            return back.solve(back.slope(by_r), by_multipliers)
        a, b = np.split(self.factors.back(np.append(by_r, by_multipliers)), [len(by_r)])
        return back.slope(a), b

    def multipliers(self, by_r: np.ndarray, z: np.ndarray, b: np.ndarray) -> np.ndarray:
        """a (k d,), for what solve_transposed returned; one product with Q'."""
        rho = np.repeat(self.rho, self.D.shape[1])
        return np.asarray(z / rho + by_r - transposed(self.problem.Q) @ z - self.V @ b)

    @cached_property
    def solve(self) -> Solve:
        """The solver of M (dr, dlambda) = (error, balance); InputError where M is singular."""
        if not np.any(self.D) and not self.V.shape[1]:
            return lambda error, balance: (error, balance)
        if isinstance(self.problem.Q, InterfaceOperator):
            return _by_iteration(self)

        def solve(error: np.ndarray, balance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            dr, multipliers = np.split(self.factors.solve(np.append(error, balance)), [len(error)])
            return dr, multipliers

        return solve


def _by_iteration(tangent: Tangent) -> Solve:
    """In the dimensionless problem, where the methods know the sizes of things."""
    scaled, scales = dimensionless(tangent.problem)
    rho, form = tangent.rho * scales.length / scales.force, scaled.Q.coupled
    linearised = Linearised(replace(coulomb_equations(scaled), rho=rho), tangent.D)
    inner = (
        _by_products(scaled, linearised) if form is None else _with_bodies(scaled, linearised, form)
    )

    def solve(error: np.ndarray, balance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        unit = scales.multipliers / (scales.force * scales.length)
        return scales.to_physical(*inner(error / scales.force, balance * unit))

    return solve


def _by_products(problem: InterfaceProblem, linearised: Linearised) -> Solve:
    """By products with Q: GMRES, preconditioned by the system with the model of Q."""
    inverse = linearised.inverse(model_of(problem), INNER)
    Q, V = problem.Q, problem.V

    def product(x: Stacked) -> Stacked:
        dr, multipliers = x.parts
        return Stacked((linearised.rows(dr, Q @ dr + V @ multipliers), V.T @ dr))

    def approximate(rest: Stacked) -> Stacked:
        error, balance = rest.parts
        return Stacked(linearised.solve(lambda x: Q @ x, inverse, error, -balance, ROUND))

    def solve(error: np.ndarray, balance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = _refined(product, approximate, Stacked((error, balance)), 1.0)
        return found.parts[0], found.parts[1]

    return solve


def _with_bodies(problem: InterfaceProblem, linearised: Linearised, form: CoupledForm) -> Solve:
    """With the equilibrium of the bodies beside the contacts, without products with Q."""
    P = fitted(model_of(problem, deflate=False), form, problem.V)
    coupled, none = Coupled(linearised.equations, form, P), form.pulled(np.zeros(problem.q.size))

    def solve(error: np.ndarray, balance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        right = Stacked((*none.parts, error, balance))
        found = _refined(
            lambda x: coupled.product(linearised, x),
            lambda rest: coupled.change(rest, linearised, ROUND),
            right,
            coupled.weights,
        )
        return found.parts[-2], found.parts[-1]

    return solve


def _refined(
    product: Callable[[Stacked], Stacked],
    solve: Callable[[Stacked], Stacked],
    right: Stacked,
    weights: Stacked | float,
) -> Stacked:
    """Solve A x = b by `solve` again and again for what is left, until |W (b - A x)| / |W b| is
    ACCURACY; InputError if that is out of reach, because the solution is not unique.
    """
    x, rest = 0.0 * right, right
    size = last = norm(weights * right)
    for _ in range(ROUNDS):
        if last <= ACCURACY * size:
            return x
        x = x + solve(rest)
        rest = right - product(x)
        now = norm(weights * rest)
        if not now < 0.5 * last:
            break
        last = now
    if last > 1e3 * ACCURACY * size:
        raise InputError(UNIQUE)
    return x
