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
3D. Under orthotropic friction g and mu bound the stretched force, whose set is a disc.

All are convex because Q is positive semidefinite; that is the caller's promise
(contactopt.methods.backends.conic checks it by Cholesky), since cvxpy's own test of it fails at
random on large matrices. `program.problem.get_problem_data` of cvxpy gives the arrays to others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

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
    problem : Any interface problem.

    Returns
    -------
    Variable r_n (k,). Parameter r_t (k (dim - 1),), zero unless it is set. Multipliers "gap" (k,),
    and "approach" of the plates whose motion has a normal part.
    """
    r, cost, balance, readers, r_t = _normal_parts(problem)
    push = r >= 0
    program = cp.Problem(cp.Minimize(cost), [push, *balance])
    return Program(program, {"r_n": r}, {"r_t": r_t}, {"gap": lambda: _dual(push)} | readers)


def displacements(problem: InterfaceProblem) -> Program:
    """min (u - q_n - V_n lambda)' S (u - q_n - V_n lambda) / 2 - s' lambda   subject to  u >= 0,  S
    = Q_nn^-1.

    The elastic energy minus the work of the loads, in displacements. The optimal value is minus
    that of `normal` at r_t = 0.

    Parameters
    ----------
    problem : Any interface problem.

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
    program = cp.Problem(cp.Minimize(_energy(S, stretch) - work), [apart])
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
    problem : Any interface problem.

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
    law, slip, _ = _friction(problem, r, parameters["g"], facets)
    cost = _energy(problem.Q[np.ix_(t, t)], r) + c @ r
    program = cp.Problem(cp.Minimize(cost), [law, *balance])
    return Program(program, {"r_t": r}, parameters, {"slip": slip} | shift)


def tresca(problem: InterfaceProblem, facets: int | None = None) -> Program:
    """min r' Q r / 2 + q' r   subject to  r_n >= 0 where contacts may open,  |r_t| <= g,  V' r + s
    = 0.

    This is Tresca's law where g is its limit, and Coulomb's law where g = mu |r_n|.

    Parameters
    ----------
    problem, facets : As for `tangential`.

    Returns
    -------
    Variable r (k dim,), normal first in each block. Parameter g (k,). Multipliers "gap", "slip" and
    "approach".
    """
    r, r_n, r_t, cost, balance, readers = _parts(problem)
    g, apart = cp.Parameter(problem.contacts, nonneg=True), problem.law.lowest == 0
    law, slip, _ = _friction(problem, r_t, g, facets)
    push = [r_n[np.flatnonzero(apart)] >= 0] if apart.any() else []

    def gap() -> np.ndarray:
        out = np.zeros(len(apart))
        for constraint in push:
            out[apart] = _dual(constraint)
        return out

    program = cp.Problem(cp.Minimize(cost), [*push, law, *balance])
    return Program(program, {"r": r}, {"g": g}, {"gap": gap, "slip": slip} | readers)


def associated(problem: InterfaceProblem, facets: int | None = None) -> Program:
    """min r' Q r / 2 + q' r   subject to  r in Coulomb's cones |r_t| <= mu r_n,  V' r + s = 0.

    Its optimality conditions are those of friction with an associated flow rule: contacts that slip
    also open, by u_n = mu |u_t|.

    Parameters
    ----------
    problem, facets : As for `tangential`.

    Returns
    -------
    Variable r (k dim,). Multipliers "gap" (so opened), "slip" and "approach". InputError if the law
    has no such cones.
    """
    return _over_cones(problem, None, facets)


def acary_cadoux(problem: InterfaceProblem, facets: int | None = None) -> Program:
    """min r' Q r / 2 + (q + mu s n)' r   subject to  r in Coulomb's cones,  V' r + s_plates = 0.

    At its solution u_n + mu s is at least mu |u_t|, so that Coulomb's law holds where s = |u_t|.
    Source: Acary, Cadoux, Lemarechal, Malick (2011), A formulation of the linear discrete Coulomb
    friction problem via convex optimization.

    Parameters
    ----------
    problem, facets : As for `tangential`.

    Returns
    -------
    Variable r (k dim,). Parameter s (k,), zero unless it is set. Multipliers "gap" u_n, "slip" u_t
    and "approach". InputError if the law has no such cones.
    """
    s = cp.Parameter(problem.contacts, nonneg=True, value=np.zeros(problem.contacts))
    return _over_cones(problem, s, facets)


def tangential_disc_program(Q: np.ndarray, A: np.ndarray) -> tuple[Any, Any, dict[str, Any]]:
    """min t' Q t / 2 + c' t   subject to  |t_i| <= g_i at each contact i,  A t = b.

    This is `tangential` for one matrix and many c, g and b: build it once, set the parameters and
    solve many times.

    Parameters
    ----------
    Q : (2k, 2k) symmetric positive semidefinite; the caller checks that.
    A : (p, 2k) rows of the balance.

    Returns
    -------
    The cvxpy problem, its variable t (2k,), and its parameters c (2k,), g (k,) and b (p,) by name.
    The multipliers of A t = b are the dual value of the last constraint.
    """
    k, p = len(Q) // 2, len(A)
    t = cp.Variable(2 * k, name="t")
    parameters = {"c": cp.Parameter(2 * k), "g": cp.Parameter(k, nonneg=True)}
    constraints = [cp.SOC(parameters["g"], _columns(t, k), axis=0)]
    if p:
        parameters["b"] = cp.Parameter(p)
        constraints.append(A @ t == parameters["b"])
    objective = cp.Minimize(cp.quad_form(t, cp.psd_wrap(Q)) / 2 + parameters["c"] @ t)
    return cp.Problem(objective, constraints), t, parameters


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
    return r, _energy(problem.Q[np.ix_(n, n)], r) + c @ r, balance, approach, r_t


def _parts(problem: InterfaceProblem) -> tuple[Any, Any, Any, Any, list[Any], dict[str, Reader]]:
    """Variable r, its normal and tangential parts, cost, balance, its multiplier by name."""
    n, t = _components(problem)
    r = cp.Variable(problem.q.size, name="r")
    balance, approach = _balance(problem.V.T @ r + problem.s, "approach")
    return r, r[n], r[t], _energy(problem.Q, r) + problem.q.ravel() @ r, balance, approach


def _over_cones(problem: InterfaceProblem, s: Any, facets: int | None) -> Program:
    plain = problem.law.plain
    if not (plain.unilateral and plain.proportional):
        raise InputError(
            "this law has no cone of forces |r_t| <= mu r_n: use `tresca` or `bilateral`."
        )
    mu = plain.coefficient
    r, r_n, r_t, cost, balance, readers = _parts(problem)
    law, slip, size = _friction(problem, r_t, cp.multiply(mu, r_n), facets)
    push = r_n >= 0  # follows from the cone unless mu = 0
    if s is not None:
        cost = cost + cp.multiply(mu, s) @ r_n
    readers["gap"] = lambda: _dual(push) + mu * (size() - (0 if s is None else s.value))
    program = cp.Problem(cp.Minimize(cost), [push, law, *balance])
    return Program(program, {"r": r}, {} if s is None else {"s": s}, readers | {"slip": slip})


def _friction(
    problem: InterfaceProblem, r_t: Any, g: Any, facets: int | None
) -> tuple[Any, Reader, Reader]:
    """|t_i| <= g_i for r_t (k d,), the reader of the slip u_t (k, d) and that of the multiplier of
    g (k,).

    t is r_t itself or, where friction depends on the direction, what `Law.stretch` makes of it.
    Intervals are polygons with two facets. Polygons are inscribed: they never allow more friction
    than the disc.
    """
    k, d = problem.contacts, problem.dim - 1
    back = problem.law.stretch(problem.dim)
    if back is not None:
        back = np.linalg.inv(back)
        r_t = sp.block_diag(list(back), format="csr") @ r_t

    def slip(v: np.ndarray) -> np.ndarray:
        return v if back is None else np.einsum("kab,kb->ka", back, v)

    t = _columns(r_t, k)
    if d == 2 and facets is None:
        disc = cp.SOC(g, t, axis=0)
        read = lambda: slip(_dual(disc, 1).reshape(2, k).T)  # noqa: E731
        return disc, read, lambda: _dual(disc, 0).reshape(k)
    if facets is not None and facets < 3:
        raise InputError(f"a polygon needs at least 3 facets; got {facets}.")
    D, reach = np.array([[1.0], [-1.0]]), 1.0
    if d == 2:
        angle = 2 * np.pi * np.arange(facets or 0) / (facets or 1)
        D, reach = np.column_stack([np.cos(angle), np.sin(angle)]), float(np.cos(angle[1] / 2))
    polygon = D @ t <= reach * np.ones((len(D), 1)) @ cp.reshape(g, (1, k), order="F")
    read = lambda: slip(-_dual(polygon).T @ D)  # noqa: E731
    return polygon, read, lambda: reach * _dual(polygon).sum(axis=0)


def _columns(t: Any, k: int) -> Any:
    """A flat vector of k blocks with the blocks as its columns."""
    return cp.reshape(t, (t.size // k, k), order="F")


def _energy(Q: np.ndarray, r: Any) -> Any:
    """r' Q r / 2."""
    return cp.quad_form(r, cp.psd_wrap(_symmetric(Q))) / 2


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
