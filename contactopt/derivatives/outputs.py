"""Quantities of a solved state with their derivatives by forces, multipliers and displacements.

    approach, shift              of the plates along the mean normal and along t1 [length]
    normal_force, shear_force    on the upper body of a pair, the latter along t1, with the signs of load paths [force];
                                 of one pair of several as normal_force:PAIR
    resultant:PAIR:COMPONENT     of the contact forces on the upper body of a pair, in the coordinates of space [force]
    pressure:CONTACT             at one contact, by its number [stress]
    pressure@X,Y                 at a place, and the stresses of contactopt.analysis.places: von_mises:BODY:BOUNDARY, ...
    energy                       elastic energy of all bodies [force length]
    pressure, width, stick       the smooth readings of contactopt.analysis.quantities; of one pair of several pressure:PAIR

A largest stress has the derivative of the stress at the place where it is largest. The last three are formulas over many forces. Their derivative by the force at each closed contact is a central
difference of the reading, which solves nothing; what the parameters do to the forces is exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from contactopt.analysis.edges import contact_edge, stick_edge
from contactopt.analysis.places import PLACED, Place, map_of, place_of, pressure_weights, read_stress
from contactopt.analysis.quantities import QUANTITIES, elastic_energy
from contactopt.analysis.resultants import planes_of, views
from contactopt.derivatives.parameters import MATERIAL, Parameter
from contactopt.derivatives.states import Seeds, Step
from contactopt.errors import InputError
from contactopt.problem.laws import Law

READINGS = ("pressure", "width", "stick")
LINEAR = ("approach", "shift", "normal_force", "shear_force")
STEP = 1e-5  # of a reading's central differences, over the force at the contact
MOST = 3000  # contacts at which a reading is differentiated


@dataclass(frozen=True, eq=False)
class Functional:
    """A linear function of the contact forces of one state, for quantities that have no name.

    weights  (k, dim), one per component of the reactions
    """

    weights: Any

    def __call__(self, step: Step) -> Seeds:
        weights = np.asarray(self.weights, dtype=float)
        if weights.shape != step.problem.q.shape:
            raise InputError(
                f"the weights of a functional must have the shape {step.problem.q.shape}; got {weights.shape}."
            )
        return Seeds(float(np.sum(weights * step.solution.reactions)), reactions=weights)


def seeds_of(quantity: Any, step: Step) -> Seeds:
    """Differentiate a quantity of a solved state.

    Parameters
    ----------
    quantity
        A name from this module's head, or a function of the state that returns Seeds.
    step
        The solved state.

    Returns
    -------
    Seeds
        The value of the quantity, and its derivatives by forces, multipliers and displacements.

    Raises
    ------
    InputError
        For an unknown quantity.
    """
    if callable(quantity):
        return quantity(step)
    if not isinstance(quantity, str):
        raise InputError(f"a quantity is given by its name; got {quantity!r}.")
    place = place_of(quantity, step.reduction.scene)
    if place is not None:
        return (
            Functional(pressure_weights(place, step.reduction))(step)
            if place.kind == "pressure"
            else _stress(step, place)
        )
    kind, *rest = quantity.split(":")
    if quantity == "stick":
        return _stick(step)
    if kind in ("pressure", "width") and (not rest or (len(rest) == 1 and not rest[0].isdigit())):
        return _reading(kind, step, _pair(step, rest[0]) if rest else None)
    if quantity == "energy":
        return _energy(step)
    if quantity in ("approach", "shift"):
        return _motion(step, 0 if quantity == "approach" else 1)
    if kind in ("normal_force", "shear_force") and len(rest) <= 1:
        return _force(step, kind, rest[0] if rest else None)
    if kind == "resultant" and len(rest) == 2:
        return _resultant(step, *rest)
    if kind == "pressure" and len(rest) == 1:
        return _pressure_at(step, rest[0])
    known = ", ".join((*LINEAR, *READINGS, "energy", "resultant:PAIR:COMPONENT", "pressure:CONTACT", *PLACED))
    raise InputError(f"unknown quantity {quantity!r}; choose from {known}.")


def _motion(step: Step, component: int) -> Seeds:
    problem, lam = step.problem, step.solution.multipliers
    if len(lam) == 0:
        raise InputError(
            f"scene '{step.reduction.scene.name}' has no plate, hence no approach and no shift; ask for another quantity."
        )
    rows = problem.V.reshape(problem.contacts, problem.dim, -1)[:, component]
    weights = np.average(rows, axis=0, weights=problem.areas) * (-1.0 if component == 0 else 1.0)
    return Seeds(float(weights @ lam), multipliers=weights)


def _pair(step: Step, name: str | None) -> slice:
    if name is None:
        return slice(0, step.problem.contacts)
    for pair in step.problem.pairs:
        if pair.name == name:
            return pair.contacts
    raise InputError(f"there is no contact '{name}', only {', '.join(pair.name for pair in step.problem.pairs)}.")


def _force(step: Step, kind: str, pair: str | None) -> Seeds:
    weights = np.zeros(step.problem.q.shape)
    weights[_pair(step, pair), 0 if kind == "normal_force" else 1] = 1.0 if kind == "normal_force" else -1.0
    return Functional(weights)(step)


def _resultant(step: Step, pair: str, component: str) -> Seeds:
    scene = step.reduction.scene
    if component not in scene.components:
        raise InputError(f"there is no component {component!r}; use {', '.join(scene.components)}.")
    axis = np.eye(scene.dim)[scene.components.index(component)]
    for plane in planes_of(step.reduction):  # mirror images balance each other across it
        axis = axis - plane.inward * (plane.inward @ axis)
    if scene.kind == "axisymmetric" and component == "r":
        axis = 0 * axis
    weights, own = np.zeros(step.problem.q.shape), _pair(step, pair)
    weights[own] = step.reduction.frames[own] @ axis
    return Functional(weights)(step)


def _pressure_at(step: Step, number: str) -> Seeds:
    problem = step.problem
    if not number.isdigit() or int(number) >= problem.contacts or not problem.areas[int(number)] > 0:
        raise InputError(
            f"pressure:CONTACT needs the number of a contact with an area, 0 to {problem.contacts - 1}; got {number}."
        )
    weights = np.zeros(problem.q.shape)
    weights[int(number), 0] = 1 / problem.areas[int(number)]
    return Functional(weights)(step)


def _energy(step: Step) -> Seeds:
    by_r, by_U = np.zeros(step.problem.q.size), []
    for body, B, U, force in zip(step.reduction.bodies, step.reduction.maps, step.displaced, step.forces):
        own, by_force = body.energy_gradient(U, force)
        moved = body.displacement(own, np.zeros(len(body.resultants))) - body.at_rest if np.any(own) else 0 * own
        by_r += B @ (moved + by_force)
        by_U.append(own)

    def explicit(which: Parameter) -> float:
        if which.kind not in MATERIAL:
            return 0.0
        parts = zip(step.reduction.scene.parts, step.reduction.bodies, step.displaced, step.forces)
        return sum(body.energy_change(which.kind, U, F) for part, body, U, F in parts if which.concerns(part))

    value = elastic_energy(step.reduction, step.solution)
    return Seeds(value, by_r.reshape(step.problem.q.shape), bodies=tuple(by_U), explicit=explicit)


def _stress(step: Step, place: Place) -> Seeds:
    """A stress inside a body: a function of its displacement U, which follows the contact forces by its compliance.

    The multipliers do not enter, since the free motions that they stand for strain nothing.
    """
    found = read_stress(place, step.reduction, step.displaced)
    number, body, U = found.body, step.reduction.bodies[found.body], step.displaced[found.body]
    own = found.map.transposed(found.slopes)
    moved = body.displacement(own, np.zeros(len(body.resultants))) - body.at_rest
    by_r = (step.reduction.maps[number] @ moved).reshape(step.problem.q.shape)

    def explicit(which: Parameter) -> float:
        part = step.reduction.scene.parts[number]
        if which.kind not in MATERIAL or not which.concerns(part):
            return 0.0
        if which.kind == "E":
            return found.value / part.material.E  # type: ignore[union-attr]
        by_poisson = map_of(place, step.reduction, by_poisson=True)
        return float(np.sum(found.slopes * by_poisson.stress(U)))

    bodies = tuple(own if i == number else None for i in range(len(step.displaced)))
    return Seeds(found.value, by_r, bodies=bodies, explicit=explicit, stress=found)


def _reading(name: str, step: Step, pair: slice | None) -> Seeds:
    """A quantity of contactopt.analysis that reads the normal forces, of all contacts or one pair, at closed contacts."""
    reduction, solution = replace(step.reduction, problem=step.problem), step.solution
    if pair is not None:
        number = [made.contacts for made in step.problem.pairs].index(pair)
        reduction, solution = views(reduction, solution)[number]
    read, r = QUANTITIES[name], solution.reactions
    by_r = np.zeros(r.shape)
    for i in _few(name, np.flatnonzero(reduction.problem.law.pressed(r))):

        def at(h: float, i: int = i) -> float:
            there = r.copy()
            there[i, 0] += h
            return read(reduction, replace(solution, reactions=there))

        by_r[i, 0] = _central(at, STEP * float(np.abs(r[i]).max()))
    whole = np.zeros(step.problem.q.shape)
    whole[pair or slice(None)] = by_r
    return Seeds(read(reduction, solution), whole)


def _stick(step: Step) -> Seeds:
    """Half-width of the stick zone over that of contact, differentiated where contacts stay open, stick or slip as they do.

    It depends on the forces at closed contacts, on the slip of the step, and on the friction bound. A contact that slips
    stays at its bound: its tangential force changes with the normal one, and may turn.
    """
    scene, problem, r = step.reduction.scene, step.problem, step.solution.reactions
    u = problem.displacements(r, step.solution.multipliers)
    sticks, slips = problem.law.sticking(r), problem.law.slipping(r)
    across = np.stack([-r[:, 2], r[:, 1]], axis=1) if problem.dim == 3 else None

    def read(there: np.ndarray, moved: np.ndarray, law: Law) -> float:
        at = replace(problem, law=law)
        edge = contact_edge(scene, at, there)
        return stick_edge(scene, at, there, moved[:, 1:])[0] / edge if edge > 0 else 0.0

    def along(i: int, force: np.ndarray, slip: np.ndarray, t: float) -> float:
        there, moved = r.copy(), u.copy()
        there[i] += t * force
        moved[i, 1:] += t * slip
        return read(there, moved, problem.law)

    by_r, by_u = np.zeros(r.shape), np.zeros(u.shape)
    still = np.zeros(problem.dim - 1)
    for i in _few("stick", np.flatnonzero(sticks | slips)):
        h = STEP * float(np.abs(r[i]).max())
        for c in range(problem.dim if sticks[i] else 1):
            way = np.eye(problem.dim)[c]
            if slips[i]:  # a small step along the edge of the cone
                bound = problem.law.bound(r[:, 0] + h * (np.arange(len(r)) == i))[i]
                way[1:] = (bound / np.linalg.norm(r[i, 1:]) - 1) * r[i, 1:] / h if np.any(r[i, 1:]) else 0.0
            by_r[i, c] = _central(partial(along, i, way, still), h)
        if slips[i] and across is not None and np.any(across[i]):
            turn = across[i] / np.linalg.norm(across[i])
            by_r[i, 1:] += turn * _central(partial(along, i, np.append(0.0, turn), still), h)
        size = float(np.abs(u[i, 1:]).max())
        if slips[i] and size > 0:
            for c in range(problem.dim - 1):
                way = np.eye(problem.dim - 1)[c]
                by_u[i, c + 1] = _central(partial(along, i, 0 * r[i], way), STEP * size)

    def explicit(which: Parameter) -> float:
        if which.kind != "mu":
            return 0.0
        change = step.law_change(which)

        def at(h: float) -> float:
            law, there = problem.law.shifted(h * change), r.copy()
            old, new = problem.law.bound(r[:, 0]), law.bound(r[:, 0])
            grows = np.divide(new, old, out=np.ones(len(old)), where=old > 0)
            there[slips, 1:] *= grows[slips, None]
            return read(there, u, law)

        return _central(at, STEP * float(problem.law.bound(np.ones(len(r))).max(initial=0.0)))

    return Seeds(read(r, u, problem.law), by_r, slip=by_u, explicit=explicit)


def _few(name: str, contacts: np.ndarray) -> np.ndarray:
    if len(contacts) > MOST:
        raise InputError(f"'{name}' can be differentiated at {MOST} closed contacts at most; got {len(contacts)}.")
    return contacts


def _central(function: Callable[[float], float], step: float) -> float:
    return (function(step) - function(-step)) / (2 * step)
