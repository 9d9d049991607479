"""Meshes divided everywhere or where marked; boundaries keep their names and their curvature.

scikit-fem divides the elements: all of them into halves, or marked ones, by red, green and blue
patterns in the plane and by bisection in space. It forgets the named boundaries. Every new boundary
facet lies in one old boundary facet, which gives it its names. New nodes then move to the surface
that the mesh stands for, which `boundary_curves` finds.
"""

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import skfem
from scipy.spatial import cKDTree
from skfem import Mesh, MeshTet

from contactopt.cards import count
from contactopt.checks import place_words
from contactopt.errors import InputError
from contactopt.meshes.barycentric import barycentric, frames_of
from contactopt.meshes.bisection import bisected, uncut
from contactopt.meshes.cells import (
    CURVED,
    area_vectors,
    is_curved,
    knowing,
    outer_corners,
    straight,
    volumes,
)
from contactopt.meshes.curves import plane_curves
from contactopt.meshes.facet_surfaces import space_curves
from contactopt.meshes.given_curves import Curve

log = logging.getLogger(__name__)
FLAT = 0.1  # least share of its volume that an element keeps where its nodes move to a curve
BENT = 0.15  # sagitta of an edge over its length, beyond which the mesh is too coarse for its curve
SMALLEST = 1e-10  # elements are not divided below this fraction of the coordinates or of the body
Function = Callable[[np.ndarray], np.ndarray]
Curves = Mapping[str, Function | None]  # by the name of the boundary; None where it is flat


# scikit-fem says of large arrays that it copies them; no user can do anything about it
logging.getLogger("skfem.mesh.mesh").addFilter(
    lambda record: "C_CONTIGUOUS" not in record.getMessage()
)


class TooSmall(InputError):
    """All marked elements are so small that their halves would have no volume for rounding."""


def boundary_curves(mesh: Mesh) -> dict[str, Curve | None]:
    """Each boundary's line or surface by name, '' for the rest; None where flat."""
    return plane_curves(mesh) if len(mesh.p) == 2 else space_curves(mesh)


def divide(mesh: Mesh, marked: np.ndarray, curves: Curves) -> Any:
    """Divide the marked elements (by number) of a mesh of straight triangles or tetrahedra, and
    others as far as it takes to stay conforming; named boundaries stay.

    `curves` puts new nodes on the true surface. Elements that are as small as rounding allows stay
    whole; TooSmall if all marked ones are. A new node stays on its edge where it would turn an
    element inside out on the curve.
    """
    marked = np.asarray(marked)
    corners = mesh.p[:, mesh.t[:, marked]]
    size = np.ptp(corners, axis=1).max(axis=0)
    scale = max(np.abs(mesh.p).max(), np.ptp(mesh.p, axis=1).max())
    large = size > SMALLEST * scale
    if len(marked) and not large.any():
        place = place_words(corners[:, :, 0].mean(axis=1))
        raise TooSmall(
            f"the elements near ({place}) cannot be divided"
            " further: they are as small as rounding allows."
        )
    return _refined(mesh, marked[large], curves)


def graded(mesh: Mesh, large: Callable[[np.ndarray], np.ndarray], curves: Curves) -> Any:
    """Divide elements and their parts while `large` marks their corners, as `divide` does."""
    if not isinstance(mesh, MeshTet):
        while len(marked := np.flatnonzero(large(mesh.p[:, mesh.t]))):
            mesh = divide(mesh, marked, curves)
        return mesh
    cut, held = uncut(mesh), _present(mesh, curves)
    members = {name: facets_of(mesh, name) for name in held}
    while len(marked := np.flatnonzero(large(cut.p[:, cut.t]))):
        new = bisected(cut, marked)
        points, fresh = new.p.copy(), np.arange(cut.p.shape[1], new.p.shape[1])
        for name, curve in held.items():
            on = np.isin(new.facets, members[name])
            nodes = [np.delete(new.t, v, axis=0)[:, mine].ravel() for v, mine in enumerate(on)]
            mine = np.intersect1d(fresh, np.concatenate(nodes))
            if len(mine):
                points[:, mine] = curve(points[:, mine])
        straight_edges = MeshTet(new.p, new.t.astype(np.int32), sort_t=False)
        cut = new._replace(p=_unfolded(straight_edges, points).p)
    return cut.mesh(mesh)


def split(mesh: Mesh, curves: Curves) -> Any:
    """Halve all elements of a mesh, with new nodes of curved boundaries on their curves, as for
    `divide`.

    Order and named boundaries stay. In a mesh of second order the nodes on edges and faces become
    corners.
    """
    fine = _refined(straight(mesh), 1, curves, mesh.doflocs if is_curved(mesh) else None)
    return bent(fine, curves) if is_curved(mesh) else fine


def _refined(
    mesh: Mesh, how: int | np.ndarray, curves: Curves, places: np.ndarray | None = None
) -> Mesh:
    """The mesh divided as scikit-fem is told, its new nodes at `places`, if any, and on curves."""
    if isinstance(mesh, MeshTet) and not isinstance(how, int):
        fine = bisected(uncut(mesh), how).mesh(mesh)
    else:
        fine = named_like(mesh, replace(mesh, _boundaries=None, _subdomains=None).refined(how))
    new = np.arange(mesh.p.shape[1], fine.p.shape[1])
    points = fine.p.copy() if places is None else places.copy()
    for name, curve in _present(mesh, curves).items():
        mine = np.intersect1d(new, np.unique(fine.facets[:, facets_of(fine, name)]))
        if len(mine):
            points[:, mine] = curve(points[:, mine])
    return _unfolded(fine, points)


def facets_of(mesh: Mesh, name: str) -> np.ndarray:
    """Number the facets (f,) of a boundary; the name '' stands for what has no name."""
    if name:
        return np.asarray(mesh.boundaries[name])
    named = np.concatenate([[0][:0], *(mesh.boundaries or {}).values()])
    return np.setdiff1d(mesh.boundary_facets(), named)


def _present(mesh: Mesh, curves: Curves) -> dict[str, Function]:
    """The curves of boundaries that have facets."""
    return {
        name: curve
        for name, curve in curves.items()
        if curve is not None and len(facets_of(mesh, name))
    }


def _unfolded(mesh: Mesh, points: np.ndarray) -> Any:
    """The mesh with its nodes at `points`, but for those that would turn an element inside out."""
    nodes = np.asarray(mesh.dofs.element_dofs if is_curved(mesh) else mesh.t)
    nodes = nodes[:, np.any(points != mesh.doflocs, axis=0)[nodes].any(axis=0)]
    before = volumes(mesh, mesh.doflocs[:, nodes])
    sense, least = np.sign(before[:, -1:]), FLAT * np.abs(before).min(axis=1)
    points, kept = points.copy(), 0
    while (bad := (volumes(mesh, points[:, nodes]) * sense).min(axis=1) < least).any():
        back = np.unique(nodes[:, bad])
        back = back[np.any(points[:, back] != mesh.doflocs[:, back], axis=0)]
        if not len(back):
            break
        points[:, back], kept = mesh.doflocs[:, back], kept + len(back)
    if kept:
        said = "%s off the curved boundary, where it would turn elements inside out"
        log.warning(said, count(kept, "node stays", "nodes stay"))
    return knowing(replace(mesh, doflocs=points), mesh)


def bent(mesh: Mesh, curves: Curves) -> Any:
    """Bend the edges and faces of a mesh of straight elements along its curved boundaries: a mesh
    of second order, or the same mesh where there is no curve.

    Elements and named boundaries keep their numbers. An edge that would leave its chord by more
    than BENT of its length, or fold an element, stays straight.
    """
    known = {name: (facets_of(mesh, name), curve) for name, curve in _present(mesh, curves).items()}
    if not known:
        return mesh
    flat = knowing(replace(mesh, _boundaries=None, _subdomains=None), mesh)
    made = knowing(CURVED[mesh.refdom.__name__].from_mesh(flat), flat)
    shift, plane = np.zeros_like(made.doflocs), len(mesh.p) == 2
    edges = flat.facets if plane else flat.edges
    middle = (made.dofs.facet_dofs if plane else made.dofs.edge_dofs)[0]
    for facets, curve in known.values():
        mine = facets if plane else np.unique(flat.f2e[:, facets])
        ends = mesh.p[:, edges[:, mine]]
        _shift(shift, middle[mine], ends, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0), curve)
    # the node within a face or an element follows those around it
    within, local = made.dofs.element_dofs, shift[:, made.dofs.element_dofs]
    if isinstance(mesh, skfem.MeshQuad):
        shift[:, within[8]] = local[:, 4:8].sum(axis=1) / 2
    elif isinstance(mesh, skfem.MeshHex):
        faces = made.dofs.facet_dofs[0]
        shift[:, faces] = shift[:, middle[mesh.f2e]].sum(axis=1) / 2
        for facets, curve in known.values():
            corners = mesh.p[:, mesh.facets[:, facets]]
            _shift(shift, faces[facets], corners, np.ptp(corners, axis=1).max(axis=0), curve)
        local = shift[:, within]
        shift[:, within[26]] = local[:, 20:26].sum(axis=1) / 2 - local[:, 8:20].sum(axis=1) / 4
    made = _unfolded(made, made.doflocs + shift)
    return knowing(replace(made, _boundaries=mesh.boundaries), made)


def slivers(mesh: Mesh, curves: Curves) -> np.ndarray:
    """The volumes (elements,) between the straight facets of simplices and the curves that these
    stand for [length^dim], negative where the body lies beyond its curve.

    A facet with the area vector n that leaves its curve by d at the middles of its edges encloses
    2/3 n . d in the plane and 1/3 n . (the sum of d) in space, by the rule of its second order.
    """
    found, plane = np.zeros(mesh.t.shape[1]), len(mesh.p) == 2
    for name, curve in _present(mesh, curves).items():
        facets = facets_of(mesh, name)
        corners = mesh.p[:, outer_corners(mesh, facets)]
        normal = area_vectors(corners)
        for i, j in combinations(range(len(mesh.p)), 2):
            middle, size = (corners[:, i] + corners[:, j]) / 2, corners[:, i] - corners[:, j]
            off = curve(middle) - middle
            near = np.linalg.norm(off, axis=0) <= BENT * np.linalg.norm(size, axis=0)
            share = np.where(near, np.sum(normal * off, axis=0), 0.0) * (2 if plane else 1) / 3
            np.add.at(found, mesh.f2t[0, facets], share)
    return found


def _shift(
    shift: np.ndarray, nodes: np.ndarray, corners: np.ndarray, size: np.ndarray, curve: Function
) -> None:
    """Write down how nodes amid corners (dim, c, n) move to a curve that is near beside `size`."""
    places = corners.mean(axis=1)
    off = curve(places) - places
    near = np.linalg.norm(off, axis=0) <= BENT * size
    shift[:, nodes[near]] = off[:, near]


def named_like(old: Mesh, new: Mesh) -> Mesh:
    """Give a mesh of a part of the same body the named boundaries of another one."""
    if not old.boundaries:
        return new
    facets, outer = old.boundary_facets(), new.boundary_facets()
    # of quadrilaterals all triangles between their corners
    choices = np.array(list(combinations(range(len(old.facets)), len(old.p))))
    corners = np.concatenate([old.p[:, old.facets[c][:, facets]] for c in choices], axis=2)
    facets = np.tile(facets, len(choices))
    centres = new.p[:, new.facets[:, outer]].mean(axis=1)
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=0).max(axis=0)
    # A facet holds points of the ball around its corners alone, however the sizes of facets vary.
    held = cKDTree(centres.T).query_ball_point(middle.T, radius)
    within = np.concatenate([[0][:0], *held]).astype(int)
    of = np.repeat(np.arange(len(facets)), [len(own) for own in held])
    off = barycentric(frames_of(corners), of, centres[:, within])[1]
    order = np.lexsort((off, within))
    found, first = np.unique(within[order], return_index=True)
    parent = np.full(len(outer), -1)
    parent[found] = facets[of[order[first]]]
    names = {
        name: np.sort(outer[np.isin(parent, members)]).astype(np.int32)
        for name, members in old.boundaries.items()
    }
    return replace(new, _boundaries=names)
