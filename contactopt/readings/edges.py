"""Where contact and stick end, below the element size: the one definition of the half-width of a
zone.

Next to an edge at distance c from the centre of a zone, the pressure (where contact ends by itself)
and the slack of the friction bound (where stick ends) are proportional to sqrt(c^2 - x^2), and the
slip beyond c to (x - c)^(3/2). A straight line through the squares of values inside, against x^2,
or through slip^(2/3), against x, meets zero at the edge.

The nodes at the edge of a discrete zone jump as the exact edge moves, and so do the values at the
nodes next to it. The values an element further hardly do. The lines therefore leave the nearest
nodes out: what they read then falls smoothly with the element size, as the estimate of an error
needs it.

The force of a node is a mean of the traction around it, weighted by the shape function of the node.
Divided by the nodal area, it is the traction where that function has its centroid. In a graded mesh
of linear elements this is beside the node, by a share of the element size.

A zone is read at each of its ends (contactopt.readings.patches), wherever it lies on the contact
surface. Its half-width is that of the strip, or the radius of the disc, with the same area; of a
zone nearer to a rectangle than to an ellipse, half of the side of the square with the same area.
Where an end cannot be read, the nodal areas are counted.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from scipy.spatial import KDTree

from contactopt.coupling.reduction import Reduction
from contactopt.defaults import EQUAL
from contactopt.meshes.cells import rim
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.contact_status import ContactStatus, contact_status
from contactopt.readings.constants import (
    FAR,
    FITTED_WITHIN,
    HIGHEST,
    NEAR,
    OUTER,
    SETTLED,
    SHARES,
    SINGULAR,
    SMOOTH,
    SPARE,
    STEPS,
    WITHIN,
)
from contactopt.readings.patches import End, is_round, patches_of
from contactopt.readings.peaks import Peak, Reading, neighbours
from contactopt.scenes.scene import Scene

Read = tuple[float, float]  # a distance and its uncertainty
Reader = Callable[[End], Read | None]


def contact_area(
    scene: Scene, problem: InterfaceProblem, reactions: np.ndarray, width: float
) -> float:
    """The area on which one pair of surfaces touches, with all mirror images, around the axis or
    over the thickness [length^2]: of the zone whose half-width (contact_edge) is read, or of the
    nodes that touch.
    """
    touching = contact_status(problem, reactions).touching
    counted = float(problem.areas[touching].sum())
    if width == _counted(scene, problem, touching) or _is_ring(scene, problem):
        return counted
    return (
        float(np.pi * width**2) if scene.dim == 3 else scene.analysis.area(width, scene.thickness)
    )


def is_level(problem: InterfaceProblem, frames: np.ndarray, reactions: np.ndarray) -> bool:
    """Whether a zone in space has a half-width: not where it bends around a body."""
    normals = frames[contact_status(problem, reactions).touching, 0]
    if problem.dim == 2 or not len(normals):
        return True
    mean = normals.mean(axis=0)
    return bool(np.min(normals @ mean) > 0.9 * np.linalg.norm(mean))  # least cosine with the mean


def _is_ring(scene: Scene, problem: InterfaceProblem) -> bool:
    """Whether an axisymmetric contact surface does not reach the axis."""
    radius = np.abs(problem.coordinates[0])
    return scene.analysis.revolved and bool(np.min(radius) > EQUAL * np.max(radius))


def contact_edge(scene: Scene, problem: InterfaceProblem, reactions: np.ndarray) -> float:
    """The half-width of the contact zone [length], as contact_zone() reads it."""
    return contact_zone(scene, problem, reactions)[0]


def contact_zone(
    scene: Scene, problem: InterfaceProblem, reactions: np.ndarray
) -> tuple[float, float]:
    """Read the half-width of the contact zone of one pair, and its uncertainty [length]; 0 without
    contact.

    Where contact ends by itself on a line, its edge is the zero of a root times a polynomial that
    fit the outer pressure without the last two nodes; on a surface, or beside a corner, that of a
    straight line through p^2 against x^2 next to the edge. Where every node touches, the edge is
    that of the surface. A disc counts only with the area of the zone to within an element, else
    nodal areas do. The uncertainty is half of what fit and line differ, at least a share of an
    element; of nodal areas that of the nodes at the edge.
    """
    touching = contact_status(problem, reactions).touching
    pressure = reactions[:, 0] / problem.areas

    def read(end: End) -> Read | None:
        end = _at_centroids(end, scene)
        line = end.inner(pressure, SMOOTH)
        line = None if line is None else end.clip(line)
        if problem.dim == 2 and end.free:
            edge = _end_of_pressure(end, pressure, problem.areas)
            if edge is not None:
                return edge, end.step / 2 if line is None else abs(edge - line) / 2
        return None if line is None else (line, end.step / 2)

    least = FITTED_WITHIN if problem.dim == 2 else WITHIN
    width, doubt = _half_width(scene, problem, touching, np.abs(reactions[:, 0]), read, least)
    return width, 0.0 if touching.all() and _ends_at_corners(problem, pressure) else doubt


def _ends_at_corners(problem: InterfaceProblem, pressure: np.ndarray) -> bool:
    """Whether pressure on a line does not fall towards its ends: there the surface ends."""
    if problem.dim == 3 or len(pressure) < 2:
        return False
    mirrored, places = problem.chart.mirrored[0], problem.chart.places[0]
    order = np.argsort(np.abs(places) if mirrored else places)
    ends = [order[-2:]] if mirrored else [order[-2:], order[1::-1]]
    return all(pressure[last] >= pressure[before] for before, last in ends)


def stick_edge(
    scene: Scene,
    problem: InterfaceProblem,
    reactions: np.ndarray,
    slip: np.ndarray | None = None,
    zone: Read | None = None,
) -> Read:
    """Read the half-width of the stick zone of one pair, and its uncertainty [length]; `zone` is
    that of contact, where known.

    The edge is where the slack of the friction bound is zero, measured in the direction in which
    the nearest node slips. Where contact ends at a corner there are two readings: one extrapolates
    the slack over its bound from inside, the other the `slip` (k, dim - 1) of the last step from
    outside. The edge is their mean, and half their distance is its uncertainty. A reading that is
    off by more than an element is left out.
    """
    status = contact_status(problem, reactions)
    if not status.stick.any():  # or on less than what belongs to one contact
        least = problem.areas[problem.law.rough & status.touching]
        area = float(least.max(initial=0.0))
        return 0.0, scene.analysis.half_width(area, scene.thickness)
    contact, uncertain = zone or contact_zone(scene, problem, reactions)
    if not status.slip.any():
        return contact, uncertain
    bound, r_t = problem.law.bound_along(reactions), reactions[:, 1:]
    slack = bound - np.sum(r_t * _directions(problem, r_t, status), axis=1)
    relative = slack / np.where(bound > 0, bound, 1.0)
    distance = None if slip is None else np.linalg.norm(slip, axis=1)

    def read(end: End) -> Read | None:
        if status.open[end.contact].any():  # contact ends by itself beyond the stick zone
            end = _at_centroids(end, scene)
            edge = end.inner(slack / problem.areas, SMOOTH)
            if edge is None:
                return None
            other = end.inner(slack / problem.areas, NEAR)
            apart = end.step if other is None else abs(end.clip(edge) - end.clip(other))
            return end.clip(edge), apart / 2
        found = [end.inner(relative, NEAR)]
        if distance is not None:
            found.append(end.outer(distance, NEAR))
        edges = [edge for edge in found if edge is not None and end.clip(edge) == edge]
        if not edges:
            return None
        return float(np.mean(edges)), float(np.ptp(edges) if len(edges) > 1 else end.step) / 2

    width, uncertainty = _half_width(scene, problem, status.stick, problem.areas, read, WITHIN)
    return min(width, contact), uncertainty


def _half_width(
    scene: Scene,
    problem: InterfaceProblem,
    inside: np.ndarray,
    weights: np.ndarray,
    read: Reader,
    least: float,
) -> tuple[float, float]:
    """Half-width of the zone `inside` from readings of its ends, and its uncertainty."""
    area, counted = float(problem.areas[inside].sum()), _counted(scene, problem, inside)
    if ring := _is_ring(scene, problem):  # half of the width of the ring, along its section
        around = 2 * np.pi * np.abs(problem.coordinates[0])
        counted = float((problem.areas / around)[inside].sum()) / 2
    nodes = inside.sum() * 2.0 ** sum(problem.chart.mirrored)
    # of the nodes at the edge
    share = (1 / nodes if problem.dim == 2 else (np.pi / nodes) ** 0.5) if nodes else 0.0
    coarse = counted, float(counted * min(1.0, share)) if nodes else 0.0
    if inside.all() or not inside.any():
        return coarse
    found = [patch.measure(read) for patch in patches_of(problem, inside, weights)]
    ends = [patch for patch in found if patch is not None and patch.last > patch.first]
    if not found or len(ends) < len(found):  # not read, or read beyond the middle
        return coarse
    long = problem.dim == 3 and abs(ends[0].last - np.sqrt(area / np.pi)) > ends[0].step
    if long or (problem.dim == 3 and _reaches_rim(problem, inside)):  # no disc
        return coarse
    uncertainty = sum(patch.copies * max(patch.uncertainty, least * patch.step) for patch in ends)
    if scene.analysis.revolved and not ring:  # between two distances from the axis, or a disc
        squares = (abs(p.last**2 - (p.first**2 if p.first > 0 or p.last < 0 else 0)) for p in ends)
        return float(np.sqrt(sum(squares))), uncertainty
    return sum(patch.copies * (patch.last - patch.first) / 2 for patch in ends), uncertainty


def _reaches_rim(problem: InterfaceProblem, inside: np.ndarray) -> bool:
    """Whether a zone reaches an end of its surface that is no plane of symmetry."""
    if problem.chart.cells is None:
        return False
    sides, places = rim(problem.chart.cells), problem.chart.places
    cut = np.abs(places) <= EQUAL * np.ptp(places, axis=1)[:, None]
    cut &= np.array(problem.chart.mirrored)[:, None]
    return bool(np.any(inside[sides] & ~np.all(cut[:, sides], axis=1).any(axis=0)))


def _counted(scene: Scene, problem: InterfaceProblem, inside: np.ndarray) -> float:
    """The half-width of a zone [length] by its nodal areas alone."""
    area = float(problem.areas[inside].sum())
    if problem.dim == 3 and inside.any() and is_round(problem, inside):
        return float(np.sqrt(area / np.pi))
    return scene.analysis.half_width(area, scene.thickness)


def _at_centroids(end: End, scene: Scene) -> End:
    """The end on a line moved to centroids of shape functions: (m - l) / 3 at lengths l and m."""
    if scene.degree != 1 or scene.dim == 3:
        return end
    order = np.argsort(end.distance)
    steps, centroids = np.diff(end.distance[order]), end.distance.copy()
    centroids[order[1:-1]] += np.diff(steps) / 3
    return replace(end, distance=centroids)


def _end_of_pressure(end: End, pressure: np.ndarray, areas: np.ndarray) -> float | None:
    """The zero of sqrt(c^2 - x^2) times a polynomial, best fitted to the pressure, or None."""
    last = end.distance[end.inside].max()
    if np.sum(end.inside) <= OUTER:  # one contact alone may be at the centre
        return None
    x, p = end.distance / last, pressure[end.contact]
    innermost, far = np.sort(x[end.inside])[-OUTER:].min(), 1 + FAR * end.step / last
    found = [(end.step / last, np.nan)]
    for share in SHARES:
        fitted = end.inside & (x >= share) & (x < innermost)
        weights = np.sqrt(areas[end.contact[fitted]] / areas[end.contact].max())
        spare = len(np.unique(x[fitted])) - SPARE
        for degree in range(min(spare, HIGHEST + 1)):
            found.append(_fitted_root(x[fitted], p[fitted] / p[fitted].max(), weights, degree, far))
    edge = min(found)[1]
    return None if np.isnan(edge) else float(last * edge)


def _fitted_root(
    x: np.ndarray, p: np.ndarray, weights: np.ndarray, degree: int, far: float
) -> tuple[float, float]:
    """The error of c, and c, of the best fit (Gauss, Newton); infinity and nan beyond `far`."""
    none, square = (np.inf, np.nan), (1 + far) ** 2 / 4
    basis = chebvander(2 * (x - x.min()) / np.ptp(x) - 1, degree) * weights[:, None]
    fit = np.linalg.lstsq(basis * np.sqrt(square - x**2)[:, None], p * weights)[0]
    for _ in range(STEPS):
        root = np.sqrt(square - x**2)[:, None]
        q, r = np.linalg.qr(np.hstack([basis * root, (basis @ fit)[:, None] / (2 * root)]))
        if np.abs(np.diag(r)).min() < SINGULAR:
            return none
        known = q.T @ (p * weights)
        fit, step = np.split(np.linalg.solve(r, known), [-1])
        new = max(square + float(step[0]), (square + float(x.max()) ** 2) / 2)
        if not new < far**2:
            return none
        settled, square = abs(new - square) <= SETTLED * square, new
        if settled:
            rest = np.sum((p * weights - q @ known) ** 2) / (len(x) - degree - 2)
            edge = float(np.sqrt(square))
            return float(np.sqrt(rest)) / abs(r[-1, -1]) / (2 * edge), edge
    return none


def _directions(problem: InterfaceProblem, r_t: np.ndarray, status: ContactStatus) -> np.ndarray:
    """Unit vectors (k, dim - 1) of friction, in stick of the nearest slip; zero where open."""
    x, slipping = problem.coordinates.T, status.slip
    nearest = np.where(slipping[:, None], r_t, 0.0)
    found = KDTree(x[slipping]).query(x[status.stick])[1]
    nearest[status.stick] = r_t[slipping][found]
    return np.asarray(nearest / np.maximum(np.linalg.norm(nearest, axis=1), 1e-300)[:, None])


def width_reading(reduction: Reduction, solution: Solution) -> Reading:
    """The half-width of the contact zone of a reduction with one pair of surfaces [length]."""
    problem, r = reduction.problem, solution.reactions
    touching = contact_status(problem, r).touching
    missing = "" if touching.any() else "nothing touches, so that the zone of contact has no width"
    zone = contact_zone(reduction.scene, problem, r)
    return Reading(*zone, _edges_of(problem, touching), missing)


def _edges_of(problem: InterfaceProblem, inside: np.ndarray) -> tuple[Peak, ...]:
    """The contacts on both sides of a zone's edge, as one peak; none where the zone has no edge."""
    across = inside[neighbours(problem)] != inside[:, None]
    edge = np.flatnonzero(np.any(across, axis=1))
    return (Peak(0.0, 0.0, problem.coordinates[:, edge[0]], 0.0, edge),) if len(edge) else ()


def stick_width(reduction: Reduction, solution: Solution, zone: Read) -> Read:
    """Half-width of the stick zone of a single pair, and its uncertainty [length]."""
    problem, r = reduction.problem, solution.reactions
    if not problem.law.sticking(r).any():
        return stick_edge(reduction.scene, problem, r)
    slip = reduction.moved(solution)[:, 1:]
    return stick_edge(reduction.scene, problem, r, slip, zone)


def stick_reading(reduction: Reduction, solution: Solution) -> Reading:
    """The half-width of the stick zone over that of contact [-]."""
    edge = width_reading(reduction, solution)
    if edge.missing:
        return replace(edge, value=0.0)
    stick, uncertainty = stick_width(reduction, solution, (edge.value, edge.uncertainty))
    status = contact_status(reduction.problem, solution.reactions)
    ratio, own = stick / edge.value, uncertainty / edge.value
    if status.slip.any() and status.stick.any():
        own += ratio * edge.uncertainty / edge.value
    return Reading(ratio, own, (*_edges_of(reduction.problem, status.stick), *edge.peaks))
