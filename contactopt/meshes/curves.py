"""The smooth outline that a plane mesh stands for: straight pieces, arcs, and what is between them.

The outline of a body is a chain of nodes. It is cut at corners; between them runs of nodes on one
line are straight, runs on one circle are arcs, as far as the rounding of the coordinates allows to
say. An edge that belongs to no run turns at its ends into the directions of the runs beside it, or
of the circle through a node and its two neighbours. So straight pieces stay straight, and no edge
feels what is beyond its neighbours.

Every edge of length c carries the curve

    y(s) = (1 - s/c) y_a(s) + s/c y_b(s)        over its chord, 0 <= s <= c,

where y_a and y_b are arcs through both ends, with the curvatures k_a and k_b: an arc if these are
the same. The blended arcs lie between the two and do not overshoot; neighbours have one tangent in
common. Source: Wenz (1996), Interpolation of curve data by blended generalized circles, Computer
Aided Geometric Design 13.

Edges of second order are cut in halves at the nodes within them, which lie on the outline as well.
"""

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree
from skfem import Mesh

from contactopt.defaults import EQUAL
from contactopt.meshes.cells import is_curved
from contactopt.meshes.given_curves import Curve

# a polygon that turns by more between two edges has a corner there; three chords make a fillet
CORNER = np.deg2rad(35)
# unless it is an arc that is tangent to the edges beside it, and turns by less
LARGEST = np.deg2rad(75)
ALIKE = 1e-3  # relative difference of their curvatures, and of angles [rad]
# a smaller turn is a corner if it is more than this, and times what its neighbours suggest
KINK = np.deg2rad(5), 5.0
DIGITS = range(6, 13)  # decimal digits that files write
STEEP = np.sin(np.deg2rad(60))  # largest sine of the angle between an edge and its curve


def plane_curves(mesh: Mesh) -> dict[str, Curve | None]:
    """By the name of each boundary of a plane mesh, '' for others: its curve, None if straight."""
    facets = mesh.boundary_facets()
    edges, points, owner, known = _edges(mesh, facets)
    ends = np.zeros((2, edges.shape[1]))
    near = rounding(points[:, np.unique(edges)])
    for chain, numbers, forward in _chains(edges):
        bends = _bends(points[:, chain], near)
        ends[:, numbers] = np.where(forward, bends, -bends[::-1])
    found: dict[str, Curve | None] = {}
    for name, label, mine in shares(mesh, owner):
        found[name] = None
        if np.any(ends[:, mine] != 0):
            found[name] = Curve(_Blends(points[:, edges[:, mine]], ends[:, mine]), known, label)
    return found


def shares(mesh: Mesh, owner: np.ndarray) -> Iterator[tuple[str, str, np.ndarray]]:
    """The name of each boundary of a mesh, or '' for what has none; what messages call its curve;
    and whether each piece of the surface, on the facets `owner` (t,), is its own.
    """
    left = np.ones(len(owner), dtype=bool)
    for name, facets in (mesh.boundaries or {}).items():
        mine = np.isin(owner, facets)
        left &= ~mine
        yield name, f"the curve of boundary {name!r}", mine
    yield "", "the curve of the boundary without a name", left


def _edges(mesh: Mesh, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """Edges (2, e) of the outline, places of nodes, facets of edges, whether any edge is curved."""
    ends = mesh.facets[:, facets]
    if not is_curved(mesh):
        return ends, mesh.p, facets, False
    middle, points = mesh.dofs.facet_dofs[0, facets], mesh.doflocs
    off = np.linalg.norm(points[:, middle] - points[:, ends].mean(axis=1), axis=0)
    if not np.any(off > EQUAL * np.linalg.norm(points[:, ends[1]] - points[:, ends[0]], axis=0)):
        return ends, points, facets, False
    halves = np.concatenate([[ends[0], middle], [middle, ends[1]]], axis=1)
    return halves, points, np.tile(facets, 2), True


def rounding(points: np.ndarray) -> float:
    """Find how far nodes (dim, m) may be off because a file rounds its numbers [length]."""
    size, largest = np.ptp(points, axis=1).max(), np.abs(points).max()
    least = max(EQUAL * size, 16 * np.finfo(float).eps * largest)
    with np.errstate(over="ignore"):  # a place beyond single precision is none of it
        single = np.array_equal(points, points.astype(np.float32))
    if single:
        return float(max(least, 2.0**-22 * largest))
    sample = points.ravel()[:: max(1, points.size // 200)]
    for digits in DIGITS:
        if all(float(f"{x:.{digits - 1}e}") == x for x in sample.tolist()):
            return float(max(least, 2 * 10.0 ** (np.floor(np.log10(largest)) + 1 - digits)))
    return float(least)


def _chains(edges: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Edges (2, e) joined to chains: nodes, numbers of edges, and whether each runs forward.

    A closed chain ends where it begins.
    """
    at: dict[int, list[int]] = {}
    pairs = edges.T.tolist()
    for number, pair in enumerate(pairs):
        for node in pair:
            at.setdefault(node, []).append(number)
    left = set(range(len(pairs)))
    starts = [node for node, numbers in at.items() if len(numbers) != 2]
    chains = []
    for start in [*(node for node in starts for _ in at[node]), *at]:
        nodes, passed = [start], []
        while True:
            follow = [n for n in at[nodes[-1]] if n in left]
            if not follow or (len(nodes) > 1 and len(at[nodes[-1]]) != 2):
                break
            left.remove(follow[0])
            passed.append(follow[0])
            first, last = pairs[follow[0]]
            nodes.append(last if first == nodes[-1] else first)
        if passed:
            numbers = np.array(passed)
            chains.append((np.array(nodes), numbers, edges[0, numbers] == np.array(nodes[:-1])))
    return chains


def _bends(x: np.ndarray, near: float) -> np.ndarray:
    """Curvatures (2, n), positive to the left, at the ends of the edges of a chain (2, n + 1)."""
    closed = x.shape[1] > 3 and np.array_equal(x[:, 0], x[:, -1])
    turn, length = _turns(x, closed)
    corner = _corners(turn, length)
    if closed:  # begins at a corner, or where the curvature changes most
        curvature = turn[:-1] / length
        jump = np.abs(curvature - np.roll(curvature, 1)) + np.where(corner[:-1], np.inf, 0.0)
        first = int(np.argmax(jump))
        if first:
            order = np.roll(np.arange(len(length)), -first)
            bends = _bends(x[:, np.append(order, first)], near)
            return np.asarray(np.roll(bends, first, axis=1))
    runs = np.full(len(length), np.nan)  # the curvature of the run that an edge belongs to
    cuts = np.unique([0, *np.flatnonzero(corner), len(length)])
    for first, last in pairwise(cuts.tolist()):
        for start, end, bend in _runs(x[:, first : last + 1], near):
            runs[first + start : first + end] = bend
    return _ends(turn, length, corner, runs)


def _turns(x: np.ndarray, closed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Turns (n + 1,) of a chain at its nodes [rad], nan at open ends, and lengths (n,) of edges."""
    steps = np.diff(x, axis=1)
    length, direction = np.hypot(*steps), np.arctan2(*steps[::-1])
    turn = np.full(x.shape[1], np.nan)
    turn[1:-1] = np.diff(direction)
    if closed:
        turn[[0, -1]] = direction[0] - direction[-1]
    return (turn + np.pi) % (2 * np.pi) - np.pi, length


def _corners(turn: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Whether nodes are corners: the turn is large, or far larger than next to it, or an end."""
    spacing = np.concatenate([length[-1:], length, length[:1]])
    span = (spacing[:-1] + spacing[1:]) / 2
    rate = np.where(np.isnan(turn), 0.0, np.abs(turn)) / np.minimum(spacing[:-1], spacing[1:])
    beside = np.concatenate([rate[-2:-1], rate, rate[1:2]])
    expected = np.maximum(beside[:-2], beside[2:]) * span
    kink = (np.abs(turn) > KINK[0]) & (np.abs(turn) > KINK[1] * expected)
    return np.isnan(turn) | (~_on_fillet(turn, length) & ((np.abs(turn) > CORNER) | kink))


def _on_fillet(turn: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Whether nodes lie on an arc of few chords: one tangent to the edges before and after it.

    A chord of an arc of curvature k turns by twice asin(k c / 2), half of it at each end.
    """
    # a closed chain ends where it begins
    count = len(turn) - 1 if turn[0] == turn[-1] else len(turn)
    after = np.resize(np.append(length, [np.nan] * (count - len(length))), count)
    before = np.roll(after, 1)
    across = before**2 + after**2 + 2 * before * after * np.cos(turn[:count])
    bend = 2 * np.sin(turn[:count]) / np.sqrt(across)
    found = np.zeros(count, dtype=bool)
    for node in np.flatnonzero((np.abs(turn[:count]) > CORNER) & (np.abs(turn[:count]) < LARGEST)):
        alike = np.abs(bend - bend[node]) < ALIKE * np.abs(bend[node])
        first = last = int(node)
        while alike[(first - 1) % count] and last - first < count - 2:
            first -= 1
        while alike[(last + 1) % count] and last - first < count - 2:
            last += 1
        ends = np.array([first - 1, last + 1]) % count
        half = np.arcsin(bend[node] * np.array([before[first % count], after[last % count]]) / 2)
        if np.all(np.abs(turn[ends] - half) < ALIKE):
            found[np.arange(first - 1, last + 2) % count] = True
    return np.resize(found, len(turn))


def _runs(x: np.ndarray, near: float) -> list[tuple[int, int, float]]:
    """First and last node, and curvature, of runs of three nodes on a line or four on a circle."""
    found, start, last = [], 0, x.shape[1] - 1
    steps = np.diff(x, axis=1)
    area = np.hypot(*steps[:, :-1]) * np.hypot(*steps[:, 1:])
    across = steps[:, :-1] + steps[:, 1:]
    # from the neighbours' chord
    off = (steps[0, :-1] * steps[1, 1:] - steps[1, :-1] * steps[0, 1:]) / np.hypot(*across)
    straight = np.abs(off) <= 2 * near
    # the same curvature at the next node
    even = np.abs(np.diff(off / area)) <= 2 * near * (1 / area[:-1] + 1 / area[1:])
    while start < last:
        line = arc = start
        if start < len(straight) and straight[start]:
            line = _reach(x, start, lambda nodes: _on_line(nodes, near))
        if start < len(even) and even[start]:
            arc = _reach(x, start, lambda nodes: _circle(nodes, near) is not None)
        if line - start >= 2 and arc - start <= 2 * (line - start):
            found.append((start, line, 0.0))
            start = line
        elif arc - start >= 3:
            found.append((start, arc, _circle(x[:, start : arc + 1], near) or 0.0))
            start = arc
        else:
            start += 1
    return found


def _reach(x: np.ndarray, start: int, fits: Callable[[np.ndarray], bool]) -> int:
    """The last node such that all from `start` to it fit, found by doubling and halving steps."""
    good, end, step = start + 1, x.shape[1] - 1, 1
    while step and good < end:
        last = min(good + step, end)
        if fits(x[:, start : last + 1]):
            good, step = last, 2 * step
        else:
            break
    while step > 1:
        step //= 2
        if good + step <= end and fits(x[:, start : good + step + 1]):
            good += step
    return good


def _on_line(nodes: np.ndarray, near: float) -> bool:
    """Whether nodes lie on the line through the first and the last one."""
    along, offset = nodes[:, -1] - nodes[:, 0], nodes - nodes[:, :1]
    across = np.abs(along[0] * offset[1] - along[1] * offset[0])
    return bool(np.all(across <= near * np.hypot(*along)))


def _circle(nodes: np.ndarray, near: float) -> float | None:
    """The curvature of the circle on which nodes (2, m) lie, positive to the left; None off it."""
    centre, radius = fitted_sphere(nodes)
    away = nodes - centre
    if radius == 0.0 or np.any(np.abs(np.hypot(*away) - radius) > near):
        return None
    sweep = np.sum(away[0, :-1] * away[1, 1:] - away[1, :-1] * away[0, 1:])
    return float(np.sign(sweep) / radius)


def fitted_sphere(places: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre (dim, 1) and radius of the circle or sphere that fits places (dim, m) best."""
    middle = places.mean(axis=1, keepdims=True)
    offset = places - middle
    size = max(np.abs(offset).max(), 1e-300)
    offset = offset / size
    terms = np.column_stack([2 * offset.T, np.ones(offset.shape[1])])
    *centre, rest = np.linalg.lstsq(terms, np.sum(offset**2, axis=0), rcond=None)[0]
    radius = np.sqrt(max(rest + np.sum(np.square(centre)), 0.0))
    return middle + size * np.array(centre)[:, None], float(size * radius)


def _ends(turn: np.ndarray, length: np.ndarray, corner: np.ndarray, runs: np.ndarray) -> np.ndarray:
    """Curvatures (2, n) at both ends of edges, of their runs or of circles through three nodes."""
    n = len(length)
    free = np.isnan(runs)
    edge = np.arange(n)
    found = np.empty((2, n))
    for side, node, beside in ((0, edge, edge - 1), (1, edge + 1, (edge + 1) % n)):
        # the chord between the two neighbours of the node
        other = length[beside]
        across = np.sqrt(length**2 + other**2 + 2 * length * other * np.cos(turn[node]))
        three = 2 * np.sin(turn[node]) / across
        away = turn[node] - np.arcsin(np.clip(runs[beside] * other / 2, -STEEP, STEEP))
        found[side] = np.where(free[beside], three, 2 * np.sin(away) / length)
        found[side, corner[node]] = np.nan
    found = np.where(np.isnan(found), found[::-1], found)  # at a corner as at the other end
    found = np.where(np.isnan(found), 0.0, found)
    return np.clip(np.where(free, found, runs), -2 * STEEP / length, 2 * STEEP / length)


class _Blends:
    """Edges with ends (2, 2, e) and the curvatures (2, e) of the arcs blended over them."""

    def __init__(self, corners: np.ndarray, bends: np.ndarray) -> None:
        self.start, self.bends = corners[:, 0], bends
        along = corners[:, 1] - corners[:, 0]
        self.length = np.hypot(*along)
        self.along = along / self.length
        self.tree = cKDTree(corners.mean(axis=1).T)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """The places (2, m) of points near the edges."""
        edge = self._nearest(points)
        s, c = self._foot(points, edge)[0], self.length[edge]
        rest = s * (c - s)
        root = np.sqrt(1 - (self.bends[:, edge] * c / 2) ** 2)
        bend = self.bends[:, edge]
        first, last = bend * rest / (np.sqrt(root**2 + bend**2 * rest) + root)
        height = (1 - s / c) * first + s / c * last
        x, y = self.along[:, edge]
        return np.asarray(self.start[:, edge] + s * np.stack([x, y]) + height * np.stack([y, -x]))

    def _foot(self, points: np.ndarray, edge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far along edges the points nearest to points (2, m) are, and how far from these."""
        offset, along = points - self.start[:, edge], self.along[:, edge]
        s = np.clip(np.sum(offset * along, axis=0), 0, self.length[edge])
        return s, np.linalg.norm(offset - s * along, axis=0)

    def _nearest(self, points: np.ndarray) -> np.ndarray:
        """The number (m,) of the nearest edge, by the distance of its middle."""
        some = self.tree.query(points.T)[1]
        reach = self._foot(points, some)[1] + self.length.max() * (1 + EQUAL) / 2
        found = self.tree.query_ball_point(points.T, reach)
        edge = np.concatenate(found).astype(int)
        of = np.repeat(np.arange(len(found)), [len(each) for each in found])
        middle = np.linalg.norm(self.tree.data[edge] - points.T[of], axis=1)
        order = np.lexsort((middle, self._foot(points[:, of], edge)[1], of))
        return np.asarray(edge[order][np.searchsorted(of, np.arange(len(found)))])
