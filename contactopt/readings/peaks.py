"""The largest pressure, read so that its error falls smoothly with the mesh.

A single node jumps from mesh to mesh, and the estimate of an error lives on differences between
meshes: the value at a peak comes from a fit through several nodes, weighted by the nodal areas.
Every reading says how uncertain it is.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations_with_replacement

import numpy as np
from scipy.spatial import cKDTree

from contactopt.coupling.reduction import Reduction
from contactopt.defaults import EQUAL
from contactopt.meshes.cells import joined
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.chart import Chart
from contactopt.readings.constants import FITTED, MOST_PEAKS, NEIGHBOURS
from contactopt.readings.patches import least

# Of the value, times the share of the fitted contacts on a surface that lie beside open ones, which
# may be missing. So read, 120 ellipses on random meshes were off by at most 2.3 times what is
# claimed where one contact or more lies across the short half-axis.
BESIDE = 1.0
BESIDE_REACH = 3.01  # the neighbours of fitted contacts lie within three times their reach
WINDOW = 16  # points of a grid on each side of a top, which its fit sees first


@dataclass(frozen=True, eq=False)
class Peak:
    """A local maximum of a quantity.

    value        [its unit];   uncertainty  of the reading [its unit]
    place        (dim,) [length];   size  distance of the nodes there [length]
    contacts     (m,) numbers of the contacts from which it was read
    body, elements  where it lies inside a body: the number of the body and the elements around it
    sources, slopes  (s,) numbers of all contacts that were read, and the derivatives of a pressure
                     by the normal forces there [1 / area]
    drop       by which share of the value it falls to the least of the contacts around it [-]
    """

    value: float
    uncertainty: float
    place: np.ndarray
    size: float
    contacts: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    body: int = -1
    elements: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    sources: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    slopes: np.ndarray = field(default_factory=lambda: np.empty(0))
    drop: float = 1.0


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


def pressure_reading(reduction: Reduction, solution: Solution) -> Reading:
    """Read the largest pressure of one pair of surfaces [stress].

    The square of the pressure is quadratic under Hertz's ellipse and near any smooth top: it is
    fitted to the few nodes around every local maximum, by nodal areas. What nodes scatter about the
    fit is the uncertainty. Nodes on an axis are left out, since u_r / r is poorly resolved there.
    At the rim the nodal value counts.
    """
    problem = reduction.problem
    pressure = nodal_pressure(problem, solution)
    if not np.any(pressure > 0):
        return Reading(0.0, missing="nothing touches, so that there is no pressure")
    usable = problem.areas > 0
    if reduction.scene.analysis.revolved:
        radius = np.abs(problem.coordinates[0])
        beside = usable & (radius > EQUAL * radius.max(initial=0.0))
        usable = beside if np.any(pressure[beside] > 0) else usable
    noise = solution.residual * float(np.linalg.norm(solution.reactions))
    found = []
    seen = np.where(usable, np.maximum(pressure, 0.0), 0.0)
    for top in (i for i in maxima(seen, largest_around(problem, seen)) if seen[i] > 0):
        peak = _fitted_top(problem, pressure, usable, top)
        uncertainty = peak.uncertainty + noise / float(problem.areas[top])
        near = around(problem, top)
        others = near[usable[near] & (near != top)]  # none around a contact that is alone
        drop = 1.0 - float(seen[others].min() / seen[top]) if len(others) else 1.0
        found.append(replace(peak, uncertainty=uncertainty, drop=drop))
    found.sort(key=lambda peak: -peak.value)
    return Reading(found[0].value, found[0].uncertainty, tuple(found))


def nodal_pressure(problem: InterfaceProblem, solution: Solution) -> np.ndarray:
    """Divide the normal forces by the nodal areas, (k,) [stress]; 0 at contacts without an area."""
    forces = solution.reactions[:, 0]
    return np.divide(forces, problem.areas, out=np.zeros(len(forces)), where=problem.areas > 0)


def neighbours(problem: InterfaceProblem) -> np.ndarray:
    """(k, m) numbers of the contacts nearest to each, itself among them."""
    places, node = _surroundings(problem)
    count = min(NEIGHBOURS[problem.dim], len(node))
    near = cKDTree(places.T).query(problem.chart.places.T, k=count)[1]
    return np.asarray(node[near.reshape(problem.contacts, count)])


def around(problem: InterfaceProblem, contact: int) -> np.ndarray:
    """Numbers of the contacts nearest to one, itself among them."""
    near = np.empty(0, dtype=int)
    for places, node, radius in _widening(problem, contact):
        far = np.linalg.norm(places - problem.chart.places[:, [contact]], axis=0)
        nearest = least(far, min(NEIGHBOURS[problem.dim], len(node)))
        near = node[nearest]
        if far[nearest].max() < radius and len(near) == NEIGHBOURS[problem.dim]:
            break
    return near


def maxima(sizes: np.ndarray, largest: np.ndarray) -> np.ndarray:
    """Numbers of the places that are the largest around, the largest first. Differences of the size
    of rounding do not change the order.
    """
    chosen = np.flatnonzero(sizes >= (1 - EQUAL) * largest)
    order = np.round(sizes[chosen] / (EQUAL * sizes.max(initial=0.0) or 1.0))
    return chosen[np.argsort(-order, kind="stable")[:MOST_PEAKS]]


def largest_around(problem: InterfaceProblem, sizes: np.ndarray) -> np.ndarray:
    """The largest size (k,) of each contact and its neighbours."""
    grid = problem.chart.grid
    if grid is None:
        return np.asarray(sizes[neighbours(problem)].max(axis=1))
    side = round(NEIGHBOURS[problem.dim] ** (1 / len(grid)))
    from scipy.ndimage import maximum_filter  # late, since it takes long to import

    return np.asarray(maximum_filter(sizes.reshape(grid), side, mode="nearest").ravel())


def _surroundings(problem: InterfaceProblem) -> tuple[np.ndarray, np.ndarray]:
    """Places (dim - 1, m) with mirror images, once around closed lines, and their contacts."""
    chart = problem.chart
    if chart.period is None:
        return chart.images()
    shifts = chart.period * np.array([-1.0, 0.0, 1.0])
    places = (chart.places[0] + shifts[:, None]).reshape(1, -1)
    return places, np.tile(np.arange(problem.contacts), 3)


def _widening(
    problem: InterfaceProblem, contact: int
) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Places around a contact as in _surroundings(), and the distance up to which there are no
    others: on a grid a window first, then all.
    """
    chart = problem.chart
    if chart.grid is not None and not any(chart.mirrored) and chart.period is None:
        at = np.unravel_index(contact, chart.grid)
        ranges = [np.arange(n)[max(i - WINDOW, 0) : i + WINDOW + 1] for i, n in zip(at, chart.grid)]
        node = np.ravel_multi_index(np.ix_(*ranges), chart.grid).ravel()
        places = chart.places[:, node]
        steps = np.ptp(places, axis=1) / [max(len(own) - 1, 1) for own in ranges]
        yield places, node, WINDOW * float(steps.min())
    yield *_surroundings(problem), np.inf


def _fitted_top(
    problem: InterfaceProblem, pressure: np.ndarray, usable: np.ndarray, top: int
) -> Peak:
    """The peak of the pressure near a node.

    Linear elements err by about h / m^2 of the pressure on the m-th ring around an axis: u_z / h^2
    grows there like log m, which nodes held at their gap cannot follow. Beside an axis fits are
    therefore widened twofold until the value changes by more than it did the last time: what the
    rings spoil fades with the width, and what the pressure lacks of an ellipse grows.
    """
    count, widest = FITTED[problem.dim], 0
    if np.any((problem.areas > 0) & ~usable):  # nodes on an axis, whose neighbours are poor, too
        widest = len(_surroundings(problem)[1])
    first = made = _fit_to(count, problem, pressure, usable, top)
    best, change = replace(made, uncertainty=made.value), np.inf
    while np.isfinite(made.uncertainty) and abs(made.value - best.value) <= change:
        if count > FITTED[problem.dim]:
            change = abs(made.value - best.value)
        share = FITTED[problem.dim] / count
        best, count = replace(made, uncertainty=made.uncertainty * share**0.5), 2 * count
        if count > widest:
            break
        made = _fit_to(count, problem, pressure, usable, top)
    return replace(best, contacts=first.contacts, size=first.size)


def _same_side(chart: Chart, contact: int) -> np.ndarray:
    """Whether contacts (k,) are on the same side as one of them, of a surface cut at corners."""
    k = chart.places.shape[1]
    if chart.cells is None:
        return np.ones(k, dtype=bool)
    place = chart.places[0] + 1j * chart.places[-1]  # one number sorts faster than two
    if len(np.unique(place)) == k:
        return np.ones(k, dtype=bool)
    mates = [chart.cells[[0, i]] for i in range(1, len(chart.cells))]
    piece = joined(np.concatenate(mates, axis=1), k)
    return np.asarray(piece == piece[contact])


def _fit_to(
    count: int, problem: InterfaceProblem, pressure: np.ndarray, usable: np.ndarray, top: int
) -> Peak:
    """As _fitted_top, from a quadratic fit to the square of the pressure at `count` contacts;
    infinitely uncertain if these are too few or not all pressed. A weight w in v^2 is w / (2 v) in
    v.
    """
    usable = usable & _same_side(problem.chart, top)
    loaded = usable & (pressure > 0)
    for places, node, radius in _widening(problem, top):
        dim, offset = len(places), places - problem.chart.places[:, [top]]
        distance = np.where(usable[node], np.linalg.norm(offset, axis=0), np.inf)
        near = least(distance, min(count, int(usable[node].sum())))
        # of a zone that is long, and narrower than this, the contacts within it
        if dim > 1 and not np.all(loaded[node[near]]) and np.sum(loaded[node]) >= count:
            near = least(np.where(loaded[node], distance, np.inf), count)
        reach = float(distance[near].max(initial=0.0))
        if BESIDE_REACH * reach <= radius and np.all(loaded[node[near]]):
            break
    nodal, pressed, areas = float(pressure[top]), pressure[node[near]], problem.areas[node[near]]
    size = reach / max(len(near) / 2, 1) ** (1 / dim) or float(problem.areas[top] ** (1 / dim))
    # with a first coordinate of 1
    powers = list(combinations_with_replacement(range(dim + 1), 2))
    place, own = problem.coordinates[:, top], np.unique(node[near])
    alone = Peak(nodal, np.inf, place, size, own, sources=np.array([top]))
    alone = replace(alone, slopes=1 / problem.areas[alone.sources])
    if len(near) <= len(powers) or not np.all(pressed > 0):
        return alone  # too few contacts to know
    terms = _terms(offset[:, near] / reach, powers)
    square, root = pressed**2, np.sqrt(areas / areas.mean())
    weights = np.linalg.pinv(terms * root[:, None]) * root
    fit = weights @ square
    left = float(np.linalg.norm((terms @ fit - square) * root))
    scatter = left / (len(near) - len(powers)) ** 0.5
    at_top = abs(float(fit[0]) - nodal**2) if usable[top] else 0.0
    # rings at an axis bear little
    at_top *= min(1.0, float(np.sqrt(problem.areas[top] / areas.mean())))
    beside = 0.0
    if dim > 1:
        some = usable[node] & ((distance <= BESIDE_REACH * reach) | (len(near) < NEIGHBOURS[3]))
        beside = _beside_open(places, pressure[node], some, near)
    doubt = max(scatter / 2, at_top / 2, BESIDE * beside * nodal**2)
    if _outermost(offset[:, near]):
        return replace(alone, uncertainty=doubt / (nodal or 1.0))
    inner = np.concatenate([terms[distance[near] <= reach / 2], _stationary(fit, powers, dim)])
    highest = inner[np.argmax(inner @ fit)]
    value = max(float(highest @ fit), 0.0) ** 0.5
    slopes = (highest @ weights) * pressed / areas / (value or np.inf)
    return replace(
        alone, value=value, uncertainty=doubt / (value or 1.0), sources=node[near], slopes=slopes
    )


def _beside_open(
    places: np.ndarray, pressure: np.ndarray, usable: np.ndarray, near: np.ndarray
) -> float:
    """The share of the contacts `near` (m,) of which a neighbour bears nothing."""
    away = np.linalg.norm(places[:, near, None] - places[:, None, usable], axis=0)
    count = min(NEIGHBOURS[3], away.shape[1])
    around = np.argpartition(away, count - 1, axis=1)[:, :count]
    return float(np.mean(np.any(pressure[usable][around] <= 0, axis=1)))


def _terms(offsets: np.ndarray, powers: list[tuple[int, int]]) -> np.ndarray:
    """The terms (m, powers) of a quadratic polynomial at m offsets (dim, m)."""
    terms = np.concatenate([np.ones((1, offsets.shape[1])), offsets])
    return np.array([terms[i] * terms[j] for i, j in powers]).T


def _stationary(fit: np.ndarray, powers: list[tuple[int, int]], dim: int) -> np.ndarray:
    """The terms (1, powers) of a quadratic at its top near the nodes, else (0, powers)."""
    H = np.zeros((dim + 1, dim + 1))
    for coefficient, (i, j) in zip(fit, powers):
        H[i, j] += coefficient / 2
        H[j, i] += coefficient / 2
    if np.any(np.linalg.eigvalsh(H[1:, 1:]) >= 0):
        return np.empty((0, len(powers)))
    at = -np.linalg.solve(H[1:, 1:], H[1:, :1])
    return _terms(at[:, np.linalg.norm(at, axis=0) <= 0.5], powers)


def at_rim(reduction: Reduction, solution: Solution) -> bool:
    """Whether the largest pressure is at the rim, where it may be infinite."""
    problem = reduction.problem
    top = int(np.argmax(nodal_pressure(problem, solution)))
    offsets = _surroundings(problem)[0] - problem.chart.places[:, [top]]
    return _outermost(offsets[:, least(np.linalg.norm(offsets, axis=0), 9)])


def _outermost(offsets: np.ndarray) -> bool:
    """Whether the nodes (dim - 1, m) around a node all lie on one side of it."""
    if len(offsets) == 1:
        return bool((offsets > 0).any() != (offsets < 0).any())
    near = offsets[:, np.any(offsets != 0, axis=0)]
    angles = np.sort(np.arctan2(near[1], near[0]))
    gaps = np.diff(np.append(angles, angles[:1] + 2 * np.pi))
    return bool(np.max(gaps, initial=0.0) > 0.8 * np.pi)
