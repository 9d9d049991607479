"""The contact surface's own coordinates and local frames, laid out from contact normals, cells,
planes of symmetry and areas alone: a body that is turned takes them along.
"""

import numpy as np

from contactopt.coupling.planes_of_symmetry import ContactPoints, SymmetryPlane, symmetry_planes
from contactopt.defaults import CLOSE, EQUAL
from contactopt.meshes.cells import rim, sides_of
from contactopt.problem.chart import Chart

FLAT = 0.1  # a mean normal shorter than this belongs to a surface that closes on itself
STEEP = 0.9  # cosine beyond which a direction is too near the normal to make a tangent of it
ALIKE = 1e-3  # relative difference below which principal moments count as equal


def lay_out(
    contacts: ContactPoints, copies: int, revolved: bool
) -> tuple[Chart, np.ndarray, np.ndarray]:
    """Lay out the chart and the local frames of a contact surface.

    Contacts are ordered along the contact line, or row by row of the tangent chart. In 2D t1 is n
    turned clockwise. In 3D it is the first direction of the chart, made orthogonal to n. With more
    than one of `copies`, mirror images that make the bodies whole, a plane of symmetry mirrors the
    chart. In an axisymmetric scene the first coordinate is the distance from an axis. Returns the
    chart and the frames (k, dim, dim) of the contacts in their new order, and this order (k,).
    """
    planes, mirrors = symmetry_planes(contacts), copies > 1
    if revolved and contacts.points[0].min() <= EQUAL * contacts.size:
        planes, mirrors = [SymmetryPlane(np.array([1.0, 0.0]), 0.0)], True
    period = None
    if len(contacts.points) == 2:
        n = contacts.normals
        frames = np.stack([n.T, np.stack([n[1], -n[0]]).T], axis=1)
        places, mirrored, period = _line(contacts, frames[:, 1].T, planes, mirrors)
        order = np.argsort(places[0], kind="stable")
    else:
        axes = _axes(contacts, planes)
        frames = _frames(contacts.normals, axes)
        places, mirrored = _plane(contacts, axes, planes, mirrors)
        order = np.lexsort([_rank(row, contacts.size) for row in places])
    cells = np.argsort(order)[contacts.cells]  # the place of each contact in the order
    return Chart(places[:, order], mirrored, period, cells), frames[order], order


def _line(
    contacts: ContactPoints, tangents: np.ndarray, planes: list[SymmetryPlane], mirrors: bool
) -> tuple[np.ndarray, tuple[bool, ...], float | None]:
    """Arc length (1, k) along t1, whether it is mirrored at 0, and the period of a closed line:
    from an end in a plane of symmetry, else from the middle or, if closed, the least gap.
    """
    chains, period = _chains(contacts, tangents)
    place = np.zeros(contacts.points.shape[1])
    end = 0.0
    for number, (chain, steps) in enumerate(chains):
        if number:
            link = chains[number - 1][0][-1:], chain[:1]
            end += abs(float(_steps(contacts.points, tangents, *link)[0]))
        place[chain] = end + np.concatenate([[0.0], np.cumsum(steps)])
        end = float(place[chain[-1]])
    if period is not None:
        return place[None], (False,), period
    ends = [chains[0][0][0], chains[-1][0][-1]]
    in_plane = [plane.contains(contacts.points[:, ends], contacts.size) for plane in planes]
    if cut := [i for i, *inside in zip(ends, *in_plane) if any(inside)]:
        at = cut[_least(contacts.gap[cut], contacts.size)]
        return (place - place[at])[None], (mirrors,), None
    return (place - end / 2)[None], (False,), None


def _chains(
    contacts: ContactPoints, tangents: np.ndarray
) -> tuple[list[tuple[np.ndarray, np.ndarray]], float | None]:
    """The pieces of the contact line, each as contacts and steps; the period of a loop."""
    k = contacts.points.shape[1]
    following, length = np.full(k, -1), np.zeros(k)
    step = _steps(contacts.points, tangents, *contacts.cells)
    first, second = np.where(step >= 0, contacts.cells, contacts.cells[::-1])
    following[first], length[first] = second, np.abs(step)
    started = np.setdiff1d(np.arange(k), following[following >= 0])
    if not len(started) and k > 0:  # a closed line
        start = _least(contacts.gap, contacts.size)
        chain = _walk(following, start)
        if len(chain) == k:
            return [(chain, length[chain[:-1]])], float(length.sum())
    seen, chains = np.zeros(k, dtype=bool), []
    for start in [*started, *range(k)]:
        if not seen[start]:
            chain = _walk(following, start)
            seen[chain] = True
            chains.append((chain, length[chain[:-1]]))
    along = (tangents @ contacts.areas) @ contacts.points
    return sorted(chains, key=lambda piece: float(along[piece[0]].mean())), None


def _walk(following: np.ndarray, start: int) -> np.ndarray:
    chain = [int(start)]
    while following[chain[-1]] >= 0 and following[chain[-1]] != start:
        chain.append(int(following[chain[-1]]))
    return np.array(chain)


def _steps(points: np.ndarray, tangents: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """From contacts i to contacts j along their mean tangents; the chord on a circle."""
    mean, chord = tangents[:, i] + tangents[:, j], points[:, j] - points[:, i]
    size, along = np.linalg.norm(mean, axis=0), np.sum(mean * chord, axis=0)
    return np.where(size > EQUAL, along / np.maximum(size, EQUAL), np.linalg.norm(chord, axis=0))


def _least(gap: np.ndarray, size: float) -> int:
    """Number of the least gap; the first of those that are equal but for rounding."""
    return int(np.argmax(gap <= gap.min() + EQUAL * size))


def _axes(contacts: ContactPoints, planes: list[SymmetryPlane]) -> tuple[np.ndarray, np.ndarray]:
    """Two orthogonal directions (3,) of a surface, right-handed with its normal: into the bodies
    from planes of symmetry; without any, the first is that in which the areas spread most, or else
    that of the longest edge of the rim.
    """
    n = _mean_normal(contacts)
    inward = [plane.inward - (plane.inward @ n) * n for plane in planes]
    inward = [s / np.linalg.norm(s) for s in inward if np.linalg.norm(s) > FLAT]
    pairs = [(a, b) for a in inward for b in inward if np.cross(n, a) @ b > 1 - EQUAL]
    if pairs:
        return pairs[0]
    if inward:
        return np.cross(inward[0], n), inward[0]
    first = _spread(contacts, n)
    return first, np.cross(n, first)


def _mean_normal(contacts: ContactPoints) -> np.ndarray:
    """The mean normal of a surface; that of the plane that fits best, if it closes on itself."""
    mean = contacts.normals @ contacts.areas / contacts.areas.sum()
    size = float(np.linalg.norm(mean))
    if size > FLAT:
        return np.asarray(mean / size)
    centred = contacts.points - contacts.points.mean(axis=1, keepdims=True)
    thin = np.linalg.svd(centred, full_matrices=True)[0][:, 2]
    return np.asarray(thin if thin @ contacts.normals[:, 0] >= 0 else -thin)


def _spread(contacts: ContactPoints, n: np.ndarray) -> np.ndarray:
    """The first direction of a surface without symmetry, where areas or a contact reach further."""
    points, areas = contacts.points, contacts.areas
    centred = points - (points @ areas / areas.sum())[:, None]
    centred = centred - np.outer(n, n @ centred)
    moments, vectors = np.linalg.eigh((centred * areas) @ centred.T)
    if moments[2] - moments[1] > ALIKE * moments[2]:
        first = vectors[:, 2]
    else:
        first = _rim_direction(contacts)
        first = first - (first @ n) * n
        first = first / np.linalg.norm(first)
    along = first @ centred
    sense = float(areas @ along**3) / max(float(areas @ np.abs(along) ** 3), 1e-300)
    if abs(sense) <= ALIKE:
        sense = float(along[np.argmax(np.abs(along) > EQUAL * contacts.size)])
    return np.asarray(first if sense >= 0 else -first)


def _rim_direction(contacts: ContactPoints) -> np.ndarray:
    """Along the longest edge of the rim, whose edges belong to one cell only."""
    edges = rim(contacts.cells)
    if not edges.size:  # the surface closes on itself
        edges = np.unique(np.sort(sides_of(contacts.cells).reshape(2, -1), axis=0), axis=1)
    chords = contacts.points[:, edges[1]] - contacts.points[:, edges[0]]
    length = np.linalg.norm(chords, axis=0)
    return np.asarray(chords[:, np.argmax(length >= length.max() * (1 - EQUAL))])


def _plane(
    contacts: ContactPoints,
    axes: tuple[np.ndarray, np.ndarray],
    planes: list[SymmetryPlane],
    mirrors: bool,
) -> tuple[np.ndarray, tuple[bool, ...]]:
    """Coordinates (2, k) along the axes, and which of them are mirrored."""
    places, mirrored = np.stack(axes) @ contacts.points, []
    for axis, row in zip(axes, places):
        across = [p for p in planes if abs(axis @ p.inward) > 1 - EQUAL]
        if across:
            row -= across[0].offset * float(np.sign(axis @ across[0].inward))
        else:
            row -= (row.max() + row.min()) / 2
        mirrored.append(mirrors and bool(across))
    return places, tuple(mirrored)


def _rank(row: np.ndarray, size: float) -> np.ndarray:
    """(k,) the row that each value belongs to; neighbours closer than rounding share one."""
    order = np.argsort(row)
    rank = np.empty(len(row), dtype=int)
    rank[order] = np.concatenate([[0], np.cumsum(np.diff(row[order]) > CLOSE * size)])
    return rank


def _frames(normals: np.ndarray, axes: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Rows n, t1, t2: t1 is the first direction made orthogonal to n, or the second near n."""
    n = normals.T
    steep = np.abs(n @ axes[0]) > STEEP
    towards = np.where(steep[:, None], axes[1], axes[0])
    t1 = towards - np.sum(towards * n, axis=1)[:, None] * n
    t1 = t1 / np.linalg.norm(t1, axis=1)[:, None]
    return np.stack([n, t1, np.cross(n, t1)], axis=1)
