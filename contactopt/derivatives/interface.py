"""The derivative of a solution by q, the law's parameter mu, s, Q and V of its problem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from contactopt.checks import check_number, real_array
from contactopt.derivatives.kinks import Onesided, Weak, of_kinks, weak_contacts
from contactopt.derivatives.linear import Tangent, transposed
from contactopt.errors import InputError
from contactopt.linear.operators import FINEST
from contactopt.methods.kernels.coupled_newton import improved
from contactopt.problem import InterfaceProblem, Scales, Solution, natural_map_residual
from contactopt.problem.certificate import Moved
from contactopt.problem.scaling import immovable, scales_of, without_rounding

if TYPE_CHECKING:
    from scipy.sparse import spmatrix
    from scipy.sparse.linalg import LinearOperator

CERTIFIED = 1e-5  # largest certificate of a solution whose derivative means anything
NEAR = 1e-6  # distance to a kink, over the largest force, within which a contact is weakly active


@dataclass(frozen=True, eq=False)
class Change:
    """By how much reactions (k, dim), multipliers (p,), displacements u (k, dim) change."""

    reactions: np.ndarray
    multipliers: np.ndarray
    displacements: np.ndarray


@dataclass(frozen=True, eq=False)
class Dual:
    """The gradient of a function of the solution with respect to the data of the problem,
    in the unit of the function over theirs.

    q   (k, dim);  mu  (k,) by the law's parameter at each contact;  s  (p,)
    reactions, multipliers  of the solution, with which df = sum (q r') * dQ + sum V * dV
    """

    q: np.ndarray
    s: np.ndarray
    reactions: np.ndarray
    multipliers: np.ndarray
    by_parameter: Callable[[], np.ndarray]

    @cached_property
    def mu(self) -> np.ndarray:
        return self.by_parameter()

    def along_Q(self, change: spmatrix | LinearOperator | np.ndarray) -> float:
        """df for a change of Q: an array, a sparse matrix, or an operator with products."""
        return float(self.q.ravel() @ np.asarray(change @ self.reactions.ravel()))

    @property
    def Q(self) -> np.ndarray:
        """(k dim, k dim) by the entries of Q, an outer product."""
        return np.outer(self.q, self.reactions)

    @property
    def V(self) -> np.ndarray:
        """(k dim, p) by the entries of V."""
        return np.outer(self.q, self.multipliers) + np.outer(self.reactions, self.s)


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """The linear system of the derivatives at one solution. It is factorised, or set up, once.

    distance  to a kink, over the largest force, within which a contact counts as weakly active [-]
    moved     Q r (k dim,) of the solution's reactions, where it is known [length]
    """

    problem: InterfaceProblem
    solution: Solution
    distance: float
    moved: np.ndarray | None = None

    @cached_property
    def _scales(self) -> Scales:
        return scales_of(self.problem)

    @cached_property
    def _rho(self) -> np.ndarray:
        """Steps (k,) of the natural map [force / length]."""
        own = self.problem.compliances
        if not own.min(initial=np.inf) > 1e-3 * own.max(initial=0.0):
            own = np.maximum(own, 1e-3 * self._scales.length / self._scales.force)
        return np.asarray(1 / own)

    @cached_property
    def _point(self) -> np.ndarray:
        """y = r - rho u (k, dim) [force]."""
        r, problem = self.solution.reactions, self.problem
        moved = problem.Q @ r.ravel() if self.moved is None else self.moved
        u = (moved + problem.V @ self.solution.multipliers).reshape(r.shape) + problem.q
        return np.asarray(r - self._rho[:, None] * u)

    @cached_property
    def tangent(self) -> Tangent:
        """The matrix M."""
        problem = self.problem
        D = problem.law.project(self._point)[1].copy()
        D[~problem.law.rough, 1:, :] = 0.0  # no friction, no tangential force, even at rest
        # On a plane of symmetry friction holds nothing, since nothing moves: its force is zero.
        held = immovable(problem).reshape(problem.q.shape)
        if held.any():
            D[held[:, :, None] | held[:, None, :]] = 0.0
        accuracy = max(FINEST, min(self.solution.residual, CERTIFIED))
        return Tangent(problem, without_rounding(problem.V), self._rho, D, accuracy)

    @cached_property
    def weak(self) -> tuple[Weak, ...]:
        """The weakly active contacts, at which the solution has one-sided derivatives only."""
        return weak_contacts(self.problem.law, self._point, self.distance * self.force)

    @property
    def differentiable(self) -> bool:
        """Whether the solution has a gradient."""
        return not self.weak

    @property
    def force(self) -> float:
        """The largest force, with which distances to kinks are compared."""
        sizes = np.linalg.norm(self.solution.reactions, axis=1)
        return float(sizes.max(initial=0.0)) or self._scales.force

    @property
    def sentence(self) -> str:
        """What is known of the derivative, for people."""
        near = f", within {self.distance:g} of the largest force of a kink"
        names = [f"{weak.contact} ({weak.edge})" for weak in self.weak]
        return of_kinks("solution", names, near)

    @cached_property
    def by_parameter(self) -> np.ndarray:
        """P_mu (k, dim) [force]."""
        return self.problem.law.project_by_parameter(self._point)

    def forward(
        self,
        *,
        q: ArrayLike | None = None,
        mu: ArrayLike | None = None,
        s: ArrayLike | None = None,
        Q: spmatrix | LinearOperator | np.ndarray | None = None,
        V: ArrayLike | None = None,
    ) -> Change:
        """The change of the solution along a direction of q (k, dim), mu (k,) or a number, s (p,),
        Q (array, sparse or operator) and V; one-sided where contacts are weakly active. InputError
        on wrong shapes, and where the solution is not unique.
        """
        problem, r, lam = self.problem, self.solution.reactions, self.solution.multipliers
        du = _given("q", q, problem.q.shape).copy()
        dmu = None if mu is None else _given("mu", mu, (problem.contacts,))
        ds = _given("s", s, problem.s.shape).copy()
        if Q is not None:
            du += np.asarray(_shaped("Q", Q, 2 * (r.size,)) @ r.ravel()).reshape(r.shape)
        if V is not None:
            turned = _given("V", V, problem.V.shape)
            du += (turned @ lam).reshape(r.shape)
            ds += turned.T @ r.ravel()
        error = -self.tangent.slope(du.ravel()).reshape(r.shape)
        if dmu is not None:
            error += self.by_parameter * dmu[:, None]
        dr, dlam, moves = self._step(error, -ds)
        if self.weak:
            direction = np.zeros(problem.contacts) if dmu is None else dmu
            extra = self.onesided.step(dr - self._rho[:, None] * (moves() + du), direction)
            dr, dlam = dr + extra[0], dlam + extra[1]
            moved = problem.Q @ dr.ravel() + problem.V @ dlam
            return Change(dr, dlam, moved.reshape(r.shape) + du)
        return Change(dr, dlam, moves() + du)

    @cached_property
    def onesided(self) -> Onesided:
        """The complementarity problem of the weakly active contacts."""
        contacts = np.array([weak.contact for weak in self.weak], dtype=int)

        def response(error: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            dr, dlam, moves = self._step(error, 0 * self.problem.s)
            return dr, dlam, dr - self._rho[:, None] * moves()

        by_parameter = self.by_parameter if np.any(self.problem.law.rough) else 0 * self._point
        place = self.problem.law, self._point, contacts, self.tangent.D, by_parameter
        return Onesided(*place, self.distance * self.force, self.force, response)

    def adjoint(
        self,
        *,
        reactions: ArrayLike | None = None,
        multipliers: ArrayLike | None = None,
        displacements: ArrayLike | None = None,
    ) -> Dual:
        """The gradient with respect to all data of f(r, lambda, u) with the derivatives `reactions`
        (k, dim), `multipliers` (p,) and `displacements` (k, dim), from one transposed solve.
        Where contacts are weakly active it is that of the piece at which the solver ended.
        InputError as forward().
        """
        problem = self.problem
        by_r = _given("reactions", reactions, problem.q.shape)
        by_lam = _given("multipliers", multipliers, problem.s.shape)
        by_u = _given("displacements", displacements, problem.q.shape)
        if np.any(by_u):
            by_r = by_r + np.asarray(transposed(problem.Q) @ by_u.ravel()).reshape(by_r.shape)
            by_lam = by_lam + problem.V.T @ by_u.ravel()
        z, b, a = self.tangent.solve_transposed(by_r.ravel(), by_lam)

        def by_parameter() -> np.ndarray:
            return np.asarray(np.sum(self.by_parameter * a().reshape(by_r.shape), axis=1))

        r, lam = self.solution.reactions, self.solution.multipliers
        return Dual(by_u - z.reshape(by_u.shape), -b, r, lam, by_parameter)

    def _step(
        self, error: np.ndarray, balance: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, Callable[[], np.ndarray]]:
        """dr (k, dim), dlambda (p,) on the solver's last piece, and Q dr + V dlambda (k, dim)."""
        dr, dlam, moved = self.tangent.solve(error.ravel(), balance)
        V = self.problem.V
        return dr.reshape(error.shape), dlam, lambda: (moved() + V @ dlam).reshape(error.shape)


def sensitivity(
    problem: InterfaceProblem, solution: Solution, distance: float | None = None
) -> Sensitivity:
    """The derivative of a certified solution with respect to the data of its problem, as an
    operator with products forward and adjoint.

    Nothing is solved before it is asked for; the factors are then kept and serve all directions.

    Parameters
    ----------
    problem : the interface problem
    solution : its certified solution
    distance : to a kink, over the largest force, within which a contact counts as weakly active
        [-]; by default 1e-6, or a hundred certificates of the solution if that is more

    Returns
    -------
    Sensitivity : with `forward`, `adjoint`, `weak`, `differentiable` and a `sentence` that says
        what is known

    Raises
    ------
    InputError : for a solution that is not certified, or that belongs to another problem

    Sources: those of contactopt.derivatives.
    """
    if not isinstance(problem, InterfaceProblem) or not isinstance(solution, Solution):
        raise InputError(
            "sensitivity needs an InterfaceProblem and its Solution; "
            f"got {type(problem).__name__} and {type(solution).__name__}."
        )
    r = solution.reactions
    moved = _moved(problem, solution) if r.shape == problem.q.shape else None
    residual = natural_map_residual(problem, r, solution.multipliers, moved)
    if not solution.solved or not residual <= CERTIFIED:
        raise InputError(
            f"only a certified solution has a derivative; this one is '{solution.status}' with the"
            f" residual {residual:.1e} on this problem: solve it with a smaller tol first."
        )
    distance = told_apart(residual) if distance is None else distance
    check_number("distance", distance, low=0.0)
    return Sensitivity(problem, solution, distance, None if moved is None else moved.value)


def _moved(problem: InterfaceProblem, solution: Solution) -> Moved:
    """Q r, from the displacements of the bodies where a method carried them along."""
    form, X = getattr(problem.Q, "coupled", None), solution.displacements
    if form is not None and X is not None and len(X.parts) == len(form.terms):
        found = improved(form, X, solution.reactions)
        if found.accuracy <= CERTIFIED:
            return found
    return Moved(np.asarray(problem.Q @ solution.reactions.ravel()), 0.0)


def told_apart(residual: float) -> float:
    """The distance to a kink, over the largest force, below which a certificate cannot say on which
    side of it a solution lies.
    """
    return max(NEAR, 100 * residual)  # and this many times the certificate, if that is more


def _given(name: str, value: ArrayLike | None, shape: tuple[int, ...]) -> np.ndarray:
    """The array of that shape; zeros if there is none, and one number fills it."""
    if value is None:
        return np.zeros(shape)
    array = real_array(name, value)
    return np.broadcast_to(array, shape) if array.ndim == 0 else _shaped(name, array, shape)


def _shaped(
    name: str, value: spmatrix | LinearOperator | np.ndarray, shape: tuple[int, ...]
) -> spmatrix | LinearOperator | np.ndarray:
    if getattr(value, "shape", None) != shape:
        raise InputError(
            f"{name} must have the shape {shape}; got"
            f" {getattr(value, 'shape', type(value).__name__)}."
        )
    return value
