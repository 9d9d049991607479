"""Loads that no contact forces can balance, told before anything is solved.

Every solution has forces r in the friction cones K with V' r + s = 0. A motion z (p,) of the free
bodies that every contact lets pass, V z in the dual cone of K, g_n >= mu |g_t| at each contact, has
z' V' r >= 0 for all such r. Where it moves the loads forward, s' z > 0, this contradicts z' V' r =
-s' z: there is no solution, and the bodies fly apart, slide off or topple along z. A contact whose
friction has a given bound b in place of mu r_n lets every motion with g_n >= 0 pass, and takes no
more work than b |g_t| from it, so that there s' z > sum b |g_t| is the contradiction. A contact
that cannot open lets a motion pass with g_n = 0, and with g_t = 0 where it can rub. Where the
forces of least squares that balance the loads are admissible there is no such motion. Otherwise the
search for it is a linear program with a polygon inside each cone; what it finds is checked on its
own.

Source: Farkas' lemma for cones; Boyd, Vandenberghe (2004), Convex Optimization, section 5.9.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.defaults import EQUAL
from contactopt.errors import Unbalanced
from contactopt.problem.cones import polygon, simplex_steps
from contactopt.problem.interface_problem import InterfaceProblem
from contactopt.problem.scaling import isotropic, without_rounding

# work of the largest load over a motion's displacements from which on the motion counts
SURE = 1e-6
FLAT = 1e-6  # share of the motion of the contacts below which they do not slide


@dataclass(frozen=True, eq=False)
class Escape:
    """The smallest motion z (p,), of few bodies, that moves the loads forward and that no contact
    resists.

    strongest  number of the multiplier that moves furthest, of the body on which the loads do most
               work; where it turns without sliding, that of the rotation
    opens      whether no contact slides in it
    loose      whether it moves no contact at all
    """

    motion: np.ndarray
    strongest: int
    opens: bool
    loose: bool


def escape(problem: InterfaceProblem) -> Escape | None:
    """A motion along which loads drive the bodies away from all contacts, or None."""
    if not np.any(problem.s):
        return None
    problem = isotropic(problem)
    s, given = problem.s / np.abs(problem.s).max(), _given(problem)
    if _balanced(problem, s, given):
        return None
    loose = sorted_motions(problem)[1]
    alone = loose @ np.linalg.lstsq(loose, s, rcond=None)[0]
    if _passes(problem, s, given, alone):
        return _described(problem, s, alone)
    found = _search(problem, sp.csr_array(problem.V), s, given)
    if found is None or not _passes(problem, s, given, found):
        return None
    return _described(problem, s, found)


def _described(problem: InterfaceProblem, s: np.ndarray, motion: np.ndarray) -> Escape:
    """A motion that loads s (p,) drive, with what it does to which body."""
    g = (problem.V @ motion).reshape(problem.q.shape)
    still = np.abs(g).max(initial=0.0) <= EQUAL * (np.abs(problem.V) @ np.abs(motion)).max()
    opens = bool(np.abs(g[:, 1:]).max(initial=0.0) <= FLAT * np.abs(g).max(initial=0.0))
    owners = [name.partition(":")[0] for name in problem.motions] or ["" for _ in s]
    work = {
        owner: sum(s[i] * motion[i] for i, own in enumerate(owners) if own == owner)
        for owner in owners
    }
    body = max(work, key=lambda owner: work[owner])
    size = np.abs(motion) * np.array([owner == body for owner in owners])
    turns = size * np.array(["rotation" in name for name in problem.motions] or np.zeros(len(s)))
    if opens and turns.max() > 1e-3 * size.max():  # it tips over
        size = turns
    return Escape(motion, int(np.argmax(size)), opens, bool(still))


def sorted_motions(problem: InterfaceProblem) -> tuple[np.ndarray, np.ndarray]:
    """Orthogonal bases of the motions that contacts resist (p, m) and of those that nothing resists
    (p, f).
    """
    resists = np.repeat(problem.law.rough[:, None], problem.dim, axis=1)
    resists[:, 0] = True
    sizes, count = np.linalg.norm(problem.V, axis=0), len(problem.s)
    sizes = np.where(sizes > 0, sizes, 1.0)
    moved = np.vstack([(problem.V / sizes)[resists.ravel()], np.zeros((count, count))])
    _, stretches, axes = np.linalg.svd(np.linalg.qr(moved, mode="r"))
    held, basis = stretches >= EQUAL, without_rounding(axes.T) / sizes[:, None]
    return basis[:, held], basis[:, ~held]


def resisted(problem: InterfaceProblem) -> tuple[InterfaceProblem, np.ndarray | None, str]:
    """The problem in the motions that contacts resist, their basis or None, and a sentence."""
    kept, loose = sorted_motions(problem)
    work = np.abs(loose.T @ problem.s) > SURE * (np.abs(loose.T) @ np.abs(problem.s))
    if not loose.shape[1] or work.any():
        return problem, None, ""
    said = (
        f"neither supports nor contacts resist a motion of {_names(problem, loose)}: loads do not"
        " move it, and displacements are those without it"
    )
    return problem.altered(V=problem.V @ kept, s=kept.T @ problem.s, motions=()), kept, said


def _names(problem: InterfaceProblem, loose: np.ndarray) -> str:
    """Names of motions that together determine the loose ones (p, f): the largest of the first
    bodies.
    """
    labels = [_label(problem, number) for number in range(len(loose))]
    owners = [label.partition(":")[0] for label in labels]
    left, found = loose * np.where(problem.reach > 0, problem.reach, 1.0)[:, None], []
    whole = np.linalg.norm(left, axis=1)
    for owner in dict.fromkeys(owners):
        own = np.array([name == owner for name in owners])
        while np.any((sizes := own * np.linalg.norm(left, axis=1)) > SURE * whole):
            number = int(np.argmax(sizes > (1 - SURE) * sizes.max()))  # the first of equal ones
            found.append(number)
            row = left[number] / sizes[number]
            left = left - np.outer(left @ row, row)
    return ", ".join(labels[number] for number in sorted(found))


def _label(problem: InterfaceProblem, number: int) -> str:
    return problem.motions[number] if problem.motions else f"column {number} of V"


def _along(rows: sp.csr_array, dim: int) -> list[Any]:
    """V (k dim, p) along each direction of slip of the polygon."""
    normal = np.arange(rows.shape[0] // dim) * dim
    return [sum(c * rows[normal + 1 + i] for i, c in enumerate(way)) for way in polygon(dim)[0]]


def _given(problem: InterfaceProblem) -> np.ndarray:
    """(k,) friction bounds over the largest load: 0 if mu r_n, infinite if nonlinear in r_n."""
    force = np.abs(problem.s).max()
    bounds = [problem.law.bound(np.full(problem.contacts, r_n)) for r_n in (0.0, force)]
    other = problem.law.rough & (problem.law.coefficient == 0)
    return np.where(other, np.where(bounds[0] == bounds[1], bounds[0] / force, np.inf), 0.0)


def _balanced(problem: InterfaceProblem, s: np.ndarray, given: np.ndarray) -> bool:
    """Whether the forces of least squares that balance the loads are admissible."""
    even = problem.V @ np.linalg.lstsq(problem.V.T @ problem.V, -s, rcond=None)[0]
    r, shut = even.reshape(problem.q.shape), problem.law.lowest < 0
    normal = np.where(shut, np.abs(r[:, 0]), r[:, 0])
    bound = problem.mu * normal + np.where(np.isinf(given) & ~shut, 0.0, given)
    held = np.all(normal >= 0) and np.all(np.linalg.norm(r[:, 1:], axis=1) <= bound)
    left = np.linalg.norm(problem.V.T @ even + s)
    return bool(held and left <= 1e-10 * np.linalg.norm(s))  # counts as exact


def _search(
    problem: InterfaceProblem, V: sp.csr_array, s: np.ndarray, given: np.ndarray
) -> np.ndarray | None:
    """min |z|_1 with s' z - given' w = 1, V z in a polygon inside each dual cone, g = 0 where a
    contact cannot move, and w >= |g_t| in a polygon where the bound is given; None without any.
    """
    from scipy.optimize import linprog  # late, since it takes long to import

    normal, factor = V[:: problem.dim], polygon(problem.dim)[1]
    shut, fixed = problem.law.lowest < 0, _stuck(problem, given)
    bounded = np.isfinite(given) & (given > 0)
    smooth, rubs, count = (problem.mu == 0) & ~shut, (problem.mu > 0) & ~shut, int(np.sum(bounded))
    mu, slopes = sp.diags_array(factor * problem.mu), _along(V, problem.dim)
    rows = [-normal[smooth]] + [(mu @ slope - normal)[rubs] for slope in slopes]
    within, slid = sp.vstack(rows), sp.vstack([factor * slope[bounded] for slope in slopes])
    own = sp.vstack([-sp.eye_array(count)] * len(slopes))
    blocks = np.arange(problem.q.size).reshape(problem.q.shape)
    still = [V[blocks[fixed, 1:].ravel()], normal[shut]]
    equal = sp.vstack([sp.csr_array(s[None]), *still])
    lost = sp.csr_array(-given[bounded][None])
    lost.resize(equal.shape[0], count)
    A = sp.block_array([[within, -within, None], [slid, -slid, own]], format="csr")
    answer = linprog(  # z = z+ - z-
        np.append(np.ones(2 * len(s)), np.zeros(count)),
        A,
        np.zeros(A.shape[0]),
        sp.hstack([equal, -equal, lost], format="csr"),
        np.append(1.0, np.zeros(equal.shape[0] - 1)),
        [(0, 1 / SURE)] * (2 * len(s)) + [(0, None)] * count,
        method="highs",
        options={"maxiter": simplex_steps(A.nnz)},
    )
    if answer.x is None or answer.status != 0:
        return None
    return np.asarray(answer.x[: len(s)] - answer.x[len(s) : 2 * len(s)])


def _stuck(problem: InterfaceProblem, given: np.ndarray) -> np.ndarray:
    """Contacts (k,) whose friction no motion along the surface overcomes for sure."""
    return np.asarray(np.isinf(given) | ((problem.law.lowest < 0) & problem.law.rough))


def _passes(
    problem: InterfaceProblem, s: np.ndarray, given: np.ndarray, motion: np.ndarray
) -> bool:
    """Whether the motion does work and meets the conditions of all contacts up to rounding."""
    g = (problem.V @ motion).reshape(problem.q.shape)
    size = np.abs(problem.V) @ np.abs(motion)
    slide = np.linalg.norm(g[:, 1:], axis=1)
    fixed = _stuck(problem, given) & (slide > EQUAL * size.max())
    needed = np.where(fixed, np.inf, problem.mu * slide)
    shut = problem.law.lowest < 0
    work = s * motion
    lost = np.sum(given[np.isfinite(given)] * slide[np.isfinite(given)])
    return bool(
        np.all((g[:, 0] - needed)[~shut] >= -EQUAL * size.max())
        and np.all(np.abs(g[shut, 0]) <= EQUAL * size.max())
        and not np.any(fixed & shut)
        and work.sum() - lost > SURE * np.abs(work).sum()
    )


def sentence(problem: InterfaceProblem, found: Escape) -> str:
    """Say what a motion without resistance does to which body, and what to change."""
    body, _, motion = _label(problem, found.strongest).rpartition(": ")
    body = body or "a body"
    if found.loose:
        far = np.abs(found.motion) > EQUAL * np.abs(found.motion).max()
        labels = [_label(problem, i).rpartition(": ")[0] for i in np.flatnonzero(far).tolist()]
        together = list(dict.fromkeys(filter(None, labels)))
        if len(together) > 1:
            return (
                "the loads do not balance: neither supports nor contacts hold"
                f" {' and '.join(together)}, which move together ({motion}); hold one of them by a"
                " support, or give loads that balance."
            )
        return (
            f"the loads do not balance: neither supports nor contacts hold {body} ({motion}); add a"
            " support, or loads that balance."
        )
    if motion.startswith("rotation"):
        return (
            f"the load is more than the contacts can hold: {body} tips over ({motion}); change the"
            " load or add a support; contactopt limit finds the load that they hold."
        )
    if found.opens:
        return (
            f"the load pulls the bodies apart: no contact holds {body} ({motion}); press them"
            " together or add a support."
        )
    return (
        f"the load is more than the contacts can hold: {body} slides off ({motion}); press the"
        " bodies together, or add friction or a support; contactopt limit finds the load that they"
        " hold."
    )


def check_equilibrium(problem: InterfaceProblem) -> None:
    """Raise Unbalanced for a load that no contacts can balance, with the motion's name."""
    if problem.motions:
        found = escape(problem)
        if found is not None:
            raise Unbalanced(sentence(problem, found))
        return
    if not len(problem.s):
        return
    if not problem.law.unilateral:
        if (found := escape(problem)) is not None:
            raise Unbalanced(sentence(problem, found))
        return
    V = problem.V.reshape(problem.contacts, problem.dim, -1)
    for column, s in zip(np.moveaxis(V, 2, 0), problem.s):
        rounding = 1e-9 * np.abs(column).max(initial=0.0)
        along = rounding > 0 and np.all(np.abs(column[:, 1:]) <= rounding)
        # what normal reactions add to s
        if s != 0 and along and np.all(column[:, 0] * np.sign(s) >= -rounding):
            raise Unbalanced(
                "the load on the plate pulls the bodies apart: no equilibrium; press them together."
            )
