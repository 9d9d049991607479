"""The mortar coupling of bodies whose contact nodes do not match, from faces to the maps T."""

import logging
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import AssembledBody, Mesh, Surface
from contactopt.bodies.corners import smooth_tilts
from contactopt.coupling.charts import lay_out
from contactopt.coupling.coupling import Coupling, guided, local_map, of_contacts
from contactopt.coupling.faces import Faces, faces_of
from contactopt.coupling.mortar import Mortar, contact_normals, mortar
from contactopt.coupling.planes_of_symmetry import ContactPoints, end_planes
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.meshes.curves import KINK
from contactopt.scenes.contact import SIDES, Contact
from contactopt.scenes.scene import Scene

# contacts for each node of a thin body, below which displacements of its surface move none of them
FEWEST = 0.95
# A support holds a node along the normal if it holds all components of it above the first number.
# Displacements move contacts apart from each other if the singular value is above the second one
# times the largest.
ACROSS, APART = 1e-3, 0.1
MOST = 1000  # contacts or nodes up to which these singular values are computed

log = logging.getLogger(__name__)


def couple_surfaces(
    scene: Scene, pair: Contact, upper: AssembledBody, lower: AssembledBody
) -> Coupling:
    """The mortar coupling of two bodies with meshes (contactopt.coupling.mortar), numbered along
    the chart: one contact for each node of the carrier that faces the other side. InputError if a
    body has no mesh there, or if the surfaces face each other nowhere.

    The contacts are carried by the side that the pair names. Otherwise it is the one with more
    contacts where they face each other, unless a thin body on the other side has more nodes there
    than contacts: the thin one carries them then (contactopt.bodies.thickness). The other side does
    so, too, where supports hold nodes of the carrier, and the other side has fewer nodes there than
    contacts: its displacements alone could not tell their forces apart.
    """
    bodies = upper, lower
    meshes = [_mesh(body.surface(name)) for body, name in zip(bodies, pair.surfaces)]
    sides = _halved([_faces(body.name, mesh) for body, mesh in zip(bodies, meshes)], meshes)
    m, loose, crowded = _carried(sides, meshes, pair.carrier)
    one = _whole_where_even(sides[m.own], m.nodes, m.normals)
    if one is not sides[m.own]:
        sides[m.own] = one
        m, loose, crowded = _carried(sides, meshes, SIDES[m.own])
    carrier, mine, theirs = sides[m.own], meshes[m.own], meshes[1 - m.own]
    # A component is held at a contact where supports hold it on both sides; the other side is held
    # as well where a plane of symmetry of both cuts it.
    own_held = _held(m, carrier, mine)
    other_held = np.stack([m.alone[1 - m.own] @ ~row == 0 for row in theirs.held])
    if carrier.mirror is not None:
        other_held |= carrier.mirror[:, m.nodes]
    number = np.full(carrier.points.shape[1], -1)
    number[m.nodes] = np.arange(len(m.nodes))
    cells = number[carrier.cell_nodes()]
    cells = cells[np.all(cells >= 0, axis=1)].T  # those whose corners all carry contacts
    along = own_held & (np.abs(m.normals) <= smooth_tilts(m.normals, cells))
    contacts = ContactPoints(m.points, m.normals, m.areas, cells, own_held & other_held, m.gap)
    laid_out = lay_out(contacts, scene.copies, scene.analysis.revolved)
    _, frames, order = laid_out
    maps = []
    for i, mesh in enumerate(meshes):
        traces = [
            sp.csr_matrix(sum(part @ picked for part, picked in zip(row, mesh.picked)))
            for row in m.components(i, along)
        ]
        alone = [sp.csr_matrix(m.alone[i] @ picked) for picked in mesh.picked]
        still = contacts.held[:, order]
        maps.append(guided(local_map(traces, order, frames), alone, order, frames, still))
    side = SIDES[m.own]
    said = "contact '%s': mortar, %d contacts on the %s body '%s'"
    log.info(said, pair.name, len(order), side, carrier.name)
    made = of_contacts("mortar", side, contacts, laid_out, (maps[0], maps[1]), m.share)
    if loose < FEWEST:
        other = SIDES[1 - m.own]
        said = (
            f"contact '{pair.name}': the {other} body '{sides[1 - m.own].name}' is thin and has"
            f" {loose:.2g} contacts for each of its nodes, so that it can bulge between them; take"
            f" carrier = '{other}', or a finer mesh of the {side} body."
        )
        return replace(made, doubt=said)
    if crowded:
        said = (
            f"contact '{pair.name}': supports hold the {side} body '{carrier.name}' at contacts of"
            f" which the other body's nodes can tell {crowded} too few apart, so that their forces"
            f" may alternate; take carrier = '{SIDES[1 - m.own]}', or a finer mesh of the other"
            " body."
        )
        return replace(made, doubt=said)
    return made


def _carried(
    sides: list[Faces], meshes: list[Mesh], carrier: str | None
) -> tuple[Mortar, float, int]:
    """Contacts, how many there are per node of a thin other side, and how many too many."""

    def suits(made: Mortar) -> tuple[float, int]:
        return _per_node(made, sides, meshes), _crowded(made, sides, meshes)

    made = mortar(sides[0], sides[1], carrier)
    loose, crowded = suits(made)
    if carrier is None and (loose < FEWEST or crowded):
        turned = mortar(sides[0], sides[1], SIDES[1 - made.own])
        other, left = suits(turned)
        if other > loose if loose < FEWEST else other >= FEWEST and left < crowded:
            return turned, other, left
    return made, loose, crowded


def _held(made: Mortar, carrier: Faces, mesh: Mesh) -> np.ndarray:
    """(dim, k) the components that a support of their own side holds at the contacts. One that
    moved to where the other surface ends is no more at its node, which a support may hold.
    """
    held, at = mesh.held[:, made.nodes], carrier.points[:, made.nodes]
    moved = np.linalg.norm(made.points - at, axis=0) > EQUAL * np.ptp(made.points, axis=1).max()
    if carrier.mirror is None:
        return held & ~moved
    return held & (~moved | carrier.mirror[:, made.nodes])


def _crowded(made: Mortar, sides: list[Faces], meshes: list[Mesh]) -> int:
    """How many held contacts are more than the other side can move independently."""
    held, other = _held(made, sides[made.own], meshes[made.own]), meshes[1 - made.own]
    still = np.all(held | (np.abs(made.normals) <= ACROSS), axis=0)
    if not 0 < still.sum() <= MOST:
        return 0
    W = made.weights[1 - made.own][np.flatnonzero(still)]
    W = W[:, np.flatnonzero(~other.held.all(axis=0))]
    W = W[np.diff(W.indptr) > 0]  # contacts that both sides hold are none
    return int(W.shape[0]) - _independent(W)


def _per_node(made: Mortar, sides: list[Faces], meshes: list[Mesh]) -> float:
    """The least number of contacts per node of covered thin faces of the other side, or 1."""
    other = 1 - made.own
    if sides[other].degree == 1:
        return 1.0
    W, faces = made.weights[other], sides[other].faces[meshes[other].thin]
    seen = np.diff(W.tocsc().indptr) > 0
    covered = faces[seen[faces].all(axis=1)]
    count = np.asarray(W.sum(axis=0)).ravel()[covered].mean(axis=1).min(initial=1.0)
    nodes = np.unique(covered)
    if count < FEWEST and len(nodes) <= MOST and _independent(W[:, nodes]) == len(nodes):
        return 1.0
    return float(count)


def _independent(W: sp.csr_matrix) -> int:
    """How many displacements of nodes move contacts apart from each other, by weights (k, n)."""
    W = W[np.diff(W.indptr) > 0]
    if not W.shape[0]:
        return 0
    values = np.linalg.svd(W[:, np.unique(W.indices)].toarray(), compute_uv=False)
    return int(np.sum(values > APART * values[0]))


def _whole_where_even(side: Faces, nodes: np.ndarray, normals: np.ndarray) -> Faces:
    """The surface that is not cut at a corner where its contacts, at `nodes` (k,), have nearly the
    same normals (dim, k): a tip on a flat surface has one contact.
    """
    points = side.points[:, nodes]
    _, first, own = np.unique(points, axis=1, return_index=True, return_inverse=True)
    twin = first[own.ravel()]
    even = np.sum(normals * normals[:, twin], axis=0) > np.cos(KINK[0])
    even &= twin != np.arange(len(nodes))
    if not even.any():
        return side
    number = np.arange(side.points.shape[1])
    number[nodes[even]] = nodes[twin[even]]
    return replace(side, faces=number[side.faces])


def _mesh(surface: Surface) -> Mesh:
    if surface.mesh is None:
        raise InputError(
            f"body '{surface.body}' has no mesh on its contact surface, so that its points must be"
            " those of the other surface."
        )
    return surface.mesh


def _faces(name: str, m: Mesh) -> Faces:
    made = faces_of(name, m.kind, m.degree, m.faces, m.outward, m.measure, m.locations, m.curve)
    return replace(made, every=bool(m.thin.any()))


def _halved(sides: list[Faces], meshes: list[Mesh]) -> list[Faces]:
    """Both surfaces with the nodes that lie in a plane of symmetry of both."""
    planes = [end_planes(_vertices(side, mesh)) for side, mesh in zip(sides, meshes)]
    size = max(float(np.ptp(side.points[:, np.unique(side.faces)], axis=1).max()) for side in sides)
    common = [
        plane
        for plane in planes[0]
        for other in planes[1]
        if np.all(plane.inward == other.inward) and abs(plane.offset - other.offset) <= EQUAL * size
    ]
    if not common:
        return sides
    made = []
    for side in sides:
        mirror = np.zeros(side.points.shape, dtype=bool)
        for plane in common:
            mirror[plane.inward != 0] |= plane.contains(side.points, size)
        made.append(replace(side, mirror=mirror))
    return made


def _vertices(side: Faces, mesh: Mesh) -> ContactPoints:
    """All vertices of the linear cells of a surface, as candidates for contacts."""
    corners = side.cell_nodes()
    nodes, cells = np.unique(corners, return_inverse=True)
    held, none = mesh.held[:, nodes], np.zeros(len(nodes))
    normals = contact_normals(side)[0][:, nodes]
    cells = cells.reshape(corners.shape).T
    return ContactPoints(side.points[:, nodes], normals, none, cells, held, none)
