"""Newton's steps on the contact equations and the equilibrium of the bodies at once: no solve
inside a solve.

The unknowns are the displacements X of the bodies, the contact forces r and the multipliers lambda.
With Q = T A^-1 T' + R (contactopt.linear.saddle_point) one step of Newton's method on r = P(r - rho
(T X + R r + V lambda + q)) is

    A dX - T' dr = T' r - A X
    (I - D + D rho R) dr + D rho (T dX + V dlambda) = error,   V' dr = -balance.

Flexible GMRES solves it to the accuracy that the step is worth. Its preconditioner is block
triangular: the Schur complement for a model of Q gives (dr, dlambda), then one V-cycle per body
gives dX for the right side T' dr and the rest. The displacements are carried from step to step, so
that equilibrium becomes as accurate as the contact equations.

Source of the preconditioner: Bramble, Pasciak (1988), A preconditioning technique for indefinite
systems; Murphy, Golub, Wathen (2000), A note on preconditioning for indefinite linear systems.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from contactopt.linear.budget import expect, spent
from contactopt.linear.concurrency import one_blas_thread
from contactopt.linear.flexible_gmres import flexible_gmres
from contactopt.linear.saddle_point import CoupledForm, in_equilibrium
from contactopt.linear.stacked import Stacked, norm
from contactopt.methods import constants
from contactopt.methods.kernels.alart_curnier import (
    admissible,
    coulomb_equations,
    glued_contacts,
    glued_projection,
)
from contactopt.methods.kernels.balance import settled
from contactopt.methods.kernels.krylov import model_of
from contactopt.methods.kernels.linearised import Linearised
from contactopt.methods.kernels.newton_loop import Forcing, Unknowns
from contactopt.methods.kernels.semismooth import Equations
from contactopt.methods.method import Iterate, Known
from contactopt.methods.preconditioners import Preconditioner
from contactopt.problem import InterfaceProblem
from contactopt.problem.certificate import Moved

# V-cycles of all bodies for the bonded solution (`python -m experiments.questions.large_punch`)
USUAL = 8
IDLE = 3  # steps without progress after which it starts again


class State(NamedTuple):
    """Displacements X of the bodies, contact forces r (k, d) and multipliers (p,)."""

    X: Stacked
    r: np.ndarray
    multipliers: np.ndarray

    def plus(self, change: State, times: float = 1.0) -> State:
        """The sum with so many times a change."""
        X, r, multipliers = change
        return State(self.X + times * X, self.r + times * r, self.multipliers + times * multipliers)


@dataclass(frozen=True, eq=False)
class Coupled:
    """The equations of one problem, its form before condensation and a model of Q."""

    equations: Equations
    form: CoupledForm
    P: Preconditioner

    @cached_property
    def weights(self) -> Stacked:
        """Weights of the residuals of X, r and the balance, in units of the root of an energy."""
        r = np.repeat(self.equations.rho**-0.5, self.equations.q.shape[1])
        return _joined(self.form.diagonal() ** -0.5, r, np.ones(len(self.equations.s)))

    def moved(self, at: State) -> np.ndarray:
        """The relative displacements u (k, d)."""
        u = self.form.moved(at.X, at.r.ravel()) + self.equations.V @ at.multipliers
        return np.asarray(u.reshape(at.r.shape) + self.equations.q)

    def linearised(self, at: State) -> tuple[Stacked, Linearised]:
        """The right side of Newton's step in parts for X, r, the balance; its contact equations."""
        equations = self.equations
        P, D = equations.project(at.r - equations.rho[:, None] * self.moved(at))
        balance = equations.V.T @ at.r.ravel() + equations.s
        forces = self.form.unbalanced(at.X, at.r.ravel())
        return _joined(forces, (P - at.r).ravel(), -balance), Linearised(equations, D)

    def size(self, right: Stacked) -> float:
        """The residual that belongs to a right side."""
        return norm(self.weights * right)

    def product(self, linearised: Linearised, x: Stacked) -> Stacked:
        """The left sides of Newton's step for changes of X, r and the multipliers."""
        X, r, multipliers = _parted(x)
        V, moved = self.equations.V, self.form.moved(X, r)
        forces = self.form.stiffness(X) - self.form.pulled(r)
        return _joined(forces, linearised.rows(r, moved + V @ multipliers), V.T @ r)

    def solve(self, right: Stacked, linearised: Linearised, rtol: float) -> Stacked:
        """The changes that Newton's step makes for a right side, to a relative accuracy."""
        form, inverse = self.form, linearised.rough(self.P)
        model = (lambda x: self.P @ x) if self.P.model is None else self.P.model.matvec

        def precondition(x: Stacked) -> Stacked:
            forces, error, balance = _parted(x)
            r, multipliers = linearised.solve(model, inverse, error, -balance, constants.SCHUR_STEP)
            return _joined(form.approximate(forces + form.pulled(r)), r, multipliers)

        product = partial(self.product, linearised)
        return flexible_gmres(product, precondition, right, self.weights, rtol)

    def change(self, right: Stacked, linearised: Linearised, rtol: float) -> State | None:
        """Newton's step, or None if its linear system could not be solved."""
        change = self.solve(right, linearised, rtol)
        if not np.isfinite(norm(change)):
            return None
        X, r, multipliers = _parted(change)
        return State(X, r.reshape(self.equations.q.shape), multipliers)

    def judged(self, at: State, error: np.ndarray) -> Known:
        """The forces r + error, equal to r at the solution, what Q makes of them, its accuracy."""
        r = at.r + error
        return r, at.multipliers, improved(self.form, at.X, r)


def improved(form: CoupledForm, X: Stacked, r: np.ndarray) -> Moved:
    """Q r for forces r (k, d) from displacements X of the bodies, which one V-cycle improves."""
    missing = form.unbalanced(X, r.ravel())
    correction = form.approximate(missing)
    energy = X.dot(form.pulled(r.ravel()) - missing)
    lacking = missing.dot(correction)
    accuracy = np.sqrt(lacking / energy) if energy > 0 else (np.inf if lacking else 0.0)
    better = X + correction
    return Moved(form.moved(better, r.ravel()), float(accuracy), better)


@dataclass(frozen=True, eq=False)
class CoupledAt:
    """The right side of Newton's step at a point, its contact equations and its residual."""

    point: State
    residual: float
    right: Stacked
    linearised: Linearised


class CoupledSteps:
    """Newton's method on contacts and bodies. Where the residual does not fall for IDLE steps, a
    rough start has led the sorting of contacts into a circle: it starts again, once, from an
    accurate bonded solution.
    """

    def __init__(self, problem: InterfaceProblem, preconditioner: str | None):
        self.problem, form, several = problem, problem.Q.coupled, len(problem.pairs) > 1
        with one_blas_thread():
            P = model_of(problem, preconditioner, deflate=several)
            equations = coulomb_equations(problem, stiffer=P.factors[:: problem.dim])
            self.coupled = Coupled(equations, form, P if several else fitted(P, form, problem.V))
        self.restart(constants.COUPLED_FIRST)
        self.best = np.inf

    def restart(self, first: float) -> None:
        self.accuracy = Forcing(first, constants.LOOSEST, constants.COUPLED_TIGHTEST)
        self.idle = 0

    def begin(self, start: Iterate | None) -> State | None:
        """The first point; None if there is none."""
        form, before = self.coupled.form, spent()
        with one_blas_thread():
            if start is not None:
                return State(in_equilibrium(form, start[0], constants.GIVEN_BALANCE), *start)
            bonded = self._bonded()
        expect(slower=(spent() - before) / (USUAL * form.size))
        return bonded

    def evaluate(self, point: Unknowns) -> CoupledAt:
        at, coupled = State(*point), self.coupled
        with one_blas_thread():
            right, linearised = coupled.linearised(at)
            displacements, law = partial(coupled.moved, at), self.problem.law
            change = settled(coupled.equations, law, at.r, linearised.D, displacements)
            if change is not None:
                at = at._replace(multipliers=at.multipliers + change)
                right, linearised = coupled.linearised(at)
            return CoupledAt(at, coupled.size(right), right, linearised)

    def change(self, at: CoupledAt) -> Unknowns | None:
        self.idle = 0 if at.residual < self.best else self.idle + 1
        self.best = min(self.best, at.residual)
        with one_blas_thread():
            if self.idle > IDLE and self.accuracy.first > constants.COUPLED_TIGHTEST:
                self.restart(constants.COUPLED_TIGHTEST)
                bonded = self._bonded()
                return None if bonded is None else bonded.plus(at.point, -1.0)
            rtol = self.accuracy(at.residual)
            return self.coupled.change(at.right, at.linearised, rtol)

    def shown(self, at: CoupledAt) -> Known:
        """What the driver judges."""
        r, error = at.point.r, _parted(at.right)[1].reshape(at.point.r.shape)
        with one_blas_thread():
            return self.coupled.judged(at.point, admissible(self.problem, r, error) - r)

    def _bonded(self) -> State | None:
        """The bonded solution of `cold_start`, as accurate as the first step, or no force."""
        problem, coupled = self.problem, self.coupled
        none = np.zeros(problem.q.shape)
        zero = State(coupled.form.pulled(none.ravel()), none, np.zeros(len(problem.s)))
        glued = glued_contacts(problem)
        if not glued.any():
            return zero
        glue = Coupled(glued_projection(coupled.equations, glued), coupled.form, coupled.P)
        change = glue.change(*glue.linearised(zero), self.accuracy.first)
        bonded = None if change is None else zero.plus(change)
        if bonded is None or len(problem.s):
            return bonded or zero
        return min(zero, bonded, key=lambda state: coupled.size(coupled.linearised(state)[0]))


def fitted(P: Preconditioner, form: CoupledForm, V: np.ndarray) -> Preconditioner:
    """Scale a preconditioner P so that the eigenvalues of P Q lie about 1 / SCHUR_MARGIN where a
    random force does most of its work, with one V-cycle for Q.

    A block triangular preconditioner wants a Schur complement that is rather too large. Only forces
    in balance tell: a body without supports is held at a few nodes meanwhile, and the V-cycle knows
    the large motion that follows to few digits. So V'x = 0, and of Q x counts what no motion can
    undo.
    """
    # The mean eigenvalue of P Q, weighted with the work of the force: (Qx)' P (Qx) over x' Qx.
    x = np.random.default_rng(0).normal(size=P.shape[0])
    x -= V @ np.linalg.lstsq(V, x, rcond=None)[0]
    Qx = form.moved(form.approximate(form.pulled(x)), x)
    PV = np.stack([P @ v for v in V.T], axis=1) if V.shape[1] else V
    Qx = Qx - V @ (np.linalg.pinv(V.T @ PV) @ (PV.T @ Qx))
    factor, model = float(x @ Qx) / float(Qx @ (P @ Qx)) / constants.SCHUR_MARGIN, P.model
    stiff = None if model is None else lambda y: model @ y / factor
    return Preconditioner(P.shape[0], lambda y: factor * (P @ y), stiff)


def _joined(X: Stacked, r: np.ndarray, multipliers: np.ndarray) -> Stacked:
    return Stacked((*X.parts, r, multipliers))


def _parted(x: Stacked) -> tuple[Stacked, np.ndarray, np.ndarray]:
    *X, r, multipliers = x.parts
    return Stacked(tuple(X)), r, multipliers
