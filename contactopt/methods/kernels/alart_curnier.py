"""Alart and Curnier's equations of contact and friction, their Newton steps, dense or by Krylov
methods, and where to start.

r = P(r - rho (Q r + V lambda + q)),  V' r + s = 0,  P the map of the law (contactopt.problem.laws,
                                      `project`)
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.linear.deadline import enough
from contactopt.linear.operators import diagonal
from contactopt.methods.constants import LAST_LOOSEST, LAST_SHARE, LOOSE
from contactopt.methods.kernels.bonded import LEAST_PIVOT, Bonded, bonded
from contactopt.methods.kernels.krylov import krylov_step
from contactopt.methods.kernels.semismooth import RIDGE, Equations
from contactopt.methods.kernels.sparse_blocks import block_matrix, factorised
from contactopt.methods.kernels.sparse_newton import block_step
from contactopt.methods.method import Iterate
from contactopt.methods.preconditioners import Preconditioner
from contactopt.problem import InterfaceProblem

GLUE = 1e-8  # added to Q for the bonded solution, which a Q of deficient rank leaves open

LEAST_REACH = 1e-12  # of a multiplier's column of V, which is dimensionless
LEAST_FELT = 1e-8  # share of its motion that the glued contacts must feel of every multiplier

# equations, error, balance, D, relative accuracy -> dr, dlambda or None where the linear system is
# singular
Step = Callable[[Equations, np.ndarray, np.ndarray, np.ndarray, float], Iterate | None]


def forcing(residual: float, last: float, first: float, loosest: float, tightest: float) -> float:
    """Choose the relative accuracy of the linear system of a Newton step that is worth its price,
    from the residual of the equations now and before the last step; `last` is infinite before the
    first step, whose accuracy is given. The step
    that ends a solve need not come further than that asks.

    Source: Eisenstat, Walker (1996), Choosing the forcing terms in an inexact Newton method, SIAM
    J. Sci. Comput. 17, 16-32.
    """
    if last in (0.0, np.inf):
        worth = first if last else tightest
    else:
        worth = min(loosest, max(tightest, 0.5 * (residual / last) ** 2))
    return max(worth, min(LAST_LOOSEST, LAST_SHARE * enough()))


def coulomb_equations(
    problem: InterfaceProblem,
    center: np.ndarray | float = 0.0,
    weight: float = 0.0,
    stiffer: np.ndarray | float = 1.0,
) -> Equations:
    """Write the Alart-Curnier equations of a problem, with rho_i = 1 over the mean compliance of
    contact i.

    A proximal term of that `weight`, a compliance, counts from the forces `center` (k, dim). The
    compliance that Newton's steps should see is smaller than the diagonal of Q by `stiffer`, (k,)
    or one number. Source: Alart, Curnier (1991), A mixed formulation for frictional contact
    problems prone to Newton like solution methods.
    """
    compliance = diagonal(problem.Q).reshape(problem.q.shape).mean(axis=1) / stiffer + weight
    rho = 1 / np.maximum(compliance, 1e-3)
    law = problem.law
    return Equations(problem.Q, problem.q, problem.V, problem.s, law.project, rho, center, weight)


def admissible(problem: InterfaceProblem, r: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Forces within the bounds of the law to the last digit, at the solution equal to r (k, dim):
    P(y) = r + error. Thin bodies between several pairs of surfaces are much softer under smooth
    forces than 1 / rho, so that P(y) would make a displacement of the rounding of u; there r is
    projected.
    """
    if len(problem.pairs) == 1:
        return r + error
    return problem.law.nearest(r, np.maximum(r[:, 0], problem.law.lowest))


def definite(Q: np.ndarray | sp.csr_array) -> bool:
    """Whether a symmetric Q is safely positive definite; False if its factorisation fails."""
    try:
        if sp.issparse(Q):
            factors = splu(
                sp.csc_array(Q),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
            pivots = factors.U.diagonal()
        else:
            pivots = np.linalg.cholesky(Q).diagonal() ** 2
    except (RuntimeError, np.linalg.LinAlgError):
        return False
    return bool(pivots.min() > LEAST_PIVOT**2 * pivots.max())


def newton_steps(problem: InterfaceProblem, P: Preconditioner | None = None) -> tuple[Step, Step]:
    """Newton's steps and the bonded solution: by products with Q, or by its factors."""
    if P is not None:

        def step(equations, error, balance, D, rtol):  # type: ignore[no-untyped-def]
            return krylov_step(equations, P, error, balance, D, rtol)

        return step, step
    solver: Callable[..., Iterate | None]
    if sp.issparse(problem.Q):
        solver = partial(block_step, matrix=block_matrix(problem.Q, problem.dim))
    else:
        # it pays for elastic bodies that a plate presses together
        factor = bonded(problem) if len(problem.s) else None
        solver = partial(_dense_step, factor=factor)

    def exact(ridge: float) -> Step:
        return lambda equations, error, balance, D, rtol: solver(
            equations, error=error, balance=balance, D=D, ridge=ridge
        )

    return exact(RIDGE), exact(GLUE)


def _dense_step(
    equations: Equations,
    factor: Bonded | None,
    error: np.ndarray,
    balance: np.ndarray,
    D: np.ndarray,
    ridge: float,
) -> Iterate | None:
    """One dense step, through the bonded system while few contacts are open or slip."""
    loose = np.any(np.eye(D.shape[1]) != D, axis=(1, 2))
    if factor is not None and loose.sum() <= LOOSE * len(loose):
        with suppress(la.LinAlgError, np.linalg.LinAlgError):
            return factor.step(equations.rho, error, balance, D)
    return equations.step(error, balance, D, ridge)


def cold_start(
    problem: InterfaceProblem, step: Step | None = None, accuracy: float = 0.0
) -> Iterate:
    """Find the bonded solution of a dimensionless problem, from which Newton's method starts, to a
    relative accuracy; by default with factors.

    Without a plate the start has no force at all, if its residual is smaller: forces that bond
    rigid bodies are of any size, but on elastic bodies Newton's method cycles from no force.
    """
    zero = np.zeros(problem.q.shape), np.zeros(len(problem.s))
    glued = glued_contacts(problem)
    if not glued.any():
        return zero
    equations = coulomb_equations(problem)
    if isinstance(problem.Q, np.ndarray) and not len(problem.s):
        bonded = _bonded(problem, np.repeat(glued, problem.dim))
    else:
        glue = replace(glued_projection(equations, glued), rho=np.ones(problem.contacts))
        _, error, balance, D = glue.evaluate(*zero)
        bonded = (step or newton_steps(problem)[1])(glue, error, balance, D, accuracy)
    if bonded is None or len(problem.s):
        return bonded or zero
    return min(zero, bonded, key=lambda point: equations.evaluate(*point)[0])


def _bonded(problem: InterfaceProblem, glued: np.ndarray) -> Iterate | None:
    """The forces that hold the components `glued` (k dim,) at rest, for an array Q and no plate."""
    Q = problem.Q if glued.all() else problem.Q[np.ix_(glued, glued)]
    inverse = factorised(Q + GLUE * np.eye(len(Q)))
    if inverse is None:
        return None
    r = np.zeros(problem.q.shape)
    r.ravel()[glued] = inverse(-problem.q.ravel()[glued])
    return (r, np.zeros(0)) if np.isfinite(r).all() else None


def glued_contacts(problem: InterfaceProblem) -> np.ndarray:
    """Choose the contacts (k,) that the bonded solution of a dimensionless problem glues.

    They are those that would penetrate and, where loads press free bodies together, those whose gap
    is at most the least approach q_i + Q_ii F of a contact i that bears the load F of its pair
    alone. All are glued where the near ones alone would leave a motion free.
    """
    gap = problem.q[:, 0]
    closed = np.asarray((problem.law.lowest < 0) | (gap < 0))
    if not len(problem.s):
        return closed
    reach = np.maximum(np.abs(problem.V).max(axis=0, initial=0.0), LEAST_REACH)
    force = float(np.sum(np.abs(problem.s) / reach))
    indented = gap + diagonal(problem.Q).reshape(problem.q.shape)[:, 0] * force
    pairs = [slice(pair.start, pair.stop) for pair in problem.pairs]
    for own in pairs or [slice(0, problem.contacts)]:
        closed[own] |= gap[own] <= indented[own].min(initial=np.inf)
    if closed.all() or _determined(problem, closed):
        return closed
    return np.ones(problem.contacts, dtype=bool)


def _determined(problem: InterfaceProblem, closed: np.ndarray) -> bool:
    """Whether the glued contacts hold every motion that all of them hold."""
    V = sp.csr_array(problem.V)
    near = V[np.repeat(closed, problem.dim)]
    whole, felt = (V.T @ V).toarray(), (near.T @ near).toarray()
    try:
        return bool(la.eigh(felt, whole, eigvals_only=True, subset_by_index=[0, 0])[0] > LEAST_FELT)
    except la.LinAlgError:
        return False


def glued_projection(equations: Equations, glued: np.ndarray) -> Equations:
    """The linear equations in which `glued` (k,) contacts stick and others have no force."""
    D = np.where(glued[:, None, None], np.eye(equations.q.shape[1]), 0.0)
    return replace(equations, project=lambda y: (np.where(glued[:, None], y, 0.0), D))
