"""The coupling of bodies whose contact nodes match: each has its partner on the other body."""

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.spatial import KDTree

from contactopt.bodies.assembled import AssembledBody, Surface
from contactopt.bodies.corners import turns
from contactopt.bodies.elements import opposed, unit
from contactopt.coupling.charts import lay_out
from contactopt.coupling.coupling import Coupling, guided, local_map, of_contacts
from contactopt.coupling.planes_of_symmetry import ContactPoints, normals_in_planes
from contactopt.coupling.segments import FACING
from contactopt.defaults import CLOSE
from contactopt.errors import InputError
from contactopt.problem.chart import Chart
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Scene

# and, where normals of a curved surface are known to its turn only, never beyond this fraction
LOOSEST = 0.25
NEAREST = 8  # nodes among which the nearest one that faces a node is looked for
REMEDY = (
    "give both meshes the same nodes there, or couple the surfaces with Contact(...,"
    " coupling='mortar')"
)
STEPS = 20  # of the search along a normal, which usually takes two
CHUNK = 256  # nodes that are compared with all others at a time


def couple_nodes(
    scene: Scene, pair: Contact, upper: AssembledBody, lower: AssembledBody
) -> Coupling:
    """The coupling whose contacts are the contact nodes of the lower body, or of the upper one if
    that alone has a mesh. InputError if the contact nodes of two bodies do not match.

    Frames and areas are those of the body that the contacts belong to, but for areas on a
    half-space that a mesh faces. The contacts are numbered along the chart.
    """
    names, conforming = pair.surfaces, True
    if upper.meshed and lower.meshed:
        first, second = upper.surface(names[0]), lower.surface(names[1])
        lead, partner = second, _match(first, second)
        if second.mesh is None and first.mesh is not None:  # cells of a half-space reach beyond it
            lead = replace(second, areas=first.areas[partner])
        normals, gap = lead.normals, 0 * lead.areas
        conforming = _conforming(lead.cells, first.cells, partner)
    else:
        lead = upper.surface(names[0]) if upper.meshed else lower.surface(names[1])
        follower, sign = (lower, -1.0) if upper.meshed else (upper, 1.0)
        other, gap = follower.facing(lead, sign * lead.normals)
        if (one := _without_copies(lead, sign * other.normals)) is not lead:
            lead = one
            other, gap = follower.facing(lead, sign * lead.normals)
        first, second = (lead, other) if upper.meshed else (other, lead)
        partner, normals = np.arange(len(gap)), other.normals
    held = first.held[:, partner] & second.held
    points = ContactPoints(lead.points, normals, lead.areas, lead.cells, held, gap)
    if upper.meshed and lower.meshed:
        normals = normals_in_planes(points)
        apart = (first.weights @ first.places.T)[partner] - second.weights @ second.places.T
        points = replace(points, normals=normals, gap=np.sum(normals * apart.T, axis=0))
    _, frames, order = laid_out = _laid_out(scene, lead, points)
    rows = (first, partner[order]), (second, order)
    still = held[:, order]
    upper_map, lower_map = (
        guided(local_map(own.traces, there, frames), own.alone or own.traces, there, frames, still)
        for own, there in rows
    )
    maps = upper_map, lower_map
    side = "lower" if lower.meshed else "upper"
    made = of_contacts("matching", side, points, laid_out, maps)
    return replace(made, conforming=conforming)


def _conforming(cells: np.ndarray, others: np.ndarray, partner: np.ndarray) -> bool:
    """Whether the cells (v, c) have partners at the corners of a cell of the other surface."""
    if len(cells) != len(others):
        return False
    known = np.unique(np.sort(others, axis=0), axis=1)
    both = np.unique(np.concatenate([known, np.sort(partner[cells], axis=0)], axis=1), axis=1)
    return both.shape[1] == known.shape[1]


def _without_copies(surface: Surface, outward: np.ndarray) -> Surface:
    """The surface with one contact, in place of one for each side, at corners where the other body
    has one normal for all. Their areas are those of the sides that face it: `outward` (dim, k) is
    the direction to it.
    """
    k = surface.points.shape[1]
    if surface.chart is not None:  # the points of a grid have no copies
        return surface
    both = np.concatenate([surface.points, outward])
    known, first, own = np.unique(both, axis=1, return_index=True, return_inverse=True)
    if known.shape[1] == k:
        return surface
    rank = np.argsort(np.argsort(first))  # the contacts keep their order
    own, first = rank[own.ravel()], np.sort(first)
    towards = np.sum(surface.normals * outward, axis=0) > -FACING
    share = np.where(towards | (np.bincount(own, towards) == 0)[own], surface.areas, 0.0)
    areas = np.bincount(own, share)
    M = sp.csr_matrix((share / areas[own], (own, np.arange(k))), (len(first), k))
    normals, opposite = unit(surface.normals @ M.T)
    if opposite is not None:
        sentence = opposed(surface.points[:, first[opposite]])
        raise InputError(f"body '{surface.body}': {sentence}")
    return replace(
        surface,
        points=surface.points[:, first],
        normals=normals,
        areas=areas,
        weights=sp.csr_matrix(M @ surface.weights),
        traces=tuple(sp.csr_matrix(M @ trace) for trace in surface.traces),
        alone=surface.alone and tuple(sp.csr_matrix(M @ trace) for trace in surface.alone),
        held=surface.held[:, first],
        cells=own[surface.cells],
    )


def _laid_out(
    scene: Scene, lead: Surface, points: ContactPoints
) -> tuple[Chart, np.ndarray, np.ndarray]:
    """Chart, frames and order of the contacts, known to the surface or laid out."""
    n = points.normals
    along = np.all(np.abs(n) == np.abs(lead.normals)) and np.all(n == n[:, :1])
    if lead.chart is None or not along:
        return lay_out(points, scene.copies, scene.analysis.revolved)
    frame = np.roll(np.eye(len(n)), 1, axis=0)  # n, t1, t2 along the last, first, second component
    frame[0] = n[:, 0]
    k = len(points.gap)
    return lead.chart, np.broadcast_to(frame, (k, *frame.shape)), np.arange(k)


def _match(upper: Surface, lower: Surface) -> np.ndarray:
    """The partner on the upper surface of every lower contact (k,), on one normal of the lower
    surface or, if it nowhere turns away from its mean normal, on a parallel to that. InputError if
    there are none, or if the numbers of contacts differ.
    """
    k = lower.points.shape[1]
    if upper.points.shape[1] != k:
        raise InputError(
            f"interface nodes do not match: body '{upper.body}' has {upper.points.shape[1]} contact"
            f" nodes, body '{lower.body}' has {k}; {REMEDY}."
        )
    facing = np.sum(upper.normals * lower.normals, axis=0)
    if np.array_equal(upper.points, lower.points) and np.all(facing < 0):
        return np.arange(k)
    spacing, apart = 1.0, np.unique(lower.points.T, axis=0)  # nodes at corners are there twice
    if len(apart) > 1:
        spacing = float(KDTree(apart).query(apart, k=2)[0][:, 1].min())
    mean = lower.normals @ lower.areas
    mean = mean / max(float(np.linalg.norm(mean)), 1e-300)
    turn = _turn(lower)
    directions = [(lower.normals, turn)]
    if np.all(mean @ lower.normals > 0.1) and turn.any():
        directions.append((np.tile(mean[:, None], k), np.zeros(k)))
    distances = []
    for direction, slack in directions:
        partner, off, allowed = _along(upper, lower, direction, slack, max(spacing, 1e-300))
        if np.all(off <= allowed) and len(np.unique(partner)) == k:
            return partner
        distances.append(float(off.max()))
    raise InputError(
        f"interface nodes do not match: a contact node of body '{upper.body}' lies"
        f" {min(distances):.3g} off the normal through the nearest one of body '{lower.body}'"
        f" (spacing {spacing:.3g}); {REMEDY}."
    )


def _turn(surface: Surface) -> np.ndarray:
    """(k,) twice the largest difference between neighbours' normals, which bounds their error."""
    turn = turns(surface.normals, surface.cells)
    return np.where(turn > 1e-12, 2 * turn, 0.0)


def _along(
    upper: Surface, lower: Surface, direction: np.ndarray, slack: np.ndarray, spacing: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The partner (k,) of every lower contact along a direction (dim, k), its distance from that
    line, and what is allowed.

    Each search starts at the nearest upper contact that does not face the same way and moves along
    the line to the height of the contact found, until it finds the same again. Where that is too
    far off, all upper contacts are compared, up to the first without a partner.
    """
    count = lower.points.shape[1]
    tree, height = KDTree(upper.points.T), np.zeros(count)
    found, ranks = np.full(count, -1), np.arange(1, min(NEAREST, count) + 1)
    for _ in range(STEPS):
        near = tree.query((lower.points + height * direction).T, k=ranks)[1]
        before, found = found, near[np.arange(count), _best(upper, lower, near, spacing)]
        height = np.sum((upper.points[:, found] - lower.points) * direction, axis=0)
        if np.array_equal(before, found):
            break

    def measured(some: np.ndarray | slice) -> tuple[np.ndarray, np.ndarray]:
        apart = upper.points[:, found[some]] - lower.points[:, some]
        height = np.sum(apart * direction[:, some], axis=0)
        allowed = np.minimum(CLOSE + slack[some] * np.abs(height) / spacing, LOOSEST) * spacing
        return np.linalg.norm(apart - height * direction[:, some], axis=0), allowed

    off, allowed = measured(slice(None))
    lost = np.flatnonzero(off > allowed)
    for some in (lost[i : i + CHUNK] for i in range(0, len(lost), CHUNK)):
        apart = upper.points[:, None] - lower.points[:, some, None]  # (dim, some, all)
        heights = np.einsum("dij,di->ij", apart, direction[:, some])
        distance = np.linalg.norm(apart - heights * direction[:, some, None], axis=0)
        distance[lower.normals[:, some].T @ upper.normals >= 0] = np.inf
        best = np.argmin(distance, axis=1)
        better = distance[np.arange(len(some)), best] < off[some]
        found[some[better]] = best[better]
        off[some], allowed[some] = measured(some)
        if np.any(off[some] > allowed[some]):
            break
    return found, off, allowed


def _best(upper: Surface, lower: Surface, near: np.ndarray, spacing: float) -> np.ndarray:
    """Which (k,) of some upper contacts (k, j), the nearest first, is the partner of each lower
    one: the first that does not face the same way, or one at its place that faces it better.
    """
    cosine = np.einsum("di,dij->ij", lower.normals, upper.normals[:, near])
    row = np.arange(len(near))
    first = np.argmax(cosine < 0, axis=1)
    apart = np.linalg.norm(upper.points[:, near] - upper.points[:, near[row, first], None], axis=0)
    return np.asarray(np.argmin(np.where(apart <= CLOSE * spacing, cosine, np.inf), axis=1))
