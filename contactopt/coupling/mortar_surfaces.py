"""The coupling of bodies whose contact nodes do not match: contacts on one side, integrals over the
overlap of both.
"""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import AssembledBody, Mesh, Surface
from contactopt.coupling.charts import NEAR, ContactPoints, lay_out, symmetry_planes
from contactopt.coupling.coupling import Coupling, renumbered
from contactopt.coupling.faces import Faces, faces_of
from contactopt.coupling.mortar import Mortar, contact_normals, mortar
from contactopt.errors import InputError
from contactopt.scenes.contact import SIDES, Contact
from contactopt.scenes.scene import Scene

log = logging.getLogger(__name__)


def couple_surfaces(
    scene: Scene, pair: Contact, upper: AssembledBody, lower: AssembledBody
) -> Coupling:
    """The mortar coupling of two bodies with meshes (contactopt.coupling.mortar), numbered along
    the chart.

    The contacts are carried by the side that the pair names, otherwise by that with more contacts
    where they face each other.

    Parameters
    ----------
    scene : The kind of the scene and its law.
    pair : The pair of surfaces.
    upper, lower : The two bodies, both with a mesh.

    Returns
    -------
    One contact for each node of that body that faces the other one.

    Raises
    ------
    InputError : If a body has no mesh on its contact surface, or if the surfaces face each other
        nowhere.
    """
    meshes = [_mesh(body.surface(name)) for body, name in zip((upper, lower), pair.surfaces)]
    # The contacts, with their weights on both sides.
    sides = _halved([_faces(body.name, mesh) for body, mesh in zip((upper, lower), meshes)], meshes)
    m = mortar(sides[0], sides[1], pair.carrier)
    mine, theirs = meshes[m.own], meshes[1 - m.own]
    # A component is held at a contact where supports hold it on both sides.
    own_held = mine.held[mine.unknowns[:, m.nodes]]
    other_held = np.stack([m.alone[1 - m.own] @ ~theirs.held[row] == 0 for row in theirs.unknowns])
    mirror = sides[m.own].mirror
    # the other side is held as well where a plane of symmetry of both cuts it
    if mirror is not None:
        other_held |= mirror[:, m.nodes]
    cells = _cells(sides[m.own], m.nodes)
    # Chart and frames, and the maps T from the displacements of both bodies in the order of the
    # chart.
    contacts = ContactPoints(m.points, m.normals, m.areas, cells, own_held & other_held, m.gap)
    chart, frames, order = lay_out(contacts, scene.copies, scene.kind == "axisymmetric")
    maps = [_map(m, i, mesh, own_held, frames, order) for i, mesh in enumerate(meshes)]
    areas, places, planes = m.areas[order], m.points[:, order], tuple(symmetry_planes(contacts))
    cells, carrier = renumbered(cells, order), SIDES[m.own]
    log.info(
        "contact '%s': mortar, %d contacts on the %s body '%s'",
        pair.name,
        len(order),
        carrier,
        sides[m.own].name,
    )
    gap, share = m.gap[order], m.share[order]
    return Coupling(
        maps[0], maps[1], frames, gap, areas, places, chart, cells, planes, "mortar", carrier, share
    )


def _mesh(surface: Surface) -> Mesh:
    if surface.mesh is None:
        raise InputError(
            f"body '{surface.body}' has no mesh on its contact surface, so that its points must be"
            " those of the other surface."
        )
    return surface.mesh


def _faces(name: str, mesh: Mesh) -> Faces:
    return faces_of(
        name,
        mesh.kind,
        mesh.degree,
        mesh.faces,
        mesh.outward,
        mesh.measure,
        mesh.locations,
        mesh.curve,
    )


def _halved(sides: list[Faces], meshes: list[Mesh]) -> list[Faces]:
    """Both surfaces with the nodes that lie in a plane of symmetry of both."""
    planes = [symmetry_planes(_vertices(side, mesh)) for side, mesh in zip(sides, meshes)]
    size = max(float(np.ptp(side.points[:, np.unique(side.faces)], axis=1).max()) for side in sides)
    common = [
        plane
        for plane in planes[0]
        if any(
            np.all(plane.inward == p.inward) and abs(plane.offset - p.offset) <= NEAR * size
            for p in planes[1]
        )
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
    nodes, cells = np.unique(
        side.faces[:, side.cells].reshape(-1, side.cells.shape[1]), return_inverse=True
    )
    held, none = mesh.held[mesh.unknowns[:, nodes]], np.zeros(len(nodes))
    normals = contact_normals(side)[0][:, nodes]
    return ContactPoints(
        side.points[:, nodes], normals, none, cells.reshape(-1, side.cells.shape[1]).T, held, none
    )


def _cells(side: Faces, nodes: np.ndarray) -> np.ndarray:
    """(v, c) contacts at the corners of the cells whose corners all carry contacts."""
    number = np.full(side.points.shape[1], -1)
    number[nodes] = np.arange(len(nodes))
    cells = number[side.faces[:, side.cells].reshape(-1, side.cells.shape[1])]
    return np.asarray(cells[np.all(cells >= 0, axis=1)].T)


def _map(
    m: Mortar, body: int, mesh: Mesh, held: np.ndarray, frames: np.ndarray, order: np.ndarray
) -> sp.csr_matrix:
    """T (k dim, n): the body's unknowns -> its part of the displacement of the contacts, in the
    frames and their order.
    """
    k, dim = frames.shape[:2]
    place = np.empty(k, dtype=int)
    place[order] = np.arange(k)
    rows, columns, values = [], [], []
    for c, row in enumerate(m.components(body, held)):
        for unknowns, part in zip(mesh.unknowns, row):
            if not part.nnz:
                continue
            entries = sp.coo_matrix(part)
            contact = place[entries.row]
            rows.append((contact[:, None] * dim + np.arange(dim)).ravel())
            columns.append(np.repeat(unknowns[entries.col], dim))
            values.append((frames[contact, :, c] * entries.data[:, None]).ravel())
    index = np.concatenate(rows), np.concatenate(columns)
    T = sp.csr_matrix((np.concatenate(values), index), (k * dim, len(mesh.held)))
    T.eliminate_zeros()
    return T
