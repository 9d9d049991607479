"""The connected patches of a zone on a contact surface, and the ends at which each of them is read.

On a contact line a patch is a run of neighbouring contacts, in general position: off the origin of
the chart, reaching the end of the surface, across the seam of a closed curve. On a surface it is a
disc about its centre, seen as one end, or an ellipse: lengths along its axes are scaled so that it
becomes the disc of the same area.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contactopt.defaults import EQUAL, ROUNDED
from contactopt.problem import InterfaceProblem
from contactopt.problem.chart import Chart
from contactopt.readings.constants import RING, ROUNDNESS

# distances that differ by less than this fraction of an element belong to one ring of nodes
SAME = 1e-5

# rings of nodes next to the edge: how many are left out, how many are fitted
Window = tuple[int, int]


@dataclass(frozen=True)
class Ends:
    """Where a patch begins and ends along its line [length]; `copies` of it make the whole zone.

    step  distance of neighbouring contacts next to its end [length]
    """

    first: float
    last: float
    copies: int
    uncertainty: float
    step: float


@dataclass(frozen=True, eq=False)
class End:
    """The contacts on one side of a patch's centre, up to the next patch.

    contact   (m,) their indices;  distance  (m,) from the centre [length];  inside  (m,) whether
              they belong to the patch
    step      distance of neighbouring nodes next to the edge [length]
    free      whether the patch ends before the surface does on the other side too: only then are
              values symmetric about its centre, in the mean, and their squares straight far from
              the edge
    """

    contact: np.ndarray
    distance: np.ndarray
    inside: np.ndarray
    step: float
    free: bool = True

    def inner(self, value: np.ndarray, window: Window) -> float | None:
        """The zero [length] of value^2, a line in distance^2 through values inside; or None."""
        depth = self.distance[self.inside].max() - self.distance
        square = self._zero(self.distance**2, value[self.contact] ** 2, self.inside, depth, window)
        return float(np.sqrt(square)) if square and square > 0 else None

    def outer(self, value: np.ndarray, window: Window) -> float | None:
        """The zero [length] of value^(2/3), a line in the distance, through outer values."""
        depth = self.distance - self.distance[~self.inside].min()
        outside, root = ~self.inside, value[self.contact] ** (2 / 3)
        return self._zero(self.distance, root, outside, depth, window)

    def clip(self, edge: float) -> float:
        """The edge, brought to less than an element from where the nodes say that it is."""
        last = self.distance[self.inside].max()
        return float(np.clip(edge, last - self.step / 2, last + 1.5 * self.step))

    def _zero(
        self, x: np.ndarray, y: np.ndarray, side: np.ndarray, depth: np.ndarray, window: Window
    ) -> float | None:
        """The zero of the line through y(x) at the rings on one side; None if it does not fall."""
        rings = _rings(depth[side], self.step, sum(window))
        skip = max(0, min(window[0], len(rings) - window[1]))
        fitted = rings[skip : skip + window[1]]
        slack = SAME * self.step
        near = side & (depth >= fitted[0] - slack) & (depth <= fitted[-1] + slack)
        if np.ptp(depth[near]) <= slack:
            return None
        slope, height = np.polyfit(x[near], y[near], 1)
        falls = (slope < 0) == bool(self.inside[near][0])
        return float(-height / slope) if slope and falls else None


@dataclass(frozen=True, eq=False)
class Patch:
    """A patch with the contacts around it, up to the next patch.

    contact   (m,) indices;  place  (m,) along the line, or from the centre of a disc [length];
              inside  (m,) mask
    centred   whether the centre is at the place 0 for sure: on a plane of symmetry, or that of a
              disc
    copies    how many images of the patch make the whole zone
    chart     of all contacts, from which the distance of neighbours is taken
    stretch   by how much distances grow at most where an ellipse becomes a disc
    """

    contact: np.ndarray
    place: np.ndarray
    inside: np.ndarray
    centred: bool
    copies: int
    chart: Chart
    stretch: float = 1.0

    def measure(self, read: Callable[[End], tuple[float, float] | None]) -> Ends | None:
        """The ends of the patch by the readings of each from its centre, by iteration, or None."""
        x = self.place[self.inside]
        first, last, uncertainty = float(x.min()), float(x.max()), 0.0
        if self.centred:
            found = self._read(1.0, 0.0, read)
            if found is None:
                return None
            step = self.step(self.contact, self.place, last)
            return Ends(-found[0], found[0], self.copies, found[1], step)
        for _ in range(20):  # of that iteration, which gains about two digits in each
            centre = (first + last) / 2
            left, right = self._read(-1.0, centre, read), self._read(1.0, centre, read)
            if left is None or right is None:
                return None
            before, first, last = (first, last), centre - left[0], centre + right[0]
            uncertainty = (left[1] + right[1]) / 2
            if max(abs(first - before[0]), abs(last - before[1])) <= ROUNDED * (last - first):
                break
        step = self.step(self.contact, self.place, last)
        return Ends(first, last, self.copies, uncertainty, step)

    def _read(
        self, sign: float, centre: float, read: Callable[[End], tuple[float, float] | None]
    ) -> tuple[float, float] | None:
        """Distance of one end from the centre and its uncertainty [length]."""
        distance = sign * (self.place - centre) if not self.centred else np.abs(self.place)
        # A centre that rounding moves off a node must not take it from either side.
        side = distance >= -SAME * np.ptp(self.place)
        contact, distance, inside = self.contact[side], distance[side], self.inside[side]
        if not inside.any():
            return None
        last = float(distance[inside].max())
        step = self.step(contact, distance, last)
        if inside.all():
            return last, step / 2
        free = self.centred or not bool(self.inside[~side].all())
        return read(End(contact, distance, inside, step, free))

    def step(self, contact: np.ndarray, distance: np.ndarray, edge: float) -> float:
        """Distance between neighbouring contacts next to an edge at that distance [length]."""
        points, grid = self.chart.places, self.chart.grid
        if grid is not None:
            return self.stretch * float(np.min(np.ptp(points, axis=1) / (np.array(grid) - 1)))
        near = contact[least(np.abs(distance - edge), 5)]
        squares = [np.sum((points - points[:, [i]]) ** 2, axis=0) for i in near]
        found = np.sqrt(np.median([np.partition(apart, 1)[1] for apart in squares]))
        return self.stretch * float(found)


def least(values: np.ndarray, count: int) -> np.ndarray:
    """(count,) the places of the least of many values in order, without sorting all."""
    if count < len(values):
        some = np.flatnonzero(values <= np.partition(values, count - 1)[count - 1])
        return np.asarray(some[np.argsort(values[some], kind="stable")[:count]])
    return np.argsort(values, kind="stable")


def patches_of(problem: InterfaceProblem, inside: np.ndarray, weights: np.ndarray) -> list[Patch]:
    """The connected patches of a zone along a line in order, on a surface one disc or none."""
    if problem.dim == 3:
        disc = _disc(problem, inside, weights)
        return [] if disc is None else [disc]
    chart = problem.chart
    order = chart.order()
    place, within = chart.places[0, order], inside[order]
    # the line begins where the longest way leads through contacts outside
    if chart.period is not None:
        begin = _longest_run(~within)
        place = np.concatenate([place[begin:], place[:begin] + chart.period])
        order, within = np.roll(order, -begin), np.roll(within, -begin)
    apart = _apart(chart, order)
    piece = np.cumsum(np.append(False, apart))
    starts = np.flatnonzero(within & np.append(True, ~within[:-1] | apart))
    stops = np.flatnonzero(within & np.append(~within[1:] | apart, True))
    found = []
    for i in range(len(starts)):
        last = starts[i + 1] if i + 1 < len(starts) else len(order)
        part = np.arange(stops[i - 1] + 1 if i else 0, last)
        part = part[piece[part] == piece[starts[i]]]
        reaches = chart.mirrored[0] and _reaches_origin(place, place[starts[i] : stops[i] + 1])
        copies = 1 if reaches or not chart.mirrored[0] else 2
        found.append(Patch(order[part], place[part], within[part], reaches, copies, chart))
    return found


def _apart(chart: Chart, order: np.ndarray) -> np.ndarray:
    """(k - 1,) whether the line has a hole between contacts that follow each other in an order."""
    if chart.cells is None:
        return np.zeros(len(order) - 1, dtype=bool)
    first, second = np.sort(np.argsort(order)[chart.cells], axis=0)
    return np.asarray(~np.isin(np.arange(len(order) - 1), first[second == first + 1]))


def _reaches_origin(place: np.ndarray, patch: np.ndarray) -> bool:
    """Whether a patch and its mirror image are one: only a contact on the plane between them."""
    plane = EQUAL * np.abs(place).max()
    off_plane = np.abs(place[np.abs(place) > plane])
    nearest = np.abs(patch).min()
    touches = np.abs(place).min() <= plane
    return bool(touches and (nearest <= plane or nearest <= off_plane.min()))


def _longest_run(mask: np.ndarray) -> int:
    """Index in the middle of the longest run of true values around a closed line."""
    n, twice = len(mask), np.concatenate([mask, mask])
    # the length of the run that ends at each place, n at most
    places = np.arange(2 * n)
    length = places - np.maximum.accumulate(np.where(twice, -1, places))
    last = int(np.argmax(np.minimum(length, n)))
    return int(last - length[last] // 2) % n


def _disc(problem: InterfaceProblem, inside: np.ndarray, weights: np.ndarray) -> Patch | None:
    """The contacts inside as a disc about their centre, or an ellipse that becomes one; or None."""
    x = _from_centre(problem, inside, weights)
    for scaled, stretch in ((x, 1.0), _as_disc(problem, x, inside, weights)):
        distance = np.linalg.norm(scaled, axis=0)
        contact = np.arange(problem.contacts)
        disc = Patch(contact, distance, inside, True, 1, problem.chart, stretch)
        step = disc.step(contact, distance, float(distance[inside].max()))
        if abs(distance[~inside].min() - distance[inside].max()) <= ROUNDNESS * step:
            return disc
    return None


def is_round(problem: InterfaceProblem, inside: np.ndarray) -> bool:
    """Whether a zone on a surface, scaled to equal axes, is more an ellipse than a rectangle."""
    areas = problem.areas
    x, own = _from_centre(problem, inside, areas)[:, inside], areas[inside]
    scaled, _ = _as_disc(problem, x, slice(None), own)
    disc = np.sqrt(own.sum() / np.pi)
    return bool(np.linalg.norm(scaled, axis=0).max() <= 1.12 * disc)  # a disc has 1


def _from_centre(problem: InterfaceProblem, inside: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(2, k) places from the centre of gravity of a zone, which planes of symmetry hold."""
    x, w = problem.chart.places, weights[inside]
    centre = np.where(problem.chart.mirrored, 0.0, x[:, inside] @ w / w.sum())
    return np.asarray(x - centre[:, None])


def _as_disc(
    problem: InterfaceProblem, x: np.ndarray, inside: np.ndarray | slice, weights: np.ndarray
) -> tuple[np.ndarray, float]:
    """Places (2, k) scaled at equal area to the moments of a disc, and the largest factor."""
    moments = (x[:, inside] * weights[inside]) @ x[:, inside].T
    if any(problem.chart.mirrored):
        moments = np.diag(np.diag(moments))
    values, axes = np.linalg.eigh(moments)
    if values[0] <= ROUNDED * values[1]:
        return x, 1.0
    factors = (values[0] * values[1]) ** 0.25 / np.sqrt(values)
    return np.asarray(axes * factors @ axes.T @ x), float(factors[0])


def _rings(depth: np.ndarray, step: float, count: int) -> list[float]:
    """The least depths, at most `count`, each about a step or more beyond the one before."""
    rings = [float(depth.min())]
    while len(rings) < count and np.any(beyond := depth > rings[-1] + RING * step):
        rings.append(float(depth[beyond].min()))
    return rings
