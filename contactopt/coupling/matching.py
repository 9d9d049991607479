"""The coupling of bodies whose contact nodes match: every contact of one body has its partner on
the other.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from contactopt.bodies.assembled import AssembledBody, Surface
from contactopt.coupling.charts import ContactPoints, lay_out, normals_in_planes, symmetry_planes
from contactopt.coupling.coupling import Coupling, local_map, renumbered
from contactopt.errors import InputError
from contactopt.problem.chart import Chart
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Scene

MATCH = 1e-6  # nodes match within this fraction of the shortest distance between contact nodes
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
    that alone has a mesh.

    Frames and areas are those of the body that the contacts belong to. The contacts are numbered
    along the chart.

    Parameters
    ----------
    scene : The kind of the scene and its law.
    pair : The pair of surfaces.
    upper, lower : The two bodies, of which at least one has a mesh.

    Returns
    -------
    One contact for each pair of nodes.

    Raises
    ------
    InputError : If the contact nodes of two bodies do not match.
    """
    names = pair.surfaces
    if upper.meshed and lower.meshed:
        first, second = upper.surface(names[0]), lower.surface(names[1])
        partner = _match(first, second)
        held = first.held[:, partner] & second.held
        normals = normals_in_planes(
            ContactPoints(
                second.points, second.normals, second.areas, second.cells, held, 0 * second.areas
            )
        )
        apart = (first.weights @ first.places.T)[partner] - second.weights @ second.places.T
        gap = np.sum(normals * apart.T, axis=0)
        lead = second
    else:
        lead = upper.surface(names[0]) if upper.meshed else lower.surface(names[1])
        follower, outward = (lower, -lead.normals) if upper.meshed else (upper, lead.normals)
        other, gap = follower.facing(lead, outward)
        first, second = (lead, other) if upper.meshed else (other, lead)
        partner, normals = np.arange(len(gap)), other.normals
    carrier = "lower" if lower.meshed else "upper"
    held = first.held[:, partner] & second.held
    points = ContactPoints(lead.points, normals, lead.areas, lead.cells, held, gap)
    chart, frames, order = _laid_out(scene, lead, points)
    upper_map, lower_map = (
        local_map(first, partner[order], frames),
        local_map(second, order, frames),
    )
    cells = renumbered(lead.cells, order)
    areas, places, planes = lead.areas[order], lead.points[:, order], tuple(symmetry_planes(points))
    return Coupling(
        upper_map,
        lower_map,
        frames,
        gap[order],
        areas,
        places,
        chart,
        cells,
        planes,
        "matching",
        carrier,
    )


def _laid_out(
    scene: Scene, lead: Surface, points: ContactPoints
) -> tuple[Chart, np.ndarray, np.ndarray]:
    """Chart, frames and order of the contacts: those of a surface that knows its coordinates, or
    else laid out.
    """
    known, normals = lead.chart, points.normals
    if (
        known is not None
        and np.all(np.abs(normals) == np.abs(lead.normals))
        and np.all(normals == normals[:, :1])
    ):
        # n, t1 and t2 along the last, first and second component
        frame = np.roll(np.eye(len(normals)), 1, axis=0)
        frame[0] = normals[:, 0]
        return (
            known,
            np.broadcast_to(frame, (len(points.gap), *frame.shape)),
            np.arange(len(points.gap)),
        )
    return lay_out(points, scene.copies, scene.kind == "axisymmetric")


def _match(upper: Surface, lower: Surface) -> np.ndarray:
    """For every contact of the lower surface (k,) the number of its partner on the upper one.

    Partners lie on one normal of the lower surface. If this finds no partners and the lower surface
    nowhere turns away from its mean normal, partners on a common parallel to the mean normal are
    accepted as well.

    Raises
    ------
    InputError : If there are no such partners, or if the numbers of contacts differ.
    """
    k = lower.points.shape[1]
    if upper.points.shape[1] != k:
        raise InputError(
            f"interface nodes do not match: body '{upper.body}' has {upper.points.shape[1]} contact"
            f" nodes, body '{lower.body}' has {k}; {REMEDY}."
        )
    if np.array_equal(upper.points, lower.points):
        return np.arange(k)
    spacing = (
        float(KDTree(lower.points.T).query(lower.points.T, k=2)[0][:, 1].min()) if k > 1 else 1.0
    )
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
    """(k,) twice the largest difference between the normal at a contact and those next to it: a
    bound on its error.

    Normals are means over facets. Inside a smooth surface they are off by less than the turn from
    one facet to the next, at its rim, where there is one facet only, by half of the facet's own
    turn.
    """
    turn, (normals, cells) = np.zeros(surface.points.shape[1]), (surface.normals, surface.cells)
    for corner in cells:
        for other in cells:
            np.maximum.at(
                turn, corner, np.linalg.norm(normals[:, corner] - normals[:, other], axis=0)
            )
    return np.where(turn > 1e-12, 2 * turn, 0.0)


def _along(
    upper: Surface, lower: Surface, direction: np.ndarray, slack: np.ndarray, spacing: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The partner (k,) of every lower contact along a direction (dim, k), its distance from that
    line, and what is allowed.

    Each search starts at the nearest contact of the upper surface and moves along the line to the
    height of the contact found, until it finds the same one again. Contacts that face the same way
    as the lower one, on the far side of a pin in a bush, do not count. Where the search ends
    further off than is allowed, all contacts of the upper surface are compared, up to the first
    ones that have no partner among them either: then the surfaces do not match.
    """
    count = lower.points.shape[1]
    tree, height = KDTree(upper.points.T), np.zeros(count)
    found = np.full(count, -1)
    for _ in range(STEPS):
        near = tree.query(
            (lower.points + height * direction).T, k=np.arange(1, min(NEAREST, count) + 1)
        )[1]
        facing = np.einsum("di,dij->ij", lower.normals, upper.normals[:, near]) < 0
        before, found = found, near[np.arange(count), np.argmax(facing, axis=1)]
        height = np.sum((upper.points[:, found] - lower.points) * direction, axis=0)
        if np.array_equal(before, found):
            break

    def measured(some: np.ndarray | slice) -> tuple[np.ndarray, np.ndarray]:
        apart = upper.points[:, found[some]] - lower.points[:, some]
        height = np.sum(apart * direction[:, some], axis=0)
        allowed = np.minimum(MATCH + slack[some] * np.abs(height) / spacing, LOOSEST) * spacing
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
