"""The convex programs of friction in cvxpy, written as on a blackboard.

Signs and letters are those of contactopt.problem: u = Q r + V lambda + q, V' r + s = 0. Every
function takes an InterfaceProblem, dimensionless or not (backends want it dimensionless), and
returns a Program:

    normal           forces r_n of contact without friction, or with r_t given (paper, eq (21))
    displacements    the dual of `normal`: gaps and approach instead of forces
    penalised        `normal` with a spring in every contact: penetration instead of a constraint
    bilateral        `normal` without separation: r_n of any sign
    tangential       friction forces under given bounds, r_n given (eq (22)): intervals, discs or
                     polygons
    tresca           normal and tangential forces together, friction bounds given
    associated       convex relaxation of Coulomb's law: slip opens the gap by mu |u_t|
    acary_cadoux     the same with the gap shifted by mu s; Coulomb's law where s = |u_t|

Discs and cones become polygons and pyramids with `facets`, which makes the last four QPs also in
3D.

All are convex because Q is positive semidefinite; that is the caller's promise
(contactopt.methods.backends.conic checks it by Cholesky), since cvxpy's own test of it fails at
random on large matrices.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.linalg as la

from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem

Reader = Callable[[], np.ndarray]


@dataclass(frozen=True, eq=False)
class Program:
    """A cvxpy problem with its variables and parameters by name; solve with
    `program.problem.solve(solver=...)`.

    multipliers  after a solve, by name and with the signs of contactopt.problem: "gap" u_n (k,),
                 "slip" u_t (k, d - 1), "approach" lambda of the plates (p,), ...; each function
                 says which. InputError before a solve.
    """

    problem: Any
    variables: dict[str, Any]
    parameters: dict[str, Any]
    readers: dict[str, Reader]

    @property
    def multipliers(self) -> dict[str, np.ndarray]:
        return {name: read() for name, read in self.readers.items()}


def normal(problem: InterfaceProblem) -> Program:
    """min r_n' Q_nn r_n / 2 + (q_n + Q_nt r_t)' r_n   subject to  r_n >= 0,  V' r + s = 0.

    This is contact without friction, or with given tangential forces.

    Parameters
    ----------
    problem : Any interface problem; backends want it dimensionless.

    Returns
    -------
    Variable r_n (k,). Parameter r_t (k (dim - 1),), zero unless it is set. Multipliers "gap" (k,),
    and "approach" of the plates whose motion has a normal part.
    """
    r, cost, balance, readers, r_t = _normal_parts(problem)
    push = r >= 0
    readers = {"gap": lambda: _dual(push)} | readers
    return Program(
        cp.Problem(cp.Minimize(cost), [push, *balance]), {"r_n": r}, {"r_t": r_t}, readers
    )


def displacements(problem: InterfaceProblem) -> Program:
    """min (u - q_n - V_n lambda)' S (u - q_n - V_n lambda) / 2 - s' lambda   subject to  u >= 0,  S
    = Q_nn^-1.

    The elastic energy minus the work of the loads, in displacements. The optimal value is minus
    that of `normal` at r_t = 0.

    Parameters
    ----------
    problem : Any interface problem; backends want it dimensionless.

    Returns
    -------
    Variables u, the gap (k,), and lambda, the approach (p,). Multiplier "reaction", r_n = S (u -
    q_n - V_n lambda).

    Raises
    ------
    InputError : If Q_nn is singular, because displacements do not determine forces then.
    """
    dim = problem.dim
    try:
        S = la.cho_solve(
            la.cho_factor(_symmetric(problem.Q[::dim, ::dim])), np.eye(problem.contacts)
        )
    except la.LinAlgError as error:
        raise InputError(
            "the normal compliance is singular, so use the program in forces, `normal`."
        ) from error
    u, plates, V = cp.Variable(problem.contacts, name="u"), _pushing(problem), problem.V[::dim]
    variables, stretch, work = {"u": u}, u - problem.q[:, 0], 0
    if plates.any():
        variables["lambda"] = lam = cp.Variable(plates.sum(), name="lambda")
        stretch, work = stretch - V[:, plates] @ lam, problem.s[plates] @ lam
    apart = u >= 0
    program = cp.Problem(
        cp.Minimize(cp.quad_form(stretch, cp.psd_wrap(_symmetric(S))) / 2 - work), [apart]
    )
    return Program(program, variables, {}, {"reaction": lambda: _dual(apart)})


def penalised(problem: InterfaceProblem, stiffness: float = 1e3) -> Program:
    """`normal` plus |r_n|^2 / (2 stiffness): bodies may penetrate, r_n = stiffness max(-u_n, 0).

    This is the dual of penalising max(-u_n, 0)^2 in displacements. The penetration falls like 1 /
    stiffness.

    Parameters
    ----------
    problem : Any interface problem; backends want it dimensionless.
    stiffness : Of each contact node [force / length].

    Returns
    -------
    Variable r_n (k,). Parameters r_t (k (dim - 1),) and compliance = 1 / stiffness. Multipliers
    "gap", negative where the bodies penetrate, and "approach".
    """
    r, cost, balance, readers, r_t = _normal_parts(problem)
    compliance = cp.Parameter(nonneg=True, value=1 / stiffness)
    push = r >= 0
    readers = {"gap": lambda: _dual(push) - compliance.value * r.value} | readers
    program = cp.Problem(cp.Minimize(cost + compliance * cp.sum_squares(r) / 2), [push, *balance])
    return Program(program, {"r_n": r}, {"r_t": r_t, "compliance": compliance}, readers)


def bilateral(problem: InterfaceProblem) -> Program:
    """min r_n' Q_nn r_n / 2 + (q_n + Q_nt r_t)' r_n   subject to  V' r + s = 0.

    The surfaces cannot separate, u_n = 0.

    Parameters
    ----------
    problem : Any interface problem; backends want it dimensionless.

    Returns
    -------
    Variable r_n (k,) of any sign. Parameter r_t (k (dim - 1),). Multiplier "approach".
    """
    r, cost, balance, readers, r_t = _normal_parts(problem)
    return Program(cp.Problem(cp.Minimize(cost), balance), {"r_n": r}, {"r_t": r_t}, readers)


def tangential(problem: InterfaceProblem, facets: int | None = None) -> Program:
    """min r_t' Q_tt r_t / 2 + (q_t + Q_tn r_n + V_t lambda)' r_t   subject to  |r_t| <= g at each
    contact.

    Plates that only move tangentially belong to this program, V_t' r_t + s = 0. The approach lambda
    of the others is given.

    Parameters
    ----------
    problem : Any interface problem; backends want it dimensionless.
    facets : Number of edges of the regular polygon that is inscribed in each disc; None for discs,
        which are intervals in 2D.

    Returns
    -------
    Variable r_t (k (dim - 1),). Parameters r_n (k,), g (k,) and approach. Multipliers "slip" u_t,
    and "shift" of the tangential plates.
    """
    n, t = _components(problem)
    plates, V = _pushing(problem), problem.V[t]
    r = cp.Variable(len(t), name="r_t")
    parameters = {"r_n": cp.Parameter(len(n)), "g": cp.Parameter(len(n), nonneg=True)}
    c = problem.q[:, 1:].ravel() + problem.Q[np.ix_(t, n)] @ parameters["r_n"]
    if plates.any():
        parameters["approach"] = cp.Parameter(plates.sum())
        c = c + V[:, plates] @ parameters["approach"]
    balance, shift = _balance(V[:, ~plates].T @ r + problem.s[~plates], "shift")
    law, slip, _ = _friction(
        cp.reshape(r, (problem.dim - 1, len(n)), order="F"), parameters["g"], facets
    )
    cost = cp.quad_form(r, cp.psd_wrap(_symmetric(problem.Q[np.ix_(t, t)]))) / 2 + c @ r
    return Program(
        cp.Problem(cp.Minimize(cost), [law, *balance]),
        {"r_t": r},
        parameters,
        {"slip": slip} | shift,
    )


def tresca(problem: InterfaceProblem, facets: int | None = None) -> Program:
    """min r' Q r / 2 + q' r   subject to  r_n >= 0 where contacts may open,  |r_t| <= g,  V' r + s
    = 0.

    This is Tresca's law where g is its limit, and Coulomb's law where g = mu |r_n|.

    Parameters
    ----------
    problem : Any interface problem; backends want it dimensionless.
    facets : Number of edges of the regular polygon that is inscribed in each disc; None for discs,
        which are intervals in 2D.

    Returns
    -------
    Variable r (k dim,), normal first in each block. Parameter g (k,). Multipliers "gap", "slip" and
    "approach".
    """
    r, r_n, r_t, cost, balance, approach = _parts(problem)
    g = cp.Parameter(problem.contacts, nonneg=True)
    law, slip, _ = _friction(r_t, g, facets)
    push, gap = _push(r_n, problem.law.lowest == 0)
    readers = {"gap": gap, "slip": slip} | approach
    return Program(
        cp.Problem(cp.Minimize(cost), [*push, law, *balance]), {"r": r}, {"g": g}, readers
    )


def associated(problem: InterfaceProblem, facets: int | None = None) -> Program:
    """min r' Q r / 2 + q' r   subject to  r in Coulomb's cones |r_t| <= mu r_n,  V' r + s = 0.

    Its optimality conditions are those of friction with an associated flow rule: contacts that slip
    also open, by u_n = mu |u_t|.

    Parameters
    ----------
    problem : Any interface problem; backends want it dimensionless.
    facets : Number of edges of the regular polygon that is inscribed in each disc; None for discs,
        which are intervals in 2D.

    Returns
    -------
    Variable r (k dim,). Multipliers "gap" (so opened), "slip" and "approach".

    Raises
    ------
    InputError : If the law has no such cones.
    """
    return _over_cones(problem, None, facets)


def acary_cadoux(problem: InterfaceProblem, facets: int | None = None) -> Program:
    """min r' Q r / 2 + (q + mu s n)' r   subject to  r in Coulomb's cones,  V' r + s_plates = 0.

    At its solution u_n + mu s is at least mu |u_t|, so that Coulomb's law holds where s = |u_t|.
    Source: Acary, Cadoux, Lemarechal, Malick (2011), A formulation of the linear discrete Coulomb
    friction problem via convex optimization.

    Parameters
    ----------
    problem : Any interface problem; backends want it dimensionless.
    facets : Number of edges of the regular polygon that is inscribed in each disc; None for discs,
        which are intervals in 2D.

    Returns
    -------
    Variable r (k dim,). Parameter s (k,), zero unless it is set. Multipliers "gap" u_n, "slip" u_t
    and "approach".

    Raises
    ------
    InputError : If the law has no such cones.
    """
    s = cp.Parameter(problem.contacts, nonneg=True, value=np.zeros(problem.contacts))
    return _over_cones(problem, s, facets)


def tangential_disc_program(Q: np.ndarray, A: np.ndarray) -> tuple[Any, Any, dict[str, Any]]:
    """min t' Q t / 2 + c' t   subject to  |t_i| <= g_i at each contact i,  A t = b.

    This is `tangential` for one matrix and many c, g and b: build it once, set the parameters and
    solve many times.

    Parameters
    ----------
    Q : (2k, 2k) symmetric positive semidefinite; the caller checks that, because cvxpy's own check
        is unreliable.
    A : (p, 2k) rows of the balance.

    Returns
    -------
    (problem, variable, parameters) : The cvxpy problem, its variable t (2k,), and its parameters c
        (2k,), g (k,) and b (p,) by name. The multipliers of A t = b are the dual value of the last
        constraint.
    """
    k, p = len(Q) // 2, len(A)
    t = cp.Variable(2 * k, name="t")
    parameters = {"c": cp.Parameter(2 * k), "g": cp.Parameter(k, nonneg=True)}
    constraints = [cp.SOC(parameters["g"], cp.reshape(t, (2, k), order="F"), axis=0)]
    if p:
        parameters["b"] = cp.Parameter(p)
        constraints.append(A @ t == parameters["b"])
    objective = cp.Minimize(cp.quad_form(t, cp.psd_wrap(Q)) / 2 + parameters["c"] @ t)
    return cp.Problem(objective, constraints), t, parameters


def as_conic(program: Program) -> dict[str, Any]:
    """The data of min x' P x / 2 + q' x  subject to  A x + y = b,  y in cones: zero, nonnegative,
    second-order, in
    this order.

    Parameters
    ----------
    program : Its parameters must have values.

    Returns
    -------
    Keys P, q, A, b (P and A sparse, P with both triangles), zero and nonneg (numbers of rows), soc
    (list of dimensions), and columns: name of a variable -> its slice of x.
    """
    data, _, _ = program.problem.get_problem_data(cp.CLARABEL)
    dims, first = data["dims"], data["param_prob"].var_id_to_col
    columns = {
        name: slice(first[v.id], first[v.id] + v.size) for name, v in program.variables.items()
    }
    cones = {"zero": int(dims.zero), "nonneg": int(dims.nonneg), "soc": [int(d) for d in dims.soc]}
    return {
        "P": data["P"],
        "q": data["c"],
        "A": data["A"],
        "b": data["b"],
        "columns": columns,
    } | cones


def as_qp(program: Program) -> Any:
    """A program without cones for qpsolvers, with dense matrices.

    Parameters
    ----------
    program : Its parameters must have values.

    Returns
    -------
    Its x is ordered as in as_conic().

    Raises
    ------
    InputError : If the program has second-order cones.
    """
    import qpsolvers

    conic = as_conic(program)
    if conic["soc"]:
        raise InputError(
            "the program has second-order cones, so it is no QP: use as_conic, or polygons"
            " (facets=...)."
        )
    A, b, zero = conic["A"].toarray(), conic["b"], conic["zero"]
    equal = {"A": A[:zero], "b": b[:zero]} if zero else {}
    less = {"G": A[zero:], "h": b[zero:]} if conic["nonneg"] else {}
    return qpsolvers.Problem(conic["P"].toarray(), conic["q"], **less, **equal)


# What the programs share


def _components(problem: InterfaceProblem) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the normal and of the tangential components in a flat vector."""
    blocks = np.arange(problem.q.size).reshape(problem.q.shape)
    return blocks[:, 0], blocks[:, 1:].ravel()


def _pushing(problem: InterfaceProblem) -> np.ndarray:
    """Which plates' motions have a normal part; the others do not concern the normal problem."""
    return np.asarray(np.any(np.abs(problem.V[:: problem.dim]) > 1e-9, axis=0))


def _normal_parts(problem: InterfaceProblem) -> tuple[Any, Any, list[Any], dict[str, Reader], Any]:
    """Variable r_n, cost, balance, its multiplier by name, parameter r_t."""
    n, t = _components(problem)
    plates = _pushing(problem)
    r, r_t = cp.Variable(len(n), name="r_n"), cp.Parameter(len(t), value=np.zeros(len(t)))
    c = problem.q[:, 0] + problem.Q[np.ix_(n, t)] @ r_t
    V = problem.V[:, plates]
    balance, approach = _balance(V[n].T @ r + V[t].T @ r_t + problem.s[plates], "approach")
    cost = cp.quad_form(r, cp.psd_wrap(_symmetric(problem.Q[np.ix_(n, n)]))) / 2 + c @ r
    return r, cost, balance, approach, r_t


def _parts(problem: InterfaceProblem) -> tuple[Any, Any, Any, Any, list[Any], dict[str, Reader]]:
    """Variable r, its normal part (k,) and tangential part (dim - 1, k), cost, balance, its
    multiplier by name.
    """
    r = cp.Variable(problem.q.size, name="r")
    blocks = cp.reshape(r, (problem.dim, problem.contacts), order="F")
    balance, approach = _balance(problem.V.T @ r + problem.s, "approach")
    cost = cp.quad_form(r, cp.psd_wrap(_symmetric(problem.Q))) / 2 + problem.q.ravel() @ r
    return r, blocks[0], blocks[1:], cost, balance, approach


def _over_cones(problem: InterfaceProblem, s: Any, facets: int | None) -> Program:
    if not (problem.law.unilateral and problem.law.proportional):
        raise InputError(
            "this law has no cone of forces |r_t| <= mu r_n: use `tresca` or `bilateral`."
        )
    r, r_n, r_t, cost, balance, approach = _parts(problem)
    law, slip, size = _friction(r_t, cp.multiply(problem.mu, r_n), facets)
    push = r_n >= 0  # follows from the cone unless mu = 0
    if s is not None:
        cost = cost + cp.multiply(problem.mu, s) @ r_n
    gap = lambda: _dual(push) + problem.mu * (size() - (0 if s is None else s.value))  # noqa: E731
    program = cp.Problem(cp.Minimize(cost), [push, law, *balance])
    return Program(
        program, {"r": r}, {} if s is None else {"s": s}, {"gap": gap, "slip": slip} | approach
    )


def _friction(t: Any, g: Any, facets: int | None = None) -> tuple[Any, Reader, Reader]:
    """|t_i| <= g_i for the columns of t (d, k), the reader of the slip u_t (k, d) and that of the
    multiplier of g (k,).

    Intervals are polygons with two facets. Polygons are inscribed: they never allow more friction
    than the disc.
    """
    d, k = t.shape
    if d == 2 and facets is None:
        disc = cp.SOC(g, t, axis=0)
        return disc, lambda: _dual(disc, 1).reshape(2, k).T, lambda: _dual(disc, 0).reshape(k)
    if facets is not None and facets < 3:
        raise InputError(f"a polygon needs at least 3 facets; got {facets}.")
    D, reach = np.array([[1.0], [-1.0]]), 1.0
    if d == 2:
        angle = 2 * np.pi * np.arange(facets or 0) / (facets or 1)
        D, reach = (
            np.stack([np.cos(angle), np.sin(angle)], axis=1),
            float(np.cos(np.pi / (facets or 1))),
        )
    polygon = D @ t <= reach * np.ones((len(D), 1)) @ cp.reshape(g, (1, k), order="F")
    return polygon, lambda: -_dual(polygon).T @ D, lambda: reach * _dual(polygon).sum(axis=0)


def _push(r_n: Any, apart: np.ndarray) -> tuple[list[Any], Reader]:
    """r_n >= 0 at the contacts that may open, a mask (k,), and the reader of the gap (k,), zero at
    the others.
    """
    if not apart.any():
        return [], lambda: np.zeros(len(apart))
    push = (r_n if apart.all() else r_n[np.flatnonzero(apart)]) >= 0

    def gap() -> np.ndarray:
        out = np.zeros(len(apart))
        out[apart] = _dual(push)
        return out

    return [push], gap


def _balance(resultant: Any, name: str) -> tuple[list[Any], dict[str, Reader]]:
    """resultant = 0 and the reader of its multiplier; nothing without plates."""
    if resultant.size == 0:
        return [], {name: lambda: np.zeros(0)}
    balance = resultant == 0
    return [balance], {name: lambda: _dual(balance)}


def _dual(constraint: Any, part: int | None = None) -> np.ndarray:
    value = constraint.dual_value if part is None else constraint.dual_value[part]
    if value is None:
        raise InputError("the program has no answer yet: solve it before reading its multipliers.")
    return np.asarray(value, dtype=float)


def _symmetric(Q: np.ndarray) -> np.ndarray:
    return (Q + Q.T) / 2
