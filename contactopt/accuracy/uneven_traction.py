"""What an equilibrated stress lacks where a mortar coupling joins facets that do not match.

The contact traction t is linear between the contacts of one side. On a facet of the other side it
bends wherever a contact lies within it, and the stress of contactopt.accuracy.equilibrated bears
only the linear traction with the same moments. The element there is cut into a fan of triangles
whose outer edges lie between the bends. A stress of composite elements on the fan, with the rest of
t on these edges and none on the others, makes up for it: it is in equilibrium, since the moments of
the rest are zero. Of all such stresses that of least energy is taken; its norm adds to that of
s* - s(v).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import skfem

from contactopt.accuracy.equilibrated import Simplices
from contactopt.accuracy.equilibrium_elements import EquilibriumElements
from contactopt.accuracy.facing_facets import measures
from contactopt.errors import InputError
from contactopt.material import Material

SAME = 1e-9  # bends nearer to each other than this share of a facet are one
UNBALANCED = 1e-6  # of the force on a piece
# of the head of this module, and the vertices of the regular tetrahedron with edges of length one
CONSTANT = 1.73
REGULAR = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]]) / np.sqrt(2)


def uneven_traction(scene: Any) -> list[np.ndarray]:
    """For every body (e,) the energy norm of what is missing in its elements."""
    d = scene.problem.dim
    out = [np.zeros(0 if own is None else len(own.volume)) for own in scene.cells]
    for pair in (own for own in scene.pairs if own.joined):
        body, facets = pair.sides[1].body, pair.sides[1].facets
        energy = (_in_plane if d == 2 else _in_space)(scene, pair)
        elements = scene.cells[body].mesh.f2t[0, facets]
        np.add.at(out[body], elements, np.sqrt(scene.factor * energy))
    return out


def _in_space(scene: Any, pair: Any) -> np.ndarray:
    """An upper bound of the least energy behind each facet (f,)."""
    side, points = pair.sides[1], pair.rule
    cells, material = scene.cells[side.body], scene.bodies[side.body].body.material
    area, facets = measures(pair.points[1]), points.facets[1]
    t = pair.of_contacts(scene.tractions)[:, points.facets[0]] @ pair.frame  # (v, S, dim)
    t = np.einsum("vSs,vSd->Ssd", points.at[0], t)
    turn = pair.slopes[0][points.facets[0]] / pair.slopes[1][facets]
    square = np.zeros((len(area), 3, 3))
    weights = points.weights * turn[:, None]
    np.add.at(square, facets, np.einsum("Ss,Ssd,Sse->Sde", weights, t, t, optimize=True))
    m = pair.moments(1, scene.tractions)
    even = 12 / area[:, None] * (m - m.sum(axis=0) / 4)
    square -= np.einsum("vfd,vfe->fde", even, m)
    elements = cells.mesh.f2t[0, side.facets]
    return uneven_energy(cells, material, elements, area, square)


def uneven_energy(
    cells: Any, material: Any, elements: np.ndarray, area: np.ndarray, square: np.ndarray
) -> np.ndarray:
    """An upper bound (f,) of the least energies of stresses in some tetrahedra (f,), without a
    divergence and with tractions on one facet alone, whose moments are zero.

    Parameters
    ----------
    cells, material, elements : The elements of the body, what it is made of, and the tetrahedra.
    area : (f,) of the facets.
    square : (f, dim, dim) integrals over the facets of t t' for the tractions t.
    """
    regular = Simplices(skfem.MeshTet(REGULAR, np.arange(4)[:, None]))
    every = np.zeros(1, dtype=int)
    unit = np.linalg.inv(np.linalg.cholesky(regular.form(Material(1.0, 0.0), every)[0]))
    most = np.linalg.eigvalsh(unit @ cells.form(material, elements) @ unit.T)[:, -1]
    back = np.linalg.inv(regular.back) @ cells.back[elements]  # to the regular one
    size = np.einsum("fai,fij,faj->f", back, square, back) * area / (np.sqrt(3) / 4)
    return CONSTANT * most * np.maximum(size, 0.0)


def _in_plane(scene: Any, pair: Any) -> np.ndarray:
    """The least energy behind each facet (f,)."""
    side = pair.sides[1]
    cells, material = scene.cells[side.body], scene.bodies[side.body].body.material
    t = pair.of_contacts(scene.tractions)[:, pair.ends.facets[0]] @ pair.frame  # (v, S, dim)
    ends = np.einsum("vSs,vSd->Ssd", pair.ends.at[0], t) * side.sign
    moments = pair.moments(1, scene.tractions)
    corners, outer, rest = [], [], []
    for f in np.unique(pair.rule.facets[1]):
        own = pair.rule.facets[1] == f
        x = pair.ends.at[1][1, own]  # (pieces, 2)
        a, b = pair.points[1][..., f].T
        length = float(np.linalg.norm(b - a))
        ratio = pair.rule.weights[own].sum(axis=1) / (length * np.abs(np.diff(x))[:, 0])
        at = np.unique(np.concatenate([[0.0, 1.0], x.ravel()]))
        at = at[np.concatenate([[True], np.diff(at) > SAME])]
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
    fans = EquilibriumElements(mesh, getattr(cells, "degree", 1), scene.revolved)
    return np.bincount(outer, _least_energies(fans, moments, material), len(side.facets))


def _fans(corners: np.ndarray, fan: np.ndarray, rest: np.ndarray) -> tuple[Any, np.ndarray]:
    """A mesh of fans of triangles (e, 3, 2), numbered fan by fan, and the moments (facets, 2, 2) of
    tractions (e, 2, 2) that are linear between the first two corners of each.
    """
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
    edge = {tuple(own): i for i, own in enumerate(np.sort(mesh.facets, axis=0).T.tolist())}
    facets = np.array([edge[tuple(own)] for own in np.sort(number[:2], axis=0).T.tolist()])
    length = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    own = length[:, None, None] / 6 * (rest + rest.sum(axis=1, keepdims=True))
    place = mesh.facets[:, facets] == number[1]  # which of the facet's vertices is the second one
    for v in range(2):
        m[facets, v] = np.where(place[v][:, None], own[:, 1], own[:, 0])
    return mesh, m


def _least_energies(cells: EquilibriumElements, m: np.ndarray, material: Any) -> np.ndarray:
    """The energies (e,) of stresses with these moments of tractions, least in sum."""
    held = np.zeros(m.shape[:2], dtype=bool)
    none = np.zeros_like(cells.stress(material, np.zeros((2, len(m) + cells.mesh.nvertices))))
    stress, missed = cells.equilibrated(material, none, np.zeros(2), held, m)
    if missed > UNBALANCED:
        raise InputError("pieces of the facets in contact are too short for a bound.")
    return np.asarray(cells.products(material, stress, stress))
