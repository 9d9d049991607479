"""The matrix M of Newton's last step and its transpose: solved by factors, by products with Q, or
with the bodies at once.

    M = [[I - D + D rho Q, D rho V], [V', 0]]

The transposed system is one of the same kind, with D' and Q' in place of D and Q. Let M' (a, b) =
(g, h) and z = rho D' a. Multiply the first rows, (I - D') a + Q' z + V b = g, by rho D', which
commutes with I - D':

    [[I - D' + rho D' Q', rho D' V], [V', 0]] (z, b) = (rho D' g, h),   a = z / rho + g - Q' z - V
                                                                          b.

Every form of Q has a function that makes the solution of such a system, the one of Newton's method
where it has one (contactopt.methods.kernels); factors are made once. Iterative solves are repeated
on what is left of the right side until it is small enough.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.derivatives.constants import INNER, ROUND
from contactopt.errors import InputError
from contactopt.linear.operators import Interface, InterfaceOperator
from contactopt.linear.saddle_point import CoupledForm
from contactopt.linear.stacked import Stacked, norm
from contactopt.methods.constants import LOOSE
from contactopt.methods.kernels.bonded import Bonded
from contactopt.methods.kernels.coupled_newton import Coupled, fitted
from contactopt.methods.kernels.krylov import model_of
from contactopt.methods.kernels.linearised import Linearised
from contactopt.methods.kernels.semismooth import Equations
from contactopt.problem import InterfaceProblem

SINGULAR = 1e-13  # reciprocal condition of a matrix below which it counts as singular
UNSEEN = 1e-8  # relative residual up to which a singular system counts as solved
ACCURACY = 1e-11  # relative residual of an iterative solve
ROUNDS = 12  # of GMRES, which gain four digits each
UNIQUE = (
    "the solution has no derivative, because its linear system is singular: forces or motions are"
    " not unique there; remove redundant contacts, or hold the bodies."
)

# error (k d,), balance (p,) -> dr (k d,), dlambda (p,)
Solve = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def transposed(Q: Interface) -> Interface:
    """Q'; an operator is symmetric."""
    return Q if isinstance(Q, InterfaceOperator) else Q.T


@dataclass(frozen=True, eq=False)
class Tangent:
    """M at a solution of a dimensionless problem.

    equations  of that problem, with the steps rho (k,) of the natural map; in the transposed system
               with Q'
    D          (k, d, d) derivative of the map P
    adjoint    whether the right sides are those of an adjoint: then a singular system counts as
               solved where they do not see what is undetermined
    """

    problem: InterfaceProblem
    equations: Equations
    D: np.ndarray
    adjoint: bool = False

    def slope(self, moved: np.ndarray) -> np.ndarray:
        """D rho moved, (k d,)."""
        blocks = moved.reshape(self.D.shape[:2])
        return np.asarray(np.einsum("kab,k,kb->ka", self.D, self.equations.rho, blocks).ravel())

    @cached_property
    def transposed(self) -> Tangent:
        """The system for z and b of this module's head."""
        equations = replace(self.equations, Q=transposed(self.equations.Q))
        return Tangent(self.problem, equations, self.D.transpose(0, 2, 1), True)

    def solve_transposed(
        self, by_r: np.ndarray, by_multipliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """z (k d,) and b (p,) of M' (a, b) = (by_r, by_multipliers)."""
        return self.transposed.solve(self.transposed.slope(by_r), by_multipliers)

    def multipliers(self, by_r: np.ndarray, z: np.ndarray, b: np.ndarray) -> np.ndarray:
        """a (k d,), for what solve_transposed returned; one product with Q'."""
        given, rho = self.equations, np.repeat(self.equations.rho, self.D.shape[1])
        return np.asarray(z / rho + by_r - transposed(given.Q) @ z - given.V @ b)

    @cached_property
    def closed(self) -> np.ndarray:
        """Numbers of the unknowns of contacts that are not open."""
        return np.flatnonzero(np.repeat(np.any(self.D != 0, axis=(1, 2)), self.D.shape[1]))

    @cached_property
    def solve(self) -> Solve:
        """The solver of M (dr, dlambda) = (error, balance); InputError where M is singular."""
        Q = self.equations.Q
        if not len(self.closed) + self.equations.V.shape[1]:
            return lambda error, balance: (error, balance)
        if isinstance(Q, InterfaceOperator):
            return _by_products(self) if Q.coupled is None else _with_bodies(self, Q.coupled)
        if sp.issparse(Q):
            return _closed_alone(self, _sparse_factors)
        loose = np.any(np.eye(self.D.shape[1]) != self.D, axis=(1, 2))
        if loose.sum() <= LOOSE * len(loose):
            with suppress(la.LinAlgError):  # a Q that is not symmetric or not definite
                return _stuck(self)
        return _closed_alone(self, _dense_factors)


def _stuck(tangent: Tangent) -> Solve:
    """By the bonded system, one Cholesky factorisation, where most contacts stick."""
    rho, shape = tangent.equations.rho, tangent.equations.q.shape
    bonded = Bonded(tangent.equations.Q, tangent.equations.V)

    def solve(error: np.ndarray, balance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        dr, multipliers = bonded.step(rho, error.reshape(shape), -balance, tangent.D)
        return dr.ravel(), multipliers

    return solve


def _closed_alone(
    tangent: Tangent, factors: Callable[[Tangent], Callable[[np.ndarray], np.ndarray]]
) -> Solve:
    """By factors of the system without open contacts, whose rows are those of 1."""
    Q, V, closed, n = tangent.equations.Q, tangent.equations.V, tangent.closed, len(tangent.closed)
    inverse = factors(tangent)

    def solve(error: np.ndarray, balance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        dr = error.copy()
        dr[closed] = 0.0
        right = np.concatenate([error[closed], balance - V.T @ dr])
        if np.any(dr):
            right[:n] -= tangent.slope(Q @ dr)[closed]
        x = inverse(right)
        dr[closed] = x[:n]
        return dr, x[n:]

    return solve


def _dense_factors(tangent: Tangent) -> Callable[[np.ndarray], np.ndarray]:
    closed, d, V = tangent.closed, tangent.D.shape[1], tangent.equations.V
    n, p = len(closed), V.shape[1]
    Q, D = tangent.equations.Q, tangent.D[closed[::d] // d]
    Q = Q if n == len(Q) else Q[np.ix_(closed, closed)]
    scaled = tangent.equations.rho[closed[::d] // d, None, None] * D
    K = np.zeros((n + p, n + p))
    K[:n, :n] = (scaled @ Q.reshape(n // d, d, n)).reshape(n, n)
    K[:n, n:] = (scaled @ V[closed].reshape(n // d, d, p)).reshape(n, p)
    K[n:, :n] = V[closed].T
    i = np.arange(n // d)
    K[:n, :n].reshape(len(i), d, len(i), d)[i, :, i, :] += np.eye(d) - D
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", la.LinAlgWarning)
        factors = la.lu_factor(K.T, check_finite=False)
    if la.lapack.dgecon(factors[0], np.linalg.norm(K, np.inf))[0] > SINGULAR:
        return lambda right: np.asarray(la.lu_solve(factors, right, trans=1, check_finite=False))
    if not tangent.adjoint:
        # forces have no derivative, whatever one that an adjoint asks for may have
        raise InputError(UNIQUE)

    def consistent(right: np.ndarray) -> np.ndarray:
        x = la.lstsq(K, right, cond=UNSEEN, check_finite=False)[0]
        if np.linalg.norm(K @ x - right) > UNSEEN * np.linalg.norm(right):
            raise InputError(UNIQUE)
        return np.asarray(x)

    return consistent


def _sparse_factors(tangent: Tangent) -> Callable[[np.ndarray], np.ndarray]:
    """Many bodies of which each touches few others."""
    equations, closed, (k, d) = tangent.equations, tangent.closed, tangent.D.shape[:2]
    V, p = sp.csr_array(equations.V), equations.V.shape[1]
    places = np.arange(k), np.arange(k + 1)
    scaled = sp.bsr_array((equations.rho[:, None, None] * tangent.D, *places)).tocsr()
    rest = sp.bsr_array((np.eye(d) - tangent.D, *places)).tocsr()
    rows = (scaled @ equations.Q + rest)[closed][:, closed]
    border = (scaled @ V)[closed], V[closed].T
    K = sp.block_array([[rows, border[0]], [border[1], sp.csr_array((p, p))]], format="csc")
    try:
        factors = splu(K)
    except RuntimeError as error:
        raise InputError(UNIQUE) from error
    pivots = np.abs(factors.U.diagonal())
    if not pivots.min(initial=1.0) > SINGULAR * pivots.max(initial=1.0):
        raise InputError(UNIQUE)
    return lambda right: np.asarray(factors.solve(right))


def _by_products(tangent: Tangent) -> Solve:
    """By products with Q: GMRES, preconditioned by the system with the model of Q."""
    linearised = Linearised(tangent.equations, tangent.D)
    inverse = linearised.inverse(model_of(tangent.problem), INNER)
    Q, V = tangent.equations.Q, tangent.equations.V

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


def _with_bodies(tangent: Tangent, form: CoupledForm) -> Solve:
    """With the equilibrium of the bodies beside the contacts, without products with Q."""
    equations = tangent.equations
    P = fitted(model_of(tangent.problem, deflate=False), form, equations.V)
    coupled, linearised = Coupled(equations, form, P), Linearised(equations, tangent.D)
    none = form.pulled(np.zeros(tangent.D.shape[0] * tangent.D.shape[1]))

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
