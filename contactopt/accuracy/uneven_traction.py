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
import scipy.sparse as sp
import skfem
from scipy.sparse.linalg import splu

from contactopt.accuracy.equilibrated import Simplices
from contactopt.accuracy.equilibrium_elements import EquilibriumElements
from contactopt.errors import InputError

SAME = 1e-9  # bends nearer to each other than this share of a facet are one
UNBALANCED = 1e-6  # of the force on a piece
SOFT = 1e-12  # of the energy: rigid motions of a fan leave as many equations over


def uneven_traction(scene: Any) -> float:
    """The energy norm of what is missing on all joined surfaces."""
    total = 0.0
    for pair in (own for own in scene.pairs if own.joined):
        side, d = pair.sides[1], scene.problem.dim
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
            found = np.zeros((len(at) - 1, 2, d))  # of pieces that face nothing
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
        if corners:
            mesh, moments = _fans(np.array(corners), np.array(outer), np.array(rest))
            if isinstance(cells, EquilibriumElements):
                fans = EquilibriumElements(mesh, cells.degree, cells.revolved)
                energy = _least_in_balance(fans, moments, material)
            else:
                energy = _least_energy(Simplices(mesh), moments, material)
            total += scene.factor * energy
    return float(np.sqrt(total))


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


def _least_in_balance(cells: EquilibriumElements, m: np.ndarray, material: Any) -> float:
    """The least energy of stresses with these moments of tractions."""
    held = np.zeros(m.shape[:2], dtype=bool)
    none = np.zeros_like(cells.stress(material, np.zeros((2, len(m) + cells.mesh.nvertices))))
    stress, missed = cells.equilibrated(material, none, np.zeros(2), held, m)
    if missed > UNBALANCED:
        raise InputError("pieces of the facets in contact are too short for a bound.")
    return float(cells.products(material, stress, stress).sum())


def _least_energy(cells: Simplices, m: np.ndarray, material: Any) -> float:
    """The same of the composite stresses of contactopt.accuracy.equilibrated."""
    mesh, count = cells.mesh, len(cells.volume)
    centre = mesh.p[:, mesh.t].mean(axis=1)
    metric = cells.metric(material, slice(None))
    K = (cells.by_moments.T @ sp.block_diag(metric, format="csr") @ cells.by_moments).tocsr()
    rows, columns, values = [], [], []
    for o, others in enumerate(cells.others):
        for a, slot in zip(others, cells.slots[o]):
            x = mesh.p[:, mesh.t[a]]
            for c in range(2):
                column = (cells.opposite[o] * 2 + slot) * 2 + c
                arm = cells.sign[o] * (x[0] - centre[0] if c else centre[1] - x[1])
                for row, value in ((c, cells.sign[o]), (2, arm)):
                    rows.append(3 * np.arange(count) + row)
                    columns.append(column)
                    values.append(value)
    E = sp.csr_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
        (3 * count, K.shape[0]),
    )
    inner = np.flatnonzero(np.repeat(mesh.f2t[1] >= 0, 4))
    given = m.ravel()
    Ki, Ei = K[inner][:, inner], E[:, inner]
    size = Ki.diagonal().mean()
    soft = sp.diags(-SOFT / size * np.ones(3 * count))
    system = sp.bmat([[Ki, Ei.T], [Ei, soft]], format="csc")
    try:
        factors = splu(system)
    except RuntimeError as error:  # triangles without a height
        raise InputError("pieces of the facets in contact are too short for a bound.") from error
    solved = factors.solve(np.concatenate([-(K @ given)[inner], -E @ given]))
    given[inner] = solved[: len(inner)]
    data = cells.data(cells.seen(given.reshape(m.shape)), np.zeros(2))
    return float(cells.products(material, data, data).sum())
