"""Numbers that people ask of a contact, by name: how each is read, how uncertain that is, and its
derivatives by forces, multipliers and displacements.

    approach, shift              of the plates along the mean normal and along t1 [length]
    normal_force, shear_force    on the upper body of a pair, the latter along t1, with the signs of
                                 load paths [force]; of one pair of several as normal_force:PAIR
    resultant:PAIR:COMPONENT     of the contact forces on the upper body of a pair, in the
                                 coordinates of space [force]
    pressure:CONTACT             at one contact, by its number [stress]
    pressure@X,Y                 at a place, and the stresses of contactopt.readings.places:
                                 von_mises:BODY:BOUNDARY, ...
    displacement:BODY:BOUNDARY:COMPONENT, reaction:BODY:BOUNDARY:COMPONENT
                                 at the nodes of a boundary, as contactopt.readings.node_sets says
    energy                       elastic energy of all bodies [force length]
    pressure, width              the largest pressure [stress] and the half-width of contact
                                 [length]; of one pair of several pressure:PAIR
    stick                        the half-width of stick over that of contact [-]
    friction_work                dissipated along a load path [force length]

ROWS has one row for each. What it makes, a Quantity, is all that is known of it, and all that
errors, gradients, fits and the command line know of it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from contactopt.bodies.views import energy, energy_change
from contactopt.cards import force_unit
from contactopt.coupling.reduction import Reduction
from contactopt.errors import InputError
from contactopt.problem import Solution
from contactopt.readings.edges import stick_reading, width_reading
from contactopt.readings.node_sets import node_reading
from contactopt.readings.peaks import Peak, Reading, pressure_reading
from contactopt.readings.places import PLACED, place_of, place_seeds, read_place
from contactopt.readings.plate_motions import approach, motion
from contactopt.readings.resultants import pair_view
from contactopt.readings.slopes import of_pressure, of_stick, of_width
from contactopt.readings.state import Functional, Seeds, State
from contactopt.scenes.parameters import MATERIAL, Parameter
from contactopt.scenes.scene import Scene

__all__ = ["ROWS", "Functional", "Peak", "Quantity", "Reading", "find_quantity", "value_of"]
Reader = Callable[[Reduction, Solution], Reading]


@dataclass(frozen=True, eq=False)
class Quantity:
    """One quantity of one scene: how it is read, how uncertain that is, and its slopes.

    name    as it was asked for
    slopes  state -> Seeds: its value and its derivatives by what a state holds
    reader  (reduction, solution) -> Reading: value, uncertainty, local maxima; None: the value of
            the slopes
    nodal   whether it means another thing on the next mesh
    column  of a load path's history, whose last value it is; empty for what one state has
    """

    name: str
    slopes: Callable[[State], Seeds]
    reader: Reader | None = None
    nodal: bool = False
    column: str = ""

    def read(self, reduction: Reduction, solution: Solution) -> Reading:
        """Read it from a solution; InputError where the scene does not have it."""
        if self.reader is not None:
            return self.reader(reduction, solution)
        return Reading(self.slopes(State(reduction, solution)).value)


def find_quantity(name: object, scene: Scene) -> Quantity:
    """Find a quantity by a name listed at the top; InputError for what the scene lacks."""
    if not isinstance(name, str):
        raise InputError(f"a quantity is given by its name; got {name!r}.")
    place = place_of(name, scene)
    if place is not None:
        return Quantity(name, partial(place_seeds, place), partial(read_place, place))
    kind, _, rest = name.partition(":")
    form, make = ROWS.get(kind, (None, None))
    if make is None:
        raise InputError(f"unknown quantity {name!r}; choose from {', '.join(NAMES)}.")
    if rest and not form:
        named = ", ".join(own for own, (form, _) in ROWS.items() if form == "[:PAIR]")
        raise InputError(f"the {kind} belongs to the whole scene; of one pair ask for {named}.")
    return make(name, rest, scene)


def unit_of(name: str, units: tuple[str, str]) -> str:
    """The unit of a quantity by its name, for units of length and stress."""
    length, stress = units
    force = force_unit(units)
    work = f"{force} {length}"
    known = {"approach": length, "shift": length, "width": length, "stick": ""}
    known |= {"normal_force": force, "shear_force": force, "resultant": force}
    known |= {"energy": work, "friction_work": work, "displacement": length, "reaction": force}
    return known.get(name.partition(":")[0], stress)


def quantity_of_states(name: object, states: Sequence[Scene]) -> Quantity:
    """As `find_quantity`; InputError for a quantity of paths where there is one state."""
    found = find_quantity(name, states[-1])
    if found.column and len(states) == 1:
        raise InputError(
            f"the {name} is that of a load path, and scene '{states[-1].name}' has one state; give"
            " it steps, or ask for another quantity."
        )
    return found


def seeds_of(quantity: object, state: State) -> Seeds:
    """The value and derivatives of a quantity of a solved state, by name or as a function of it."""
    if callable(quantity):
        return quantity(state)
    return find_quantity(quantity, state.reduction.scene).slopes(state)


def value_of(name: str, reduction: Reduction, solution: Solution) -> float:
    """The value of a quantity by its name, in its unit."""
    return find_quantity(name, reduction.scene).read(reduction, solution).value


def elastic_energy(reduction: Reduction, solution: Solution) -> float:
    """Elastic energy of all bodies together, the sum of U' A U / 2 [force length]."""
    state = State(reduction, solution)
    parts = zip(reduction.bodies, state.displaced, state.forces)
    return sum(energy(body, U, F) for body, U, F in parts)


def _of_pair(
    read: Reader, slopes: Callable[[State, int], Seeds]
) -> Callable[[str, str, Scene], Quantity]:
    """A row whose quantity is read from the forces on one pair, of pressure also at a contact."""

    def make(name: str, rest: str, scene: Scene) -> Quantity:
        if read is pressure_reading and rest.isdigit():
            return Quantity(name, partial(_pressure_at, number=int(rest)), nodal=True)
        number = _pair_number(name, rest, scene)
        return Quantity(
            name, lambda state: slopes(state, number), partial(_read_pair, read, number)
        )

    return make


def _read_pair(read: Reader, number: int, reduction: Reduction, solution: Solution) -> Reading:
    """A reading of one pair of surfaces, with contacts numbered as in the whole scene."""
    first = reduction.problem.pairs[number].start
    found = read(*pair_view(reduction, solution, number))
    peaks = tuple(replace(peak, contacts=peak.contacts + first) for peak in found.peaks)
    return replace(found, peaks=peaks)


def _of_scene(
    slopes: Callable[[State], Seeds], reader: Reader | None = None
) -> Callable[[str, str, Scene], Quantity]:
    """A row whose quantity takes nothing but its name."""
    return lambda name, rest, scene: Quantity(name, slopes, reader)


def _pair_force(name: str, rest: str, scene: Scene) -> Quantity:
    column, sign = (0, 1.0) if name.startswith("normal_force") else (1, -1.0)
    number = _pair_number(name, rest, scene)

    def slopes(state: State) -> Seeds:
        weights = np.zeros(state.problem.q.shape)
        weights[state.problem.pairs[number].contacts, column] = sign
        return Functional(weights)(state)

    return Quantity(name, slopes)


def _pair_resultant(name: str, rest: str, scene: Scene) -> Quantity:
    pair, _, component = rest.rpartition(":")
    if not pair:
        raise InputError(
            f"a resultant needs a contact and a component, as in"
            f" resultant:{scene.pairs[0].name}:{scene.components[-1]}; the contacts are"
            f" {', '.join(own.name for own in scene.pairs)}."
        )
    number = _pair_number(name, pair, scene)
    if component not in scene.components:
        raise InputError(f"there is no component {component!r}; use {', '.join(scene.components)}.")

    def slopes(state: State) -> Seeds:
        axis = np.eye(scene.dim)[scene.components.index(component)]
        for plane in state.reduction.planes:  # mirror images balance each other across it
            axis = axis - plane.inward * (plane.inward @ axis)
        if scene.analysis.revolved and component == "r":
            axis = 0 * axis
        weights, own = np.zeros(state.problem.q.shape), state.problem.pairs[number].contacts
        weights[own] = state.reduction.frames[own] @ axis
        return Functional(weights)(state)

    return Quantity(name, slopes)


def _pair_number(name: str, pair: str, scene: Scene) -> int:
    """The number of the pair that a quantity names; InputError for none of several."""
    names = [own.name for own in scene.pairs]
    if not pair and len(names) > 1:
        raise InputError(
            f"scene '{scene.name}' has {len(names)} pairs of surfaces, each with its own"
            f" forces, pressure and half-widths; name the pair, as in '{name}:{names[0]}', or ask"
            " for the energy."
        )
    if pair and pair not in names:
        raise InputError(
            f"there is no pair of surfaces {pair!r}; the pairs are {', '.join(names)}."
        )
    return names.index(pair) if pair else 0


def _motion(state: State, component: int) -> Seeds:
    reduction, sign = state.reduction, -1.0 if component == 0 else 1.0
    found = None
    if approach(reduction, state.solution) is not None or component == 1:
        found = motion(reduction, state.displaced, component)
    plates = len(state.solution.multipliers)
    if found is None or not plates:
        why = (
            "its surfaces go around a body and have no mean normal" if plates else "it has no plate"
        )
        raise InputError(
            f"scene '{reduction.scene.name}' has no {'shift' if component else 'approach'}, since"
            f" {why}; ask for another quantity."
        )
    by_r, by_motions, by_U = np.zeros(state.problem.q.shape), [], []
    for body, B, weights in zip(reduction.bodies, reduction.maps, sign * found.weights):
        own = np.zeros(len(body.motions.resultants))
        total: np.ndarray | None = None
        for c in np.flatnonzero(weights):
            w, moved = (weights[c] * each for each in body.carried(int(c)))
            rates = w @ body.motions.fields
            own = own + rates
            if np.any(moved) or not np.any(rates):  # more than the free motions move it
                by_r += (B @ moved).reshape(by_r.shape)
                total = w if total is None else total + w
        by_motions.append(own)
        by_U.append(total)
    bodies = tuple(by_U) if any(each is not None for each in by_U) else ()
    value = sign * found.value + 0.0
    return Seeds(value, by_r if by_r.any() else None, np.concatenate(by_motions), bodies=bodies)


def _pressure_at(state: State, number: int) -> Seeds:
    problem = state.problem
    if number >= problem.contacts or not problem.areas[number] > 0:
        raise InputError(
            "pressure:CONTACT needs the number of a contact with an area, 0 to"
            f" {problem.contacts - 1}; got {number}."
        )
    weights = np.zeros(problem.q.shape)
    weights[number, 0] = 1 / problem.areas[number]
    return Functional(weights)(state)


def _path_column(name: str, rest: str, scene: Scene) -> Quantity:
    def slopes(state: State) -> Seeds:
        raise InputError(
            f"the {name} is that of a whole load path: no single state has it, and it has no"
            " derivative here."
        )

    return Quantity(name, slopes, column=name)


def _at_nodes(name: str, rest: str, scene: Scene) -> Quantity:
    return Quantity(name, *node_reading(name, rest, scene))


def _energy(state: State) -> Seeds:
    reduction, by_r, by_U = state.reduction, np.zeros(state.problem.q.shape), []
    for number, body in enumerate(reduction.bodies):
        own = body.internal_forces(state.displaced[number], state.forces[number])
        if np.any(own):
            by_r += state.following(number, own)
        by_U.append(own)

    def explicit(which: Parameter) -> float:
        if which.kind not in MATERIAL:
            return 0.0
        parts = zip(reduction.scene.parts, reduction.bodies, state.displaced, state.forces)
        return sum(
            energy_change(body, which.kind, U, F)
            for part, body, U, F in parts
            if which.concerns(part)
        )

    value = elastic_energy(reduction, state.solution)
    return Seeds(value, by_r, bodies=tuple(by_U), explicit=explicit)


# kind of a quantity -> what may follow its name, and a function of name, what follows, and scene
ROWS: dict[str, tuple[str, Callable[[str, str, Scene], Quantity]]] = {
    "pressure": ("[:PAIR]", _of_pair(pressure_reading, of_pressure)),
    "width": ("[:PAIR]", _of_pair(width_reading, of_width)),
    "approach": ("", _of_scene(partial(_motion, component=0))),
    "stick": ("[:PAIR]", _of_pair(stick_reading, of_stick)),
    "energy": ("", _of_scene(_energy, lambda *solved: Reading(elastic_energy(*solved)))),
    "shift": ("", _of_scene(partial(_motion, component=1))),
    "normal_force": ("[:PAIR]", _pair_force),
    "shear_force": ("[:PAIR]", _pair_force),
    "resultant": (":PAIR:COMPONENT", _pair_resultant),
    "friction_work": ("", _path_column),
    "displacement": (":BODY:BOUNDARY[:COMPONENT]", _at_nodes),
    "reaction": (":BODY:BOUNDARY:COMPONENT", _at_nodes),
}
NAMES = (*(f"{kind}{form}" for kind, (form, _) in ROWS.items()), *PLACED)
