"""Forces that contacts around one place can exchange: at a corner of 90 degrees four components of
two forces move one node in two directions.

Such forces y, with Q y = 0 and V' y = 0, change neither displacements nor balance. Among all
forces that solve the problem, those with the least friction are given: a corner under constant
pressure has this pressure, and no friction.
"""

import logging
from dataclasses import replace

import numpy as np
from scipy.linalg import eigh
from scipy.spatial import KDTree

from contactopt.cards import count
from contactopt.checks import place_words
from contactopt.linear.operators import form, has_entries
from contactopt.methods.notes import note
from contactopt.problem import InterfaceProblem, Solution, natural_map_residual
from contactopt.problem.chart import UNNAMED
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
# Residual of other forces over the square of their distance: off a cone, which bends away from its
# tangents, it is of the order of one; of allowed forces it is what is left of the search for them.
OUTSIDE = 1e-4
UNFELT = 1e-10  # relative size of displacements by forces that no body feels
# by forces that are hardly felt, and the certificate up to which others may take their place
HARDLY_FELT, CLEAR = (1e-6, 1e-8), 1e-10
LAST = 1e-8  # weight of even pressures beside the least friction
# method of multipliers: what its weight is multiplied by in each of so many rounds, Newton's steps
# in a round, and the relative size of rounding
HARDER, ROUNDS, NEWTON, EPS = 10.0, 12, 60, 1e-14


def may(problem: InterfaceProblem) -> bool:
    """Whether two contacts lie at one place, or contacts of two pairs are nearer to each other than
    three times the largest spacing.
    """
    if len(problem.pairs) < 2 and problem.pairs[0].name == UNNAMED:
        return False
    if problem.shared_places:
        return True
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


def least_friction(problem: InterfaceProblem, solution: Solution, tol: float) -> Solution:
    """The solution with the least friction where contacts exchange forces, and a note about it."""
    points, places = problem.coordinates.T, problem.shared_places
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
    said += " nothing else but slip; pressures and friction there are one choice of several, and"
    said += " may differ in an equivalent scene"
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


def _most_friction(solution: Solution, at: np.ndarray) -> np.ndarray:
    """The one with the largest friction among some contacts."""
    return at[[np.argmax(np.linalg.norm(solution.reactions[at, 1:], axis=1))]]


def _exchanged(
    problem: InterfaceProblem, solution: Solution, tol: float, near: np.ndarray, at: np.ndarray
) -> tuple[Solution, np.ndarray]:
    """The solution with the least friction that contacts exchange; where some or several stay."""
    contacts = near[_touching(problem, solution)[near]]
    own, ways, sizes = exchanges(problem, contacts)
    unfelt = bool(np.any(sizes <= UNFELT))
    for least in (*HARDLY_FELT, UNFELT):
        some = ways[:, sizes <= least]
        enough = max(solution.residual, tol if least == UNFELT else min(CLEAR, tol))
        for choose in (_with_least, _within) if some.size else ():
            chosen, uneven = choose(problem, solution, own, some)
            residual = natural_map_residual(problem, chosen, solution.multipliers)
            if residual <= enough:
                made = replace(solution, reactions=chosen, residual=residual)
                left = _most_friction(made, at) if _rubs(chosen[at]) else uneven
                return made, left if unfelt else EMPTY
    return solution, _most_friction(solution, at if len(at) else contacts) if unfelt else EMPTY


def _touching(problem: InterfaceProblem, solution: Solution) -> np.ndarray:
    """(k,) the contacts that are pressed or have no gap, and those that cannot open."""
    r, u = solution.reactions, problem.displacements(solution.reactions, solution.multipliers)
    pressed = r[:, 0] > INSIDE * np.abs(r[:, 0]).max()
    return np.asarray((problem.law.lowest < 0) | pressed | (u[:, 0] <= _felt(problem, u)))


def loosest(problem: InterfaceProblem, solution: Solution) -> int | None:
    """The contact whose force changes most if others take its place that the law allows, of those
    that touch; where they slip, these may change the slip. None if the law allows no others: then
    these forces are the nearest to a point off along an exchange by chance, and to the opposite.
    """
    contacts = np.flatnonzero(_touching(problem, solution))
    u = problem.displacements(solution.reactions, solution.multipliers)
    slipping = np.zeros(u.shape, dtype=bool)
    slipping[:, 1:] = (np.linalg.norm(u[:, 1:], axis=1) > _felt(problem, u))[:, None]
    own, ways, sizes = exchanges(problem, contacts, ~slipping.ravel())
    some, r = ways[:, sizes <= UNFELT], solution.reactions
    if not some.size:
        return None
    off, size = np.zeros(r.size), np.abs(r).max() or 1.0
    off[own] = some @ np.random.default_rng(0).normal(size=some.shape[1])
    off *= size / np.abs(off).max()
    for share in (1.0, -1.0, 1e-3, -1e-3):  # with much more force a contact may slip the other way
        found = _within(problem, solution, own, some, r + share * off.reshape(r.shape))[0]
        moved = np.linalg.norm(found - r, axis=1) / size
        off_law = natural_map_residual(problem, found, solution.multipliers)
        if off_law < OUTSIDE * moved.max() ** 2:
            return int(np.argmax(moved))
    return None


def _felt(problem: InterfaceProblem, u: np.ndarray) -> float:
    """Displacements (k, dim) beside which smaller ones count as none [length]."""
    return INSIDE * float(max(np.abs(u).max(), np.abs(u - problem.q).max()))


def exchanges(
    problem: InterfaceProblem, contacts: np.ndarray, rows: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unknowns (m,) of some contacts' forces, a basis (m, j) of changes y that the bodies hardly
    feel, and the relative sizes (j,) of Q y, or of some of its rows (k dim,), and V' y.
    """
    Q, dim = problem.Q, problem.dim
    free = np.zeros((problem.contacts, dim), dtype=bool)
    free[contacts, 0], free[contacts, 1:] = True, problem.law.rough[contacts, None]
    own = np.flatnonzero(free.ravel() & ~immovable(problem))
    if not len(own):
        return own, np.zeros((0, 0)), np.zeros(0)
    columns = Q[:, own] if form(Q) == "array" else Q[:, own].toarray()
    motions = problem.V[own] / np.where(problem.reach > 0, problem.reach, 1.0)
    scaled = columns / (np.abs(columns).max() or 1.0)
    felt = np.vstack([scaled if rows is None else scaled[rows], motions.T])
    if not problem.symmetric or rows is not None:
        return own, *_shortened(felt, HARDLY_FELT[0])
    # y'Q y <= HARDLY_FELT and |V'y|^2 <= HARDLY_FELT hold on a space that contains the y looked for
    # and is found sooner, since the matrix is semidefinite
    few = {"subset_by_value": (-np.inf, HARDLY_FELT[0])}  # in half the time of all
    some = eigh(scaled[own] + motions @ motions.T, **few)[1]
    ways, sizes = _shortened(felt @ some, HARDLY_FELT[0])
    return own, some @ ways, sizes


def _shortened(matrix: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal directions that a matrix shortens to `least` or less, and to what."""
    sizes, directions = np.linalg.svd(matrix, full_matrices=len(matrix) < matrix.shape[1])[1:]
    sizes = np.pad(sizes, (0, matrix.shape[1] - len(sizes)))
    return directions[sizes <= least].T, sizes[sizes <= least]


def _with_least(
    problem: InterfaceProblem, solution: Solution, own: np.ndarray, unfelt: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forces (k, dim) with the least friction among those that are exchanged and, of these, with
    the least sum of pressure times force; and where this sum chose among uneven pressures. Even
    ones are right: what could be added to them is zero in the mean.
    """
    changed, weight = solution.reactions.ravel().copy(), _weights(problem).ravel()[own]
    scaled = unfelt * weight[:, None]
    changed[own] -= unfelt @ np.linalg.lstsq(scaled, changed[own] * weight, rcond=None)[0]
    chosen = changed.reshape(problem.q.shape)
    tangents = own % problem.dim > 0
    rubbing = unfelt[tangents]
    sizes, ways = np.linalg.svd(rubbing, full_matrices=len(rubbing) < rubbing.shape[1])[1:]
    alone = scaled[~tangents] @ ways[int(np.sum(sizes > SEEN)) :].T
    if not alone.size:
        return chosen, EMPTY
    normal, sizes = own[~tangents] // problem.dim, np.linalg.norm(alone, axis=1)
    pressures = (chosen[:, 0] / problem.areas)[normal[sizes > SEEN * sizes.max()]]
    uneven = np.ptp(pressures) > 1e-3 * np.abs(pressures).max()  # others are alike
    return chosen, normal[[np.argmax(sizes)]] if uneven else EMPTY


def _weights(problem: InterfaceProblem) -> np.ndarray:
    """(k, dim) roots of the weights of squared forces in the sum that is least."""
    weight = np.ones(problem.q.shape)
    weight[:, 0] = np.sqrt(LAST * problem.areas.mean() / problem.areas)
    return weight


def _within(
    problem: InterfaceProblem,
    solution: Solution,
    own: np.ndarray,
    unfelt: np.ndarray,
    wanted: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The same where the law bounds the choice, or the nearest to `wanted` forces (k, dim), and no
    place: the least of a convex function over the forces that obey the law with the displacements
    of the solution, by the method of multipliers with Newton's steps.
    """
    dim, size = problem.dim, np.abs(solution.reactions).max()
    contacts, place = np.unique(own // dim, return_inverse=True)
    law, given = problem.law.select(contacts), solution.reactions[contacts]
    ways = np.zeros((*given.shape, unfelt.shape[1]))
    ways[place, own % dim] = unfelt
    ways = ways @ _allowed(problem, solution, contacts, ways)
    flat, weight = ways.reshape(given.size, -1), _weights(problem)[contacts].ravel()
    aim = np.zeros(given.size)
    if wanted is not None:
        aim, weight = wanted[contacts].ravel(), np.ones(given.size)
    scaled = flat * weight[:, None]
    square = scaled.T @ scaled
    z, pull, stiff = np.zeros(flat.shape[1]), np.zeros_like(given), HARDER
    for _ in range(ROUNDS):
        least = np.inf
        for _ in range(NEWTON):
            r = given + ways @ z
            y = r + pull / stiff
            inside, slope = law.nearest_derivative(y, r[:, 0])
            off, left = y - inside, weight * (r.ravel() - aim)
            value = left @ left + stiff * np.vdot(off, off)
            if value < least * (1 - EPS):
                least, kept = value, (z, stiff * off)
                bent = (ways - slope @ ways).reshape(given.size, -1)
                bent = square + stiff * flat.T @ bent
                pulled = scaled.T @ left + flat.T @ kept[1].ravel()
                step = -np.linalg.lstsq(bent, pulled, rcond=None)[0]
            elif np.abs(step).max(initial=0.0) <= EPS * size:
                break
            else:
                step = step / 2
            z = kept[0] + step
        z, pull, stiff = *kept, stiff * HARDER
        r = given + ways @ z
        if np.abs(r - law.nearest(r, r[:, 0])).max() <= EPS * size:
            break
    changed = solution.reactions.copy()
    changed[contacts] = r
    return changed, EMPTY


def _allowed(
    problem: InterfaceProblem, solution: Solution, contacts: np.ndarray, ways: np.ndarray
) -> np.ndarray:
    """Combinations of changes (k, dim, j) that keep the force of each sliding contact on its ray,
    and are zero at open ones.
    """
    u = problem.displacements(solution.reactions, solution.multipliers)
    felt = _felt(problem, u)
    u = u[contacts]
    u[np.abs(u[:, 0]) <= felt, 0] = 0.0
    u[np.linalg.norm(u[:, 1:], axis=1) <= felt, 1:] = 0.0
    moved, size = np.linalg.norm(u, axis=1), np.abs(solution.reactions).max()
    y = solution.reactions[contacts] - size * u / np.where(moved > 0, moved, 1.0)[:, None]
    y[:, 0] += INSIDE * size  # a contact without force that slips has a ray, too
    slope = problem.law.select(contacts).project(y)[1]
    slope[moved == 0] = np.eye(problem.dim)
    return _shortened((ways - slope @ ways).reshape(y.size, -1), UNFELT)[0]


def _rubs(r: np.ndarray) -> bool:
    """Whether some of these forces have friction."""
    return bool(np.abs(r[:, 1:]).max(initial=0.0) > INSIDE * np.abs(r).max(initial=0.0))
