"""The programs in displacements: the primal form of the programs in forces.

The bodies' energy is that of the stiffness S = Q^-1, (u - q - V lambda)' S (u - q - V lambda) / 2,
less the work s' lambda of the loads on the plates. Lagrange's multiplier of the definition of the
stretch z = u - q - V lambda is the force r = S z, and the minimum over u leaves the program in
forces with the opposite sign: the value here is minus the value there. A friction bound |r_t| <= g
turns into its conjugate, the work g |u_t| of slip, and a cone of forces into its dual cone u_n >=
mu |u_t|. With `facets` |u_t| is the largest of -c . u_t over the corners c of the polygon.

InputError if the compliance is singular, because displacements do not determine forces then.
"""

from typing import Any

import cvxpy as cp
import numpy as np
import scipy.linalg as la

from contactopt.errors import InputError
from contactopt.models.program import (
    Program,
    Reader,
    answered,
    blockwise,
    columns,
    components,
    cone_coefficient,
    corners,
    matrix,
    pushing,
    stated,
)
from contactopt.problem import InterfaceProblem


@stated
def normal(problem: InterfaceProblem) -> Program:
    """min z' S_nn z / 2 - (s + V_t' r_t)' lambda   subject to  u >= 0,  z = u - q_n - Q_nt r_t -
    V_n lambda,  S_nn = Q_nn^-1.
    """
    u, lam, z, S, law, given, r_t = _normal(problem)
    return _program(-given @ lam, [u >= 0, law], u, lam, {"r_t": r_t}, S, z)


@stated
def penalised(problem: InterfaceProblem, stiffness: float = 1e3) -> Program:
    """min z' S_nn z / 2 - (s + V_t' r_t)' lambda + kappa |max(-u, 0)|^2 / 2   subject to  z = u -
    q_n - Q_nt r_t - V_n lambda,  S_nn = Q_nn^-1.
    """
    u, lam, z, S, law, given, r_t = _normal(problem)
    kappa = cp.Parameter(nonneg=True, value=stiffness, name="kappa")
    work = -given @ lam + kappa * cp.sum_squares(cp.neg(u)) / 2
    return _program(work, [law], u, lam, {"r_t": r_t, "kappa": kappa}, S, z)


@stated
def bilateral(problem: InterfaceProblem) -> Program:
    """min z' S_nn z / 2 - (s + V_t' r_t)' lambda   subject to  u = 0,  z = u - q_n - Q_nt r_t - V_n
    lambda,  S_nn = Q_nn^-1.
    """
    u, lam, z, S, law, given, r_t = _normal(problem)
    return _program(-given @ lam, [u == 0, law], u, lam, {"r_t": r_t}, S, z)


@stated
def tangential(problem: InterfaceProblem, facets: int | None = None) -> Program:
    """min z' S_tt z / 2 - s' shift + sum over the contacts of g |u_t|   subject to  z = u_t - q_t -
    Q_tn r_n - V lambda - V_t shift,  S_tt = Q_tt^-1.
    """
    n, t = components(problem)
    plates, V = pushing(problem), problem.V[t]
    u = cp.Variable(len(t), name="u_t")
    shift = cp.Variable(int((~plates).sum()), name="shift")
    z = cp.Variable(len(t), name="z")
    r_n, g = cp.Parameter(len(n), name="r_n"), cp.Parameter(len(n), nonneg=True, name="g")
    parameters = {"r_n": r_n, "g": g}
    rest = problem.q[:, 1:].ravel() + problem.Q[np.ix_(t, n)] @ r_n + V[:, ~plates] @ shift
    if plates.any():
        parameters["approach"] = lam = cp.Parameter(int(plates.sum()), name="lambda")
        rest = rest + V[:, plates] @ lam
    S = _stiffness(problem.Q[np.ix_(t, t)])
    work = -problem.s[~plates] @ shift + g @ _slip(problem, u, facets)
    program = cp.Problem(cp.Minimize(cp.quad_form(z, S) / 2 + work), [z == u - rest])
    return Program(program, {"u_t": u, "shift": shift}, parameters, _reaction(S, z))


@stated
def tresca(problem: InterfaceProblem, facets: int | None = None) -> Program:
    """min z' S z / 2 - s' lambda + sum over the contacts of g |u_t|   subject to  u_n >= 0 where
    contacts may open,  u_n = 0 elsewhere,  z = u - q - V lambda,  S = Q^-1.
    """
    u, u_n, u_t, lam, z, S, stretch = _all(problem)
    g = cp.Parameter(problem.contacts, nonneg=True, name="g")
    work = -problem.s @ lam + g @ _slip(problem, u_t, facets)
    apart = problem.law.lowest == 0
    contact = [u_n[np.flatnonzero(apart)] >= 0] if apart.any() else []
    closed = [u_n[np.flatnonzero(~apart)] == 0] if not apart.all() else []
    return _program(work, [*contact, *closed, stretch], u, lam, {"g": g}, S, z)


@stated
def associated(problem: InterfaceProblem, facets: int | None = None) -> Program:
    """min z' S z / 2 - s' lambda subject to u_n >= mu |u_t|, z = u - q - V lambda, S = Q^-1."""
    mu = cone_coefficient(problem)
    u, u_n, u_t, lam, z, S, stretch = _all(problem)
    opening = u_n >= cp.multiply(mu, _slip(problem, u_t, facets))
    return _program(-problem.s @ lam, [opening, stretch], u, lam, {}, S, z)


@stated
def acary_cadoux(problem: InterfaceProblem, facets: int | None = None) -> Program:
    """min z' S z / 2 - s_plates' lambda   subject to  u_n + mu s >= mu |u_t|,  z = u - q - V
    lambda,  S = Q^-1.
    """
    mu = cone_coefficient(problem)
    u, u_n, u_t, lam, z, S, stretch = _all(problem)
    s = cp.Parameter(problem.contacts, nonneg=True, value=np.zeros(problem.contacts), name="s")
    opening = u_n + cp.multiply(mu, s) >= cp.multiply(mu, _slip(problem, u_t, facets))
    return _program(-problem.s @ lam, [opening, stretch], u, lam, {"s": s}, S, z)


def _normal(problem: InterfaceProblem) -> tuple[Any, ...]:
    """u, lambda, z, S_nn, the definition of z, the load of the plates, the parameter r_t."""
    n, t = components(problem)
    plates, k = pushing(problem), problem.contacts
    V = problem.V[:, plates]
    u, z = cp.Variable(k, name="u"), cp.Variable(k, name="z")
    lam = cp.Variable(int(plates.sum()), name="lambda")
    r_t = cp.Parameter(len(t), value=np.zeros(len(t)), name="r_t")
    rest = problem.q[:, 0] + problem.Q[np.ix_(n, t)] @ r_t + V[n] @ lam
    load = problem.s[plates] + V[t].T @ r_t
    return u, lam, z, _stiffness(problem.Q[np.ix_(n, n)], "S_nn"), z == u - rest, load, r_t


def _all(problem: InterfaceProblem) -> tuple[Any, ...]:
    """u, its normal and tangential parts, lambda, z, S, the definition of z."""
    n, t = components(problem)
    u, z = cp.Variable(problem.q.size, name="u"), cp.Variable(problem.q.size, name="z")
    lam = cp.Variable(len(problem.s), name="lambda")
    stretch = z == u - problem.q.ravel() - problem.V @ lam
    return u, u[n], u[t], lam, z, _stiffness(problem.Q), stretch


def _stiffness(Q: np.ndarray, name: str = "S") -> Any:
    """Q^-1; InputError if Q is singular."""
    try:
        return matrix(la.cho_solve(la.cho_factor((Q + Q.T) / 2), np.eye(len(Q))), name)
    except la.LinAlgError as error:
        raise InputError(
            "the compliance is singular, so use the program in forces, form='dual'."
        ) from error


def _slip(problem: InterfaceProblem, u_t: object, facets: int | None) -> Any:
    """|u_t| (k,): the largest work that the forces of the unit disc, or of its polygon, resist."""
    u = columns(blockwise(problem.law.stretch(problem.dim), u_t), problem.contacts)
    reach = corners(facets, problem.dim)
    return cp.norm(u, 2, axis=0) if reach is None else cp.max(-reach @ u, axis=0)


def _reaction(S: cp.Expression, z: cp.Variable) -> dict[str, Reader]:
    return {"reaction": lambda: np.asarray(S.value @ answered(z.value))}


def _program(
    work: cp.Expression,
    rules: list[cp.Constraint],
    u: cp.Variable,
    lam: cp.Variable,
    parameters: dict[str, Any],
    S: cp.Expression,
    z: cp.Variable,
) -> Program:
    """min z' S z / 2 + work subject to the rules, with lambda only where there are plates."""
    program = cp.Problem(cp.Minimize(cp.quad_form(z, S) / 2 + work), rules)
    variables = {"u": u} | ({"lambda": lam} if lam.size else {})
    return Program(program, variables, parameters, _reaction(S, z))
