"""The matrix M of Newton's last step and its transpose: solved by factors, by products with Q, or
with the bodies at once.

    M = [[I - D + D rho Q, D rho V], [V', 0]]

Open contacts, D = 0, have unit rows in M. They leave the system, and what is left is square in the
closed contacts and the multipliers. Every form of Q has a class that solves that system K and its
transpose for any number of right sides; the factors are made once. Iterative solves are repeated on
what is left of the right side until it is small enough.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, gmres, splu

from contactopt.derivatives.constants import INNER, ROUND
from contactopt.errors import InputError
from contactopt.linear.flexible_gmres import flexible_gmres
from contactopt.linear.operators import Interface, InterfaceOperator
from contactopt.linear.saddle_point import CoupledForm
from contactopt.linear.stacked import Stacked, Vector, norm
from contactopt.methods.constants import LOOSE, SLIPPING
from contactopt.methods.kernels.bonded import Bonded
from contactopt.methods.kernels.coupled_newton import fitted
from contactopt.methods.kernels.krylov import model_of
from contactopt.methods.preconditioners import Preconditioner
from contactopt.problem import InterfaceProblem

SINGULAR = 1e-13  # reciprocal condition of K below which it counts as singular
UNSEEN = 1e-8  # relative residual up to which a singular system counts as solved
ACCURACY = 1e-11  # relative residual of an iterative solve
ROUNDS = 12  # of GMRES, which gain four digits each
RESTART, CYCLES = 60, 3  # of GMRES
UNIQUE = (
    "the solution has no derivative, because its linear system is singular: forces or motions are"
    " not unique there; remove redundant contacts, or hold the bodies."
)

Act = Callable[[np.ndarray], np.ndarray]


def transposed_product(Q: Interface, x: np.ndarray) -> np.ndarray:
    """Q' x; an operator is symmetric."""
    return np.asarray(Q @ x if isinstance(Q, InterfaceOperator) else Q.T @ x)


@dataclass(frozen=True, eq=False)
class Tangent:
    """M at a solution of a dimensionless problem.

    problem  dimensionless;  rho  (k,) steps of the natural map;  D  (k, d, d) derivative of the map
             P
    """

    problem: InterfaceProblem
    rho: np.ndarray
    D: np.ndarray

    def solve(self, error: np.ndarray, balance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """dr (k d,) and dlambda (p,) with M (dr, dlambda) = (error, balance)."""
        Q, V, closed, n = self.problem.Q, self.problem.V, self.closed, len(self.closed)
        dr = np.where(self.is_closed, 0.0, error)
        right = np.concatenate([error[closed], balance - V.T @ dr])
        if np.any(dr):
            right[:n] -= self.slope(Q @ dr)[closed]
        x = self.system.solve(right, False) if len(right) else right
        dr[closed] = x[:n]
        return dr, x[n:]

    def solve_transposed(
        self, by_r: np.ndarray, by_multipliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """z = D' rho a (k d,), a (k d,) where D is not zero, and b (p,), with M' (a, b) = (by_r,
        by_multipliers).
        """
        closed, n = self.closed, len(self.closed)
        right = np.concatenate([by_r[closed], by_multipliers])
        x = self.system.solve(right, True) if len(right) else right
        a = np.zeros(len(by_r))
        a[closed] = x[:n]
        return self.slope_transposed(a), a, x[n:]

    def on_open(self, by_r: np.ndarray, z: np.ndarray, b: np.ndarray) -> np.ndarray:
        """a (k d,) on the contacts with D = 0, zero elsewhere, for what solve_transposed returned;
        one product with Q'.
        """
        moved = transposed_product(self.problem.Q, z)
        return np.where(self.is_closed, 0.0, by_r - moved - self.problem.V @ b)

    def slope(self, moved: np.ndarray) -> np.ndarray:
        """D rho moved, (k d,)."""
        blocks = moved.reshape(self.D.shape[:2])
        return np.asarray(np.einsum("kab,k,kb->ka", self.D, self.rho, blocks).ravel())

    def slope_transposed(self, a: np.ndarray) -> np.ndarray:
        """rho D' a, (k d,)."""
        blocks = a.reshape(self.D.shape[:2])
        return np.asarray(np.einsum("kab,k,ka->kb", self.D, self.rho, blocks).ravel())

    @cached_property
    def is_closed(self) -> np.ndarray:
        """Mask (k d,) of the unknowns of contacts that are not open."""
        return np.repeat(np.any(self.D != 0, axis=(1, 2)), self.D.shape[1])

    @cached_property
    def closed(self) -> np.ndarray:
        """Numbers of these unknowns."""
        return np.flatnonzero(self.is_closed)

    @cached_property
    def system(self) -> Stuck | Dense | Sparse | Krylov | Coupled:
        """What solves K x = right and K' x = right (n + p,), by the means that fit the form of Q;
        InputError where it is singular.
        """
        Q = self.problem.Q
        if isinstance(Q, InterfaceOperator):
            return Krylov(self) if Q.coupled is None else Coupled(self, Q.coupled)
        if sp.issparse(Q):
            return Sparse(self)
        loose = np.any(np.eye(self.problem.dim) != self.D, axis=(1, 2))
        if loose.sum() <= LOOSE * len(loose):
            with suppress(la.LinAlgError):  # a Q that is not symmetric or not definite
                return Stuck(self, loose)
        return Dense(self)


class Stuck:
    """K through the bonded system [[Q, V], [V', 0]] of a symmetric Q, one Cholesky factorisation,
    where most contacts stick.

    M = L B + R with B the bonded matrix, L = D rho (rho where a contact sticks) and R = I - D.
    Hence w = L' a of the transposed system M' a = g solves B w + R' a = g, and only the contacts N
    that do not stick are left as unknowns,

        (rho D' + (B^-1)_NN (I - D)') a_N = (B^-1 g)_N.
    """

    def __init__(self, tangent: Tangent, loose: np.ndarray):
        self.tangent, self.loose = tangent, np.flatnonzero(loose)
        self.bonded = Bonded(tangent.problem.Q, tangent.problem.V)

    def solve(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        tangent, (k, d) = self.tangent, self.tangent.problem.q.shape
        full, n = np.zeros(k * d), len(tangent.closed)
        full[tangent.closed] = right[:n]
        if not transposed:
            dr, multipliers = self.bonded.step(
                tangent.rho, full.reshape(k, d), -right[n:], tangent.D
            )
            return np.concatenate([dr.ravel()[tangent.closed], multipliers])
        w, multipliers = self.bonded.solve(full, -right[n:])
        a = w / np.repeat(tangent.rho, d)
        if len(self.loose):
            N = (self.loose[:, None] * d + np.arange(d)).ravel()
            kept = np.eye(d) - tangent.D[self.loose]
            scaled = tangent.rho[self.loose, None, None] * tangent.D[self.loose]
            G = self.bonded.inverse(N)[N].reshape(len(N), len(self.loose), d)
            matrix = np.einsum("nib,iab->nia", G, kept).reshape(len(N), len(N))
            i = np.arange(len(self.loose))
            matrix.reshape(len(i), d, len(i), d)[i, :, i, :] += scaled.transpose(0, 2, 1)
            own = la.solve(matrix, w[N], check_finite=False)
            added = np.zeros(k * d)
            added[N] = np.einsum("iab,ia->ib", kept, own.reshape(-1, d)).ravel()
            moved, more = self.bonded.solve(added, 0 * multipliers)
            a, multipliers = a - moved / np.repeat(tangent.rho, d), multipliers - more
            a[N] = own
        return np.concatenate([a[tangent.closed], multipliers])


class Dense:
    """K and its factors as arrays."""

    def __init__(self, tangent: Tangent):
        problem, closed, d = tangent.problem, tangent.closed, tangent.problem.dim
        n, p = len(closed), len(problem.s)
        Q = problem.Q if n == problem.q.size else problem.Q[np.ix_(closed, closed)]
        D = tangent.D[closed[::d] // d]
        scaled = tangent.rho[closed[::d] // d, None, None] * D
        K = np.zeros((n + p, n + p))
        K[:n, :n] = (scaled @ Q.reshape(n // d, d, n)).reshape(n, n)
        K[:n, n:] = (scaled @ problem.V[closed].reshape(n // d, d, p)).reshape(n, p)
        K[n:, :n] = problem.V[closed].T
        i = np.arange(n // d)
        K[:n, :n].reshape(len(i), d, len(i), d)[i, :, i, :] += np.eye(d) - D
        size = np.linalg.norm(K, np.inf) if n + p else 0.0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", la.LinAlgWarning)
            self.factors = la.lu_factor(K.T, check_finite=False)
        regular = not n + p or la.lapack.dgecon(self.factors[0], size)[0] > SINGULAR
        self.singular = None if regular else K

    def solve(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        if self.singular is not None:
            if not transposed:
                # forces have no derivative, whatever one that an adjoint asks for may have
                raise InputError(UNIQUE)
            return _consistent(self.singular.T, right)
        return np.asarray(
            la.lu_solve(self.factors, right, trans=int(not transposed), check_finite=False)
        )


def _consistent(K: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The least solution of a singular system whose right side does not see what is undetermined;
    InputError for others.
    """
    x = la.lstsq(K, right, cond=UNSEEN, check_finite=False)[0]
    if np.linalg.norm(K @ x - right) > UNSEEN * np.linalg.norm(right):
        raise InputError(UNIQUE)
    return np.asarray(x)


class Sparse:
    """K and its factors, sparse: many bodies of which each touches few others."""

    def __init__(self, tangent: Tangent):
        problem, closed, d = tangent.problem, tangent.closed, tangent.problem.dim
        k, p, V = problem.contacts, len(problem.s), sp.csr_array(problem.V)
        places = np.arange(k), np.arange(k + 1)
        scaled = sp.bsr_array((tangent.rho[:, None, None] * tangent.D, *places)).tocsr()
        rest = sp.bsr_array((np.eye(d) - tangent.D, *places)).tocsr()
        rows = (scaled @ problem.Q + rest)[closed][:, closed]
        border = (scaled @ V)[closed], V[closed].T
        K = sp.block_array([[rows, border[0]], [border[1], sp.csr_array((p, p))]], format="csc")
        try:
            self.factors = splu(K)
        except RuntimeError as error:
            raise InputError(UNIQUE) from error
        pivots = np.abs(self.factors.U.diagonal())
        if not pivots.min(initial=1.0) > SINGULAR * pivots.max(initial=1.0):
            raise InputError(UNIQUE)

    def solve(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        return np.asarray(self.factors.solve(right, trans="T" if transposed else "N"))


class Krylov:
    """K by products with Q: GMRES, preconditioned by the same system with the model of Q
    (contactopt.methods.preconditioners).
    """

    def __init__(self, tangent: Tangent, P: Preconditioner | None = None):
        self.tangent = tangent
        self.P = model_of(tangent.problem) if P is None else P
        self.rough = {flag: _rough_inverse(tangent, self.P, flag) for flag in (False, True)}

    def product(self, x: np.ndarray, transposed: bool, act: Act) -> np.ndarray:
        """K x or K' x (n + p,), where act makes the products with Q or its model."""
        tangent, V, n = self.tangent, self.tangent.problem.V, len(self.tangent.closed)
        full = np.zeros(len(V))
        full[tangent.closed] = x[:n]
        D = tangent.D
        turned, blocks = D.transpose(0, 2, 1) if transposed else D, full.reshape(D.shape[:2])
        top = full - np.einsum("kab,kb->ka", turned, blocks).ravel()
        if transposed:
            full = tangent.slope_transposed(full)
            top += act(full) + V @ x[n:]
        else:
            top += tangent.slope(act(full) + V @ x[n:])
        return np.concatenate([top[tangent.closed], V.T @ full])

    def inverse(self, transposed: bool) -> Act:
        """An approximate inverse of K or K': that for the model of Q to INNER, or a rough one
        without a model.
        """
        rough = self.rough[transposed]
        if self.P.model is None:
            return rough
        act = self.P.model.matvec
        return lambda x: _gmres(lambda y: self.product(y, transposed, act), x, INNER, rough)

    def solve(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        Q = self.tangent.problem.Q

        def product(x: np.ndarray) -> np.ndarray:
            return self.product(x, transposed, lambda y: Q @ y)

        inverse = self.inverse(transposed)

        def solve(rest: np.ndarray) -> np.ndarray:
            return _gmres(product, rest, ROUND, inverse)

        return _refined(product, solve, right, np.ones(len(right)))


class Coupled:
    """K with the equilibrium of the bodies beside it, so that no product with Q is needed
    (contactopt.methods.kernels.coupled_newton).

    With Q = T A^-1 T' + R the unknowns X of the bodies are eliminated by A X = T' dr forward, by A
    X = -T' z in the adjoint. Flexible GMRES sees bodies and contacts, with a V-cycle for A^-1.
    """

    def __init__(self, tangent: Tangent, form: CoupledForm):
        self.tangent, self.form = tangent, form
        P = model_of(tangent.problem, deflate=False)
        self.contacts = Krylov(tangent, fitted(P, form, tangent.problem.V))

    def solve(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        tangent, form, contacts = self.tangent, self.form, self.contacts
        n, sign, inverse = len(tangent.closed), 1 - 2 * transposed, contacts.inverse(transposed)

        def forces(x: np.ndarray) -> np.ndarray:
            """What the contacts do to the bodies: dr or z (k d,)."""
            full = np.zeros(tangent.problem.q.size)
            full[tangent.closed] = x[:n]
            return tangent.slope_transposed(full) if transposed else full

        def product(x: Stacked) -> Stacked:
            X, rest = Stacked(x.parts[:-1]), x.parts[-1]
            bodies = form.stiffness(X) - sign * form.pulled(forces(rest))
            lower = contacts.product(rest, transposed, lambda y: form.moved(sign * X, y))
            return Stacked((*bodies.parts, lower))

        def precondition(x: Stacked) -> Stacked:
            rest = inverse(x.parts[-1])
            bodies = form.approximate(Stacked(x.parts[:-1]) + sign * form.pulled(forces(rest)))
            return Stacked((*bodies.parts, rest))

        rho = np.repeat(tangent.rho, tangent.problem.dim)[tangent.closed]
        share = rho**0.5 if transposed else rho**-0.5
        own = np.concatenate([share, np.ones(len(tangent.problem.s))])
        weights = Stacked((*(form.diagonal() ** -0.5).parts, own))

        def solve(rest: Stacked) -> Any:
            return flexible_gmres(product, precondition, rest, weights, ROUND)

        none = form.pulled(np.zeros(tangent.problem.q.size))
        found = _refined(product, solve, Stacked((*none.parts, right)), weights)
        return np.asarray(found.parts[-1])


def _refined(
    product: Callable[[Any], Any], solve: Callable[[Any], Any], right: Vector, weights: Vector
) -> Any:
    """Solve A x = b to ACCURACY by solving again for what is left, from x -> A x, b -> an
    approximate x, and weights W of the rows, like b: the residual is |W (b - A x)| / |W b|.

    InputError if that is out of reach, because the solution is not unique.
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


def _rough_inverse(tangent: Tangent, P: Preconditioner, transposed: bool) -> Act:
    """P where contact holds a component, the identity where it slips, bordered by the balance."""
    closed, n, d = tangent.closed, len(tangent.closed), tangent.D.shape[1]
    V = tangent.problem.V[closed]
    rho = np.repeat(tangent.rho, d)[closed]
    inside = np.diagonal(tangent.D, axis1=1, axis2=2).ravel()[closed] > SLIPPING
    unknowns = closed[inside]
    before, after = (1.0, 1 / rho[inside]) if transposed else (1 / rho[inside], 1.0)

    def apply(x: np.ndarray) -> np.ndarray:
        y, full = x.copy(), np.zeros(P.shape[0])
        full[unknowns] = before * x[inside]
        y[inside] = after * (P @ full)[unknowns]
        return y

    held = inside[:, None] * V
    left, right = (held, rho[:, None] * held) if transposed else (rho[:, None] * held, V)
    Y = np.stack([apply(v) for v in left.T], axis=1) if V.shape[1] else V
    K = np.linalg.pinv(right.T @ Y)

    def solve(x: np.ndarray) -> np.ndarray:
        y = apply(x[:n])
        multipliers = K @ (right.T @ y - x[n:])
        return np.concatenate([y - Y @ multipliers, multipliers])

    return solve


def _gmres(product: Act, right: np.ndarray, rtol: float, inverse: Act) -> np.ndarray:
    n = len(right)
    A = LinearOperator((n, n), matvec=lambda x: product(x.ravel()), dtype=float)
    M = LinearOperator((n, n), matvec=lambda x: inverse(x.ravel()), dtype=float)
    found = gmres(A, right, rtol=rtol, restart=min(n, RESTART), maxiter=CYCLES, M=M)
    return np.asarray(found[0])
