"""Problems without a solution: a ray that proves it.

Every solution of Coulomb's problem has forces r in the friction cones K that balance the plates,
and no penetration:
    r in K,   V' r + s = 0,   (Q r + V lambda + q)_n >= 0.
Let y (k,) >= 0 weigh the contacts, y_i = 0 at contacts without a part in the proof, e = (y, 0) its
blocks, and z (p,) displace the plates, such that
    g = Q' e + V z is in the polar cone of K (g_n + mu |g_t| <= 0),   V' e = 0,   q' e + s' z < 0.
Then 0 <= e' u + z' (V' r + s) = g' r + q' e + s' z < 0 for every such r and lambda, a
contradiction: there is no solution. Such a ray exists, but for closure, exactly where the three
conditions cannot be met. It is found by a linear program with a polygon inside each polar cone,
made exact by a least-squares step, and checked in floating point on its own. Source: Farkas' lemma
for cones; Boyd, Vandenberghe (2004), Convex Optimization, section 5.9.
"""

import logging
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from contactopt.checks import place_words
from contactopt.defaults import EQUAL, ROUNDED
from contactopt.linear.operators import asymmetry, diagonal, form, has_entries, row_sizes
from contactopt.problem.cones import polygon, simplex_steps, unit
from contactopt.problem.interface_problem import InterfaceProblem
from contactopt.problem.scaling import dimensionless, isotropic

MOST_ENTRIES = 3_000_000  # entries of the program up to which it is tried
MARGIN = 1e-7  # least -(q' e + s' z) of a ray of size one, over the size of its terms

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Infeasible:
    """A proof that a problem has no solution: the ray (weights y (k,), motions z (p,)) of this
    module's docstring, or the contradictions of all states of the contacts
    (contactopt.methods.kernels.states), for which y and z are zero.

    sentence  what it means, for people
    margin    -(q' e + s' z) [work], positive; of contradictions: the least of them [-]
    branches  number of sets of states that are contradicted; 0 where a ray is the proof
    """

    weights: np.ndarray
    motions: np.ndarray
    margin: float
    sentence: str
    branches: int = 0


def infeasibility(problem: InterfaceProblem, time_limit: float = np.inf) -> Infeasible | None:
    """Look for a proof, in at most `time_limit` [s], that a problem has no solution; None says
    nothing. Laws without a cone, operators and more than MOST_ENTRIES entries are not looked at; a
    positive definite Q without a plate always has a solution.
    """
    if (apart := held_apart(problem)) is not None:
        return apart
    problem = isotropic(problem)
    cones = problem.law.unilateral and problem.law.proportional
    if not cones or not has_entries(problem.Q) or problem.contacts == 0:
        return None
    entries = problem.Q.nnz if form(problem.Q) == "sparse" else problem.Q.size
    edges = len(polygon(problem.dim)[0])
    if entries / problem.dim * edges > MOST_ENTRIES or _definite(problem):
        return None
    scaled, scales = dimensionless(problem)
    # without the unit compliance that this form gives components that cannot move
    held = row_sizes(problem.Q) == 0
    Q = sp.csr_array(scaled.Q)
    Q = sp.csr_array(Q - sp.diags_array(np.where(held, Q.diagonal(), 0.0)))
    ray = _program(scaled, Q, time_limit)
    if ray is None:
        return None
    for _ in range(3):  # least-squares steps
        if _verified(scaled, Q, *ray):
            weights, motions = ray
            work = float(scaled.q[:, 0] @ weights + scaled.s @ motions)
            return Infeasible(
                weights,
                motions * scales.multipliers / scales.length,
                -work * scales.force * scales.length,
                _sentence(scaled, weights, motions),
            )
        ray = _polished(scaled, Q, *ray)
    log.info("a ray that would prove the problem infeasible did not stand the check")
    return None


def held_apart(problem: InterfaceProblem) -> Infeasible | None:
    """Find a contact without separation or slip that nothing can move, and that is not at rest."""
    if problem.law.unilateral or not problem.contacts:
        return None
    Q, law, places = problem.Q, problem.law, problem.coordinates
    size = diagonal(Q) if not has_entries(Q) else abs(Q).sum(axis=1)
    moves = (np.asarray(size).ravel() > 0) | np.any(problem.V, axis=1)
    fixed = np.zeros(problem.q.shape, dtype=bool)
    fixed[:, 0] = np.broadcast_to(law.lowest, len(fixed)) == -np.inf
    fixed[:, 1:] = np.isinf(law.bound(np.zeros(len(fixed))))[:, None]
    fixed &= ~moves.reshape(fixed.shape)
    apart = np.where(fixed, np.abs(problem.q), 0.0).max(axis=1)
    worst = int(np.argmax(apart))
    if not apart[worst] > EQUAL * np.ptp(places, axis=1).max(initial=0.0):
        return None
    where = place_words(places[:, worst])
    sentence = (
        f"nodes that are tied are held on both sides, {apart[worst]:.3g} apart at ({where}), so"
        " there is no solution; free one side, or prescribe the same displacement on both."
    )
    weights = np.zeros(len(apart))
    weights[worst] = 1.0
    return Infeasible(weights, np.zeros(len(problem.s)), float(apart[worst]), sentence)


def _definite(problem: InterfaceProblem) -> bool:
    """Whether there is no plate and Q a symmetric array, positive definite far above rounding."""
    if len(problem.s) or form(problem.Q) == "sparse" or asymmetry(problem.Q) > ROUNDED:
        return False
    try:
        pivots = np.diag(np.linalg.cholesky(problem.Q)) ** 2
    except np.linalg.LinAlgError:
        return False
    return bool(pivots.min() > 1e-6 * pivots.max())


def _verified(
    problem: InterfaceProblem, Q: sp.csr_array, weights: np.ndarray, motions: np.ndarray
) -> bool:
    """Whether (weights, motions) is a ray to rounding, with a margin far above it."""
    k, d = problem.q.shape
    if np.any(weights < 0) or not (np.all(np.isfinite(weights)) and np.all(np.isfinite(motions))):
        return False
    e = np.zeros((k, d))
    e[:, 0] = weights
    V, flat = problem.V, e.ravel()
    g = (Q.T @ flat + V @ motions).reshape(k, d)
    size = (abs(Q).T @ flat + np.abs(V) @ np.abs(motions)).reshape(k, d).max(axis=1)
    polar = (
        g[:, 0] + problem.mu * np.linalg.norm(g[:, 1:], axis=1) <= ROUNDED * (1 + problem.mu) * size
    )
    free = np.abs(V.T @ flat) <= ROUNDED * (np.abs(V).T @ flat)
    terms = float(np.abs(problem.q[:, 0]) @ weights + np.abs(problem.s) @ np.abs(motions))
    gain = -float(problem.q[:, 0] @ weights + problem.s @ motions)
    return bool(np.all(polar) and np.all(free) and gain > MARGIN * terms > 0)


def _program(
    problem: InterfaceProblem, Q: sp.csr_array, time_limit: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """min q' e + s' z over rays with y, z in the unit box; None unless it is negative in time."""
    from scipy.optimize import linprog

    k, d = problem.q.shape
    normal = np.arange(k) * d
    # g from (y, z)
    G = sp.hstack([sp.csr_array(Q.T[:, normal]), sp.csr_array(problem.V)], format="csr")
    (ways, factor), rough = polygon(d), problem.mu > 0
    rows = [G[normal[~rough]]]
    for way in ways:
        slope = sum(c * G[normal + 1 + i] for i, c in enumerate(way))
        rows.append((G[normal] + sp.diags_array(factor * problem.mu) @ slope)[rough])
    A = sp.vstack(rows, format="csr")
    p = len(problem.s)
    balance = sp.hstack([sp.csr_array(problem.V[normal].T), sp.csr_array((p, p))]) if p else None
    cost = np.concatenate([problem.q[:, 0], problem.s])
    cost = cost / (np.abs(cost).max(initial=0.0) or 1.0)
    exact = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    answer = linprog(
        cost,
        A,
        np.zeros(A.shape[0]),
        balance,
        np.zeros(p) if p else None,
        [(0, 1)] * k + [(-1, 1)] * p,
        method="highs",
        options={"time_limit": time_limit, "maxiter": simplex_steps(A.nnz)} | exact,
    )
    if answer.x is None or answer.fun is None or answer.fun > -1e-9:
        return None
    return np.maximum(answer.x[:k], 0.0), answer.x[k:]


def _polished(
    problem: InterfaceProblem, Q: sp.csr_array, weights: np.ndarray, motions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The ray moved, by least squares, to where its active conditions hold to rounding."""
    k, d = problem.q.shape
    normal = np.arange(k) * d
    used = weights > 1e-7 * weights.max(initial=0.0)
    G = np.hstack([Q.T[:, normal[used]].toarray(), problem.V])
    x = np.concatenate([weights[used], motions])
    g = (G @ x).reshape(k, d)
    size = (np.abs(G) @ np.abs(x)).reshape(k, d).max(axis=1)
    length = np.linalg.norm(g[:, 1:], axis=1)
    apex = (np.abs(g).max(axis=1) <= 1e-7 * size) & (size > 0)
    edge = ~apex & (np.abs(g[:, 0] + problem.mu * length) <= 1e-7 * size) & (size > 0)
    blocks = G.reshape(k, d, -1)
    along = np.einsum("kd,kdj->kj", unit(g[:, 1:]), blocks[:, 1:])
    slopes = blocks[:, 0] + problem.mu[:, None] * along
    smooth = problem.mu == 0
    balance = np.hstack([problem.V[normal[used]].T, np.zeros((len(motions), len(motions)))])
    rows = [
        blocks[apex & ~smooth].reshape(-1, len(x)),
        blocks[apex & smooth, 0],
        slopes[edge],
        balance,
    ]
    active = np.vstack(rows)
    x = x - np.linalg.lstsq(active, active @ x, rcond=1e-11)[0] if len(active) else x
    new = np.zeros(k)
    new[used] = np.maximum(x[: used.sum()], 0.0)
    return new, x[used.sum() :]


def _sentence(problem: InterfaceProblem, weights: np.ndarray, motions: np.ndarray) -> str:
    largest = float(weights.max(initial=0.0))
    contacts: list[int] = np.flatnonzero(weights > 1e-6 * largest).tolist() if largest > 0 else []
    if len(contacts) == 0:
        named = problem.motions or ["the plate"] * len(motions)
        what = named[int(np.argmax(np.abs(problem.s * motions)))]
        return (
            f"no forces of the contacts can balance the load on {what}, so there is no solution;"
            " change the load."
        )
    listed = ", ".join(map(str, contacts[:8])) + (", ..." if len(contacts) > 8 else "")
    if np.any(problem.s):
        return (
            f"the load presses contacts {listed} together further than any forces of the contacts"
            " can hold apart, so there is no solution; check the load, the gaps and the supports."
        )
    return (
        f"the bodies overlap at contacts {listed} in a way that no forces of the contacts can"
        " separate, so there is no solution; check the prescribed displacements, the gaps and the"
        " supports."
    )
