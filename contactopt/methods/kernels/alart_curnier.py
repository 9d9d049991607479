"""Alart and Curnier's equations of contact and friction, their Newton steps, dense or by Krylov
methods, and where to start.

r = P(r - rho (Q r + V lambda + q)),  V' r + s = 0,  P the map of the law (contactopt.problem.laws,
                                      `project`)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.linear.operators import diagonal
from contactopt.methods.constants import KRYLOV_FIRST, KRYLOV_LOOSEST, KRYLOV_TIGHTEST, LOOSE
from contactopt.methods.kernels.bonded import LEAST_PIVOT, Bonded
from contactopt.methods.kernels.krylov import krylov_step
from contactopt.methods.kernels.semismooth import RIDGE, Equations
from contactopt.methods.preconditioners import Preconditioner
from contactopt.problem import InterfaceProblem

FIRST = KRYLOV_FIRST  # also of the bonded solution
GLUE = 1e-8  # added to Q for the bonded solution, which a Q of deficient rank leaves open

LEAST_REACH = 1e-12  # of a multiplier's column of V, which is dimensionless
LEAST_FELT = 1e-8  # share of its motion that the glued contacts must feel of every multiplier

Iterate = tuple[np.ndarray, np.ndarray]  # reactions (k, dim), multipliers (p,)
# equations, error, balance, D, relative accuracy -> dr, dlambda or None
Step = Callable[[Equations, np.ndarray, np.ndarray, np.ndarray, float], Iterate | None]


def forcing(residual: float, last: float) -> float:
    """Choose the relative accuracy of the linear system of a Newton step that is worth its price.

    Source: Eisenstat, Walker (1996), Choosing the forcing terms in an inexact Newton method, SIAM
    J. Sci. Comput. 17, 16-32.

    Parameters
    ----------
    residual, last : The residual of the equations now and before the last step; `last` is infinite
        before the first step.

    Returns
    -------
    The accuracy, between KRYLOV_TIGHTEST and KRYLOV_LOOSEST.
    """
    if last in (0.0, np.inf):
        return FIRST if last else KRYLOV_TIGHTEST
    return min(KRYLOV_LOOSEST, max(KRYLOV_TIGHTEST, 0.5 * (residual / last) ** 2))


def coulomb_equations(
    problem: InterfaceProblem,
    center: np.ndarray | None = None,
    weight: float = 0.0,
    stiffer: np.ndarray | float = 1.0,
) -> Equations:
    """Write the Alart-Curnier equations of a problem, with rho_i = 1 over the mean compliance of
    contact i.

    Source: Alart, Curnier (1991), A mixed formulation for frictional contact problems prone to
    Newton like solution methods.

    Parameters
    ----------
    problem : A dimensionless interface problem.
    center : (k, dim) forces of a proximal term, if there is one.
    weight : The weight of the proximal term, a compliance.
    stiffer : By what the compliance that Newton's steps should see is smaller than the diagonal of
        Q, (k,) or one number.

    Returns
    -------
    The equations, which can be evaluated and solved for a Newton step.
    """
    compliance = diagonal(problem.Q).reshape(problem.q.shape).mean(axis=1) / stiffer + weight
    return Equations(
        problem.Q,
        problem.q,
        problem.V,
        problem.s,
        problem.law.project,
        1 / np.maximum(compliance, 1e-3),
        center,
        weight,
    )


def admissible(problem: InterfaceProblem, r: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Forces within the bounds of the law to the last digit, at the solution equal to r (k, dim):
    P(y) = r + error.

    Thin bodies between several pairs of surfaces are much softer under smooth forces than 1 / rho.
    There P(y), which contains rho u, would make a displacement of the rounding of u, and r itself
    is projected on the bounds instead.
    """
    if len(problem.pairs) == 1:
        return r + error
    return problem.law.nearest(r, np.maximum(r[:, 0], problem.law.lowest))


def definite(Q: sp.csr_array) -> bool:
    """Say whether a sparse symmetric Q is safely positive definite, as that of elastic bodies
    without redundant
    contacts.

    Parameters
    ----------
    Q : (n, n) sparse matrix.

    Returns
    -------
    False also where its factorisation fails.
    """
    try:
        pivots = splu(
            sp.csc_array(Q), diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        ).U.diagonal()
    except RuntimeError:
        return False
    return bool(pivots.min() > LEAST_PIVOT**2 * pivots.max())


def _bonded_factor(problem: InterfaceProblem) -> Bonded | None:
    """The factorised bonded system where it pays: elastic bodies pressed together by a plate, Q of
    full rank.
    """
    try:
        return Bonded(problem.Q, problem.V) if len(problem.s) else None
    except la.LinAlgError:
        return None


def krylov(P: Preconditioner) -> tuple[Step, Step]:
    """Make Newton's steps from products with Q, and those of the bonded solution, which are the
    same.

    Parameters
    ----------
    P : The preconditioner of the steps.

    Returns
    -------
    Two functions (equations, error, balance, D, rtol) -> step.
    """

    def step(equations, error, balance, D, rtol):  # type: ignore[no-untyped-def]
        return krylov_step(equations, P, error, balance, D, rtol)

    return step, step


def dense(problem: InterfaceProblem) -> tuple[Step, Step]:
    """Make Newton's steps by factorisations of arrays, and those of the bonded solution.

    Parameters
    ----------
    problem : A dimensionless interface problem with Q an array.

    Returns
    -------
    Two functions (equations, error, balance, D, rtol) -> step, or None where the system is
    singular.
    """
    factor = _bonded_factor(problem)

    def steps(ridge: float) -> Step:
        return lambda equations, error, balance, D, rtol: _newton_step(
            equations, factor, error, balance, D, ridge
        )

    return steps(RIDGE), steps(GLUE)


def sparse(problem: InterfaceProblem) -> tuple[Step, Step]:
    """Make Newton's steps by sparse factors, for many bodies of which each touches few others, and
    those of the bonded
    solution.

    Parameters
    ----------
    problem : A dimensionless interface problem with Q sparse.

    Returns
    -------
    Two functions (equations, error, balance, D, rtol) -> step, or None where the system is
    singular.
    """
    V = sp.csr_array(problem.V)

    def steps(ridge: float) -> Step:
        return lambda equations, error, balance, D, rtol: _sparse_step(
            equations, V, error, balance, D, ridge
        )

    return steps(RIDGE), steps(GLUE)


def _sparse_step(
    equations: Equations,
    V: sp.csr_array,
    error: np.ndarray,
    balance: np.ndarray,
    D: np.ndarray,
    ridge: float,
) -> Iterate | None:
    """One step by the factors of [[I - D + D rho (Q + ridge I), D rho V], [V', 0]]; None if it is
    singular.
    """
    k, d = error.shape
    n, p = error.size, len(balance)
    places = np.arange(k * d).reshape(k, d)
    where = np.repeat(places, d, axis=1).ravel(), np.tile(places, (1, d)).ravel()
    scaled = sp.csr_array(((equations.rho[:, None, None] * D).ravel(), where), (n, n))
    rest = sp.csr_array(
        ((np.eye(d) - D + ridge * equations.rho[:, None, None] * D).ravel(), where), (n, n)
    )
    matrix = sp.block_array(
        [[scaled @ equations.Q + rest, scaled @ V], [V.T, sp.csr_array((p, p))]], format="csc"
    )
    try:
        x = splu(matrix).solve(np.concatenate([error.ravel(), -balance]))
    except RuntimeError:  # exactly singular
        return None
    return (x[:n].reshape(k, d), x[n:]) if np.all(np.isfinite(x)) else None


def _newton_step(
    equations: Equations,
    factor: Bonded | None,
    error: np.ndarray,
    balance: np.ndarray,
    D: np.ndarray,
    ridge: float = RIDGE,
) -> Iterate | None:
    """One dense step, through the bonded system while few contacts are open or slip."""
    loose = np.any(np.eye(D.shape[1]) != D, axis=(1, 2))
    if factor is not None and loose.sum() <= LOOSE * len(loose):
        try:
            return factor.step(equations.rho, error, balance, D)
        except (la.LinAlgError, np.linalg.LinAlgError):
            pass
    return equations.step(error, balance, D, ridge)


def cold_start(problem: InterfaceProblem, step: Step | None = None) -> Iterate:
    """Find the bonded solution, from which Newton's method starts.

    All contacts are glued if a plate presses the bodies together, else those that would penetrate.
    Without a plate the start has no force at all, if its residual is smaller: forces that bond
    rigid bodies are of any size. On elastic bodies Newton's method cycles from there, because it
    takes contacts for sliding before friction acts.

    Parameters
    ----------
    problem : A dimensionless interface problem.
    step : How the bonded system is solved; by default with factors.

    Returns
    -------
    Forces (k, dim) and multipliers (p,).
    """
    zero = np.zeros(problem.q.shape), np.zeros(len(problem.s))
    glued = glued_contacts(problem)
    if not glued.any():
        return zero
    glue = replace(
        glued_projection(coulomb_equations(problem), glued), rho=np.ones(problem.contacts)
    )
    _, error, balance, D = glue.evaluate(*zero)
    make = sparse if sp.issparse(problem.Q) else dense
    bonded = (step or make(problem)[1])(glue, error, balance, D, FIRST)
    if bonded is None or len(problem.s):
        return bonded or zero
    equations = coulomb_equations(problem)
    return min(zero, bonded, key=lambda point: equations.evaluate(*point)[0])


def glued_contacts(problem: InterfaceProblem) -> np.ndarray:
    """Choose the contacts that the bonded solution glues.

    Where loads press free bodies together these are all contacts that the loads may close, and
    otherwise those that would penetrate. One contact i that bears the load F of a pair alone closes
    once the bodies have approached by q_i + Q_ii F. Further contacts only stiffen the pair. So no
    contact closes whose gap exceeds the least of these approaches, unless a body turns. All are
    glued where the near ones alone would leave a motion free.

    Parameters
    ----------
    problem : A dimensionless interface problem.

    Returns
    -------
    (k,) mask.
    """
    gap = problem.q[:, 0]
    closed = np.asarray((problem.law.lowest < 0) | (gap < 0))
    if not len(problem.s):
        return closed
    force = float(
        np.sum(
            np.abs(problem.s) / np.maximum(np.abs(problem.V).max(axis=0, initial=0.0), LEAST_REACH)
        )
    )
    indented = gap + diagonal(problem.Q).reshape(problem.q.shape)[:, 0] * force
    for first, last in [(pair.start, pair.stop) for pair in problem.pairs] or [
        (0, problem.contacts)
    ]:
        own = slice(first, last)
        closed[own] |= gap[own] <= indented[own].min(initial=np.inf)
    return (
        closed
        if closed.all() or _determined(problem, closed)
        else np.ones(problem.contacts, dtype=bool)
    )


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
    """Write the equations in which some contacts are glued and the others carry no force.

    Parameters
    ----------
    equations : The equations of contact and friction.
    glued : (k,) mask of the contacts that are glued.

    Returns
    -------
    The same equations with another map. They are linear.
    """
    D = np.where(glued[:, None, None], np.eye(equations.q.shape[1]), 0.0)
    return replace(equations, project=lambda y: (np.where(glued[:, None], y, 0.0), D))
