"""Calibration: parameters of a scene from measured quantities, by nonlinear least squares with
exact derivatives.

With the model's quantities m(x), the data y, and the standard deviation sigma of the noise, x
minimises sum ((m - y) / sigma)^2. scipy's trust-region method gets the Jacobian from one forward
solve for each parameter and state. Near the solution the estimate is normally distributed with the
covariance (J' J)^-1, J = dm/dx / sigma; without a given sigma it is estimated from the residuals,
and Student's distribution takes the place of the normal one. The singular values of J, for
parameters in units of their own size, say what the data can tell: a direction with the singular
value s is known to the relative accuracy 1 / s, and where s vanishes it is not identifiable.
Friction of contacts that all stick is the example to remember.

Sources: Bates, Watts (1988), Nonlinear regression analysis and its applications; Branch, Coleman,
Li (1999), the method `trf`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import norm, t

from contactopt.checks import check_number
from contactopt.derivatives.kinks import Weak
from contactopt.derivatives.states import Chain, along, solved_chain
from contactopt.errors import InputError
from contactopt.readings.quantities import seeds_of
from contactopt.scenes.parameters import MATERIAL, Parameter, put_all
from contactopt.scenes.parameters import parameters as parameters_of
from contactopt.scenes.scene import Scene

logger = logging.getLogger(__name__)

CONFIDENCE = 0.95
BLIND = 1e-8  # singular values below this fraction of the largest tell nothing
EVALUATIONS = 60  # of the model, at most
SHARE = 1e-3  # of such a direction, from which on a parameter is not identifiable
HALVINGS = 10  # of the friction coefficients that are tried where contacts stick
# E over its first value
LIMITS = {"E": (1e-12, np.inf), "nu": (-0.999, 0.4999), "mu": (0.0, np.inf)}


@dataclass(frozen=True, eq=False)
class Fit:
    """Fitted parameters, and what the data say of them.

    values        name -> value;  intervals  name -> (low, high) of the confidence 95 %, infinite
                  where not identifiable
    covariance    (p, p) of the values, in the order of `names`
    singular      (p,) singular values of the Jacobian by the parameters over their size and the
                  data over their noise, largest first; directions (p, p): in its rows the
                  combinations of parameters they belong to
    identifiable  name -> whether the data say anything of it
    data, model   quantity -> (states,) measured and computed;  noise  quantity -> standard
                  deviation
    evaluations   of the model;  certificates  (evaluations,) largest certificate of the states
                  visited each time
    weak          (number of the state, contact) of weakly active contacts at the solution, where
                  the model has kinks
    scenes        the states with the fitted values;  converged, message  of the optimiser
    """

    names: tuple[str, ...]
    values: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    covariance: np.ndarray
    singular: np.ndarray
    directions: np.ndarray
    identifiable: dict[str, bool]
    data: dict[str, np.ndarray]
    model: dict[str, np.ndarray]
    noise: dict[str, float]
    evaluations: int
    certificates: tuple[float, ...]
    weak: tuple[tuple[int, Weak], ...]
    scenes: tuple[Scene, ...]
    converged: bool
    message: str

    @property
    def sentence(self) -> str:
        """What was found, for people."""
        parts = []
        for name, (low, high) in self.intervals.items():
            value = f"{name} = {self.values[name]:.6g} in [{low:.6g}, {high:.6g}]"
            blind = f"{name} cannot be identified from these data"
            parts.append(value if self.identifiable[name] else blind)
        if self.weak:
            parts.append(
                f"{len(self.weak)} contacts are weakly active there, so the intervals hold on one"
                " side"
            )
        return "; ".join(parts)


class _Model:
    """The quantities of a path as functions of the parameters, with warm starts and the
    certificates of all states visited.

    Residuals and Jacobian have one row for each datum that was measured, in units of its noise.
    """

    def __init__(
        self,
        scenes: tuple[Scene, ...],
        which: tuple[Parameter, ...],
        data: dict[str, np.ndarray],
        sigma: dict[str, float],
        solving: tuple[str, float],
    ):
        self.scenes, self.which, self.data, self.sigma = scenes, which, data, sigma
        self.Q, self.tol = solving
        self.measured = [
            (name, int(n)) for name, own in data.items() for n in np.flatnonzero(np.isfinite(own))
        ]
        self.noise = np.array([sigma[name] for name, _ in self.measured])
        self.wanted = np.array([data[name][n] for name, n in self.measured])
        self.last: tuple[np.ndarray, Chain] | None = None
        self.certificates: list[float] = []

    def chain(self, values: np.ndarray) -> Chain:
        """The solved states for values (p,) of the parameters."""
        starts = base = None
        if self.last is not None:
            before, known = self.last
            if np.array_equal(before, values):
                return known
            starts = [step.solution for step in known.steps]
            if not any(one.kind in MATERIAL for one in self.which):
                base = known.steps[0].reduction
        chosen = dict(zip(self.which, values))
        scenes = [put_all(scene, chosen) for scene in self.scenes]
        made = solved_chain(scenes, self.tol, base, starts, self.Q)
        self.last = values.copy(), made
        self.certificates.append(max(step.solution.residual for step in made.steps))
        return made

    def computed(self, values: np.ndarray) -> np.ndarray:
        """(data,) what was measured, as the model has it."""
        steps = self.chain(values).steps
        return np.array([seeds_of(name, steps[n]).value for name, n in self.measured])

    def misfit(self, values: np.ndarray) -> np.ndarray:
        """(data,) residuals, infinite where a state has no solution."""
        try:
            return (self.computed(values) - self.wanted) / self.noise
        except InputError as error:  # bodies that slide off: the trust region shrinks
            logger.info("a trial of fit has no solution: %s", error)
            return np.full(len(self.measured), np.inf)

    def jacobian(self, values: np.ndarray) -> np.ndarray:
        """(data, p) slopes."""
        chain = self.chain(values)
        seeds = [seeds_of(name, chain.steps[n]) for name, n in self.measured]
        moves = [({one: 1.0}, list(chain.forward({one: 1.0}))) for one in self.which]
        rows = [
            [along(own, moved[n], way) for way, moved in moves]
            for own, (_, n) in zip(seeds, self.measured)
        ]
        return np.array(rows) / self.noise[:, None]


def fit(
    scene: Scene | Sequence[Scene],
    data: Mapping[str, Any],
    parameters: str | Sequence[str],
    *,
    noise: float | Mapping[str, float] | None = None,
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    Q: str = "auto",
    tol: float = 1e-10,
) -> Fit:
    """Fit parameters of a scene, or of a load path, to measured quantities by least squares.

    Parameters
    ----------
    scene : a Scene, or the states of a load path in their order
    data : name of a quantity (contactopt.readings.quantities) -> its measured value, on a path one
        per state; nan where it was not measured
    parameters : names of scalar parameters (contactopt.scenes.parameters)
    noise : standard deviation of the data, one number or one for each quantity, in their units;
        None: estimated from what the model leaves, for all quantities relative to the size of their
        data
    start : name -> first value; by default that of the scene
    bounds : name -> (lowest, highest) value; by default what makes sense for E, nu and mu
    Q : form of Q, as for contactopt.reduce
    tol : bound on the certificate of every state

    Returns
    -------
    Fit : values, confidence intervals, identifiability and residuals

    Raises
    ------
    InputError : for parameters that do not enter, data of the wrong shape, fewer data than
        parameters, and a first state that cannot be solved

    Sources: those of the head of this module.
    """
    scenes = (scene,) if isinstance(scene, Scene) else tuple(scene)
    if not scenes or not all(isinstance(one, Scene) for one in scenes):
        raise InputError("fit needs a Scene, or the states of a load path as a list of scenes.")
    check_number("tol", tol, low=0.0)
    which = parameters_of(parameters, scenes[0])
    fields = [one.name for one in which if one.is_field]
    if fields:
        raise InputError(
            f"'{fields[0]}' has one number per contact; fit takes parameters that are single"
            " numbers."
        )
    known, first = _data(data, len(scenes)), _first(which, scenes, start or {})
    model = _Model(scenes, which, known, _noise(noise, known), (Q, tol))
    count = len(model.measured)
    if count < len(which) + (noise is None):
        raise InputError(
            f"{count} data cannot determine {len(which)} parameters and their accuracy; measure"
            " more states."
        )
    limits = _bounds(which, bounds or {}, first)
    model.chain(first)  # an error in the first state is the user's to see
    return _result(model, *_minimised(model, first, limits, noise is None), noise is None)


def _minimised(
    model: _Model, first: np.ndarray, limits: tuple[np.ndarray, np.ndarray], estimated: bool
) -> tuple[np.ndarray, Any]:
    """The values (p,) of the smallest misfit, and what the optimiser says; where the data hardly
    know friction because contacts stick, it goes on from less friction.
    """
    size = np.where(first != 0, np.abs(first), 1.0)
    low, high = limits[0] / size, limits[1] / size

    def misfit(x: np.ndarray) -> np.ndarray:
        return model.misfit(size * x)

    def jacobian(x: np.ndarray) -> np.ndarray:
        return model.jacobian(size * x) * size

    def search(x: np.ndarray) -> Any:
        return least_squares(
            misfit, x, jacobian, (low, high), "trf", 1e-10, 1e-9, 1e-10, max_nfev=EVALUATIONS
        )

    found = search(first / size)
    freedom = max(len(model.measured) - len(first), 1)
    spread = np.sqrt(2 * found.cost / freedom) if estimated else 1.0
    told = np.linalg.norm(jacobian(found.x), axis=0) * np.abs(found.x) > spread
    sticks = np.array([one.kind == "mu" for one in model.which]) & ~told
    slipping = _slipping(misfit, found.x, sticks, low) if sticks.any() else None
    if slipping is not None:
        other = search(slipping)
        if other.cost < found.cost:
            told = (
                "contacts stick at the first values, where the data hardly know friction; the fit"
                " went on from less of it"
            )
            logger.info(told)
            found, found.message = other, f"{other.message} ({told})"
    return size * found.x, found


def _slipping(
    misfit: Callable[[np.ndarray], np.ndarray], x: np.ndarray, sticks: np.ndarray, low: np.ndarray
) -> np.ndarray | None:
    """The best point with less of the frictions in the mask (p,) that do not matter, or None."""
    here, best, least = float(np.sum(misfit(x) ** 2)), None, np.inf
    for i in range(1, HALVINGS + 1):
        point = np.where(sticks, np.maximum(x / 2**i, low + 1e-3 * (x - low)), x)
        cost = float(np.sum(misfit(point) ** 2))
        if cost < least and cost != here:
            best, least = point, cost
    return best


def _result(model: _Model, values: np.ndarray, found: Any, estimated: bool) -> Fit:
    """Intervals and identifiability from the Jacobian at the solution."""
    J = model.jacobian(values)
    names, freedom = tuple(one.name for one in model.which), len(J) - len(values)
    variance = 2 * found.cost / freedom if estimated else 1.0
    unit = np.where(values != 0, np.abs(values), 1.0)
    _, singular, directions = np.linalg.svd(J * unit, full_matrices=False)
    seen = singular > BLIND * singular.max(initial=0.0)
    inverse = directions[seen].T @ np.diag(1 / singular[seen] ** 2) @ directions[seen]
    covariance = variance * unit[:, None] * inverse * unit
    blind = np.sqrt(np.sum(directions[~seen] ** 2, axis=0)) > SHARE
    quantile = t.ppf(0.5 + CONFIDENCE / 2, freedom) if estimated else norm.ppf(0.5 + CONFIDENCE / 2)
    half = np.where(blind, np.inf, quantile * np.sqrt(np.diag(covariance)))
    chain, root = model.chain(values), float(np.sqrt(variance))
    computed = {name: np.full(len(chain.steps), np.nan) for name in model.data}
    for (name, n), value in zip(model.measured, model.computed(values)):
        computed[name][n] = value
    return Fit(
        names,
        dict(zip(names, values.tolist())),
        {name: (float(v - h), float(v + h)) for name, v, h in zip(names, values, half)},
        covariance,
        singular / root if root > 0 else singular,
        directions,
        dict(zip(names, (~blind).tolist())),
        model.data,
        computed,
        {name: root * one for name, one in model.sigma.items()},
        len(model.certificates),
        tuple(model.certificates),
        chain.weak,
        tuple(step.reduction.scene for step in chain.steps),
        bool(found.status > 0),
        str(found.message),
    )


def _data(data: Mapping[str, Any], states: int) -> dict[str, np.ndarray]:
    """quantity -> (states,); InputError for anything else."""
    if not isinstance(data, Mapping) or not data:
        raise InputError("the data must be a mapping from names of quantities to measured values.")
    try:
        out = {name: np.atleast_1d(np.asarray(own, dtype=float)) for name, own in data.items()}
    except (TypeError, ValueError) as error:
        raise InputError(f"the data must be numbers: {error}.") from error
    for name, array in out.items():
        if array.shape != (states,):
            raise InputError(
                f"the data of '{name}' must have one value per state, shape ({states},); got"
                f" {array.shape}."
            )
    return out


def _first(
    which: tuple[Parameter, ...], scenes: tuple[Scene, ...], start: Mapping[str, float]
) -> np.ndarray:
    """First values (p,); InputError for a load that differs from state to state."""
    unknown = set(start) - {one.name for one in which}
    if unknown:
        raise InputError(f"start has a value of '{min(unknown)}', which is not fitted.")
    for one in which:
        if len({one.read(scene) for scene in scenes}) > 1:
            raise InputError(
                f"'{one.name}' differs from state to state of the path; fit parameters that all"
                " states share."
            )
    return np.array([float(start.get(one.name, one.read(scenes[0]))) for one in which])


def _noise(
    noise: float | Mapping[str, float] | None, data: dict[str, np.ndarray]
) -> dict[str, float]:
    """quantity -> standard deviation, up to a common factor where it is to be estimated."""
    if noise is None:
        known = {name: values[np.isfinite(values)] for name, values in data.items()}
        sizes = {name: float(np.linalg.norm(own)) for name, own in known.items()}
        return {name: sizes[name] / max(len(own), 1) ** 0.5 or 1.0 for name, own in known.items()}
    given = dict(noise) if isinstance(noise, Mapping) else dict.fromkeys(data, noise)
    for name in data:
        if name not in given:
            raise InputError(f"noise has no standard deviation for '{name}'.")
        check_number(f"the standard deviation of '{name}'", given[name], low=0.0)
    return {name: float(given[name]) for name in data}


def _bounds(
    which: tuple[Parameter, ...], bounds: Mapping[str, tuple[float, float]], first: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    low, high = np.full((2, len(which)), np.inf)
    for i, one in enumerate(which):
        usual = LIMITS.get(one.kind, (-np.inf, np.inf))
        scale = abs(first[i]) if one.kind == "E" else 1.0
        low[i], high[i] = bounds.get(one.name, (usual[0] * scale, usual[1]))
        if not low[i] < first[i] < high[i]:
            raise InputError(
                f"the first value {first[i]:g} of '{one.name}' must lie between its bounds"
                f" {low[i]:g}, {high[i]:g}."
            )
    return low, high
