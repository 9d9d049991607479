"""Where contact and stick end, below the element size: read from how the tractions fall to their bounds.

Next to an edge at distance c from the centre, the pressure (where contact ends by itself) and the slack of the
friction bound (where stick ends) are proportional to sqrt(c^2 - x^2). A straight line through the squares of values
inside, against x^2, meets zero at the edge.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from contactopt.problem import InterfaceProblem
from contactopt.scene import Scene
from contactopt.zone import contact_half_width, pressed, stick_half_width, stuck

FIT = 6  # distances from the centre that the line is fitted to
ROUGH = 3  # the outermost ones, which carry most of the discretisation error, left out
NEAREST = 3  # to fit where the squares are straight only next to the edge


def contact_edge(scene: Scene, problem: InterfaceProblem, reactions: np.ndarray) -> float:
    """Half-width of a contact zone about x = 0 [length]; where it is no such zone or ends at a corner, by its area."""
    inside = pressed(reactions)
    edge = _edge(problem, reactions[:, 0] / problem.areas, inside, ROUGH, FIT)
    return contact_half_width(scene, problem, reactions) if edge is None else edge


def stick_edge(scene: Scene, problem: InterfaceProblem, reactions: np.ndarray) -> float:
    """Half-width of a stick zone about x = 0 [length]; where it is no such zone, by its area.

    The slack counts towards the direction in which the nearest slipping node slips. Where contact ends at a corner, the
    pressure is singular: the slack relative to its bound stays smooth but not straight, so that the nearest values
    serve best.
    """
    touching, inside = pressed(reactions), stuck(reactions, problem.mu)
    slipping = touching & ~inside
    edge = None
    if slipping.any():
        bound, r_t = problem.mu * np.abs(reactions[:, 0]), reactions[:, 1:]
        nearest = np.flatnonzero(slipping)[KDTree(problem.coordinates.T[slipping]).query(problem.coordinates.T)[1]]
        size = np.maximum(np.linalg.norm(r_t[nearest], axis=1), 1e-300)
        slack = bound - np.sum(r_t * r_t[nearest], axis=1) / size
        if touching.all():
            edge = _edge(problem, slack / np.where(bound > 0, bound, 1.0), inside, 0, NEAREST)
        else:
            edge = _edge(problem, slack / problem.areas, inside, ROUGH, FIT)
    edge = stick_half_width(scene, problem, reactions) if edge is None else edge
    return min(edge, contact_edge(scene, problem, reactions))


def _edge(problem: InterfaceProblem, value: np.ndarray, inside: np.ndarray, skip: int, fit: int) -> float | None:
    """Where value^2, a line in distance^2 through `fit` distances of nodes inside, `skip` from the edge, is zero."""
    if inside.all() or not inside.any():
        return None
    distance = np.linalg.norm(problem.coordinates[: problem.dim - 1], axis=0)
    last, first = distance[inside].max(), distance[~inside].min()
    step = _spacing(problem.coordinates, distance, last)
    if abs(first - last) > 1.5 * step:  # not a zone about the centre
        return None
    rings = _rings(distance[inside], step, skip + fit)
    skip = max(0, min(skip, len(rings) - fit))
    outer, inner = rings[skip], rings[min(skip + fit, len(rings)) - 1]
    near = inside & (distance <= outer + 1e-5 * step) & (distance >= inner - 1e-5 * step)
    if np.ptp(distance[near]) <= 1e-5 * step:
        return None
    slope, height = np.polyfit(distance[near] ** 2, value[near] ** 2, 1)
    if slope >= 0 or height <= 0:
        return None
    return float(np.clip(np.sqrt(-height / slope), last - step / 2, last + 1.5 * step))


def _spacing(coordinates: np.ndarray, distance: np.ndarray, edge: float) -> float:
    """Distance between neighbouring nodes next to the edge."""
    near = np.argsort(np.abs(distance - edge))[:5]
    return float(np.median(KDTree(coordinates.T).query(coordinates.T[near], k=2)[0][:, 1]))


def _rings(distance: np.ndarray, step: float, count: int) -> list[float]:
    """The largest distances, at most `count`, each about a step or more below the one before."""
    rings = [float(distance.max())]
    while len(rings) < count and np.any(below := distance < rings[-1] - 0.75 * step):
        rings.append(float(distance[below].max()))
    return rings
