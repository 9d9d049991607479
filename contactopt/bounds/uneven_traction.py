"""What an equilibrated stress lacks where a mortar coupling joins facets that do not match.

The contact traction t is linear between the contacts of one side. On a facet F of the other side it
bends wherever a contact lies within it, and ends where the surface of the first side does. The
stress of contactopt.bounds.tetrahedra bears only the linear traction with the same moments. A
stress s in the element T behind F makes up for it, with the rest d of t as traction on F and none
on the other facets: it is in equilibrium, since the moments of d are zero. Its norm adds to that of
s* - s(v) in T. Let T be the image x = B x^ + b of the regular simplex, whose edges have length one.
Then

    s = B s^ B' / |det B|,    s n |F| = B (s^ n^) |F^|,

is in equilibrium with d if s^ is with d^ = B^-1 d |F| / |F^|. So one constant c serves all:

    least int_T s : C^-1 : s  <=  L c int_F^ |d^|^2,    c = sup over d^ of the least int_T^ |s^|^2,

where d^ has zero moments and int_F^ |d^|^2 = 1, and L is the largest ratio of s : C^-1 : s over T
to |s^|^2 over T^. The integral is that of |t^|^2 less that of its linear part, so nothing is cut.

The constant is proved as follows. Divide the edges of F^ into n parts, and so F^ into n^(dim - 1)
facets. Let d' be linear on each, with the moments of d^ there. Composite stresses on a mesh of T^
give an upper bound c_n for such d', by an eigenvalue. The rest d^ - d' has zero moments on each of
the facets. Upon these stand regular simplices that lie in T^ side by side, and a simplex of size
1 / n has the constant c / n. Since the norms of d' and d^ - d' add up in squares, c is at most
c_n + c / n, and

    c <= c_n / (1 - 1 / n).

`python -m experiments.questions.bounds constants` computes CONSTANT so, and shows how near it is.
It is finite, by the inequalities of Korn and of traces. The bound is close where the simplex is
nearly regular and larger for others.

In a plane section nothing needs to be estimated: the element is
cut into a fan of triangles whose outer edges lie between the bends. The stress is the one of least
energy among those of composite elements on the fan, with d on these edges and none on the others.
In bodies of revolution r s takes the place of s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import skfem

from contactopt.bounds.equilibrium_elements import EquilibriumElements
from contactopt.bounds.facing_facets import FacingFacets
from contactopt.bounds.tetrahedra import Tetrahedra
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.meshes.cells import facets_at, measures

if TYPE_CHECKING:
    from contactopt.bounds.pressed_scene import PressedScene

CONSTANT = 1.73  # c of tetrahedra, from 8 parts of an edge
UNBALANCED = 1e-6  # of the force on a piece


def uneven_traction(scene: PressedScene) -> list[np.ndarray]:
    """For every body (e,) an upper bound of the energy norm of what is missing in its elements."""
    out = [np.zeros(0 if own is None else len(own.volume)) for own in scene.cells]
    for pair in (own for own in scene.pairs if own.joined):
        body, facets = pair.sides[1].body, pair.sides[1].facets
        energy = (_by_constant if scene.problem.dim == 3 else _by_fans)(scene, pair)
        elements = scene.cells[body].mesh.f2t[0, facets]
        np.add.at(out[body], elements, np.sqrt(scene.factor * energy))
    return out


def _by_constant(scene: PressedScene, pair: FacingFacets) -> np.ndarray:
    """An upper bound of the least energy behind each facet (f,)."""
    side = pair.sides[1]
    cells, material = scene.cells[side.body], scene.bodies[side.body].body.material
    elements = cells.mesh.f2t[0, side.facets]
    size = measures(pair.points[1])
    return least_energy(cells, material, elements, size, uneven_squares(scene, pair))


def uneven_squares(scene: PressedScene, pair: FacingFacets) -> np.ndarray:
    """(f, dim, dim) integrals of d d' over the facets of the second side, d by their area."""
    points, d, size = pair.rule, scene.problem.dim, measures(pair.points[1])
    facets = points.facets[1]
    t = pair.of_contacts(scene.tractions)[:, points.facets[0]] @ pair.frame  # (v, S, dim)
    t = np.einsum("vSs,vSd->Ssd", points.at[0], t)  # by the area of the first side
    area = size[facets] * np.abs(np.linalg.det(np.moveaxis(pair.ends.at[1, ..., :d], 1, 0)))
    weights = points.weights * (points.weights.sum(axis=1) / area)[:, None]
    square = np.zeros((len(size), d, d))
    own = np.einsum("Ss,Ssd,Sse->Sde", weights, t, t, optimize=True)
    np.add.at(square, facets, own)
    m = pair.moments(1, scene.tractions)
    even = d * (d + 1) / size[:, None] * (m - m.sum(axis=0) / (d + 1))  # at the vertices
    return np.asarray(square - np.einsum("vfd,vfe->fde", even, m))


def least_energy(
    cells: Tetrahedra,
    material: Material,
    elements: np.ndarray,
    size: np.ndarray,
    square: np.ndarray,
) -> np.ndarray:
    """An upper bound (f,) of the least energies of stresses in `elements`, without divergence, with
    tractions d on one facet of area `size` (f,) and none on the others; the moments of d are zero,
    and `square` (f, 3, 3) integrals of d d'.
    """
    regular = regular_tetrahedron()
    points = regular.mesh.p
    form = regular.form(Material(1.0, 0.0), np.zeros(1, dtype=int))[0]
    unit = np.linalg.inv(np.linalg.cholesky(form))
    largest = np.linalg.eigvalsh(unit @ cells.form(material, elements) @ unit.T)[:, -1]
    back = points[:, 1:] @ cells.back[elements]
    own = np.einsum("fai,fij,faj->f", back, square, back) * size / measures(points[:, :3, None])
    return np.asarray(CONSTANT * largest * np.maximum(own, 0.0))


def regular_tetrahedron() -> Tetrahedra:
    """With a vertex at the origin, and edges of the length one."""
    points = np.column_stack([np.zeros(3), np.linalg.cholesky((np.eye(3) + 1) / 2).T])
    return Tetrahedra(skfem.MeshTet(points, np.arange(4)[:, None]))


def _by_fans(scene: PressedScene, pair: FacingFacets) -> np.ndarray:
    """The least energy behind each facet (f,)."""
    side = pair.sides[1]
    cells, material = scene.cells[side.body], scene.bodies[side.body].body.material
    t = pair.of_contacts(scene.tractions)[:, pair.ends.facets[0]] @ pair.frame  # (v, S, dim)
    ends = np.einsum("vSs,vSd->Ssd", pair.ends.at[0, ..., :2], t) * side.sign
    moments = pair.moments(1, scene.tractions)
    corners, outer, rest = [], [], []
    for f in np.unique(pair.rule.facets[1]):
        own = pair.rule.facets[1] == f
        x = pair.ends.at[1, 1, own, :2]  # (pieces, 2)
        a, b = pair.points[1][..., f].T
        length = float(np.linalg.norm(b - a))
        ratio = pair.rule.weights[own].sum(axis=1) / (length * np.abs(np.diff(x))[:, 0])
        at = np.unique(np.concatenate([[0.0, 1.0], x.ravel()]))
        at = at[np.concatenate([[True], np.diff(at) > EQUAL])]
        if len(at) < 3:
            continue
        found = np.zeros((len(at) - 1, 2, 2))  # of pieces that face nothing
        order, turn = np.argsort(x.min(axis=1)), np.argsort(x, axis=1)[..., None]
        per_length = ratio[:, None, None] * np.take_along_axis(ends[own], turn, axis=1)
        found[np.searchsorted(at, x.mean(axis=1)[order]) - 1] = per_length[order]
        even = np.array([[4.0, -2.0], [-2.0, 4.0]]) / length @ moments[:, f]
        shares = np.stack([at[:-1], at[1:]], axis=1)[..., None]
        missing = found - (1 - shares) * even[0] - shares * even[1]
        own_vertices = side.vertices[:, f]
        element = cells.mesh.t[:, cells.mesh.f2t[0, side.facets[f]]]
        tip = cells.mesh.p[:, np.setdiff1d(element, own_vertices)[0]]
        places = a + at[:, None] * (b - a)
        for i in range(len(at) - 1):
            corners.append([places[i], places[i + 1], tip])
            outer.append(f)
            rest.append(missing[i])
    if not corners:
        return np.zeros(len(side.facets))
    mesh, moments = _fans(np.array(corners), np.array(outer), np.array(rest))
    fans = EquilibriumElements(mesh, cells.degree, scene.revolved)
    return np.bincount(outer, _least_energies(fans, moments, material), len(side.facets))


def _fans(corners: np.ndarray, fan: np.ndarray, rest: np.ndarray) -> tuple[Any, np.ndarray]:
    """A mesh of fans of triangles, and moments of tractions, linear on their first edges."""
    count = len(corners)
    follows = np.concatenate([[False], fan[1:] == fan[:-1]])
    number = np.zeros((3, count), dtype=int)
    points: list[np.ndarray] = []
    for e in range(count):
        if not follows[e]:
            points += [corners[e, 2], corners[e, 0]]
            tip = len(points) - 2
        points.append(corners[e, 1])
        number[:, e] = len(points) - 2, len(points) - 1, tip
    mesh = skfem.MeshTri(np.array(points).T, number)
    m = np.zeros((mesh.facets.shape[1], 2, 2))
    facets = facets_at(mesh, number[:2])
    length = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    own = length[:, None, None] / 6 * (rest + rest.sum(axis=1, keepdims=True))
    place = mesh.facets[:, facets] == number[1]  # which of the facet's vertices is the second one
    for v in range(2):
        m[facets, v] = np.where(place[v][:, None], own[:, 1], own[:, 0])
    return mesh, m


def _least_energies(cells: EquilibriumElements, m: np.ndarray, material: Material) -> np.ndarray:
    """The energies (e,) of stresses with these moments of tractions, least in sum."""
    held = np.zeros(m.shape[:2], dtype=bool)
    none = np.zeros_like(cells.stress(material, np.zeros((2, len(m) + cells.mesh.nvertices))))
    stress, missed = cells.equilibrated(material, none, np.zeros(2), held, m)
    if missed > UNBALANCED:
        raise InputError("pieces of the facets in contact are too short for a bound.")
    return np.asarray(cells.products(material, stress, stress))
