"""Where contact and stick end, below the element size: read from how tractions and slip fall to zero.

Next to an edge at distance c from the centre, the pressure (where contact ends by itself) and the slack of the
friction bound (where stick ends) are proportional to sqrt(c^2 - x^2), and the slip beyond c to (x - c)^(3/2). A straight
line through the squares of values inside, against x^2, or through slip^(2/3), against x, meets zero at the edge.

A discrete edge is at a node, and jumps from node to node as the exact one moves; the tractions and slips of the nodes
next to it jump with it, those an element further hardly do. So the lines leave the nearest ones out: what they read then falls
smoothly with the element size, as the estimate of an error needs it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from contactopt.analysis.zone import contact_half_width, pressed, stick_half_width, stuck
from contactopt.problem import InterfaceProblem
from contactopt.scenes.scene import Scene

Window = tuple[int, int]  # distances from the centre next to the edge: how many are left out, how many are fitted

SMOOTH: Window = 3, 6  # where contact ends by itself: the outermost carry most of the discretisation error
NEAR: Window = 1, 2  # where the values are straight only next to the edge


def contact_edge(scene: Scene, problem: InterfaceProblem, reactions: np.ndarray) -> float:
    """Half-width of a contact zone about x = 0 [length]; where it is no such zone or ends at a corner, by its area."""
    edge, pressure = _Edge.of(problem, pressed(reactions)), reactions[:, 0] / problem.areas
    read = None if edge is None else edge.inner(pressure, SMOOTH)
    if edge is None or read is None:
        return contact_half_width(scene, problem, reactions)
    return edge.clip(read)


def stick_edge(
    scene: Scene, problem: InterfaceProblem, reactions: np.ndarray, slip: np.ndarray | None = None
) -> tuple[float, float]:
    """Half-width of a stick zone about x = 0 and its uncertainty [length]; where it is no such zone, by its area.

    slip  (k, dim - 1) of the step that led to the reactions [length], if known
    The slack counts towards the direction in which the nearest slipping node slips. Where contact ends at a corner, the
    pressure is singular: the slack relative to its bound stays smooth but not straight, so that near values serve best, and
    the mean of what the slack inside and the slip outside read, which is as uncertain as they differ. Small steps of a path
    slip otherwise: their reading, off by more than an element, is left out.
    """
    touching, inside = pressed(reactions), stuck(reactions, problem.mu)
    found, edge = list[float](), _Edge.of(problem, inside)
    if edge is not None and np.any(touching & ~inside):
        bound, r_t = problem.mu * np.abs(reactions[:, 0]), reactions[:, 1:]
        slack = bound - np.sum(r_t * _directions(problem, r_t, touching & ~inside), axis=1)
        if not touching.all():
            read = edge.inner(slack / problem.areas, SMOOTH)
            found = [] if read is None else [edge.clip(read)]
        else:
            reads = [edge.inner(slack / np.where(bound > 0, bound, 1.0), NEAR)]
            if slip is not None:
                reads.append(edge.outer(np.linalg.norm(slip, axis=1), NEAR))
            found = [read for read in reads if read is not None and edge.clip(read) == read]
    width = float(np.mean(found)) if found else stick_half_width(scene, problem, reactions)
    return min(width, contact_edge(scene, problem, reactions)), float(np.ptp(found)) / 2 if found else 0.0


def _directions(problem: InterfaceProblem, r_t: np.ndarray, slipping: np.ndarray) -> np.ndarray:
    """Unit vectors (k, dim - 1) of friction at the slipping node nearest to each node."""
    x = problem.coordinates.T
    nearest = r_t[np.flatnonzero(slipping)[KDTree(x[slipping]).query(x)[1]]]
    return np.asarray(nearest / np.maximum(np.linalg.norm(nearest, axis=1), 1e-300)[:, None])


@dataclass(frozen=True, eq=False)
class _Edge:
    """Between the last distance inside a zone about the centre and the first outside; step: of the nodes next to it."""

    distance: np.ndarray
    inside: np.ndarray
    step: float

    @classmethod
    def of(cls, problem: InterfaceProblem, inside: np.ndarray) -> _Edge | None:
        """None where the nodes inside are none, all, or no zone about the centre."""
        if inside.all() or not inside.any():
            return None
        distance = np.linalg.norm(problem.coordinates[: problem.dim - 1], axis=0)
        step = _spacing(problem.coordinates, distance, distance[inside].max())
        zone = abs(distance[~inside].min() - distance[inside].max()) <= 1.5 * step
        return cls(distance, inside, step) if zone else None

    def inner(self, value: np.ndarray, window: Window) -> float | None:
        """Where value^2, a line in distance^2 through values inside, is zero."""
        depth = self.distance[self.inside].max() - self.distance
        square = self._zero(self.distance**2, value**2, self.inside, depth, window)
        return None if square is None or square <= 0 else float(np.sqrt(square))

    def outer(self, value: np.ndarray, window: Window) -> float | None:
        """Where value^(2/3), a line in the distance through values outside, is zero."""
        depth = self.distance - self.distance[~self.inside].min()
        return self._zero(self.distance, value ** (2 / 3), ~self.inside, depth, window)

    def clip(self, edge: float) -> float:
        """To less than an element from where the nodes say it is."""
        last = self.distance[self.inside].max()
        return float(np.clip(edge, last - self.step / 2, last + 1.5 * self.step))

    def _zero(self, x: np.ndarray, y: np.ndarray, side: np.ndarray, depth: np.ndarray, window: Window) -> float | None:
        """Of a line through y(x) at the rings in the window on one side; None if it does not fall towards the edge."""
        rings = _rings(depth[side], self.step, sum(window))
        skip = max(0, min(window[0], len(rings) - window[1]))
        fitted = rings[skip : skip + window[1]]
        near = side & (depth >= fitted[0] - 1e-5 * self.step) & (depth <= fitted[-1] + 1e-5 * self.step)
        if np.ptp(depth[near]) <= 1e-5 * self.step:
            return None
        slope, height = np.polyfit(x[near], y[near], 1)
        falls = (slope < 0) == bool(self.inside[near][0])
        return float(-height / slope) if slope and falls else None


def _spacing(coordinates: np.ndarray, distance: np.ndarray, edge: float) -> float:
    """Distance between neighbouring nodes next to the edge."""
    near = np.argsort(np.abs(distance - edge))[:5]
    return float(np.median(KDTree(coordinates.T).query(coordinates.T[near], k=2)[0][:, 1]))


def _rings(depth: np.ndarray, step: float, count: int) -> list[float]:
    """The least depths, at most `count`, each about a step or more beyond the one before."""
    rings = [float(depth.min())]
    while len(rings) < count and np.any(beyond := depth > rings[-1] + 0.75 * step):
        rings.append(float(depth[beyond].min()))
    return rings
