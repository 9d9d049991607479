"""An interval that holds the exact value of a quantity, from a bound of the error in energy.

The letters are those of contactopt.bounds.bound, which makes that bound.

A quantity J is linear in the contact forces, with the weights omega_n of the pressure and omega_t
of the shear, and in displacements of plates. Its adjoint has displacements z, and a stress s_z in
equilibrium with a unit of what J measures of plates and with tractions at the contact, the pressure
tau and the shear sigma. With s' = (s* + s(v)) / 2, d = s* - s(v), and J(v) without contact forces,

    J(u) = J(v) + int (s_z + s(z)) : C^-1 : d / 2 - int (p* z_n + t* z_t) + int (tau gap(v)
           + sigma [v_t]) + int (s_z - s(z)) : C^-1 : (s(u) - s') + U,

    U = int p (omega_n + z_n) + int t (omega_t + z_t) - int tau gap(u) - int sigma [u_t].

Only the product with s(u) - s' and U are not known. In the plane let e, 1 or -1, be the direction
of [v_t], and y_t = omega_t + z_t, y_n = omega_n + z_n. Where Coulomb's surfaces slip along e, the
shear is -mu p e, so

    p y_n + t y_t = p (y_n - mu e y_t) + (t + mu p e) y_t,

and under Tresca's law p y_n + (t + g e) y_t - g e y_t, the last term of which is known. On the
solution's own zones the adjoint has y_n - mu e y_t = 0 where they touch, y_t = 0 where they stick,
tau = 0 where they do not touch, and sigma = 0 where they slip. That the exact zones are others is
met by keeping, with one constant c,

    |tau| <= c p*,              |y_n - mu e y_t| <= c gap(v),
    |sigma| <= c (g - |t*|),    |y_t| <= c |[v_t]|,

since then |U| is at most c times C, the sum of the works of (*): those of p* in gap(u), of p in
gap(v), of t* in [u_t] and of t in [v_t] with the bounds of friction. By (*)

    |s(u) - s'|^2 + C  =  rho^2  =  |d|^2 / 4 + int p* gap(v) + int (g |[v_t]| + t* [v_t]),

so what is unknown is at most |s_z - s(z)| x + c (rho^2 - x^2) with some x between 0 and rho. With
c <= |s_z - s(z)| / (2 rho) other zones cost nothing. The energy is such a quantity with
a(v, u - v) in its place, up to |u - v|^2 / 2.

In space |t + g e| is not bounded by the work of friction alone, so that there is no interval with
friction. Coulomb's law needs small friction, as in contactopt.bounds.bound.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from contactopt.bounds.facing_facets import FacingFacets, facet_nodes
from contactopt.bounds.pressed_scene import PressedScene
from contactopt.coupling.reduction import Reduction
from contactopt.defaults import EQUAL
from contactopt.derivatives.states import Duals, duals_of
from contactopt.errors import InputError
from contactopt.problem.laws import find_law
from contactopt.readings.quantities import Quantity
from contactopt.readings.state import State

if TYPE_CHECKING:
    from contactopt.bounds.bound import Bound

TINY, HUGE = 1e-200, 1e200
ENERGY = "energy"
LINEAR = "approach", "shift", "normal_force", "shear_force", "resultant"


class _Adjoint(NamedTuple):
    """Tractions (k, dim), z of the bodies, the constant c, and Tresca's known work in y_t."""

    tractions: np.ndarray
    z: list[np.ndarray]
    constant: float
    work: float


def interval(bound: Bound, quantity: Quantity) -> tuple[float, float]:
    """The middle and half-width of an interval that holds a quantity; InputError without one."""
    scene, problem = bound.scene, bound.scene.problem
    if reason := without_interval(scene.reduction, quantity):
        raise InputError(reason)
    state = State(scene.reduction, scene.solution)
    seeds = quantity.slopes(state)
    if quantity.name in ("approach", "shift") and seeds.reactions is None:  # of held bodies
        seeds = replace(seeds, bodies=())
    if seeds.bodies and quantity.name.partition(":")[0] != ENERGY:
        raise InputError(f"there is no bound of the {quantity.name} of a plate on a held body.")
    duals = duals_of(state, seeds)
    omega, motions = np.zeros(problem.q.shape), np.zeros(len(problem.s))
    if seeds.multipliers is not None:
        motions += seeds.multipliers
    if seeds.reactions is not None and not seeds.bodies:
        omega += seeds.reactions
    value = seeds.value - float(np.sum(omega * scene.solution.reactions))
    gap_of_stress, unknown = bound.size(bound.missing), 0.0
    works = bound.contact**2 + bound.friction**2
    if quantity.name.partition(":")[0] == ENERGY:
        unknown = (gap_of_stress**2 + works) / 4
        value = bound.size(bound.strained) ** 2 / 2 + unknown
    rho = float(np.sqrt(gap_of_stress**2 / 4 + works / 2))
    limit, found = HUGE, []
    for _ in range(3):  # adjoints of a quantity, each with what the one before tells
        own = _adjoint(bound, omega, duals, limit)
        tractions = scene.balanced(own.tractions, motions)
        c = max(own.constant, _least_constant(scene, tractions))
        stress = bound.balanced_with(tractions, duals.dual.s, duals.bodies)
        strained = bound.strains(own.z)
        far = bound.size([None if a is None else a - b for a, b in zip(stress, strained)])
        both = zip(bound.products(stress, bound.missing), bound.products(strained, bound.missing))
        middle = value - own.work + sum(one.sum() + other.sum() for one, other in both) / 2
        for i in range(problem.dim):
            middle += scene.work(tractions[:, i], bound.displacement, i)
            middle -= scene.work(scene.tractions[:, i], own.z, i, change=True)
        x = min(rho, far / (2 * c)) if c > 0 else rho
        found.append((far * x + c * (rho**2 - x**2) + unknown, float(middle)))
        limit = far / (2 * rho) if rho > 0 else HUGE
    width, middle = min(found)
    return middle, width


def without_interval(reduction: Reduction, quantity: Quantity) -> str:
    """Why no interval holds the exact value of a quantity; empty if one may."""
    kind, law = quantity.name.partition(":")[0], reduction.problem.law
    if kind not in (*LINEAR, ENERGY):
        return f"there is no bound of the {kind}, only of {', '.join(LINEAR)}, energy."
    if np.any(law.rough) and reduction.problem.dim == 3:
        return f"with friction in space there is no bound of the {kind}, only of the energy norm."
    if any(own.kind == "mortar" for own in reduction.couplings):
        return f"with mortar there is no bound of the {kind}, only of the energy norm."
    return ""


def _slack(scene: PressedScene) -> np.ndarray:
    """(k,) by how much the shear is less than the friction bound, zero where it slips."""
    slack = scene.limit - np.linalg.norm(scene.tractions[:, 1:], axis=1)
    return np.where(slack > EQUAL * scene.limit, slack, 0.0)


def _least_constant(scene: PressedScene, t: np.ndarray) -> float:
    """The least c with |tau| <= c p* and |sigma| <= c (g - |t*|)."""
    found = 0.0
    for own, most in ((t[:, 0], scene.tractions[:, 0]), (t[:, 1:], _slack(scene))):
        size = np.abs(own.reshape(len(t), -1)).max(axis=1, initial=0.0)
        found = max(found, float(np.max(size[most > 0] / most[most > 0], initial=0.0)))
    return found


def _adjoint(bound: Bound, omega: np.ndarray, duals: Duals, limit: float) -> _Adjoint:
    """The adjoint, cut off where c would be more than `limit`."""
    scene = bound.scene
    t, most = scene.share[:, None] * duals.dual.q, limit * _slack(scene)[:, None]
    t[:, 0] = np.clip(t[:, 0], -limit * scene.tractions[:, 0], limit * scene.tractions[:, 0])
    t[:, 1:] = np.clip(t[:, 1:], -most, most)
    z = [own.copy() for own in scene.nodal(duals.fields)]
    constant, work = 0.0, 0.0
    rough = np.broadcast_to(scene.problem.law.rough, len(t))
    for pair, given in zip(scene.pairs, scene.reduction.scene.pairs):
        turned, one, own = np.zeros((pair.contacts.shape[1], 1)), 0.0, pair.contacts
        if np.any(rough[own[own >= 0]]):
            direction, one = _with_slip(bound, pair, z, omega[:, 1], limit)
            turned, more = _shear_by_pressure(scene, pair, given.law, direction, z, omega[:, 1])
            work += more
        constant = max(constant, one, _with_gap(bound, pair, z, omega, limit, turned))
    return _Adjoint(t, z, constant, work)


def _with_slip(
    bound: Bound, pair: FacingFacets, z: list[np.ndarray], omega: np.ndarray, limit: float
) -> tuple[np.ndarray, float]:
    """Make y_t vanish in stick and stay below `limit` times the slip; returns e (f, 1) and c."""
    side = pair.sides[0]
    slip = pair.jump(bound.displacement, pair.nodes)[1]
    within = pair.jump(bound.displacement, pair.rule)[1]
    turns = (within.min(axis=1) < 0) & (within.max(axis=1) > 0)  # slips both ways
    held = np.zeros(int(side.vertices.max()) + 1, dtype=bool)
    held[side.vertices] = pair.of_contacts(_slack(bound.scene)) > 0
    held[side.vertices[:, turns]] = True
    ends = held[side.vertices].T  # (f, 2)
    still = turns | ends.all(axis=1)
    free = np.concatenate([~ends, ~still[:, None]], axis=1)
    value = pair.jump(z, pair.nodes, True)[1] + pair.at_points(omega, pair.nodes)
    most = np.where(free, limit * np.abs(slip), 0.0)
    wanted = np.clip(value, -most, most)
    for end in range(2):  # next to what sticks in proportion
        beside = ends[:, 1 - end] & ~ends[:, end] & ~turns
        share = slip[beside, 2] / np.where(slip[beside, end] == 0, TINY, slip[beside, end])
        wanted[beside, 2] = share * wanted[beside, end]
    pair.lift(z, wanted - value, 1)
    y = pair.jump(z, pair.rule, True)[1] + pair.at_points(omega, pair.rule)
    share = np.abs(y[~still]) / np.maximum(np.abs(within[~still]), TINY)
    direction = np.where(still, 0.0, np.sign(within.sum(axis=1)))
    return direction[:, None], float(np.max(share, initial=0.0))


def _shear_by_pressure(
    scene: PressedScene,
    pair: FacingFacets,
    law: str,
    direction: np.ndarray,
    z: list[np.ndarray],
    omega: np.ndarray,
) -> tuple[np.ndarray, float]:
    """mu e (f, 1) of each facet under Coulomb's law, else the work of g e in y_t."""
    if find_law(law).proportional:
        mu = scene.problem.law.bound(np.ones(len(scene.limit)))
        mu = np.broadcast_to(mu, len(scene.limit))[pair.contacts[pair.contacts >= 0]]
        if np.ptp(mu) > EQUAL * mu.max():
            raise InputError("there is no bound where the friction coefficient varies.")
        return mu.max() * direction, 0.0
    y = pair.jump(z, pair.rule, True)[1] + pair.at_points(omega, pair.rule)
    own = pair.at_points(scene.limit, pair.rule) * direction * y
    return 0 * direction, scene.factor * float(np.sum(pair.rule.weights * own))


def _with_gap(
    bound: Bound,
    pair: FacingFacets,
    z: list[np.ndarray],
    omega: np.ndarray,
    limit: float,
    turned: np.ndarray,
) -> float:
    """Make y_n - turned y_t vanish in contact and stay below `limit` times the gap; returns c."""
    d = bound.scene.problem.dim
    nodes = facet_nodes(d)
    weights = [pair.at_points(own, pair.nodes) for own in omega.T[:2]]
    pressed = (pair.of_contacts(bound.scene.pressed) > 0).T  # (f, v)
    gap = np.maximum(pair.jump(bound.displacement, pair.nodes)[0], 0.0)
    change = pair.jump(z, pair.nodes, True)
    value = change[0] + weights[0] - turned * (change[1] + weights[1])
    most = np.where(pressed @ nodes > 1 - EQUAL, 0.0, limit * gap)
    wanted = np.clip(value, -most, most)
    for node, ends in enumerate(combinations(range(d), 2), d):
        for end, other in (ends, ends[::-1]):  # next to the pressure in proportion
            share = gap[:, node] / np.maximum(gap[:, end], TINY)
            beside = pressed[:, other] & ~pressed[:, end]
            wanted[beside, node] = (share * wanted[:, end])[beside]
    pair.lift(z, wanted - value)
    away = ~pressed.all(axis=1)
    change = pair.jump(z, pair.rule, True)
    weights = [pair.at_points(own, pair.rule) for own in omega.T[:2]]
    value = change[0] + weights[0] - turned * (change[1] + weights[1])
    gap = pair.jump(bound.displacement, pair.rule)[0]
    share = np.abs(value[away]) / np.maximum(gap[away], TINY)
    return float(np.max(share, initial=0.0))
