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

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as la

from contactopt.derivatives.constants import INNER, ROUND
from contactopt.derivatives.factors import UNIQUE, Factors, SparseFactors, dense_factors
from contactopt.errors import InputError
from contactopt.linear.operators import FINEST, Interface, form, has_entries
from contactopt.linear.stacked import Stacked, norm
from contactopt.methods.constants import LOOSE
from contactopt.methods.kernels.alart_curnier import coulomb_equations
from contactopt.methods.kernels.bonded import Bonded, last_bonded
from contactopt.methods.kernels.coupled_newton import Coupled, fitted
from contactopt.methods.kernels.krylov import model_of
from contactopt.methods.kernels.linearised import Linearised
from contactopt.problem import InterfaceProblem, dimensionless
from contactopt.problem.scaling import scales_of

# error (k d,), balance (p,) -> dr and dlambda of these shapes, and what gives Q dr
Solve = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, Callable[[], np.ndarray]]]

Inner = Callable[[Stacked], Stacked]  # the dimensionless solution for a right side


def transposed(Q: Interface) -> Interface:
    """Q'; an operator is symmetric."""
    return Q if not has_entries(Q) else Q.T


@dataclass(frozen=True, eq=False)
class Tangent:
    """M at a solution, in the units of its problem.

    problem  the interface problem, and V its motions without rounding
    rho      (k,) steps of the natural map [force / length]
    D        (k, d, d) derivative of the map P
    accuracy relative residual of an iterative solve: D is known to the certificate of the solution
    """

    problem: InterfaceProblem
    V: np.ndarray
    rho: np.ndarray
    D: np.ndarray
    accuracy: float = FINEST

    def slope(self, moved: np.ndarray) -> np.ndarray:
        """D rho moved (k d,)."""
        blocks = moved.reshape(*self.D.shape[:2], 1)
        return np.asarray((self.D @ (self.rho[:, None, None] * blocks)).reshape(moved.shape))

    @cached_property
    def factors(self) -> Factors:
        """The factors of M, where Q is known by its entries."""
        make = SparseFactors if form(self.problem.Q) == "sparse" else dense_factors
        return make(self.problem.Q, self.V, self.rho, self.D)

    @cached_property
    def transposed(self) -> Tangent:
        """The system for z and b defined at the top, for a symmetric Q."""
        return replace(self, D=self.D.transpose(0, 2, 1))

    @cached_property
    def other(self) -> Solve | None:
        """What solves the system without factors of M, and only for a symmetric Q."""
        if not has_entries(self.problem.Q):
            return _by_iteration(self)
        made = last_bonded(self.problem)
        return None if made is None else _by_bonded(self, made)

    def solve_transposed(
        self, by_r: np.ndarray, by_multipliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, Callable[[], np.ndarray]]:
        """z (k d,) and b (p,) of M' (a, b) = (by_r, by_multipliers), and what gives a (k d,)."""
        back = self.transposed
        if back.other is not None:
            z, b, moved = back.solve(back.slope(by_r), by_multipliers)
            rho = np.repeat(self.rho, self.D.shape[1])
            return z, b, lambda: z / rho + by_r - moved() - self.V @ b
        a, b = np.split(self.factors.back(np.append(by_r, by_multipliers)), [len(by_r)])
        return back.slope(a), b, lambda: a

    @cached_property
    def solve(self) -> Solve:
        """The solver of M (dr, dlambda) = (error, balance); InputError where M is singular."""
        if self.other is not None:
            return self.other
        Q = self.problem.Q

        def solve(error: np.ndarray, balance: np.ndarray) -> Any:
            dr, multipliers = np.split(self.factors.solve(np.append(error, balance)), [len(error)])
            return dr, multipliers, lambda: Q @ dr

        return solve


def _by_bonded(tangent: Tangent, made: Bonded) -> Solve | None:
    """By the factors that Newton's method has made, while few contacts are open or slip."""
    problem, D = tangent.problem, tangent.D
    scales, loose = scales_of(problem), np.any(np.eye(D.shape[1]) != D, axis=(1, 2))
    if loose.sum() > LOOSE * len(loose):
        return None
    unit, rho = scales.multipliers / scales.length, tangent.rho * scales.length / scales.force

    def solve(error: np.ndarray, balance: np.ndarray) -> Any:
        right = error.reshape(problem.q.shape), -balance * unit
        with warnings.catch_warnings():
            warnings.simplefilter("error", la.LinAlgWarning)
            try:
                dr, multipliers = made.step(rho, *right, D)
            except (la.LinAlgError, la.LinAlgWarning) as failed:
                raise InputError(UNIQUE) from failed
        dr, dlam = dr.ravel(), multipliers * scales.multipliers / scales.force
        return dr, dlam, lambda: problem.Q @ dr

    return solve


def _by_iteration(tangent: Tangent) -> Solve:
    """In the dimensionless problem, where the methods know the sizes of things."""
    problem = tangent.problem
    if not np.any(tangent.D) and not tangent.V.shape[1]:
        return lambda error, balance: (error, balance, lambda: problem.Q @ error)
    scaled, scales = dimensionless(problem)
    rho, form = tangent.rho * scales.length / scales.force, scaled.Q.coupled
    linearised = Linearised(replace(coulomb_equations(scaled), rho=rho), tangent.D)
    make = _by_products if form is None else _with_bodies
    inner = make(scaled, linearised, tangent.accuracy)

    def solve(error: np.ndarray, balance: np.ndarray) -> Any:
        unit = scales.multipliers / (scales.force * scales.length)
        *X, r, multipliers = inner(Stacked((error / scales.force, balance * unit))).parts
        dr, dlam = scales.to_physical(r, multipliers)
        if form is None:
            return dr, dlam, lambda: problem.Q @ dr
        moved = scales.length * Stacked(tuple(X))
        return dr, dlam, lambda: problem.Q.coupled.moved(moved, dr)

    return solve


def _by_products(problem: InterfaceProblem, linearised: Linearised, accuracy: float) -> Inner:
    """By products with Q: GMRES, preconditioned by the system with the model of Q."""
    inverse = linearised.inverse(model_of(problem), INNER)
    Q, V = problem.Q, problem.V

    def product(x: Stacked) -> Stacked:
        dr, multipliers = x.parts
        return Stacked((linearised.rows(dr, Q @ dr + V @ multipliers), V.T @ dr))

    def approximate(rest: Stacked, rtol: float) -> Stacked:
        error, balance = rest.parts
        return Stacked(linearised.solve(lambda x: Q @ x, inverse, error, -balance, rtol))

    return lambda right: _refined(product, approximate, right, 1.0, accuracy)


def _with_bodies(problem: InterfaceProblem, linearised: Linearised, accuracy: float) -> Inner:
    """With the equilibrium of the bodies and that of the contacts, without products with Q."""
    form = problem.Q.coupled
    P = fitted(model_of(problem, deflate=False), form, problem.V)
    coupled, none = Coupled(linearised.equations, form, P), form.pulled(np.zeros(problem.q.size))

    def approximate(rest: Stacked, rtol: float) -> Stacked:
        return coupled.solve(rest, linearised, rtol)

    def product(x: Stacked) -> Stacked:
        return coupled.product(linearised, x)

    return lambda right: _refined(
        product, approximate, Stacked((*none.parts, *right.parts)), coupled.weights, accuracy
    )


def _refined(
    product: Callable[[Stacked], Stacked],
    solve: Callable[[Stacked, float], Stacked],
    right: Stacked,
    weights: Stacked | float,
    accuracy: float,
) -> Stacked:
    """Solve A x = b by repeated `solve` to |W (b - A x)| / |W b|; InputError if not unique."""
    x, rest = 0.0 * right, right
    size = last = norm(weights * right)
    for _ in range(12):  # of GMRES, which gain four digits each
        if last <= accuracy * size:
            return x
        x = x + solve(rest, max(ROUND, 0.5 * accuracy * size / last))
        rest = right - product(x)
        now = norm(weights * rest)
        if not now < 0.5 * last:
            break
        last = now
    if last > 1e3 * accuracy * size:
        raise InputError(UNIQUE)
    return x
