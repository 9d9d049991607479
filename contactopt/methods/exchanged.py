"""Forces that contacts around one place can exchange: at a corner of 90 degrees four components of
two forces move one node in two directions.

Such forces y, with Q y = 0 and V' y = 0, change neither displacements nor balance. Among all
forces that solve the problem, those with the least friction are given: a corner under constant
pressure has this pressure, and no friction.
"""

import logging
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from contactopt.cards import count
from contactopt.checks import place_words
from contactopt.linear.operators import form, has_entries
from contactopt.methods.notes import note
from contactopt.problem import InterfaceProblem, Solution, natural_map_residual
from contactopt.problem.scaling import immovable

# Contacts around a place that exchange forces, too: on quadratic elements an exchange falls to a
# thousandth within three elements.
NEAREST = 40
# The places along an edge in space exchange forces with each other and over more contacts than
# these. With so few contacts all are looked at at once, in about a second.
FEW = 600
# share of the normal force, and of its friction, that a force may lose and still hold
INSIDE = 1e-6
SEEN = 1e-6  # size of the friction of an exchange of size one that has some
EMPTY = np.zeros(0, dtype=int)
UNFELT = 1e-10  # relative size of displacements by forces that no body feels


def least_friction(problem: InterfaceProblem, solution: Solution, tol: float) -> Solution:
    """The solution with the least friction where contacts exchange forces, and a note about it."""
    points, places = problem.coordinates.T, problem.shared_places
    if not solution.solved or not (places or _meet(problem)):
        return solution
    known, left, corners = has_entries(problem.Q), [], np.concatenate([*places, EMPTY])
    alone = known  # whether each place is looked at by itself
    if known and problem.contacts <= FEW:
        everything = np.arange(problem.contacts)
        made, at = _exchanged(problem, solution, tol, everything, corners)
        if len(at):
            left = [at[0], *(at[0] for at in places if _rubs(made.reactions[at]))]
        alone, solution = len(at) > 0 and made is solution, made
    for at in places if alone else ():
        far = np.linalg.norm(points - points[at[0]], axis=1)
        near = np.argsort(far, kind="stable")[:NEAREST]
        solution, some = _exchanged(problem, solution, tol, near, at)
        left += [at[0]] * (len(some) > 0)
    said = "the contact forces are not unique: forces that the contacts there exchange change"
    said += " nothing else"
    # in the plane a corner exchanges forces with contacts nearby alone
    unseen = not known or (problem.contacts > FEW and problem.dim == 3)
    if not left and unseen and places and _rubs(solution.reactions[corners]):
        left = [*_most_friction(solution, corners), *(at[0] for at in places)]
        why = f"with more than {FEW} contacts" if known else "where Q is known by products only"
        said = f"friction acts; whether its forces there are unique is not looked at {why}"
    if left:
        more = len(np.unique(points[left], axis=0)) - 1
        others = f" and at {count(more, 'more place')}" * (more > 0)
        where = f"at ({place_words(points[left[0]])}){others}, where several surfaces meet,"
        note(logging.getLogger(__name__), f"{where} {said}")
    return solution


def _meet(problem: InterfaceProblem) -> bool:
    """Whether contacts of two pairs are neighbours: within three times the largest spacing."""
    points = [problem.coordinates.T[pair.contacts] for pair in problem.pairs]
    if len(points) < 2 or problem.coordinates.shape[1] != problem.contacts:
        return False
    trees = [KDTree(own) for own in points]
    apart = [tree.query(own, k=[2])[0].ravel() for tree, own in zip(trees, points)]
    widths = [3 * np.max(d[np.isfinite(d)], initial=0.0) for d in apart]
    return any(
        tree.query(own)[0].min() <= max(width, other)
        for i, (own, width) in enumerate(zip(points, widths))
        for tree, other in zip(trees[:i], widths)
    )


def _most_friction(solution: Solution, at: np.ndarray) -> np.ndarray:
    """The one with the largest friction among some contacts."""
    return at[[np.argmax(np.linalg.norm(solution.reactions[at, 1:], axis=1))]]


def _exchanged(
    problem: InterfaceProblem, solution: Solution, tol: float, near: np.ndarray, at: np.ndarray
) -> tuple[Solution, np.ndarray]:
    """The solution with the least friction that contacts exchange; where some or several stay."""
    left = EMPTY
    for contacts in _closed(problem, solution, near):
        own, unfelt = exchanges(problem, contacts)
        if not unfelt.size:  # nor do fewer of them exchange any
            return solution, left
        r, uneven = _with_least(problem, solution.reactions, own, unfelt)
        residual = natural_map_residual(problem, r, solution.multipliers)
        if residual <= max(solution.residual, tol):
            made = replace(solution, reactions=r, residual=residual)
            return made, _most_friction(made, at) if _rubs(r[at]) else uneven
        left = _most_friction(solution, at if len(at) else contacts)
    return solution, left


def exchanges(problem: InterfaceProblem, contacts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unknowns (m,) of some contacts' forces, and the basis (m, j) of y with Q y = 0, V' y = 0."""
    Q, dim = problem.Q, problem.dim
    free = np.zeros((problem.contacts, dim), dtype=bool)
    free[contacts, 0], free[contacts, 1:] = True, problem.law.rough[contacts, None]
    own = np.flatnonzero(free.ravel() & ~immovable(problem))
    if not len(own):
        return own, np.zeros((0, 0))
    columns = Q[:, own] if form(Q) == "array" else Q[:, own].toarray()
    motions = problem.V[own] / np.where(problem.reach > 0, problem.reach, 1.0)
    scaled = columns / (np.abs(columns).max() or 1.0)
    felt = np.vstack([scaled, motions.T])
    if not problem.symmetric:
        return own, _unfelt(felt)
    # y'Q y <= UNFELT and |V'y|^2 <= UNFELT hold on a space that contains the y looked for and is
    # found sooner, since the matrix is semidefinite
    sizes, directions = np.linalg.eigh(scaled[own] + motions @ motions.T)
    some = directions[:, sizes <= UNFELT]
    return own, some @ _unfelt(felt @ some)


def _unfelt(felt: np.ndarray) -> np.ndarray:
    """An orthonormal basis of those directions that a matrix shortens to UNFELT or less."""
    sizes, directions = np.linalg.svd(felt, full_matrices=len(felt) < felt.shape[1])[1:]
    small = np.pad(sizes, (0, felt.shape[1] - len(sizes))) <= UNFELT
    return directions[small].T


def _closed(problem: InterfaceProblem, solution: Solution, at: np.ndarray) -> Iterator[np.ndarray]:
    """Contacts of `at` without a gap, then the pressed ones of these, then the sticking ones."""
    r, u = solution.reactions, problem.displacements(solution.reactions, solution.multipliers)
    bound = problem.law.lowest < 0
    normal = np.where(bound, np.inf, r[:, 0])
    closed = (u[:, 0] <= INSIDE * max(np.abs(u).max(), np.abs(u - problem.q).max())) | bound
    pressed = normal > INSIDE * np.abs(r[:, 0]).max()
    inside = np.linalg.norm(r[:, 1:], axis=1) < (1 - INSIDE) * problem.law.bound(r[:, 0])
    inside = pressed & (inside | ~problem.law.rough)
    for one, before in ((closed | pressed, None), (pressed, closed | pressed), (inside, pressed)):
        if before is None or not np.array_equal(one[at], before[at]):
            yield at[one[at]]


def _with_least(
    problem: InterfaceProblem, r: np.ndarray, own: np.ndarray, unfelt: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forces (k, dim) with the least friction among those that are exchanged and, of these, with
    the least sum of pressure times force; and where this sum chose among uneven pressures. Even
    ones are right: what could be added to them is zero in the mean.
    """
    tangents = own % problem.dim > 0
    seen, sizes, ways = np.linalg.svd(unfelt[tangents], full_matrices=True)
    rank = int(np.sum(sizes > SEEN))
    changed = r.ravel().copy()
    friction = seen[:, :rank].T @ changed[own[tangents]]
    changed[own] -= unfelt @ (ways[:rank].T @ (friction / sizes[:rank]))
    if rank == len(ways):
        return changed.reshape(r.shape), EMPTY
    normal = own[~tangents]
    weight = 1 / np.sqrt(problem.areas[normal // problem.dim])
    alone = unfelt[~tangents] @ ways[rank:].T
    scaled, pressed = alone * weight[:, None], changed[normal] * weight
    changed[normal] -= alone @ np.linalg.lstsq(scaled, pressed, rcond=None)[0]
    sizes = np.linalg.norm(scaled, axis=1)
    pressures = (changed[normal] * weight**2)[sizes > SEEN * sizes.max()]
    uneven = np.ptp(pressures) > 1e-3 * np.abs(pressures).max()  # else they are alike
    return changed.reshape(r.shape), normal[[np.argmax(sizes)]] // problem.dim if uneven else EMPTY


def _rubs(r: np.ndarray) -> bool:
    """Whether some of these forces have friction."""
    return bool(np.abs(r[:, 1:]).max(initial=0.0) > INSIDE * np.abs(r).max(initial=0.0))
