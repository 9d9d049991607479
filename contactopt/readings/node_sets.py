"""Displacements and reactions at the nodes of a named boundary of a body with a mesh.

    displacement:BODY:BOUNDARY:COMPONENT   mean over the area of the boundary, on an
                                           axis of revolution over its length [length]
    displacement:BODY:BOUNDARY             the largest size of a displacement there [length]
    displacement:BODY                      in the whole body [length]
    reaction:BODY:BOUNDARY:COMPONENT       sum of the forces with which supports and plates act on
                                           the nodes of the boundary, of the body with its mirror
                                           images [force]

As in Support, 'a/b' is where the boundaries a and b meet. A mean there is that of its nodes.

With U = at_rest + C F + motions lambda a mean is w' U. A reaction is w' (A U - f - F) with loads f
and w one on the unknowns that are held: its slope by U is A w. The displacement w itself belongs to
the adjoint, since w - C A w is the smooth motion of the body under a unit motion of its holder.
"""

from collections.abc import Callable
from functools import partial, reduce
from typing import TypeAlias

import numpy as np

from contactopt.bodies.assembly import Assembly
from contactopt.bodies.elements import nodes_on, surface_load
from contactopt.bodies.fields import Region
from contactopt.bodies.views import elements_of
from contactopt.coupling.reduction import Reduction
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.problem import Solution
from contactopt.readings.peaks import Reading
from contactopt.readings.places import check_meshed, check_there
from contactopt.readings.state import Seeds, State
from contactopt.scenes.body_kinds import Support
from contactopt.scenes.parameters import MATERIAL, Parameter
from contactopt.scenes.scene import Scene

UNFELT = 1e-6  # share of the forces on a body that a support may bear and is taken to bear none
Slopes: TypeAlias = Callable[[State], Seeds]
Reader: TypeAlias = Callable[[Reduction, Solution], Reading]


def node_reading(name: str, rest: str, scene: Scene) -> tuple[Slopes, Reader | None]:
    """Slopes and reader of a quantity of this module; InputError for what the scene lacks."""
    kind = name.partition(":")[0]
    body, _, boundary = rest.partition(":")
    check_meshed(name, body, scene)
    component = ""
    head, _, last = boundary.rpartition(":")
    if head:
        boundary, component = head, last
    if component and component not in scene.components:
        names = ", ".join(scene.components)
        raise InputError(f"quantity {name!r}: there is no component {component!r}; use {names}.")
    if kind == "reaction" and not component:
        raise InputError(
            f"quantity {name!r}: a reaction needs a body, a boundary and a component, as in"
            f" reaction:{body}:BOUNDARY:{scene.components[-1]}."
        )
    if boundary:
        check_there(name, scene.meshed[body], Region(boundary), scene, meeting=True)
    number = [part.name for part in scene.parts].index(body)
    axis = scene.components.index(component) if component else -1
    if kind == "reaction":
        there = number, boundary, axis
        return partial(_reaction, *there), partial(_read_reaction, *there)
    return partial(_displacement, number, boundary, axis), None


def _at(state: State, number: int) -> Assembly:
    body = elements_of(state.reduction.bodies[number])
    assert body is not None  # check_meshed
    return body


def _nodes(body: Assembly, boundary: str) -> np.ndarray:
    """The nodes of a boundary, or where several meet; all without a name."""
    if not boundary:
        return np.arange(body.unknowns.shape[1])
    known = body.basis.mesh.boundaries
    faces = (known[name] for name in Support(boundary).faces(known))
    nodes = (np.unique(nodes_on(body.basis, body.degree, np.asarray(own))) for own in faces)
    return reduce(np.intersect1d, nodes)


def _displacement(number: int, boundary: str, axis: int, state: State) -> Seeds:
    body, U = _at(state, number), state.displaced[number]
    nodes, w = _nodes(body, boundary), np.zeros(len(U))
    if axis < 0:
        moved = U[body.unknowns[:, nodes]]
        sizes = np.linalg.norm(moved, axis=0)
        top = int(np.argmax(sizes))
        w[body.unknowns[:, nodes[top]]] = moved[:, top] / (sizes[top] or 1.0)
    elif boundary in body.basis.mesh.boundaries:
        unit = np.eye(len(body.unknowns))[axis][:, None, None]
        facets = np.asarray(body.basis.mesh.boundaries[boundary])
        on_axis = body.weight[1] and np.max(body.locations[0, nodes]) <= EQUAL * np.ptp(
            body.locations
        )
        weight = (1.0, False) if on_axis else body.weight  # an axis has a length and no area
        w = surface_load(body.basis, facets, lambda x, n: unit, weight)
        w = w / w.sum()
    else:
        w[body.unknowns[axis, nodes]] = 1 / len(nodes)
    return _linear(state, number, w, float(w @ U))


def _held(number: int, boundary: str, axis: int, state: State) -> tuple[np.ndarray, bool]:
    """(n,) weights of reactions along an axis, without what images balance; if any holds."""
    body, reduction = _at(state, number), state.reduction
    held, w = np.zeros(len(body.load), dtype=bool), np.zeros(len(body.load))
    for own in body.holders.values():
        held[own] = True
    way = np.eye(len(body.unknowns))[axis]
    for plane in reduction.planes:
        way = way - plane.inward * (plane.inward @ way)
    if reduction.scene.analysis.revolved and axis == 0:
        way = 0 * way
    own = body.unknowns[:, _nodes(body, boundary)]
    w[own] = way[:, None] * held[own]
    return w, bool(held[own[axis]].any())


def bears(state: State, number: int, boundary: str) -> bool:
    """Whether more than rounding of the forces on a body is borne by what holds a boundary."""
    body, U, F = _at(state, number), state.displaced[number], state.forces[number]
    own = np.setdiff1d(body.unknowns[:, _nodes(body, boundary)], body.free)
    given = body.load + F
    missing = np.abs(state.reduction.bodies[number].internal_forces(U, F) - given)
    return bool(missing[own].sum() > UNFELT * (missing.sum() + np.abs(given).sum()))


def _reaction(number: int, boundary: str, axis: int, state: State) -> Seeds:
    body, U, F = _at(state, number), state.displaced[number], state.forces[number]
    w, _ = _held(number, boundary, axis, state)
    missing = state.reduction.bodies[number].internal_forces(U, F) - body.load - F

    def explicit(which: Parameter) -> float:
        scene = state.reduction.scene
        if not which.concerns(scene.parts[number]):
            return 0.0
        if which.kind in MATERIAL:
            return float(w @ body.stiffness_change(which.kind, U))
        value = which.read(scene)
        step = abs(value) or 1.0  # loads are linear
        changed = which.put(scene, value + step)
        return (
            float(w @ (body.load - body.reload(body, changed, changed.parts[number]).load)) / step
        )

    found = _linear(state, number, np.asarray(body.A @ w), float(w @ missing))
    by_r = found.reactions - (state.reduction.maps[number] @ w).reshape(state.problem.q.shape)
    lifts = tuple(w if own is not None else None for own in found.bodies)
    return Seeds(found.value, by_r, found.multipliers, bodies=found.bodies, lifts=lifts,
                 explicit=explicit)  # fmt: skip


def _read_reaction(
    number: int, boundary: str, axis: int, reduction: Reduction, solution: Solution
) -> Reading:
    state = State(reduction, solution)
    if _held(number, boundary, axis, state)[1]:
        return Reading(_reaction(number, boundary, axis, state).value)
    along = reduction.scene.components[axis]
    return Reading(0.0, missing=f"no support and no plate acts along {along} there")


def _linear(state: State, number: int, w: np.ndarray, value: float) -> Seeds:
    """A linear function of the displacement of one body with the slopes w (n,)."""
    motions = [np.zeros(len(body.motions.resultants)) for body in state.reduction.bodies]
    motions[number] = w @ state.reduction.bodies[number].motions.fields
    bodies = tuple(w if i == number else None for i in range(len(motions)))
    return Seeds(value, state.following(number, w), np.concatenate(motions), bodies=bodies)
