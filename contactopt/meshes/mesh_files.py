"""Meshes from files that meshio reads, with their groups as bodies and as named boundaries.

A boundary is found by its corners on the surface of the body. So its normal is the outward one of
the body, whichever way round the file writes the facets, and a face between two parts of a file is
a boundary of each. contactopt.meshes.mesh_repair holds what is repaired and what is refused.
"""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import skfem

from contactopt.cards import count
from contactopt.checks import LARGEST, check_number, overheard, place_words, remember
from contactopt.defaults import CLOSE, EQUAL
from contactopt.errors import InputError
from contactopt.meshes.cells import facets_at
from contactopt.meshes.inp_elements import FACES
from contactopt.meshes.mesh_formats import FileGroups, read_groups
from contactopt.meshes.mesh_repair import (
    CORNERS,
    Cells,
    check_connected,
    check_elements,
    complete,
    repaired,
    representatives,
)

log = logging.getLogger(__name__)


def load_mesh(path: str | Path, group: str | None = None, scale: float = 1.0) -> skfem.Mesh:
    """The mesh of one body from a file, with the boundaries that the file names.

    Parameters
    ----------
    path : File in any format that meshio reads: Gmsh (.msh), VTK (.vtu, .vtk), Abaqus and CalculiX
        (.inp), Exodus, MED, XDMF, Nastran, ... A plane mesh may lie across any axis.
    group : Name of the group of elements that is the body, or the number of a group without a name.
        None: all elements.
    scale : Unit of length of the file in that of the scene: 1000 for a file in metres and a scene
        in millimetres.

    Returns
    -------
    Triangles, quadrilaterals, tetrahedra or hexahedra, curved where the file holds elements of
        second order. Its boundaries are the groups of facets on its surface, and the groups of
        nodes that hold all corners of such facets and no node inside the body. InputError if the
        file cannot be read, if there is no such group, or if the mesh has a fault that cannot be
        repaired.
    """
    check_number("the scale of a mesh", scale, low=0.0)
    with overheard() as told:
        groups = read_groups(Path(path))
        _tell_others(Path(path), groups)
        mesh = _body(Path(path), groups, group, scale)
    return remember(mesh, dict.fromkeys(told, "") | _rings(Path(path), groups))


def load_bodies(path: Path) -> tuple[dict[str | None, skfem.Mesh], list[str]]:
    """The meshes of all groups of elements of a file, by their names, with None as the name if the
    file has no groups; and a sentence for each group that is not one body.
    """
    groups = read_groups(path)
    _tell_others(path, groups)
    found: dict[str | None, skfem.Mesh] = {}
    refused: list[str] = []
    dim = _place(path, groups)[0]
    names: list[Any] = [*groups.names(dim)] or [None]
    own = {group: _numbers(groups.members.get((group, dim), {})) for group in names}
    order = sorted(names, key=lambda name: -len(own[name]))
    for number, group in enumerate(order):
        whole = (other for other in order[:number] if np.isin(own[group], own[other]).all())
        sizes = {other: len(own[other]) for other in whole}
        larger = next((o for o in sizes if o in found or sizes[o] == len(own[group])), None)
        if larger is not None:
            how = "the same as" if sizes[larger] == len(own[group]) else "a part of"
            refused.append(f"group {group!r} is {how} {larger!r}")
            continue
        try:
            found[group] = remember(_body(path, groups, group, 1.0), _rings(path, groups))
        except InputError as error:
            refused.append(f"group {group!r}: {error}" if group else str(error))
    return {group: found[group] for group in names if group in found}, refused


def _rings(path: Path, groups: FileGroups) -> dict[str, str]:
    """A remark for scenes that are not axisymmetric where the elements of the file are."""
    own = [word for word in groups.words.values() if word.startswith(("CAX", "CGAX", "DCAX"))]
    said = "are axisymmetric, and the scene is not"
    return {f"{path}: elements of type {word} {said}": "axisymmetric" for word in own[:1]}


def _numbers(members: Mapping[int, np.ndarray]) -> np.ndarray:
    """Different numbers of the elements of a group, which it gives by their blocks."""
    return np.concatenate(
        [np.zeros(0, dtype=np.int64), *((i << 40) + own for i, own in members.items())]
    )


def _body(path: Path, groups: FileGroups, group: str | None, scale: float) -> skfem.Mesh:
    """The mesh of a group, or of all elements, of a file."""
    dim, points = _place(path, groups)
    cells = _elements(path, groups, dim, points * scale, group)
    bodies = groups.names(dim)
    hint = "mesh it in one piece"
    if len(bodies) > 1:
        others = ", ".join(name for name in bodies if name != group)
        hint = f"choose the body by its group, one of {others}"
    merged = np.arange(cells.points.shape[1])
    if group is not None or len(bodies) < 2:  # nodes of different bodies stay apart
        merged = representatives(cells)
    cells = repaired(cells, merged)
    check_connected(cells, hint)
    mesh, number = _mesh(cells)
    check_elements(cells, mesh)
    mesh = mesh.with_boundaries(_boundaries(mesh, groups, dim, number[merged]))
    left_out = len(groups.points) - len(np.unique(cells.nodes[cells.nodes < len(groups.points)]))
    log.info(
        "%s: %d elements (%s) of the body, %d nodes, from (%s) to (%s) in the unit of the scene;"
        " boundaries: %s; %d nodes of the file belong to none of its elements",
        path, mesh.nelements, cells.kind, np.count_nonzero(number >= 0),
        place_words(mesh.p.min(axis=1)), place_words(mesh.p.max(axis=1)),
        ", ".join(mesh.boundaries or {}) or "none", left_out,
    )  # fmt: skip
    return mesh


def name_boundaries(
    mesh: skfem.Mesh, places: Mapping[str, Mapping[int, tuple[float, float]]]
) -> skfem.Mesh:
    """Add boundaries to a mesh, named by where they are: name -> {axis: (least, largest
    coordinate)}.

    They are the facets of the surface whose corners all lie within these limits, to a millionth of
    the size of the body. InputError if no facet lies there.
    """
    facets = mesh.boundary_facets()
    corners = mesh.p[:, mesh.facets[:, facets]]
    near = CLOSE * np.ptp(mesh.p, axis=1).max()
    found = {}
    for name, limits in places.items():
        inside = np.ones(len(facets), dtype=bool)
        for axis, (low, high) in limits.items():
            inside &= np.all((corners[axis] >= low - near) & (corners[axis] <= high + near), axis=0)
        if not inside.any():
            first, last = place_words(mesh.p.min(axis=1)), place_words(mesh.p.max(axis=1))
            raise InputError(
                f"no facet of the surface lies at boundary {name!r}; the body reaches from"
                f" ({first}) to ({last})."
            )
        found[name] = facets[inside]
    return mesh.with_boundaries(found) if found else mesh


def _place(path: Path, groups: FileGroups) -> tuple[int, np.ndarray]:
    """Dimension of the bodies, 2 or 3, and the nodes (dim, n) in as many coordinates."""
    dim = max(dims for _, nodes, dims in groups.blocks if len(nodes))
    if dim < 2:
        raise InputError(
            f"mesh file '{path}': it holds no elements of a body, neither in a plane nor in space."
        )
    points = np.asarray(groups.points, dtype=float)
    own = [nodes.ravel() for _, nodes, dims in groups.blocks if dims == dim]
    cells = np.unique(np.concatenate(own))
    lost = cells[~np.all(np.abs(points[cells]) < LARGEST, axis=1)]
    if len(lost):
        raise InputError(
            f"mesh file '{path}': the coordinates of node"
            f" {lost[0] + 1} are no numbers below {LARGEST:g}."
        )
    if dim == points.shape[1]:
        return dim, points.T
    spread = np.ptp(points[cells], axis=0)
    if spread.min() > EQUAL * spread.max():
        raise InputError(
            f"mesh file '{path}': it holds a surface in space only; mesh the volume inside it, too."
        )
    across = 2 if spread[2] <= EQUAL * spread.max() else int(np.argmin(spread))
    if across != 2:
        said = "%s: the mesh lies across the %s axis; the other coordinates keep their order"
        log.info(said, path, "xyz"[across])
    return 2, np.delete(points, across, axis=1).T


def _elements(
    path: Path, groups: FileGroups, dim: int, points: np.ndarray, group: str | None
) -> Cells:
    """The elements of a group, all of one type, serendipity elements completed."""
    bodies = ", ".join(groups.names(dim)) or "none"
    if group is not None and group not in groups.names(dim):
        note = f"there is no group {group!r}"
        if group in groups.names(dim - 1):
            note = f"{group!r} is a group of facets, a boundary"
        raise InputError(f"mesh file '{path}': {note}; its groups of elements are {bodies}.")
    found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    before: dict[str, int] = {}
    for i, (kind, nodes, dims) in enumerate(groups.blocks):
        if dims == dim:
            chosen = np.arange(len(nodes))
            if group is not None:
                chosen = groups.members[group, dim].get(i, chosen[:0])
            if len(chosen):
                found.setdefault(kind, []).append((nodes[chosen], chosen + before.get(kind, 0)))
            before[kind] = before.get(kind, 0) + len(nodes)
    other = next((kind for kind in found if kind not in CORNERS), "")
    if other or len(found) != 1:
        kinds = {name: _kinds(groups, name, dim) for name in groups.names(dim) if group is None}
        pure = [name for name, own in kinds.items() if len(own) == 1 and own <= CORNERS.keys()]
        fault = f"elements of type {groups.words.get(other, repr(other))} cannot be used; make"
        fault += " triangles, quadrilaterals, tetrahedra or hexahedra of first or second order"
        if not other:
            words = " and ".join(groups.words.get(kind, kind) for kind in found)
            fault = f"the body mixes elements of type {words}; make all of one type"
        choice = f", or choose one of its groups: {', '.join(pure)}" if pure else ""
        raise InputError(f"mesh file '{path}': {fault}{choice}.")
    ((kind, parts),) = found.items()
    nodes, numbers = (np.concatenate(each) for each in zip(*parts))
    return complete(Cells(path, kind, points, nodes.T.astype(np.int64), numbers))


def _kinds(groups: FileGroups, name: str, dim: int) -> set[str]:
    """The types of the elements of a group."""
    return {groups.blocks[i][0] for i, own in groups.members[name, dim].items() if len(own)}


def _mesh(cells: Cells) -> tuple[skfem.Mesh, np.ndarray]:
    """The mesh of scikit-fem, and its own node for every node of the file, or -1."""
    import meshio
    from skfem.io.meshio import from_meshio

    corners = np.unique(cells.corners)
    inner = np.unique(cells.nodes[len(cells.corners) :])
    both = np.intersect1d(corners, inner)
    if len(both):
        raise cells.refused(
            int(np.argmax(np.any(cells.nodes == both[0], axis=0))),
            "a node of {} is a corner of one element and"
            " within an edge of another; mesh this place again.",
        )
    kept = np.concatenate([corners, inner])
    number = np.full(cells.points.shape[1], -1)
    number[kept] = np.arange(len(kept))
    block = cells.kind, number[cells.nodes].T
    try:
        mesh = from_meshio(
            meshio.Mesh(cells.points[:, kept].T, [block]), force_meshio_type=cells.kind
        )
    except (IndexError, ValueError) as error:  # there are not as many nodes as edges
        raise InputError(
            f"mesh file '{cells.path}': neighbouring elements do not share the nodes within their"
            " edges; mesh it again."
        ) from error
    return mesh, number


def _boundaries(
    mesh: skfem.Mesh, groups: FileGroups, dim: int, number: np.ndarray
) -> dict[str, np.ndarray]:
    """Name -> facets on the surface; `number` is the mesh's node for each of the file, or -1."""
    outer = mesh.boundary_facets()
    corners = mesh.facets[:, outer]
    found: dict[str, np.ndarray] = {}
    for name in groups.names(dim - 1):
        hits = np.zeros(0, dtype=int)
        for i, elements in groups.members[name, dim - 1].items():
            kind, nodes, _ = groups.blocks[i]
            many = 2 if dim == 2 else CORNERS.get(kind, nodes.shape[1])
            hits = np.append(hits, facets_at(mesh, number[nodes[elements][:, :many]].T))
        hits = np.unique(hits[hits >= 0])
        inner = mesh.f2t[1, hits] >= 0
        if inner.any():
            said = "no boundary of the body holds %s of %s, inside the body"
            log.warning(said, count(int(inner.sum()), "facet"), name)
        if not inner.all():
            found[name] = hits[~inner]
    skin = np.isin(np.arange(mesh.nvertices), corners)
    for name, nodes in groups.point_sets.items():
        own = number[nodes]  # those of other bodies are -1, those within edges come last
        there = np.zeros(mesh.nvertices, dtype=bool)
        there[own[(own >= 0) & (own < mesh.nvertices)]] = True
        inside = np.all(there[corners], axis=0)
        if np.any(there & ~skin):
            log.info("the nodes %s fill the body, or a part of it: they are no boundary", name)
        elif inside.any() and set(found.setdefault(name, outer[inside])) != set(outer[inside]):
            log.warning("facets and other nodes are both named %s; the facets are taken", name)
    return found


def _tell_others(path: Path, groups: FileGroups) -> None:
    """Warn of shells and lines that are no side or edge of an element of a body. A sum of random
    numbers of the corners, which are equal where nodes lie on each other, is the key of each.
    """
    dim = max(dims for _, nodes, dims in groups.blocks if len(nodes))
    others = [(kind, nodes, dims) for kind, nodes, dims in groups.blocks if 0 < dims < dim]
    if not others:
        return
    size = np.ptp(groups.points, axis=0).max() or 1.0
    with np.errstate(invalid="ignore"):  # nodes of no element may have no place
        steps = np.round(groups.points / (CLOSE * size))
    places = np.unique(steps, axis=0, return_inverse=True)[1]
    numbers = np.random.default_rng(0).integers(0, 2**63, len(groups.points), dtype=np.uint64)
    key = numbers[places.ravel()]
    sides = [np.zeros(0, dtype=np.uint64)]
    for kind, nodes, dims in groups.blocks:
        for face in FACES.get(kind.rstrip("0123456789"), ()) if dims == dim else ():
            sides.append(key[nodes[:, list(face)]].sum(axis=1))
            sides += [key[nodes[:, [i, j]]].sum(axis=1) for i, j in zip(face, face[-1:] + face)]
    known, lost = np.unique(np.concatenate(sides)), {1: set[int](), 2: set[int]()}
    for kind, nodes, dims in others:
        corners = nodes[:, : 2 if dims == 1 else CORNERS.get(kind, nodes.shape[1])]
        lost[dims].update(np.setdiff1d(key[corners].sum(axis=1), known).tolist())
    for dims, what in ((1, "line"), (2, "shell")):
        if lost[dims]:
            said = "%s: %s off the sides and edges of all elements of bodies, left out"
            log.warning(said, path, count(len(lost[dims]), what))
