"""Quantities of a solved state with their derivatives by forces, multipliers and displacements.

    approach, shift              of the plates along the mean normal and along t1 [length]
    normal_force, shear_force    on the upper body of a pair, the latter along t1, with the signs of
                                 load paths [force]; of one pair of several as normal_force:PAIR
    resultant:PAIR:COMPONENT     of the contact forces on the upper body of a pair, in the
                                 coordinates of space [force]
    pressure:CONTACT             at one contact, by its number [stress]
    pressure@X,Y                 at a place, and the stresses of contactopt.readings.places:
                                 von_mises:BODY:BOUNDARY, ...
    energy                       elastic energy of all bodies [force length]
    pressure, width, stick       the smooth readings of contactopt.readings.quantities; of one pair
                                 of several pressure:PAIR

ROWS has one row for each. What it makes, a Quantity, is all that is known of it: how it is read,
with its uncertainty and its local maxima (contactopt.readings.quantities,
contactopt.readings.places), and its slopes.

A largest stress has the derivative of the stress at the place where it is largest. Pressure, width
and stick are formulas over several forces. Their derivative by the force at each closed contact is
a central difference of the reading, which solves nothing; what the parameters do to the forces is
exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from contactopt.coupling.reduction import Reduction
from contactopt.derivatives.parameters import MATERIAL, Parameter
from contactopt.derivatives.states import Seeds, Step
from contactopt.errors import InputError
from contactopt.problem import Solution
from contactopt.problem.laws.law import Law
from contactopt.readings.edges import contact_edge, stick_edge
from contactopt.readings.places import (
    PLACED,
    Place,
    map_of,
    place_of,
    pressure_weights,
    read_place,
    read_stress,
)
from contactopt.readings.quantities import (
    OF_ONE_PAIR,
    READINGS,
    Reading,
    elastic_energy,
    value_of,
)
from contactopt.readings.resultants import views
from contactopt.scenes.scene import Scene

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
                f"the weights of a functional must have the shape {step.problem.q.shape}; got"
                f" {weights.shape}."
            )
        return Seeds(float(np.sum(weights * step.solution.reactions)), reactions=weights)


@dataclass(frozen=True, eq=False)
class Quantity:
    """One quantity of one scene: how it is read, how uncertain that is, and its slopes.

    name    as it was asked for
    slopes  step -> Seeds: its value and its derivatives by what a state holds
    reader  (reduction, solution) -> Reading: value, uncertainty, local maxima; None: the value of
            the slopes
    nodal   whether it means another thing on the next mesh
    """

    name: str
    slopes: Callable[[Step], Seeds]
    reader: Callable[[Reduction, Solution], Reading] | None = None
    nodal: bool = False

    def read(self, reduction: Reduction, solution: Solution) -> Reading:
        """Read it from a solution of a reduced scene; InputError where the scene does not have it.

        Parameters
        ----------
        reduction : a reduced scene
        solution : of its problem

        Returns
        -------
        The value with its uncertainty, in the unit of the quantity.
        """
        if self.reader is not None:
            return self.reader(reduction, solution)
        return Reading(self.slopes(Step(reduction, reduction.problem, solution)).value)


def find_quantity(name: Any, scene: Scene) -> Quantity:
    """Find a quantity by its name, before anything is solved.

    Parameters
    ----------
    name : A name from this module's head.
    scene : The scene that is asked.

    Returns
    -------
    What reads it.

    Raises
    ------
    InputError : For an unknown quantity, and for a body, boundary, pair or place that the scene
        does not have.
    """
    if not isinstance(name, str):
        raise InputError(f"a quantity is given by its name; got {name!r}.")
    place = place_of(name, scene)
    if place is not None:
        return Quantity(name, partial(_at_place, place), partial(read_place, place))
    kind, _, rest = name.partition(":")
    row = ROWS.get(kind)
    if row is None or (rest and not row[0]):
        if row is not None and kind in READINGS:
            raise InputError(
                f"the {kind} belongs to the whole scene; of one pair ask for"
                f" {', '.join(OF_ONE_PAIR)}."
            )
        known = ", ".join((*(f"{kind}{form}" for kind, (form, _) in ROWS.items()), *PLACED))
        raise InputError(f"unknown quantity {name!r}; choose from {known}.")
    return row[1](name, rest, scene)


def seeds_of(quantity: Any, step: Step) -> Seeds:
    """Differentiate a quantity of a solved state.

    Parameters
    ----------
    quantity : A name from this module's head, or a function of the state that returns Seeds.
    step : The solved state.

    Returns
    -------
    The value of the quantity, and its derivatives by forces, multipliers and displacements.

    Raises
    ------
    InputError : For an unknown quantity.
    """
    if callable(quantity):
        return quantity(step)
    return find_quantity(quantity, step.reduction.scene).slopes(step)


def _surface(name: str, rest: str, scene: Scene) -> Quantity:
    """A reading of the forces on one pair of surfaces, or the pressure at one contact."""
    kind = name.partition(":")[0]
    if kind == "pressure" and rest.isdigit():
        return Quantity(name, partial(_pressure_at, number=rest), nodal=True)
    names = [pair.name for pair in scene.pairs]
    if not rest and len(names) > 1:
        raise InputError(
            f"scene '{scene.name}' has {len(names)} pairs of surfaces, each with its own pressure"
            f" and half-widths; name the pair, as in '{kind}:{names[0]}', or ask for the energy."
        )
    if rest and rest not in names:
        raise InputError(
            f"quantity {name!r}: there is no pair of surfaces {rest!r}; the pairs are"
            f" {', '.join(names)}."
        )
    number = names.index(rest) if rest else 0
    slopes = _stick if kind == "stick" else partial(_reading, kind)
    return Quantity(name, partial(slopes, pair=number), partial(_read_pair, kind, number))


def _read_pair(kind: str, number: int, reduction: Reduction, solution: Solution) -> Reading:
    """A reading of one pair of surfaces, with contacts numbered as in the whole scene."""
    first = reduction.problem.pairs[number].start
    found = READINGS[kind](*views(reduction, solution)[number])
    return replace(
        found, peaks=tuple(replace(peak, contacts=peak.contacts + first) for peak in found.peaks)
    )


def _plain(slopes: Callable[[Step], Seeds]) -> Callable[[str, str, Scene], Quantity]:
    """A row whose quantity takes nothing but its name, and is read as in READINGS where it is
    there.
    """

    def make(name: str, rest: str, scene: Scene) -> Quantity:
        return Quantity(name, slopes, READINGS.get(name))

    return make


def _pair_force(name: str, rest: str, scene: Scene) -> Quantity:
    _check_pair(rest or None, scene)
    return Quantity(name, partial(_force, kind=name.partition(":")[0], pair=rest or None))


def _pair_resultant(name: str, rest: str, scene: Scene) -> Quantity:
    pair, _, component = rest.rpartition(":")
    _check_pair(pair, scene)
    if component not in scene.components:
        raise InputError(f"there is no component {component!r}; use {', '.join(scene.components)}.")
    return Quantity(name, partial(_resultant, pair=pair, component=component))


def _check_pair(name: str | None, scene: Scene) -> None:
    names = [pair.name for pair in scene.pairs]
    if name is not None and name not in names:
        raise InputError(f"there is no contact '{name}', only {', '.join(names)}.")


def _at_place(place: Place, step: Step) -> Seeds:
    if place.kind == "pressure":
        return Functional(pressure_weights(place, step.reduction))(step)
    return _stress(step, place)


def _motion(step: Step, component: int) -> Seeds:
    problem, lam = step.problem, step.solution.multipliers
    if len(lam) == 0:
        raise InputError(
            f"scene '{step.reduction.scene.name}' has no plate, hence no approach and no shift; ask"
            " for another quantity."
        )
    rows = problem.V.reshape(problem.contacts, problem.dim, -1)[:, component]
    weights = np.average(rows, axis=0, weights=problem.areas) * (-1.0 if component == 0 else 1.0)
    return Seeds(float(weights @ lam), multipliers=weights)


def _pair(step: Step, name: str | None) -> slice:
    if name is None:
        return slice(0, step.problem.contacts)
    return next(pair.contacts for pair in step.problem.pairs if pair.name == name)


def _force(step: Step, kind: str, pair: str | None) -> Seeds:
    weights = np.zeros(step.problem.q.shape)
    weights[_pair(step, pair), 0 if kind == "normal_force" else 1] = (
        1.0 if kind == "normal_force" else -1.0
    )
    return Functional(weights)(step)


def _resultant(step: Step, pair: str, component: str) -> Seeds:
    scene = step.reduction.scene
    axis = np.eye(scene.dim)[scene.components.index(component)]
    for plane in step.reduction.planes:  # mirror images balance each other across it
        axis = axis - plane.inward * (plane.inward @ axis)
    if scene.kind == "axisymmetric" and component == "r":
        axis = 0 * axis
    weights, own = np.zeros(step.problem.q.shape), _pair(step, pair)
    weights[own] = step.reduction.frames[own] @ axis
    return Functional(weights)(step)


def _pressure_at(step: Step, number: str) -> Seeds:
    problem = step.problem
    if (
        not number.isdigit()
        or int(number) >= problem.contacts
        or not problem.areas[int(number)] > 0
    ):
        raise InputError(
            "pressure:CONTACT needs the number of a contact with an area, 0 to"
            f" {problem.contacts - 1}; got {number}."
        )
    weights = np.zeros(problem.q.shape)
    weights[int(number), 0] = 1 / problem.areas[int(number)]
    return Functional(weights)(step)


def _energy(step: Step) -> Seeds:
    by_r, by_U = np.zeros(step.problem.q.size), []
    for body, B, U, force in zip(
        step.reduction.bodies, step.reduction.maps, step.displaced, step.forces
    ):
        own, by_force = body.energy_gradient(U, force)
        moved = (
            body.displacement(own, np.zeros(len(body.resultants))) - body.at_rest
            if np.any(own)
            else 0 * own
        )
        by_r += B @ (moved + by_force)
        by_U.append(own)

    def explicit(which: Parameter) -> float:
        if which.kind not in MATERIAL:
            return 0.0
        parts = zip(step.reduction.scene.parts, step.reduction.bodies, step.displaced, step.forces)
        return sum(
            body.energy_change(which.kind, U, F)
            for part, body, U, F in parts
            if which.concerns(part)
        )

    value = elastic_energy(step.reduction, step.solution)
    return Seeds(value, by_r.reshape(step.problem.q.shape), bodies=tuple(by_U), explicit=explicit)


def _stress(step: Step, place: Place) -> Seeds:
    """A stress inside a body: a function of its displacement U, which follows the contact forces by
    its compliance.

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
    return Seeds(found.value, by_r, bodies=bodies, explicit=explicit)


def _reading(name: str, step: Step, pair: int) -> Seeds:
    """A quantity of contactopt.readings that reads the normal forces of one pair, at closed
    contacts.
    """
    whole = replace(step.reduction, problem=step.problem)
    reduction, solution = views(whole, step.solution)[pair]
    read, r = partial(value_of, name), solution.reactions
    by_r = np.zeros(r.shape)
    for i in _few(name, np.flatnonzero(reduction.problem.law.pressed(r))):

        def at(h: float, i: int = i) -> float:
            there = r.copy()
            there[i, 0] += h
            return read(reduction, replace(solution, reactions=there))

        by_r[i, 0] = _central(at, STEP * float(np.abs(r[i]).max()))
    return Seeds(read(reduction, solution), _on_all(step, pair, by_r))


def _on_all(step: Step, pair: int, own: np.ndarray) -> np.ndarray:
    """Weights (k_i, dim) of the contacts of one pair among all contacts (k, dim)."""
    whole = np.zeros(step.problem.q.shape)
    whole[step.problem.pairs[pair].contacts] = own
    return whole


def _stick(step: Step, pair: int) -> Seeds:
    """Half-width of the stick zone over that of contact, differentiated where contacts stay open,
    stick or slip as they do.

    It depends on the forces at closed contacts, on the slip of the step, and on the friction bound.
    A contact that slips stays at its bound: its tangential force changes with the normal one, and
    may turn.
    """
    reduction, solution = views(replace(step.reduction, problem=step.problem), step.solution)[pair]
    scene, problem, r = reduction.scene, reduction.problem, solution.reactions
    u = problem.displacements(r, solution.multipliers)
    sticks = problem.law.sticking(r)
    slips = problem.law.pressed(r) & ~sticks
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
                bound = problem.law.bound_along(r + h * np.eye(len(r), r.shape[1], -i))[i]
                way[1:] = (
                    (bound / np.linalg.norm(r[i, 1:]) - 1) * r[i, 1:] / h
                    if np.any(r[i, 1:])
                    else 0.0
                )
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
        change = step.law_change(which)[step.problem.pairs[pair].contacts]

        def at(h: float) -> float:
            law, there = problem.law.shifted(h * change), r.copy()
            old, new = problem.law.bound_along(r), law.bound_along(r)
            grows = np.divide(new, old, out=np.ones(len(old)), where=old > 0)
            there[slips, 1:] *= grows[slips, None]
            return read(there, u, law)

        return _central(at, STEP * float(problem.law.bound(np.ones(len(r))).max(initial=0.0)))

    slip = _on_all(step, pair, by_u)
    return Seeds(read(r, u, problem.law), _on_all(step, pair, by_r), slip=slip, explicit=explicit)


def _few(name: str, contacts: np.ndarray) -> np.ndarray:
    if len(contacts) > MOST:
        raise InputError(
            f"'{name}' can be differentiated at {MOST} closed contacts at most; got"
            f" {len(contacts)}."
        )
    return contacts


def _central(function: Callable[[float], float], step: float) -> float:
    return (function(step) - function(-step)) / (2 * step)


# kind of a quantity -> what may follow its name, and a function of name, what follows, and scene
ROWS: dict[str, tuple[str, Callable[[str, str, Scene], Quantity]]] = {
    **{kind: ("[:PAIR]" if kind in OF_ONE_PAIR else "", _surface) for kind in READINGS},
    "approach": ("", _plain(partial(_motion, component=0))),
    "energy": ("", _plain(_energy)),
    "shift": ("", _plain(partial(_motion, component=1))),
    "normal_force": ("[:PAIR]", _pair_force),
    "shear_force": ("[:PAIR]", _pair_force),
    "resultant": (":PAIR:COMPONENT", _pair_resultant),
}
