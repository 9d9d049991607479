"""Semismooth Newton method on the Alart-Curnier equations, the primal-dual active set method for Coulomb friction.

Solves r = P(r - rho (Q r + V lambda + q)), V' r + s = 0 with P the Coulomb map (contactopt.cones.coulomb_map): each step
sorts the contacts into open, sticking and slipping and solves one linear system of the closed ones, dense, n^3/3 to
2 n^3/3 operations. Full steps from the bonded solution; the number of steps hardly depends on the mesh
(reports/newton_steps). Not globally convergent: rank-deficient Q (rigid bodies, redundant contacts) or strong
friction may make it cycle, which is what `proximal` is for.
Sources: Alart, Curnier (1991); Hueber, Stadler, Wohlmuth (2008), A primal-dual active set algorithm for
three-dimensional contact problems with Coulomb friction.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from contactopt.bonded import Bonded
from contactopt.cones import coulomb_map
from contactopt.errors import InputError
from contactopt.methods import NATIVE, Iterate
from contactopt.problem import InterfaceProblem
from contactopt.semismooth import Equations

LOOSE = 0.5  # share of contacts that do not stick, up to which the bonded factorisation is cheaper than a new one


@dataclass(frozen=True)
class Newton:
    """linear: how the systems are solved, 'dense' or 'gmres', which needs products with Q only."""

    linear: str = "dense"

    def __post_init__(self) -> None:
        if self.linear not in ("dense", "gmres"):
            raise InputError(f"unknown linear solver {self.linear!r}; choose dense or gmres.")

    def backends(self, dim: int) -> tuple[str, str]:
        return NATIVE, NATIVE

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        equations = coulomb_equations(problem)
        factor = bonded_factor(problem) if self.linear == "dense" else None
        r, multipliers = cold_start(problem, factor, self.linear) if start is None else start
        while True:
            _, error, balance, D = equations.evaluate(r, multipliers)
            yield r + error, multipliers  # P(y): at the solution equal to r, and within the bounds to the last digit
            if self.linear == "gmres":
                step = equations.krylov_step(error, balance, D)
            else:
                step = newton_step(equations, factor, error, balance, D)
            if step is None:
                return
            r, multipliers = r + step[0], multipliers + step[1]


def coulomb_equations(problem: InterfaceProblem, center: np.ndarray | None = None, weight: float = 0.0) -> Equations:
    """The Alart-Curnier equations of a problem, rho_i = 1 over the mean compliance of contact i."""
    compliance = np.diag(problem.Q).reshape(problem.q.shape).mean(axis=1) + weight
    return Equations(
        problem.Q,
        problem.q,
        problem.V,
        problem.s,
        lambda y: coulomb_map(y, problem.mu, problem.bilateral),
        1 / np.maximum(compliance, 1e-3),
        center,
        weight,
    )


def bonded_factor(problem: InterfaceProblem) -> Bonded | None:
    """The factorised bonded system where it pays: elastic bodies pressed together by a plate, Q of full rank."""
    try:
        return Bonded(problem.Q, problem.V) if len(problem.s) else None
    except la.LinAlgError:
        return None


def newton_step(
    equations: Equations, factor: Bonded | None, error: np.ndarray, balance: np.ndarray, D: np.ndarray
) -> Iterate | None:
    """One step, through the bonded system while few contacts are open or slip."""
    loose = np.any(np.eye(D.shape[1]) != D, axis=(1, 2))
    if factor is not None and loose.sum() <= LOOSE * len(loose):
        try:
            return factor.step(equations.rho, error, balance, D)
        except (la.LinAlgError, np.linalg.LinAlgError):
            pass
    return equations.step(error, balance, D)


def cold_start(problem: InterfaceProblem, factor: Bonded | None = None, linear: str = "dense") -> Iterate:
    """All contacts glued if a plate presses the bodies together, else no force at all."""
    zero = np.zeros(problem.q.shape), np.zeros(len(problem.s))
    if len(problem.s) == 0:
        return zero
    if factor is not None:
        r, multipliers = factor.solve(-problem.q.ravel(), problem.s)
        return r.reshape(problem.q.shape), multipliers
    glue = Equations(
        problem.Q,
        problem.q,
        problem.V,
        problem.s,
        lambda y: (y, np.broadcast_to(np.eye(y.shape[1]), (*y.shape, y.shape[1]))),
    )
    _, error, balance, D = glue.evaluate(*zero)
    if linear == "gmres":
        return glue.krylov_step(error, balance, D) or zero
    return glue.step(error, balance, D, ridge=1e-8) or zero
