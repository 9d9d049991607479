"""The matrix M of Newton's last step and its transpose: solved by factors, by products with Q, or
with the bodies at once.

    M = [[I - D + D rho Q, D rho V], [V', 0]]

The transposed system is one of the same kind, with D' and Q' in place of D and Q. Let M' (a, b) =
(g, h) and z = rho D' a. Multiply the first rows, (I - D') a + Q' z + V b = g, by rho D', which
commutes with I - D':

    [[I - D' + rho D' Q', rho D' V], [V', 0]] (z, b) = (rho D' g, h),   a = z / rho + g - Q' z - V
                                                                          b.

Every form of Q has a function that makes the solution of such a system, the one of Newton's method
where it has one (contactopt.methods.kernels); factors are made once. Components whose row of D is
zero have dr = error and leave the system before. Iterative solves are repeated on what is left of
the right side until it is small enough.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.derivatives.constants import INNER, ROUND, WHOLE
from contactopt.errors import InputError
from contactopt.linear.operators import Interface, InterfaceOperator, asymmetry
from contactopt.linear.saddle_point import CoupledForm
from contactopt.linear.stacked import Stacked, norm
from contactopt.methods.kernels.alart_curnier import coulomb_equations
from contactopt.methods.kernels.bonded import LEAST_PIVOT
from contactopt.methods.kernels.coupled_newton import Coupled, fitted
from contactopt.methods.kernels.krylov import model_of
from contactopt.methods.kernels.linearised import Linearised
from contactopt.methods.kernels.sparse_blocks import assembled
from contactopt.problem import InterfaceProblem, dimensionless

SINGULAR = 1e-13  # reciprocal condition of a matrix below which it counts as singular
UNSEEN = 1e-8  # relative residual up to which a singular system counts as solved
ACCURACY = 1e-11  # relative residual of an iterative solve
ROUNDS = 12  # of GMRES, which gain four digits each
SYMMETRIC = 1e-12  # |Q - Q'| / |Q| up to which Q counts as symmetric
UNIQUE = (
    "the solution has no derivative, because its linear system is singular: forces or motions are"
    " not unique there; remove redundant contacts, or hold the bodies."
)

# error (k d,) or (k d, j), balance (p,) or (p, j) -> dr and dlambda of these shapes
Solve = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
Inverse = Callable[[np.ndarray], np.ndarray]
Border = tuple[np.ndarray, np.ndarray]  # columns (m, p) and rows (p, m) of the multipliers


def transposed(Q: Interface) -> Interface:
    """Q'; an operator is symmetric."""
    return Q if isinstance(Q, InterfaceOperator) else Q.T


@dataclass(frozen=True, eq=False)
class Tangent:
    """M at a solution, in the units of its problem.

    Q, V     of the problem; in the transposed system Q'
    rho      (k,) steps of the natural map [force / length]
    D        (k, d, d) derivative of the map P
    problem  needed where Q is known by its products
    adjoint  whether the right sides are those of an adjoint: then a singular system counts as
             solved where they do not see what is undetermined
    """

    Q: Interface
    V: np.ndarray
    rho: np.ndarray
    D: np.ndarray
    problem: InterfaceProblem | None = None
    adjoint: bool = False

    @cached_property
    def scaled(self) -> np.ndarray:
        """D rho (k, d, d)."""
        return np.asarray(self.rho[:, None, None] * self.D)

    def slope(self, moved: np.ndarray) -> np.ndarray:
        """D rho moved, (k d,) or (k d, j)."""
        return _times(self.scaled, moved)

    def rows(self, unknowns: np.ndarray) -> np.ndarray:
        """Rows (m, k d) of I - D + D rho Q with an array Q."""
        (k, d), n = self.D.shape[:2], self.D.shape[0] * self.D.shape[1]
        own, place = np.unique(unknowns // d, return_inverse=True)
        blocks = self.scaled[own] @ self.Q.reshape(k, d, n)[own]
        blocks.reshape(-1, d, k, d)[np.arange(len(own)), :, own] += np.eye(d) - self.D[own]
        return blocks[place, unknowns % d]

    @cached_property
    def transposed(self) -> Tangent:
        """The system for z and b of this module's head."""
        D = self.D.transpose(0, 2, 1)
        return replace(self, Q=transposed(self.Q), D=D, adjoint=True)

    def solve_transposed(
        self, by_r: np.ndarray, by_multipliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """z (k d,) and b (p,) of M' (a, b) = (by_r, by_multipliers)."""
        return self.transposed.solve(self.transposed.slope(by_r), by_multipliers)

    def multipliers(self, by_r: np.ndarray, z: np.ndarray, b: np.ndarray) -> np.ndarray:
        """a (k d,), for what solve_transposed returned; one product with Q'."""
        rho = np.repeat(self.rho, self.D.shape[1]).reshape(-1, *(1,) * (z.ndim - 1))
        return np.asarray(z / rho + by_r - transposed(self.Q) @ z - self.V @ b)

    @cached_property
    def solve(self) -> Solve:
        """The solver of M (dr, dlambda) = (error, balance); InputError where M is singular."""
        if not np.any(self.D) and not self.V.shape[1]:
            return lambda error, balance: (error, balance)
        return _by_iteration(self) if isinstance(self.Q, InterfaceOperator) else _by_factors(self)


def _by_factors(tangent: Tangent) -> Solve:
    """By factors of the rows of D that are not zero."""
    Q, D, rho = tangent.Q, tangent.D, float(tangent.rho.mean())
    kept = np.any(D != 0, axis=2).ravel()
    rows, size = np.flatnonzero(kept), np.linalg.norm(tangent.V, axis=0)
    size = np.where(size > 0, size, 1.0)
    V = tangent.V / size  # the multipliers then are forces, like all other unknowns
    border = tangent.slope(V)[rows] / rho, V[rows].T
    inverse = (_sparse_factors if sp.issparse(Q) else _dense_factors)(tangent, kept, border)

    def solve(error: np.ndarray, balance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        dr, scale = error.copy(), size.reshape(-1, *(1,) * (error.ndim - 1))
        dr[rows] = 0.0
        right = error[rows], balance / scale
        if np.any(dr):
            moved = tangent.slope(Q @ dr) - _times(D, dr)
            right = right[0] - moved[rows], right[1] - V.T @ dr
        x = inverse(np.concatenate(right))
        dr[rows] = x[: len(rows)]
        return dr, x[len(rows) :] / (rho * scale)

    return solve


def _times(blocks: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The product of diagonal blocks (k, d, d) with x, (k d,) or (k d, j)."""
    return np.asarray((blocks @ x.reshape(*blocks.shape[:2], -1)).reshape(x.shape))


def _dense_factors(tangent: Tangent, kept: np.ndarray, border: Border) -> Inverse:
    """By Cholesky's factors of Q where components stick, and LU of what is left of the others; by
    LU of all if they are few, or Q is not symmetric and definite.

    Rows of the unit matrix in D mean Q dr + V dlambda = error / rho; with x these dr and z all
    other unknowns the system is [[Q, B], [C, E]] (x, z) = (error / rho, rest), so that

        (E - C Q^-1 B) z = rest - C Q^-1 error / rho,   x = Q^-1 (error / rho - B z).
    """
    d, V = tangent.D.shape[1], border[1].T
    p, rest = V.shape[1], np.eye(d) - tangent.D
    stick = kept & np.all(rest == 0, axis=2).ravel()
    factor = None if kept.sum() <= WHOLE else _cholesky(tangent.Q[stick][:, stick])
    if factor is None:
        A = assembled(tangent.Q, tangent.scaled, rest, kept)
        return _square(np.block([[A, border[0]], [border[1], np.zeros((p, p))]]), tangent.adjoint)
    loose, rho = np.flatnonzero(kept & ~stick), np.repeat(tangent.rho, d)[stick, None]
    own, rows = stick[kept], tangent.rows(loose)
    C = np.concatenate([rows[:, stick], V[own].T])
    E = np.block([[rows[:, loose], border[0][~own]], [V[~own].T, np.zeros((p, p))]])
    B = np.concatenate([tangent.Q[np.ix_(stick, loose)], border[0][own] / rho], axis=1)
    X = la.cho_solve(factor, B, check_finite=False)
    inverse, first = _square(E - C @ X, tangent.adjoint), np.append(own, np.zeros(p, bool))

    def solve(right: np.ndarray) -> np.ndarray:
        sides = right.reshape(len(right), -1)
        x, y = np.empty(sides.shape), la.cho_solve(factor, sides[first] / rho, check_finite=False)
        x[~first] = z = inverse(sides[~first] - C @ y)
        x[first] = y - X @ z
        return x.reshape(right.shape)

    return solve


def _cholesky(Q: np.ndarray) -> tuple[np.ndarray, bool] | None:
    """The factors of Q; None if it is not symmetric and safely positive definite."""
    if not len(Q) or asymmetry(Q) > SYMMETRIC:
        return None
    try:
        factor = la.cho_factor(Q, lower=True, overwrite_a=True, check_finite=False)
    except la.LinAlgError:
        return None
    pivots = factor[0].diagonal()
    return factor if pivots.min() > LEAST_PIVOT * pivots.max() else None


def _square(K: np.ndarray, adjoint: bool) -> Inverse:
    """The inverse of a matrix by LU; of a singular one, for an adjoint that does not see it."""
    if not len(K):
        return lambda right: right
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", la.LinAlgWarning)
        factors = la.lu_factor(K.T, check_finite=False)
    if la.lapack.dgecon(factors[0], np.linalg.norm(K, np.inf))[0] > SINGULAR:
        return lambda right: np.asarray(la.lu_solve(factors, right, trans=1, check_finite=False))
    if not adjoint:
        # forces have no derivative, whatever one that an adjoint asks for may have
        raise InputError(UNIQUE)

    def consistent(right: np.ndarray) -> np.ndarray:
        x = la.lstsq(K, right, cond=UNSEEN, check_finite=False)[0]
        if np.linalg.norm(K @ x - right) > UNSEEN * np.linalg.norm(right):
            raise InputError(UNIQUE)
        return np.asarray(x)

    return consistent


def _sparse_factors(tangent: Tangent, kept: np.ndarray, border: Border) -> Inverse:
    """Many bodies of which each touches few others."""
    k, d = tangent.D.shape[:2]
    places, p = (np.arange(k), np.arange(k + 1)), len(border[1])
    scaled = sp.bsr_array((tangent.scaled, *places)).tocsr()
    rest = sp.bsr_array((np.eye(d) - tangent.D, *places)).tocsr()
    rows = (scaled @ tangent.Q + rest)[kept][:, kept]
    border = sp.csr_array(border[0]), sp.csr_array(border[1])
    K = sp.block_array([[rows, border[0]], [border[1], sp.csr_array((p, p))]], format="csc")
    try:
        factors = splu(K)
    except RuntimeError as error:
        raise InputError(UNIQUE) from error
    pivots = np.abs(factors.U.diagonal())
    if not pivots.min(initial=1.0) > SINGULAR * pivots.max(initial=1.0):
        raise InputError(UNIQUE)
    return lambda right: np.asarray(factors.solve(right))


def _by_iteration(tangent: Tangent) -> Solve:
    """In the dimensionless problem, where the methods know the sizes of things."""
    if tangent.problem is None:
        raise TypeError("a tangent whose Q is an operator needs its problem")
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
