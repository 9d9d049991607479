"""Alart and Curnier's equations of contact and friction, their Newton steps by factors, and where
to start.

r = P(r - rho (Q r + V lambda + q)),  V' r + s = 0,  P the map of the law (contactopt.problem.laws,
                                      `project`)
"""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.linear.operators import diagonal, form
from contactopt.methods.constants import LOOSE
from contactopt.methods.kernels.balance import LEAST_FELT
from contactopt.methods.kernels.bonded import LEAST_PIVOT, Bonded, bonded
from contactopt.methods.kernels.semismooth import (
    RIDGE,
    Equations,
    Evaluated,
    Factored,
    Solve,
    evaluated,
)
from contactopt.methods.kernels.sparse_blocks import block_matrix, factorised
from contactopt.methods.method import Iterate
from contactopt.problem import InterfaceProblem

GLUE = 1e-8  # added to Q for the bonded solution, which a Q of deficient rank leaves open


def coulomb_equations(
    problem: InterfaceProblem,
    center: np.ndarray | float = 0.0,
    weight: float = 0.0,
    stiffer: np.ndarray | float = 1.0,
) -> Equations:
    """The Alart-Curnier equations (1991), with rho_i = 1 over the mean compliance of contact i. A
    proximal term of that `weight`, a compliance, counts from `center` (k, dim). The compliance that
    Newton's steps should see is smaller than the diagonal of Q by `stiffer`, (k,) or a number.
    """
    compliance = diagonal(problem.Q).reshape(problem.q.shape).mean(axis=1) / stiffer + weight
    rho = 1 / np.maximum(compliance, 1e-3)
    law = problem.law
    return Equations(problem.Q, problem.q, problem.V, problem.s, law.project, rho, center, weight)


def admissible(problem: InterfaceProblem, r: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Forces within the bounds: P(y) = r + error, or P(r) where P(y) would displace by rounding."""
    if len(problem.pairs) == 1:
        return r + error
    return problem.law.nearest(r, np.maximum(r[:, 0], problem.law.lowest))


def definite(Q: np.ndarray | sp.csr_array) -> bool:
    """Whether a symmetric Q is safely positive definite; False if its factorisation fails."""
    try:
        if form(Q) == "sparse":
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


@dataclass(frozen=True, eq=False)
class Sticking:
    """Steps through the bonded system of pressed elastic bodies while few contacts differ."""

    bonded: Bonded
    others: Factored

    def __call__(
        self, equations: Equations, at: Evaluated, rtol: float = 0.0, ridge: float = RIDGE
    ) -> Iterate | None:
        loose = np.any(np.eye(at.D.shape[1]) != at.D, axis=(1, 2))
        if loose.sum() <= LOOSE * len(loose):
            with suppress(la.LinAlgError, np.linalg.LinAlgError):
                return self.bonded.step(equations.rho, at.error, at.balance, at.D)
        return self.others(equations, at, rtol, ridge)


def solver_of(problem: InterfaceProblem) -> Solve:
    """How an array or a sparse Q solves the systems of Newton's steps."""
    factored = Factored(block_matrix(problem.Q, problem.dim))
    made = bonded(problem) if len(problem.s) and form(problem.Q) == "array" else None
    return factored if made is None else Sticking(made, factored)


def cold_start(
    problem: InterfaceProblem, solve: Solve | None = None, accuracy: float = 0.0
) -> Iterate:
    """The bonded solution of a dimensionless problem, to a relative accuracy. Without a plate no
    force at all, if its residual is smaller: forces that bond rigid bodies are of any size, but on
    elastic bodies Newton's method cycles from no force.
    """
    zero = np.zeros(problem.q.shape), np.zeros(len(problem.s))
    glued = glued_contacts(problem)
    if not glued.any():
        return zero
    equations = coulomb_equations(problem)
    if form(problem.Q) == "array" and not len(problem.s):
        bonded = _bonded(problem, np.repeat(glued, problem.dim))
    else:
        glue = replace(glued_projection(equations, glued), rho=np.ones(problem.contacts))
        solve = solve or solver_of(problem)
        bonded = solve(glue, evaluated(glue, *zero), accuracy, GLUE)
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
    """The contacts (k,) that the bonded solution glues: those that would penetrate and, where loads
    press free bodies together, those whose gap is at most the least approach q_i + Q_ii F of a
    contact i that bears the load F of its pair alone. All, where these leave a motion free.
    """
    gap = problem.q[:, 0]
    closed = np.asarray((problem.law.lowest < 0) | (gap < 0))
    if not len(problem.s):
        return closed
    reach = np.maximum(np.abs(problem.V).max(axis=0, initial=0.0), 1e-12)  # V is dimensionless
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
