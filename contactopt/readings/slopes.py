"""Slopes of what is read from many forces: the pressure, and the half-widths of contact and stick.

They are formulas over several forces. The fit that reads the pressure has exact derivatives. Those
of a half-width by the force at each closed contact are central differences of the reading, which
solve nothing; what the parameters do to the forces is exact.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from contactopt.errors import InputError
from contactopt.problem.laws.law import Law
from contactopt.readings.edges import contact_edge, stick_edge, width_reading
from contactopt.readings.peaks import pressure_reading
from contactopt.readings.resultants import pair_view
from contactopt.readings.state import Seeds, State
from contactopt.scenes.parameters import Parameter

STEP = 1e-5  # of a reading's central differences, over the force at the contact
MOST = 3000  # contacts at which a reading is differentiated


def of_pressure(state: State, pair: int) -> Seeds:
    """The largest pressure of one pair, with the derivatives of its reading."""
    reduction, solution = pair_view(state.reduction, state.solution, pair)
    reading, by_r = pressure_reading(reduction, solution), np.zeros(solution.reactions.shape)
    for peak in reading.peaks[:1]:
        np.add.at(by_r[:, 0], peak.sources, peak.slopes)
    return Seeds(reading.value, _on_all(state, pair, by_r))


def of_width(state: State, pair: int) -> Seeds:
    """The half-width of contact of one pair, which reads the normal forces at closed contacts."""
    reduction, solution = pair_view(state.reduction, state.solution, pair)
    r = solution.reactions
    by_r = np.zeros(r.shape)

    def at(i: int, h: float) -> float:
        there = r.copy()
        there[i, 0] += h
        return width_reading(reduction, replace(solution, reactions=there)).value

    for i in _few(reduction.problem.law.pressed(r)):
        by_r[i, 0] = _central(partial(at, i), STEP * float(np.abs(r[i]).max()))
    return Seeds(width_reading(reduction, solution).value, _on_all(state, pair, by_r))


def of_stick(state: State, pair: int) -> Seeds:
    """Half-width of stick over contact, by forces, slip and bounds, while states stay the same."""
    reduction, solution = pair_view(state.reduction, state.solution, pair)
    scene, problem, r = reduction.scene, reduction.problem, solution.reactions
    u, d = problem.displacements(r, solution.multipliers), problem.dim
    sticks = problem.law.sticking(r)
    slips = problem.law.pressed(r) & ~sticks

    def read(there: np.ndarray, moved: np.ndarray, law: Law) -> float:
        at = replace(problem, law=law)
        edge = contact_edge(scene, at, there)
        return stick_edge(scene, at, there, moved[:, 1:])[0] / edge if edge > 0 else 0.0

    def along(i: int, force: np.ndarray, slip: np.ndarray, t: float) -> float:
        there, moved = r.copy(), u.copy()
        there[i] += t * force
        moved[i] += t * slip
        return read(there, moved, problem.law)

    by_r, by_u = np.zeros(r.shape), np.zeros(u.shape)
    axes, still = np.eye(d), np.zeros(d)
    for i in _few(sticks | slips):
        h, size = STEP * float(np.abs(r[i]).max()), float(np.abs(u[i, 1:]).max())
        if sticks[i]:
            by_r[i] = [_central(partial(along, i, way, still), h) for way in axes]
            continue
        way, friction = axes[0].copy(), float(np.linalg.norm(r[i, 1:]))
        if friction > 0:  # a small step along the edge of the cone
            bound = problem.law.bound_along(r + h * np.eye(len(r), r.shape[1], -i))[i]
            way[1:] = (bound / friction - 1) * r[i, 1:] / h
        by_r[i, 0] = _central(partial(along, i, way, still), h)
        if d == 3 and friction > 0:
            turn = np.array([0.0, -r[i, 2], r[i, 1]]) / friction
            by_r[i] += turn * _central(partial(along, i, turn, still), h)
        if size > 0:
            by_u[i, 1:] = [_central(partial(along, i, still, way), STEP * size) for way in axes[1:]]

    def explicit(which: Parameter) -> float:
        if which.kind != "mu":
            return 0.0
        change = state.law_change(which)[state.problem.pairs[pair].contacts]

        def at(h: float) -> float:
            law, there = problem.law.shifted(h * change), r.copy()
            old, new = problem.law.bound_along(r), law.bound_along(r)
            grows = np.divide(new, old, out=np.ones(len(old)), where=old > 0)
            there[slips, 1:] *= grows[slips, None]
            return read(there, u, law)

        return _central(at, STEP * float(problem.law.bound(np.ones(len(r))).max(initial=0.0)))

    slip = _on_all(state, pair, by_u)
    return Seeds(read(r, u, problem.law), _on_all(state, pair, by_r), slip=slip, explicit=explicit)


def _on_all(state: State, pair: int, own: np.ndarray) -> np.ndarray:
    """Weights (k_i, dim) of the contacts of one pair among all contacts (k, dim)."""
    whole = np.zeros(state.problem.q.shape)
    whole[state.problem.pairs[pair].contacts] = own
    return whole


def _few(closed: np.ndarray) -> np.ndarray:
    contacts = np.flatnonzero(closed)
    if len(contacts) > MOST:
        raise InputError(
            "half-widths can be differentiated at"
            f" {MOST} closed contacts at most; got {len(contacts)}."
        )
    return contacts


def _central(function: Callable[[float], float], step: float) -> float:
    return (function(step) - function(-step)) / (2 * step)
