"""Numbers that people ask of a contact, by name, each read so that its error falls smoothly with
the mesh.

A single node, or a count of nodes, jumps from mesh to mesh, and the estimate of an error lives on
differences between meshes: values at an edge or a peak come from fits through several nodes,
weighted by the nodal areas. Every reading says how uncertain it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.chart import ON_PLANE
from contactopt.problem.contact_status import contact_status
from contactopt.readings.constants import FITTED, MOST_PEAKS, NEIGHBOURS
from contactopt.readings.edges import contact_zone, stick_edge

if TYPE_CHECKING:
    from contactopt.coupling.reduction import Reduction

CLOSED = 1e-3  # a mean motion below this share of the mean size is that of a surface around a body


def approach(problem: InterfaceProblem, solution: Solution) -> float | None:
    """How far the plates bring the bodies together along the mean normal.

    Parameters
    ----------
    problem : An interface problem.
    solution : Of the problem.

    Returns
    -------
    [length]; None without a plate, and where the surface surrounds a body, so that its normals have
    no mean.
    """
    if len(solution.multipliers) == 0:
        return None
    normal = (problem.V @ solution.multipliers).reshape(problem.q.shape)[:, 0]
    mean, size = (
        float(np.average(motion, weights=problem.areas)) for motion in (normal, np.abs(normal))
    )
    return None if size > 0 and abs(mean) < CLOSED * size else -mean


def elastic_energy(reduction: Reduction, solution: Solution) -> float:
    """Elastic energy of all bodies together, the sum of U' A U / 2.

    Parameters
    ----------
    reduction : A reduced scene.
    solution : Of its problem.

    Returns
    -------
    [force length].
    """
    displaced = reduction.displaced(solution)
    return sum(body.energy(U) for body, U in zip(reduction.bodies, displaced))


@dataclass(frozen=True, eq=False)
class Peak:
    """A local maximum of a quantity.

    value        [its unit];   uncertainty  of the reading [its unit]
    place        (dim,) [length];   size  distance of the nodes there [length]
    contacts     (m,) numbers of the contacts from which it was read
    body, elements  where it lies inside a body: the number of the body and the elements around it
    """

    value: float
    uncertainty: float
    place: np.ndarray
    size: float
    contacts: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    body: int = -1
    elements: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))


@dataclass(frozen=True, eq=False)
class Reading:
    """A quantity as it is read from one solution.

    value        [its unit];   uncertainty  of the reading alone, not of the solution [its unit]
    peaks        of a largest value: its local maxima, the largest first; of an edge, the contacts
                 next to it
    missing      one sentence if the quantity does not exist in this solution
    """

    value: float
    uncertainty: float = 0.0
    peaks: tuple[Peak, ...] = ()
    missing: str = ""


def peak_pressure(reduction: Reduction, solution: Solution) -> float:
    """Largest value of a smooth pressure, as pressure_reading() reads it [stress]."""
    return pressure_reading(reduction, solution).value


def pressure_reading(reduction: Reduction, solution: Solution) -> Reading:
    """Read the largest pressure from a local fit around the node where it is largest.

    The square of the pressure is quadratic under Hertz's ellipse, and near the top of any smooth
    pressure. A quadratic polynomial is fitted to it through the few nodes around every local
    maximum of the nodal pressures, with the nodal areas as weights. What the nodes scatter about
    the fit is the uncertainty, so that the reading agrees with the nodal values within its own
    error. Nodes on the axis of an axisymmetric mesh are left out: the strain u_r / r is poorly
    resolved there, on a ring without area. At the rim of the contact surface the nodal value is
    returned.

    Parameters
    ----------
    reduction : A reduced scene with one pair of surfaces.
    solution : Of its problem.

    Returns
    -------
    The largest pressure with its local maxima [stress].

    Raises
    ------
    InputError : If the scene has several pairs of surfaces.
    """
    _one_pair(reduction)
    problem = reduction.problem
    pressure = nodal_pressure(problem, solution)
    if not np.any(pressure > 0):
        return Reading(0.0, missing="nothing touches, so that there is no pressure")
    usable = problem.areas > 0
    if reduction.scene.kind == "axisymmetric":
        radius = np.abs(problem.coordinates[0])
        usable &= radius > ON_PLANE * radius.max(initial=0.0)
    noise = solution.residual * float(np.linalg.norm(solution.reactions))
    found = []
    for top in _maxima(problem, np.where(usable, pressure, 0.0)):
        value, uncertainty, near, size = _fitted_top(problem, pressure, usable, top)
        uncertainty += noise / float(problem.areas[top])
        found.append(Peak(value, uncertainty, problem.coordinates[:, top], size, near))
    found.sort(key=lambda peak: -peak.value)
    return Reading(found[0].value, found[0].uncertainty, tuple(found))


def nodal_pressure(problem: InterfaceProblem, solution: Solution) -> np.ndarray:
    """Divide the normal forces by the nodal areas, (k,) [stress]; 0 at contacts without an area.

    Parameters
    ----------
    problem : an interface problem
    solution : of the problem

    Returns
    -------
    (k,) pressures [stress].
    """
    forces = solution.reactions[:, 0]
    return np.divide(forces, problem.areas, out=np.zeros(len(forces)), where=problem.areas > 0)


def _maxima(problem: InterfaceProblem, pressure: np.ndarray) -> np.ndarray:
    """Numbers of the contacts whose pressure is that of no neighbour exceeded, the largest of them
    first, MOST_PEAKS at most.
    """
    places, node = _surroundings(problem)
    count = min(NEIGHBOURS[problem.dim], len(node))
    near = node[
        cKDTree(places.T).query(problem.chart.places.T, k=count)[1].reshape(problem.contacts, count)
    ]
    top = (pressure > 0) & (pressure >= pressure[near].max(axis=1))
    chosen = np.flatnonzero(top)
    return chosen[np.argsort(-pressure[chosen], kind="stable")[:MOST_PEAKS]]


def _surroundings(problem: InterfaceProblem) -> tuple[np.ndarray, np.ndarray]:
    """Places (dim - 1, m) of the whole surface with all mirror images and once around closed lines,
    and the contact of each.
    """
    chart = problem.chart
    if chart.period is None:
        return chart.images()
    shifts = chart.period * np.array([-1.0, 0.0, 1.0])
    places = (chart.places[0] + shifts[:, None]).reshape(1, -1)
    return places, np.tile(np.arange(problem.contacts), 3)


def _fitted_top(
    problem: InterfaceProblem, pressure: np.ndarray, usable: np.ndarray, top: int
) -> tuple[float, float, np.ndarray, float]:
    """Value and uncertainty of the pressure near a node, the contacts next to it, and their
    distance.

    Beside an axis the value is that of the widest fit that agrees with all narrower ones within
    their uncertainties (after Lepski): the nodes next to the axis are poor, and those farther away
    mend a smooth pressure.
    """
    count, widest = FITTED[problem.dim], 0
    if np.any((problem.areas > 0) & ~usable):  # nodes on an axis, whose neighbours are poor, too
        widest = len(_surroundings(problem)[1])
    narrowest = _fit_to(count, problem, pressure, usable, top)
    found: list[tuple[float, float]] = []
    value, doubt = narrowest[:2]
    while np.isfinite(doubt) and all(
        abs(value - other) <= doubt + around for other, around in found
    ):
        found.append((value, doubt))
        count *= 2
        if count > widest:
            break
        value, doubt = _fit_to(count, problem, pressure, usable, top)[:2]
    return *(found[-1] if found else (narrowest[0], narrowest[0])), *narrowest[2:]


def _fit_to(
    count: int, problem: InterfaceProblem, pressure: np.ndarray, usable: np.ndarray, top: int
) -> tuple[float, float, np.ndarray, float]:
    """As _fitted_top, from a quadratic fit to the square of the pressure at `count` contacts.

    The uncertainty is infinite where these are too few, or not all pressed.
    """
    places, node = _surroundings(problem)
    offset = places - problem.chart.places[:, [top]]
    distance = np.where(usable[node], np.linalg.norm(offset, axis=0), np.inf)
    near = np.argsort(distance, kind="stable")[: min(count, int(usable[node].sum()))]
    own, nodal = np.unique(node[near]), float(pressure[top])
    reach = float(distance[near].max(initial=0.0))
    size = reach / max(len(near) / 2, 1) ** (1 / len(places)) or float(
        problem.areas[top] ** (1 / len(places))
    )
    # with a first coordinate of 1
    powers = list(combinations_with_replacement(range(len(places) + 1), 2))
    if len(near) <= len(powers) or not np.all(pressure[node[near]] > 0):
        return nodal, np.inf, own, size  # too few contacts to know
    terms = np.concatenate([np.ones((1, len(near))), offset[:, near] / reach])
    terms = np.array([terms[i] * terms[j] for i, j in powers]).T
    square, root = (
        pressure[node[near]] ** 2,
        np.sqrt(problem.areas[node[near]] / problem.areas[node[near]].mean()),
    )
    fit = np.linalg.lstsq(terms * root[:, None], square * root, rcond=None)[0]
    left = (terms @ fit - square) * root
    inner = terms[distance[near] <= reach / 2]
    value = float(np.sqrt(max((inner @ fit).max(), 0.0)))
    value = (
        max(value, _stationary(fit, powers, len(places)) or 0.0)
        if not _outermost(offset[:, near])
        else nodal
    )
    scatter = float(np.sqrt(np.sum(left**2) / (len(near) - len(powers))))
    at_top = abs(float(fit[0]) - nodal**2) if usable[top] else 0.0
    at_top *= min(
        1.0, float(np.sqrt(problem.areas[top] / problem.areas[node[near]].mean()))
    )  # rings at an axis bear little
    return value, max(scatter, at_top) / (2 * value or 1.0), own, size


def _stationary(fit: np.ndarray, powers: list[tuple[int, int]], dim: int) -> float | None:
    """The root of a quadratic polynomial at its top, if it has one within half the fitted nodes;
    powers as in _fitted_top().
    """
    H = np.zeros((dim + 1, dim + 1))
    for coefficient, (i, j) in zip(fit, powers):
        H[i, j] += coefficient / 2
        H[j, i] += coefficient / 2
    if np.any(np.linalg.eigvalsh(H[1:, 1:]) >= 0):
        return None
    at = -np.linalg.solve(H[1:, 1:], H[1:, 0])
    top = float(H[0, 0] + H[0, 1:] @ at)
    return float(np.sqrt(top)) if np.linalg.norm(at) <= 0.5 and top > 0 else None


def at_rim(reduction: Reduction, solution: Solution) -> bool:
    """Whether the largest pressure is at the rim of the candidate surface, where it may be
    infinite.

    A node inside has neighbours in all directions.

    Parameters
    ----------
    reduction : A reduced scene with one pair of surfaces.
    solution : Of its problem.

    Returns
    -------
    bool
    """
    problem = reduction.problem
    top = int(np.argmax(nodal_pressure(problem, solution)))
    offsets = _surroundings(problem)[0] - problem.chart.places[:, [top]]
    return _outermost(offsets[:, np.argsort(np.linalg.norm(offsets, axis=0), kind="stable")[:9]])


def _outermost(offsets: np.ndarray) -> bool:
    """Whether the nodes (dim - 1, m) around a node all lie on one side of it."""
    if len(offsets) == 1:
        return bool((offsets > 0).any() != (offsets < 0).any())
    near = offsets[:, np.any(offsets != 0, axis=0)]
    angles = np.sort(np.arctan2(near[1], near[0]))
    return bool(
        np.max(np.diff(np.append(angles, angles[:1] + 2 * np.pi)), initial=0.0) > 0.8 * np.pi
    )


def width(reduction: Reduction, solution: Solution) -> float:
    """Half-width of the contact zone of a scene with one pair of surfaces, as contact_zone() reads
    it [length].

    Parameters
    ----------
    reduction : a reduced scene with one pair of surfaces
    solution : of its problem

    Returns
    -------
    The half-width [length].
    """
    return width_reading(reduction, solution).value


def width_reading(reduction: Reduction, solution: Solution) -> Reading:
    """Read the half-width of the contact zone with its uncertainty.

    Parameters
    ----------
    reduction : A reduced scene with one pair of surfaces.
    solution : Of its problem.

    Returns
    -------
    The half-width [length].

    Raises
    ------
    InputError : If the scene has several pairs of surfaces.
    """
    _one_pair(reduction)
    problem, r = reduction.problem, solution.reactions
    touching = contact_status(problem, r).touching
    missing = "" if touching.any() else "nothing touches, so that the zone of contact has no width"
    return Reading(
        *contact_zone(reduction.scene, problem, r), _edges_of(problem, touching), missing
    )


def _edges_of(problem: InterfaceProblem, inside: np.ndarray) -> tuple[Peak, ...]:
    """The contacts on both sides of the edge of a zone, as one peak; none where the zone has no
    edge.
    """
    places, node = _surroundings(problem)
    count = min(NEIGHBOURS[problem.dim], len(node))
    near = node[
        cKDTree(places.T).query(problem.chart.places.T, k=count)[1].reshape(problem.contacts, count)
    ]
    edge = np.flatnonzero(np.any(inside[near] != inside[:, None], axis=1))
    if not len(edge):
        return ()
    return (Peak(0.0, 0.0, problem.coordinates[:, edge[0]], 0.0, edge),)


def stick_width(reduction: Reduction, solution: Solution) -> tuple[float, float]:
    """Half-width of the stick zone of a scene with one pair of surfaces, and its uncertainty, as
    stick_edge() reads them [length].

    Parameters
    ----------
    reduction : a reduced scene with one pair of surfaces
    solution : of its problem

    Returns
    -------
    The half-width and its uncertainty [length].
    """
    _one_pair(reduction)
    problem = reduction.problem
    slip = problem.displacements(solution.reactions, solution.multipliers)[:, 1:]
    return stick_edge(reduction.scene, problem, solution.reactions, slip)


def stick_reading(reduction: Reduction, solution: Solution) -> Reading:
    """Read the half-width of the stick zone over that of contact, with its uncertainty.

    Parameters
    ----------
    reduction : A reduced scene with one pair of surfaces.
    solution : Of its problem.

    Returns
    -------
    The ratio [-].

    Raises
    ------
    InputError : If the scene has several pairs of surfaces.
    """
    edge = width_reading(reduction, solution)
    if edge.missing:
        return replace(edge, value=0.0)
    stick, uncertainty = stick_width(reduction, solution)
    status = contact_status(reduction.problem, solution.reactions)
    ratio, own = stick / edge.value, uncertainty / edge.value
    if status.slip.any() and status.stick.any():
        own += ratio * edge.uncertainty / edge.value
    return Reading(ratio, own, (*_edges_of(reduction.problem, status.stick), *edge.peaks))


def _one_pair(reduction: Reduction) -> None:
    """InputError if a scene has several pairs of surfaces, each with numbers of its own."""
    if len(reduction.problem.pairs) > 1:
        raise InputError(
            f"scene '{reduction.scene.name}' has {len(reduction.problem.pairs)} pairs of surfaces,"
            " each with its own pressure and half-widths; name the pair, as in 'pressure:"
            + reduction.problem.pairs[0].name
            + "', or ask for the energy."
        )


def _approach(reduction: Reduction, solution: Solution) -> Reading:
    value = approach(reduction.problem, solution)
    if value is None:
        raise InputError(
            f"scene '{reduction.scene.name}' has no plate, hence no approach; ask for another"
            " quantity."
        )
    return Reading(value)


# name -> function of a reduction and its solution
READINGS: dict[str, Callable[[Reduction, Solution], Reading]] = {
    "pressure": pressure_reading,
    "width": width_reading,
    "approach": _approach,
    "stick": stick_reading,
    "energy": lambda *solved: Reading(elastic_energy(*solved)),
}
# these belong to a surface, not to the scene as a whole
OF_ONE_PAIR = ("pressure", "width", "stick")


def value_of(name: str, reduction: Reduction, solution: Solution) -> float:
    """The value of one of READINGS, in its unit.

    Parameters
    ----------
    name : one of READINGS
    reduction : a reduced scene with one pair of surfaces
    solution : of its problem

    Returns
    -------
    The value.
    """
    return READINGS[name](reduction, solution).value
