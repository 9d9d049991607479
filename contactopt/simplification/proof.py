"""The proof that the part of a scene answers for the whole: one certificate of the whole.

The part is solved. Its displacements and its contact tractions are mirrored, turned or drawn out to
all nodes and contacts of the whole, which is assembled on its own meshes, with its own loads, gaps
and friction. What is computed then contains nothing of the part but these numbers:

    equilibrium   |A U - f - B' r| on unknowns that are free and the total forces of plates and
                  rigid bodies, over the largest force on a node or plate
    supports      |U - g| on unknowns that are held, over the largest displacement of the body
    contact       |r_i - P(r_i - rho_i u_i)| / F, the natural map at every contact, as in
                  contactopt.problem.certificate

This takes products with the stiffness of the whole and no solve. In space it costs much less than
the part saves. In the plane, where assembling is most of the work, a part pays if it is solved more
than once, as in a search for an accuracy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import KDTree

from contactopt.bodies import assemble
from contactopt.bodies.assembly import Assembly
from contactopt.coupling.coupling import Coupling, couple, law_of
from contactopt.coupling.crosspoints import independent
from contactopt.defaults import EQUAL
from contactopt.problem.certificate import Yardsticks, yardsticks
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Scene
from contactopt.solving.solve_scene import Solved

if TYPE_CHECKING:
    from contactopt.scenes.matrix_part import AnyPart

Key = tuple[str, str]  # ("body", its name) or ("pair", its name)
# ("body" or "pair", name), points (dim, k) of the larger scene -> the same of the smaller one, and
# matrices (k, dim, dim')
# that take vectors there back to vectors here
Fold = Callable[[Key, np.ndarray], tuple[Key, np.ndarray, np.ndarray]]


def certificate_of_whole(
    whole: Scene, elements: int, zone: float | None, part: Solved, folds: Sequence[Fold]
) -> float:
    """The largest error of the whole scene with the answer of the part, as defined at the top [-];
    infinite where something of the whole scene is not in the part. `folds` map it to the part.
    """
    bodies: dict[str, Any] = {}
    for each in whole.parts:
        bodies[each.name] = assemble(whole, each, elements, zone)
    spread = Spread(part, folds)
    errors = [0.0]
    try:
        moves = {each.name: spread.displacement(each, bodies[each.name]) for each in whole.parts}
        forces = {name: np.zeros(len(U)) for name, U in moves.items()}
        sides = [(pair, *(bodies[name] for name in pair.bodies)) for pair in whole.pairs]
        couplings = independent(
            whole.pairs, [couple(whole, *both) for both in sides], bodies.values()
        )
        for pair, made in zip(whole.pairs, couplings):
            upper, lower = pair.bodies
            r, measure = spread.reactions(pair, made)
            u = (made.upper @ moves[upper] - made.lower @ moves[lower]).reshape(r.shape)
            u[:, 0] += made.gap
            law = law_of(pair, made)
            errors.append(float(measure.errors(law, r, u).max(initial=0.0)))
            forces[upper] += made.upper.T @ r.ravel()
            forces[lower] -= made.lower.T @ r.ravel()
    except LookupError:
        return np.inf
    for each in whole.parts:
        U, F = moves[each.name], forces[each.name]
        if each.name in whole.rigid:
            errors.append(_rigid(whole, whole.rigid[each.name], U, F))
        else:
            errors.append(_elastic(bodies[each.name].body, U, F))
    return max(errors) if np.all(np.isfinite(errors)) else np.inf


class Spread:
    """The solution of a part at the places of the whole; LookupError where the part has none."""

    def __init__(self, part: Solved, folds: Sequence[Fold]):
        self.part, self.folds = part, folds
        reduction, solution = part.reduction, part.solution
        self.displaced = {
            body.name: U for body, U in zip(reduction.bodies, reduction.displaced(solution))
        }
        self.bodies: dict[str, Any] = {body.name: body for body in reduction.bodies}
        u = reduction.problem.displacements(solution.reactions, solution.multipliers)
        d = np.asarray(reduction.problem.Q @ solution.reactions.ravel()).reshape(u.shape)
        self.measure = yardsticks(reduction.problem, solution.reactions, d, u - d)

    def folded(self, key: Key, x: np.ndarray) -> tuple[Key, np.ndarray, np.ndarray]:
        """Where places of the whole lie in the part, and the matrices for vectors, as in Fold."""
        turns = np.tile(np.eye(len(x)), (x.shape[1], 1, 1))
        for fold in self.folds:
            key, x, more = fold(key, x)
            turns = turns @ more
        return key, x, turns

    def displacement(self, each: AnyPart, body: Any) -> np.ndarray:
        """U (n,) of a body of the whole; of a rigid one its translation, then zeros."""
        if not each.meshed:
            dim = len(body.components)
            key, _, turns = self.folded(("body", each.name), np.zeros((dim, 1)))
            U = self.displaced[key[1]]
            return np.concatenate([turns[0] @ U[: len(U) // 2], np.zeros(dim)])
        made: Assembly = body.body
        key, x, turns = self.folded(("body", each.name), made.locations)
        own: Assembly = self.bodies[key[1]].body
        there = self.displaced[key[1]][own.unknowns][:, _nearest(own.locations, x)]
        U = np.zeros(len(made.load))
        U[made.unknowns] = np.einsum("kab,bk->ak", turns, there)
        return U

    def reactions(self, pair: Contact, made: Coupling) -> tuple[np.ndarray, Yardsticks]:
        """r (k, dim) of a pair of the whole, and the yardsticks for its natural map."""
        key, x, turns = self.folded(("pair", pair.name), made.positions)
        pairs = self.part.reduction.problem.pairs
        number = next(i for i, own in enumerate(pairs) if own.name == key[1])
        there, own = self.part.reduction.couplings[number], pairs[number].contacts
        # two contacts at a corner differ in their normals
        towards = np.einsum("kab,ka->bk", turns, made.frames[:, 0])
        aside = EQUAL * float(np.ptp(there.positions, axis=1).max(initial=0.0))
        contacts = _nearest(there.positions + aside * there.frames[:, 0].T, x + aside * towards)
        force = np.einsum("kac,ka->kc", there.frames, self.part.solution.reactions[own])[contacts]
        # A contact of the part stands for several of the whole, or for a slice of one.
        share = made.areas / np.where(there.areas > 0, there.areas, np.inf)[contacts]
        r = np.einsum("kca,kab,kb->kc", made.frames, turns, force) * share[:, None]
        largest = float(share.max(initial=0.0)) or 1.0
        rho = self.measure.rho[own][contacts] * largest
        return r, Yardsticks(self.measure.force * largest, 0.0, rho)


def _nearest(points: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The number of the point at each wanted place; LookupError if one of them has none."""
    distance, number = KDTree(points.T).query(wanted.T)
    if distance.max(initial=0.0) > 10 * EQUAL * float(np.ptp(points, axis=1).max(initial=0.0)):
        raise LookupError
    return np.asarray(number)


def _elastic(body: Assembly, U: np.ndarray, force: np.ndarray) -> float:
    """How far an elastic body is from equilibrium, and from what its supports ask for."""
    inner = body.A @ U
    missing = inner - body.load - force
    left = np.concatenate([missing[body.free], body.motion.T @ missing - body.plate_forces])
    scale = np.concatenate([inner, body.load, force, body.plate_forces])
    driven = body.motion / np.maximum(body.motion.sum(axis=0), 1.0)
    beyond = U - body.prescribed
    beyond = beyond - body.motion @ (driven.T @ beyond)
    beyond[body.free] = 0.0
    return max(_over(left, scale), _over(beyond, U))


def _over(errors: np.ndarray, scale: np.ndarray) -> float:
    """The largest error over the largest entry of the scale."""
    size = float(np.abs(scale).max(initial=0.0))
    return float(np.abs(errors).max(initial=0.0)) / max(size, 1e-300)


def _rigid(whole: Scene, body: Any, U: np.ndarray, force: np.ndarray) -> float:
    """How far a rigid body is from the balance of its forces, and from where it is held."""
    errors = [0.0]
    for number, name in enumerate(whole.components):
        own, asked = U[: whole.dim], (body.displacement or {}).get(name, 0.0)
        if name in (body.force or {}):
            own, asked = force[: whole.dim], -body.force[name]
        errors.append(_over(own[[number]] - asked, np.append(own, asked)))
    return max(errors)
