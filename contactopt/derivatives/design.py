"""Design: profiles and loads that make the largest pressure as small as it can be, by sequential
convex programs.

The profile is an initial gap g0 + sum_j c_j shape_j over the contacts; loads and other scalar
parameters may be free as well. With x all variables, p(x) the pressures of the certified solution
and J = dp/dx from its sensitivity, one step solves

    min  t   over d, t:   p_i + (J d)_i <= t at all contacts,   x + d within bounds and convex
         constraints,   |d_j| <= radius size_j.

The largest pressure is kept as it is: the program has its kink as constraints, nothing is smoothed.
A step is taken if the largest pressure of the solved scene falls by a fair part of what the program
promised; otherwise the trust region shrinks. Every state visited is certified. Contacts that open
or slip on the way are kinks of p(x). There J is that of one side, and the trust region has the last
word.

Sources: Conn, Gould, Toint (2000), Trust-region methods, chapter 11; Outrata, Kocvara, Zowe (1998).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt.checks import check_number, real_array
from contactopt.coupling.reduction import Reduction, reduce_bodies
from contactopt.derivatives.constants import FIRST_RADIUS, GOOD, GROW, SHRINK, TAKEN
from contactopt.derivatives.states import Chain, Step, solved_chain
from contactopt.errors import InputError
from contactopt.linear.operators import diagonal
from contactopt.problem import Solution
from contactopt.readings.peaks import nodal_pressure
from contactopt.scenes.parameters import MATERIAL, Parameter, parameters, put_all
from contactopt.scenes.scene import Scene

logger = logging.getLogger(__name__)
Rules = Callable[[Any], list[Any]]  # of the cvxpy variable of all unknowns

IDLE = 1e-10  # change of the forces, over what is usual, that is rounding
# promised relative gain, and relative size of a trust region, at which the design ends
SETTLED = 1e-6


@dataclass(frozen=True)
class Visit:
    """Peak [stress], certificate, radius, whether the step was taken, and weak contacts."""

    peak: float
    certificate: float
    radius: float
    taken: bool
    weak: int


@dataclass(frozen=True, eq=False)
class Design:
    """The best state found.

    profile    (m,) coefficients of the shapes;  values  name -> value of the free parameters
    gap        (k,) initial gap [length];  pressure  (k,) [stress];  peak  the largest
    unevenness largest over mean pressure, the mean over the nodal areas of the contacts that touch
    [-]
    visits     all states visited, in their order;  converged, message  of the iteration
    reduction, solution  of the best state, whose problem has the designed gap
    """

    profile: np.ndarray
    values: dict[str, float]
    gap: np.ndarray
    pressure: np.ndarray
    peak: float
    unevenness: float
    visits: tuple[Visit, ...]
    converged: bool
    message: str
    reduction: Reduction
    solution: Solution


class _States:
    """Solves the scene for given variables x = (coefficients, parameters)."""

    def __init__(
        self,
        scene: Scene,
        shapes: Callable | np.ndarray | None,
        which: tuple[Parameter, ...],
        Q: str,
        tol: float,
    ):
        self.scene, self.which, self.tol, self.Q = scene, which, tol, Q
        self.base = reduce_bodies(scene, Q=Q)
        k = self.base.problem.contacts
        made = shapes(self.base.problem.chart.places) if callable(shapes) else shapes
        self.shapes = real_array("shapes", np.zeros((k, 0)) if made is None else made)
        if self.shapes.ndim != 2 or len(self.shapes) != k:
            raise InputError(
                f"shapes must have one row per contact, ({k}, m); got {self.shapes.shape}."
            )

    def step(self, x: np.ndarray, start: Solution | None) -> Step:
        """The solved state; InputError if it has no certified solution."""
        m, starts = self.shapes.shape[1], None if start is None else [start]
        scene = put_all(self.scene, dict(zip(self.which, x[m:])))
        base = None if any(one.kind in MATERIAL for one in self.which) else self.base
        gap = self.shapes @ x[:m]
        return solved_chain([scene], self.tol, base, starts, self.Q, gap).steps[0]

    def slopes(self, step: Step) -> np.ndarray:
        """Derivatives (k, variables) of the normal forces."""
        q, columns = np.zeros(step.problem.q.shape), []
        for shape in self.shapes.T:
            q[:, 0] = shape
            columns.append(step.sensitivity.forward(q=q).reactions[:, 0])
        for one in self.which:
            (moved,) = Chain((step,)).forward({one: 1.0})
            columns.append(moved.change.reactions[:, 0])
        return np.stack(columns, axis=1)


def design(
    scene: Scene,
    shapes: Callable[[np.ndarray], np.ndarray] | np.ndarray | None = None,
    free: str | Sequence[str] = (),
    *,
    bounds: Mapping[str, tuple[float, float]] | tuple[float, float] | None = None,
    constraints: Rules | None = None,
    Q: str = "explicit",
    tol: float = 1e-9,
    steps: int = 60,
) -> Design:
    """The profile and the loads of a scene with the smallest largest pressure.

    Parameters
    ----------
    scene : what is designed; its own gap is where the design starts
    shapes : (k, m) functions that may be added to the initial gap at the contacts, or a function
        that makes them from the places (dim - 1, k) on the contact surface; None: the profile stays
    free : names of scalar parameters that are free as well, such as loads
        (contactopt.scenes.parameters)
    bounds : name -> (lowest, highest) value of a free parameter, and 'profile' -> bounds of all
        coefficients; a pair alone is that of the profile. Free parameters need bounds
    constraints : function of the cvxpy variable of all unknowns, coefficients first, that gives a
        list of convex constraints
    Q : form of Q, as for contactopt.reduce; an array makes many derivatives cheap
    tol : bound on the certificate of every state visited
    steps : states visited at most

    Returns
    -------
    Design : the best state, with all states visited

    Raises
    ------
    InputError : for shapes of the wrong shape, free parameters without bounds, nothing that is
        free, constraints that leave no room, and a scene that cannot be solved at the start

    Sources: those of the head of this module.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"design needs a Scene; got {type(scene).__name__}.")
    check_number("steps", steps, low=0.0)
    which = parameters(free, scene) if free else ()
    states = _States(scene, shapes, which, Q, tol)
    m = states.shapes.shape[1]
    x = np.concatenate([np.zeros(m), [one.read(scene) for one in which]])
    if len(x) == 0:
        raise InputError(
            "nothing is free; give shapes of the profile, or names of free parameters."
        )
    return _improved(states, x, _bounds(bounds, which, m), constraints, steps)


def _improved(
    states: _States,
    x: np.ndarray,
    limits: tuple[np.ndarray, np.ndarray],
    constraints: Rules | None,
    steps: int,
) -> Design:
    """Steps of convex programs from x until none is promised."""
    now, radius, message = states.step(x, None), FIRST_RADIUS, "the steps ran out"
    visits = [_visit(now, radius, True)]
    slopes = states.slopes(now)
    areas = np.maximum(now.problem.areas, 1e-300)[:, None]
    steepest = np.abs(slopes / areas).max(axis=0, initial=0.0)
    if not np.all(np.abs(slopes).max(axis=0) > IDLE * _usual(states, now, x)):
        raise InputError("a shape or a free parameter does not change the pressure; leave it out.")
    sizes = _peak(now) / steepest  # each changes the pressure somewhere by as much as the largest
    while len(visits) < steps:
        d, promised = _program(now, slopes, x, radius * sizes, limits, constraints)
        if promised <= SETTLED * _peak(now) or radius < SETTLED:
            message = "no better state is near"
            break
        try:
            trial = states.step(x + d, now.solution)
        except InputError as error:
            logger.info("a trial of design has no solution: %s", error)
            radius *= SHRINK
            continue
        gain = (_peak(now) - _peak(trial)) / promised
        taken = gain >= TAKEN
        visits.append(_visit(trial, radius, taken))
        radius *= SHRINK if not taken else GROW if gain >= GOOD else 1.0
        if taken:
            now, x = trial, x + d
            slopes = states.slopes(now)
    return _designed(states, now, x, tuple(visits), message)


def _designed(
    states: _States, now: Step, x: np.ndarray, visits: tuple[Visit, ...], message: str
) -> Design:
    m, problem, r = states.shapes.shape[1], now.problem, now.solution.reactions
    pressure, touching = _pressure(now), problem.law.pressed(r)
    mean = float(r[touching, 0].sum() / problem.areas[touching].sum()) if touching.any() else np.nan
    gap = now.reduction.gap + states.shapes @ x[:m]
    values = {one.name: float(value) for one, value in zip(states.which, x[m:])}
    peak, converged = _peak(now), message != "the steps ran out"
    found = x[:m], values, gap, pressure, peak, peak / mean, visits, converged, message
    return Design(*found, now.reduction, now.solution)


def _program(
    now: Step,
    slopes: np.ndarray,
    x: np.ndarray,
    reach: np.ndarray,
    limits: tuple[np.ndarray, np.ndarray],
    constraints: Rules | None,
) -> tuple[np.ndarray, float]:
    """The step (variables,) in units of its reach and of the peak; the promised gain [stress]."""
    import cvxpy as cp

    loaded, peak = now.problem.areas > 0, _peak(now)
    p = _pressure(now)[loaded] / peak
    J = slopes[loaded] / now.problem.areas[loaded, None] / peak * reach
    d, t = cp.Variable(len(x)), cp.Variable()
    rules = [p + J @ d <= t, cp.abs(d) <= 1.0]
    for bound, sign in zip(limits, (-1.0, 1.0)):
        kept = np.flatnonzero(np.isfinite(bound))
        rules.append(sign * cp.multiply(reach[kept], d[kept]) <= sign * (bound - x)[kept])
    if constraints is not None:
        whole = cp.Variable(len(x))
        rules += [whole == x + cp.multiply(reach, d), *constraints(whole)]
    program = cp.Problem(cp.Minimize(t), rules)
    try:
        program.solve(solver=cp.CLARABEL)
    except cp.SolverError as error:
        raise InputError(f"the convex program of a design step failed: {error}.") from error
    if d.value is None:
        raise InputError(
            "the constraints and bounds leave no room for the design at its start; loosen them."
        )
    step = np.clip(d.value, -1.0, 1.0)
    return reach * step, peak * float(p.max() - (p + J @ step).max())


def _visit(step: Step, radius: float, taken: bool) -> Visit:
    weak = len(step.sensitivity.weak)
    return Visit(_peak(step), step.solution.residual, radius, taken, weak)


def _pressure(step: Step) -> np.ndarray:
    return nodal_pressure(step.problem, step.solution)


def _peak(step: Step) -> float:
    return float(_pressure(step).max(initial=0.0))


def _usual(states: _States, now: Step, x: np.ndarray) -> np.ndarray:
    """How much each variable would change the forces of contacts that are on their own."""
    compliance, rest = float(np.mean(diagonal(now.problem.Q))), x[states.shapes.shape[1] :]
    largest = float(np.abs(now.solution.reactions).max())
    shapes = np.abs(states.shapes).max(axis=0, initial=0.0) / compliance
    return np.concatenate([shapes, largest / np.where(rest != 0, np.abs(rest), 1.0)])


def _bounds(
    bounds: Mapping[str, tuple[float, float]] | tuple[float, float] | None,
    which: tuple[Parameter, ...],
    m: int,
) -> tuple[np.ndarray, np.ndarray]:
    given = {"profile": bounds} if isinstance(bounds, tuple) else dict(bounds or {})
    pairs = [given.get("profile", (-np.inf, np.inf))] * m
    for one in which:
        if one.name not in given:
            raise InputError(f"the free parameter '{one.name}' needs bounds, (lowest, highest).")
        pairs.append(given[one.name])
    unknown = set(given) - {"profile", *(one.name for one in which)}
    if unknown:
        raise InputError(f"bounds name '{min(unknown)}', which is not free.")
    made = np.array(pairs, dtype=float).reshape(len(pairs), 2)
    if np.any(made[:, 0] > made[:, 1]):
        raise InputError("a lowest value is above its highest one; exchange the bounds.")
    return made[:, 0], made[:, 1]
