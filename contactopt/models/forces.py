"""The programs in forces, the dual form, and the choice between the two forms."""

from typing import Any

import cvxpy as cp
import numpy as np

from contactopt.models import primal
from contactopt.models.program import (
    Program,
    Reader,
    blockwise,
    columns,
    components,
    cone_coefficient,
    corners,
    dual,
    dual_form,
    matrix,
    pushing,
    stated,
)
from contactopt.problem import InterfaceProblem


@stated
def normal(problem: InterfaceProblem, form: str = "dual") -> Program:
    """min r_n' Q_nn r_n / 2 + (q_n + Q_nt r_t)' r_n   subject to  r_n >= 0,  V' r + s = 0.

    This is contact without friction, or with given tangential forces.

    Parameters
    ----------
    problem : An interface problem.
    form : 'dual' in forces, or 'primal' in displacements.

    Returns
    -------
    Variable r_n (k,). Parameter r_t (k (dim - 1),), zero unless it is set. Multipliers "gap" (k,),
    and "approach" of the plates whose motion has a normal part. In the primal form the variables
    are u (k,) and lambda, and the multiplier is "reaction", r_n.

    Raises
    ------
    InputError : If the form is unknown, or primal and Q_nn singular, because displacements do not
        determine forces then.
    """
    if not dual_form(form):
        return primal.normal(problem)
    r, Q, c, r_t, balance, readers = _normal_parts(problem)
    push = r >= 0
    program = cp.Problem(cp.Minimize(cp.quad_form(r, Q) / 2 + c @ r), [push, *balance])
    return Program(program, {"r_n": r}, {"r_t": r_t}, {"gap": lambda: dual(push)} | readers)


@stated
def penalised(problem: InterfaceProblem, stiffness: float = 1e3, form: str = "dual") -> Program:
    """min r_n' Q_nn r_n / 2 + (q_n + Q_nt r_t)' r_n + |r_n|^2 / (2 kappa)   subject to  r_n >= 0,
    V' r + s = 0.

    Bodies may penetrate: r_n = kappa max(-u_n, 0) with the stiffness kappa. This is the dual of
    penalising max(-u_n, 0)^2 in displacements. The penetration falls like 1 / kappa.

    Parameters
    ----------
    problem : An interface problem; backends want it dimensionless.
    stiffness : Of each contact node [force / length].
    form : As for `normal`.

    Returns
    -------
    Variable r_n (k,). Parameters r_t (k (dim - 1),) and compliance = 1 / stiffness. Multipliers
    "gap", negative where the bodies penetrate, and "approach". The primal form has the parameter
    kappa in place of the compliance, and the multiplier "reaction".
    """
    if not dual_form(form):
        return primal.penalised(problem, stiffness)
    r, Q, c, r_t, balance, readers = _normal_parts(problem)
    compliance = cp.Parameter(nonneg=True, value=1 / stiffness, name="compliance")
    push = r >= 0
    cost = cp.quad_form(r, Q) / 2 + c @ r + compliance * cp.sum_squares(r) / 2
    readers = {"gap": lambda: dual(push) - compliance.value * r.value} | readers
    program = cp.Problem(cp.Minimize(cost), [push, *balance])
    return Program(program, {"r_n": r}, {"r_t": r_t, "compliance": compliance}, readers)


@stated
def bilateral(problem: InterfaceProblem, form: str = "dual") -> Program:
    """min r_n' Q_nn r_n / 2 + (q_n + Q_nt r_t)' r_n   subject to  V' r + s = 0.

    The surfaces cannot separate, u_n = 0.

    Parameters
    ----------
    problem, form : As for `normal`.

    Returns
    -------
    Variable r_n (k,) of any sign. Parameter r_t (k (dim - 1),). Multiplier "approach", or
    "reaction" in the primal form.
    """
    if not dual_form(form):
        return primal.bilateral(problem)
    r, Q, c, r_t, balance, readers = _normal_parts(problem)
    program = cp.Problem(cp.Minimize(cp.quad_form(r, Q) / 2 + c @ r), balance)
    return Program(program, {"r_n": r}, {"r_t": r_t}, readers)


@stated
def tangential(problem: InterfaceProblem, facets: int | None = None, form: str = "dual") -> Program:
    """min r_t' Q_tt r_t / 2 + (q_t + Q_tn r_n + V_t lambda)' r_t   subject to  |r_t| <= g at each
    contact.

    Plates that only move tangentially belong to this program, V_t' r_t + s = 0. The approach lambda
    of the others is given.

    Parameters
    ----------
    problem : An interface problem; backends want it dimensionless.
    facets : Number of edges of the regular polygon that is inscribed in each disc; None for discs,
        which are intervals in 2D.
    form : As for `normal`.

    Returns
    -------
    Variable r_t (k (dim - 1),). Parameters r_n (k,), g (k,) and approach. Multipliers "slip" u_t,
    and "shift" of the tangential plates. In the primal form the variables are u_t and shift, and
    the multiplier is "reaction", r_t.
    """
    if not dual_form(form):
        return primal.tangential(problem, facets)
    n, t = components(problem)
    plates, V = pushing(problem), problem.V[t]
    r = cp.Variable(len(t), name="r_t")
    r_n, g = cp.Parameter(len(n), name="r_n"), cp.Parameter(len(n), nonneg=True, name="g")
    parameters = {"r_n": r_n, "g": g}
    c = problem.q[:, 1:].ravel() + problem.Q[np.ix_(t, n)] @ r_n
    if plates.any():
        parameters["approach"] = lam = cp.Parameter(int(plates.sum()), name="lambda")
        c = c + V[:, plates] @ lam
    balance, shift = _balance(V[:, ~plates].T @ r + problem.s[~plates], "shift")
    law, slip, _ = _friction(problem, r, g, facets)
    Q = matrix(problem.Q[np.ix_(t, t)], "Q_tt")
    program = cp.Problem(cp.Minimize(cp.quad_form(r, Q) / 2 + c @ r), [law, *balance])
    return Program(program, {"r_t": r}, parameters, {"slip": slip} | shift)


@stated
def tresca(problem: InterfaceProblem, facets: int | None = None, form: str = "dual") -> Program:
    """min r' Q r / 2 + q' r   subject to  r_n >= 0 where contacts may open,  |r_t| <= g,  V' r + s
    = 0.

    This is Tresca's law where g is its limit, and Coulomb's law where g = mu |r_n|.

    Parameters
    ----------
    problem, facets, form : As for `tangential`.

    Returns
    -------
    Variable r (k dim,), normal first in each block. Parameter g (k,). Multipliers "gap", "slip" and
    "approach". In the primal form the variables are u (k dim,) and lambda, and the multiplier is
    "reaction", r (k dim,).
    """
    if not dual_form(form):
        return primal.tresca(problem, facets)
    r, r_n, r_t, Q, q, balance, readers = _parts(problem)
    g, apart = cp.Parameter(problem.contacts, nonneg=True, name="g"), problem.law.lowest == 0
    law, slip, _ = _friction(problem, r_t, g, facets)
    push = [r_n[np.flatnonzero(apart)] >= 0] if apart.any() else []

    def gap() -> np.ndarray:
        out = np.zeros(len(apart))
        for constraint in push:
            out[apart] = dual(constraint)
        return out

    program = cp.Problem(cp.Minimize(cp.quad_form(r, Q) / 2 + q @ r), [*push, law, *balance])
    return Program(program, {"r": r}, {"g": g}, {"gap": gap, "slip": slip} | readers)


@stated
def associated(problem: InterfaceProblem, facets: int | None = None, form: str = "dual") -> Program:
    """min r' Q r / 2 + q' r   subject to  |r_t| <= mu r_n,  V' r + s = 0.

    Its optimality conditions are those of friction with an associated flow rule: contacts that slip
    also open, by u_n = mu |u_t|.

    Parameters
    ----------
    problem, facets, form : As for `tangential`.

    Returns
    -------
    Variable r (k dim,). Multipliers "gap" (so opened), "slip" and "approach", or "reaction" in the
    primal form. InputError if the law has no such cones.
    """
    if not dual_form(form):
        return primal.associated(problem, facets)
    mu = cone_coefficient(problem)
    r, r_n, r_t, Q, q, balance, readers = _parts(problem)
    law, slip, size = _friction(problem, r_t, cp.multiply(mu, r_n), facets)
    push = r_n >= 0  # follows from the cone unless mu = 0
    readers |= {"gap": lambda: dual(push) + mu * size(), "slip": slip}
    program = cp.Problem(cp.Minimize(cp.quad_form(r, Q) / 2 + q @ r), [push, law, *balance])
    return Program(program, {"r": r}, {}, readers)


@stated
def acary_cadoux(
    problem: InterfaceProblem, facets: int | None = None, form: str = "dual"
) -> Program:
    """min r' Q r / 2 + q' r + (mu s)' r_n   subject to  |r_t| <= mu r_n,  V' r + s_plates = 0.

    At its solution u_n + mu s is at least mu |u_t|, so that Coulomb's law holds where s = |u_t|.
    Source: Acary, Cadoux, Lemarechal, Malick (2011), A formulation of the linear discrete Coulomb
    friction problem via convex optimization.

    Parameters
    ----------
    problem, facets, form : As for `tangential`.

    Returns
    -------
    Variable r (k dim,). Parameter s (k,), zero unless it is set. Multipliers "gap" u_n, "slip" u_t
    and "approach", or "reaction" in the primal form. InputError if the law has no such cones.
    """
    if not dual_form(form):
        return primal.acary_cadoux(problem, facets)
    mu = cone_coefficient(problem)
    r, r_n, r_t, Q, q, balance, readers = _parts(problem)
    s = cp.Parameter(problem.contacts, nonneg=True, value=np.zeros(problem.contacts), name="s")
    law, slip, size = _friction(problem, r_t, cp.multiply(mu, r_n), facets)
    push = r_n >= 0
    readers |= {"gap": lambda: dual(push) + mu * (size() - s.value), "slip": slip}
    cost = cp.quad_form(r, Q) / 2 + q @ r + cp.multiply(mu, s) @ r_n
    return Program(
        cp.Problem(cp.Minimize(cost), [push, law, *balance]), {"r": r}, {"s": s}, readers
    )


def _normal_parts(problem: InterfaceProblem) -> tuple[Any, Any, Any, Any, list[Any], dict]:
    """Variable r_n, Q_nn, c = q_n + Q_nt r_t, parameter r_t, balance, its multiplier by name."""
    n, t = components(problem)
    plates = pushing(problem)
    r = cp.Variable(len(n), name="r_n")
    r_t = cp.Parameter(len(t), value=np.zeros(len(t)), name="r_t")
    c = problem.q[:, 0] + problem.Q[np.ix_(n, t)] @ r_t
    V = problem.V[:, plates]
    balance, approach = _balance(V[n].T @ r + V[t].T @ r_t + problem.s[plates], "approach")
    return r, matrix(problem.Q[np.ix_(n, n)], "Q_nn"), c, r_t, balance, approach


def _parts(problem: InterfaceProblem) -> tuple[Any, Any, Any, Any, Any, list[Any], dict]:
    """Variable r, its normal and tangential parts, Q, q, balance, its multiplier by name."""
    n, t = components(problem)
    r, q = cp.Variable(problem.q.size, name="r"), cp.Constant(problem.q.ravel(), name="q")
    balance, approach = _balance(problem.V.T @ r + problem.s, "approach")
    return r, r[n], r[t], matrix(problem.Q), q, balance, approach


def _friction(
    problem: InterfaceProblem, r_t: object, g: object, facets: int | None
) -> tuple[Any, Reader, Reader]:
    """|t_i| <= g_i for r_t (k d,), the reader of the slip u_t (k, d) and that of the multiplier of
    g (k,). t is r_t, or what `Law.stretch` makes of it. Polygons with so many facets are inscribed;
    intervals have two.
    """
    k = problem.contacts
    back = problem.law.stretch(problem.dim)
    back = None if back is None else np.linalg.inv(back)

    def slip(v: np.ndarray) -> np.ndarray:
        return v if back is None else np.einsum("kab,kb->ka", back, v)

    t, points = columns(blockwise(back, r_t), k), corners(facets, problem.dim)
    if points is None:
        disc = cp.SOC(g, t, axis=0)
        read = lambda: slip(dual(disc, 1).reshape(2, k).T)  # noqa: E731
        return disc, read, lambda: dual(disc, 0).reshape(k)
    # an edge lies between two corners; the interval of 2D has its corners for edges
    D = points if problem.dim == 2 else (points + np.roll(points, -1, axis=0)) / 2
    reach = float(np.linalg.norm(D[0]))
    D = D / reach
    polygon = D @ t <= reach * np.ones((len(D), 1)) @ cp.reshape(g, (1, k), order="F")
    read = lambda: slip(-dual(polygon).T @ D)  # noqa: E731
    return polygon, read, lambda: reach * dual(polygon).sum(axis=0)


def _balance(resultant: cp.Expression, name: str) -> tuple[list[Any], dict[str, Reader]]:
    """resultant = 0 and the reader of its multiplier; nothing without plates."""
    if resultant.size == 0:
        return [], {name: lambda: np.zeros(0)}
    balance = resultant == 0
    return [balance], {name: lambda: dual(balance)}
