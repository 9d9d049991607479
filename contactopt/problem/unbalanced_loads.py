"""Loads that no contact forces can balance, told before anything is solved.

Every solution has forces r in the friction cones K with V' r + s = 0. A motion z (p,) of the free
bodies that every contact lets pass, V z in the dual cone of K, g_n >= mu |g_t| at each contact, has
z' V' r >= 0 for all such r. Where it moves the loads forward, s' z > 0, this contradicts z' V' r =
-s' z: there is no solution, and the bodies fly apart, slide off or topple along z. Where the forces
of least squares that balance the loads lie in the cones there is no such motion. Otherwise the
search for it is a linear program with a polygon inside each cone; what it finds is checked on its
own.

Source: Farkas' lemma for cones; Boyd, Vandenberghe (2004), Convex Optimization, section 5.9.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.problem.cones import polygon
from contactopt.problem.interface_problem import InterfaceProblem
from contactopt.problem.scaling import isotropic

# work of the largest load over a motion's displacements from which on the motion counts
SURE = 1e-6
SLACK = 1e-9  # by how much rounding may violate the cones, over the size of the motion at a contact
BALANCED = 1e-10  # relative error of a balance that counts as exact
FLAT = 1e-6  # share of the motion of the contacts below which they do not slide
TURNING = 1e-3  # least displacement by a rotation, over the largest, of a body that tips over
SECONDS = 5.0  # for a linear program


@dataclass(frozen=True, eq=False)
class Escape:
    """A motion z (p,) that moves the loads forward and that no contact resists: the least one, of
    few bodies.

    strongest  number of the multiplier that moves furthest, of the body on which the loads do most
               work; where it turns without sliding, that of the rotation
    opens      whether no contact slides in it
    """

    motion: np.ndarray
    strongest: int
    opens: bool


def escape(problem: InterfaceProblem) -> Escape | None:
    """Find a motion along which the loads drive the bodies away from all contacts, or None.

    Looked at are laws under which contacts can only push. Under laws whose friction is no cone,
    only motions count that do not slide where there is friction.
    """
    if not problem.law.unilateral or not np.any(problem.s):
        return None
    problem = isotropic(problem)
    s = problem.s / np.abs(problem.s).max()
    if _balanced(problem, s):
        return None
    motion = _search(problem, sp.csr_array(problem.V), s)
    if motion is None or not _passes(problem, s, motion):
        return None
    g = (problem.V @ motion).reshape(problem.q.shape)
    opens = bool(np.abs(g[:, 1:]).max(initial=0.0) <= FLAT * np.abs(g).max(initial=0.0))
    owners = [name.partition(":")[0] for name in problem.motions] or ["" for _ in s]
    work = {
        owner: sum(s[i] * motion[i] for i, own in enumerate(owners) if own == owner)
        for owner in owners
    }
    body = max(work, key=lambda owner: work[owner])
    size = np.abs(motion) * np.array([owner == body for owner in owners])
    turns = size * np.array(["rotation" in name for name in problem.motions] or np.zeros(len(s)))
    if opens and turns.max() > TURNING * size.max():
        size = turns
    return Escape(motion, int(np.argmax(size)), opens)


def _along(rows: sp.csr_array, dim: int) -> list[Any]:
    """V (k dim, p) along each direction of slip of the polygon."""
    normal = np.arange(rows.shape[0] // dim) * dim
    return [sum(c * rows[normal + 1 + i] for i, c in enumerate(way)) for way in polygon(dim)[0]]


def _balanced(problem: InterfaceProblem, s: np.ndarray) -> bool:
    """Whether the forces of least squares that balance the loads lie in the cones."""
    even = problem.V @ np.linalg.lstsq(problem.V.T @ problem.V, -s, rcond=None)[0]
    r = even.reshape(problem.q.shape)
    held = np.all(np.linalg.norm(r[:, 1:], axis=1) <= problem.mu * r[:, 0])
    left = np.linalg.norm(problem.V.T @ even + s)
    return bool(held and left <= BALANCED * np.linalg.norm(s))


def _search(problem: InterfaceProblem, V: sp.csr_array, s: np.ndarray) -> np.ndarray | None:
    """min |z|_1 with s' z = 1 and V z in a polygon inside each dual cone; None without any."""
    from scipy.optimize import linprog  # late, since it takes long to import

    normal, factor = V[:: problem.dim], polygon(problem.dim)[1]
    fixed = ~_cones(problem)
    smooth = (problem.mu == 0) | fixed
    mu = sp.diags_array(factor * problem.mu)
    rows = [-normal[smooth]]
    rows += [(mu @ slope - normal)[~smooth] for slope in _along(V, problem.dim)]
    A = sp.vstack(rows, format="csr")
    blocks = np.arange(problem.q.size).reshape(problem.q.shape)
    equal = sp.vstack([sp.csr_array(s[None]), V[blocks[fixed, 1:].ravel()]], format="csr")
    answer = linprog(  # z = z+ - z-
        np.ones(2 * len(s)),
        sp.hstack([A, -A], format="csr"),
        np.zeros(A.shape[0]),
        sp.hstack([equal, -equal], format="csr"),
        np.append(1.0, np.zeros(equal.shape[0] - 1)),
        (0, 1 / SURE),
        method="highs",
        options={"time_limit": SECONDS},
    )
    if answer.x is None or answer.status != 0:
        return None
    return np.asarray(answer.x[: len(s)] - answer.x[len(s) :])


def _cones(problem: InterfaceProblem) -> np.ndarray:
    """(k,) contacts whose forces fill a cone, or are normal to the surface."""
    return np.asarray(~problem.law.rough | (problem.mu > 0))


def _passes(problem: InterfaceProblem, s: np.ndarray, motion: np.ndarray) -> bool:
    """Whether the motion does work and meets the conditions of all contacts up to rounding."""
    g = (problem.V @ motion).reshape(problem.q.shape)
    size = np.abs(problem.V) @ np.abs(motion)
    slide = np.linalg.norm(g[:, 1:], axis=1)
    needed = np.where(
        _cones(problem), problem.mu * slide, np.where(slide > SLACK * size.max(), np.inf, 0.0)
    )
    work = s * motion
    return bool(
        np.all(g[:, 0] - needed >= -SLACK * size.max()) and work.sum() > SURE * np.abs(work).sum()
    )


def sentence(problem: InterfaceProblem, found: Escape) -> str:
    """Say what a motion without resistance does to which body, and what to change."""
    label = (
        problem.motions[found.strongest] if problem.motions else f"column {found.strongest} of V"
    )
    body, _, motion = label.rpartition(": ")
    body = body or "a body"
    if motion.startswith("rotation"):
        return (
            f"the load is more than the contacts can hold: {body} tips over ({motion}); change the"
            " load or add a support."
        )
    if found.opens:
        return (
            f"the load pulls the bodies apart: no contact holds {body} ({motion}); press them"
            " together or add a support."
        )
    return (
        f"the load is more than the contacts can hold: {body} slides off ({motion}); press the"
        " bodies together, or add friction or a support."
    )
