"""Mortar coupling of two surfaces whose nodes do not match, with dual multipliers.

One side, the finer one unless told otherwise, carries the contacts. Its linear cells (contactopt.interface.faces) have
hat functions phi_i; on the part G of every cell that the other side covers,

    a_i = int_G phi_i,    psi_i linear on the cell,    int_G psi_i phi_j = delta_ij a_i,

the dual basis of the covered part. With the shape functions N_j of the own side and N'_j of the other, evaluated at the
places that face each other,

    W_ij = int_G psi_i N_j / a_i,    W'_ij = int_G psi_i N'_j / a_i,    u_i = W_ij u_j - W'_ij u'_j,

and a contact force r_i acts by r_i W_ij on the own side, by -r_i W'_ij on the other. The functional psi_i / a_i of a field
is the value at contact i of its best linear fit on the covered part. Hence:

* Rows of W and of W' add up to one, so that forces are equal and opposite.
* The psi_i add up to one, so that a uniform pressure, r_i = p a_i, gives every node of both sides exactly the integral of
  its shape function: the patch test. It holds on partly covered faces too.
* A contact outside the other surface, whose cell is partly covered, keeps its place: fields are continued linearly to it.
  Contacts without any covered cell are left out, and those that a covered part hardly reaches (WEAK) pass their share of
  it on to the strongest contact of the same cell.

**Moments.** Forces act at W x and W' x'. The vector e_i = W_ij x_j - W'_ij x'_j between these places is zero where the
surfaces lie on each other, but not where both are polygons inscribed in one curve; the moment of interface forces is the
sum of e_i x r_i. It has a part that belongs to the geometry: a gap g_i closes along the normal before forces arise, so
that e_i - g_i n_i is the lever that remains in contact. This rest is removed by evaluating the displacement of the own
side at the other end of the lever, as a rotating surface carries it there:

    u_i = W u - W' u' - omega_i(u) x l_i,      omega_i(u) = J^-1 sum_j w_j rho_j x u_j,   J = sum_j w_j (rho_j^2 - rho_j rho_j'),

with omega_i the mean rotation of the nodes of the faces around contact i, rho_j their places from their centre, w_j the
areas of the faces. It is exact for rigid motions, so that these give u = 0 at l_i = e_i, and by transposition forces on both bodies have
no resultant moment. Since the lever is of second order in the size of the faces, so is what it changes. l_i also
contains the gap itself, but at most an eighth of the size of a face (LEVER): the arc over a face of one radius deviates
that much, so that polygons are in equilibrium whatever they are inscribed in, and the rest of a larger gap is left to the
geometry. In an axisymmetric scene moments vanish by symmetry, and no lever is needed.

**Contacts that are supported.** Where a support holds a component at a contact's node, that component of u_i is taken from
this node alone, and from the other body at the place that faces it (`alone`); on a plane of symmetry both are at
rest. The cone of the contact is untouched.

Sources: Wohlmuth (2000), A mortar finite element method using dual spaces for the Lagrange multiplier, SIAM J. Numer. Anal.
38, 989-1012; Popp, Gitterle, Gee, Wall (2010), A dual mortar approach for 3D finite deformation contact with consistent
linearization, Int. J. Numer. Meth. Engng 83, 1428-1465; Cichosz, Bischoff (2011), Consistent treatment of boundaries with
mortar contact formulations using dual Lagrange multipliers, Comput. Methods Appl. Mech. Engrg 200, 1317-1332; Puso (2004),
A 3D mortar method for solid mechanics, Int. J. Numer. Meth. Engng 59, 315-336 (rigid motions of curved interfaces).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import KDTree
from skfem.quadrature import get_quadrature

from contactopt.bodies.elements import FACES
from contactopt.errors import InputError
from contactopt.interface.segments import Overlap, overlap
from contactopt.interface.faces import Faces, cross, evaluate

SLIVER = 1e-11  # directions in which a covered part extends less than the square root of this: fields are constant there
WEAK = 1e-5  # contacts with less than this share of the covered part of their cells pass it on to a neighbour
LEVER = 1 / 8  # of the size of a contact's cells: larger gaps are levers of the geometry, not of the faces
ROUNDING = 1e-11  # shorter levers, over the size of faces, are rounding
BLOCK = 200_000  # points of integration at a time
OVERLAP = 1e-9  # initial overlap, over the extent of the contact surface, that is reported

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Mortar:
    """k contacts between two surfaces; of every pair, the upper body comes first.

    own      0 or 1: the body whose nodes carry the contacts
    nodes    (k,) these nodes
    areas    (k,) areas of the covered parts, with the weight of the integrals
    normals  (dim, k) unit normals, outward from the lower body
    gap      (k,) initial gap [length]
    points   (dim, k) positions of the nodes
    weights  two (k, nodes of the body): what the displacement of the nodes contributes to that of the contacts
    alone    two (k, nodes of the body): the displacement at the contact's own node, and at the place facing it
    lever    (dim, k) l_i, from the other body to the own one [length]; zero where the surfaces lie on each other
    around   (k, nodes of the own body) weights w of the rotations
    """

    own: int
    nodes: np.ndarray
    areas: np.ndarray
    normals: np.ndarray
    gap: np.ndarray
    points: np.ndarray
    weights: tuple[sp.csr_matrix, sp.csr_matrix]
    alone: tuple[sp.csr_matrix, sp.csr_matrix]
    lever: np.ndarray
    around: sp.csr_matrix

    def components(self, body: int, points: np.ndarray, held: np.ndarray) -> list[list[sp.csr_matrix]]:
        """Matrices G[c][d] (k, nodes): how displacements d of the nodes of a body contribute to component c of the contacts.

        points  (dim, nodes) coordinates of the body's nodes
        held    (dim, k) components that supports hold at the contacts' nodes on the own body
        The relative displacement is that of the upper body less that of the lower one.
        """
        dim, k = self.lever.shape
        W, alone = self.weights[body], self.alone[body]
        empty = sp.csr_matrix(W.shape)
        G = [[empty] * dim for _ in range(dim)]
        for c in range(dim):
            G[c][c] = W - sp.diags(held[c].astype(float)) @ (W - alone)
        if body == self.own and np.any(self.lever):
            for c, row in enumerate(rotations(self.around, points, self.lever)):
                for d, part in enumerate(row):
                    G[c][d] = G[c][d] - sp.diags((~held[c]).astype(float)) @ part
        return G


def mortar(upper: Faces, lower: Faces, own: str | None = None) -> Mortar:
    """Contacts between two surfaces.

    own  'upper' or 'lower': the body that carries the contacts; None: the one with more contacts where they face each other
    Raises InputError if the surfaces face each other nowhere.
    """
    if own not in (None, "upper", "lower"):
        raise InputError(f"the side that carries the contacts must be 'upper', 'lower' or None; got {own!r}.")
    pair = (upper, lower)
    first = 0 if own == "upper" else 1
    mine, theirs = pair[first], pair[1 - first]
    normals, sizes = contact_normals(mine)
    points = overlap(mine, theirs, normals)
    if own is None and _contacts(theirs, points.face) > _contacts(mine, points.cell // len(mine.cells)):
        return mortar(upper, lower, "upper")
    sign = 1.0 if first == 1 else -1.0  # normals leave the lower body
    if not len(points.cell):
        raise InputError(
            f"the contact boundaries of body '{upper.name}' and body '{lower.name}' face each other nowhere; "
            "check the boundaries' names, the bodies' positions, and which of them is the upper one."
        )
    nodes, areas, W, W_other, apart, least = _integrate(mine, theirs, points)
    n = sign * normals[:, nodes]
    gap = -sign * np.sum(n * apart, axis=0)
    alone, alone_other = _alone(mine, theirs, points, nodes)
    e = W @ mine.points.T - W_other @ theirs.points.T
    lever = np.zeros_like(n) if mine.weight[1] else _lever(e.T, -sign * n, gap, LEVER * sizes[nodes])
    _report_overlap(least, np.ptp(mine.points[:, nodes], axis=1).max(), pair)
    sides = [(W, alone), (W_other, alone_other)]
    (W0, alone0), (W1, alone1) = sides if first == 0 else sides[::-1]
    return Mortar(
        first, nodes, areas, n, gap, mine.points[:, nodes], (W0, W1), (alone0, alone1), lever, _around(mine, nodes)
    )


def _contacts(surface: Faces, faces: np.ndarray) -> int:
    """Number of contacts on some faces of a surface."""
    return len(np.unique(surface.faces[np.unique(faces)][:, surface.cells]))


def contact_normals(surface: Faces) -> tuple[np.ndarray, np.ndarray]:
    """Outward unit normals (dim, n), integrals of hat functions times normals, at contact nodes; sizes (n,) of the cells."""
    n, count = surface.points.shape[1], len(surface.faces)
    total, area = np.zeros(surface.points.shape), np.zeros(n)
    reference, hat = FACES[surface.kind][:2]
    at, share = get_quadrature(reference, 4)
    phi = evaluate(hat, at)[0]
    share = share / len(surface.cells)  # of the reference face
    for cell in surface.cells:
        places = np.tile(surface.places[:, cell] @ phi, count)
        face = np.repeat(np.arange(count), at.shape[1])
        normal = cross(surface.locations(face, places)[1]) * surface.turn[face]
        split = normal.reshape(len(normal), count, -1)
        length = np.linalg.norm(split, axis=0)
        for v, corner in enumerate(cell):
            node = surface.faces[:, corner]
            area += np.bincount(node, length @ (phi[v] * share), n)
            for d in range(len(total)):
                total[d] += np.bincount(node, split[d] @ (phi[v] * share), n)
    normals = np.divide(total, np.linalg.norm(total, axis=0), where=area > 0, out=np.zeros_like(total))
    return normals, area ** (1 / (surface.dim - 1))


def _integrate(own: Faces, other: Faces, points: Overlap) -> tuple[np.ndarray, ...]:
    """Contacts and their integrals.

    Returns nodes (k,), areas (k,), weights on both sides, the weighted vector (dim, k) from the other true surface to the
    own one, and the least distance of the true surfaces at a point of integration with this point.
    """
    count = own.cells.shape[1]
    used, cell = np.unique(points.cell, return_inverse=True)
    face, local = used // len(own.cells), used % len(own.cells)

    first = np.searchsorted(cell, np.arange(len(used)))  # points come in the order of the cells

    def summed(values: np.ndarray) -> np.ndarray:
        return np.add.reduceat(values, first, axis=1).T

    phi = own.hats(points.cell % len(own.cells), points.at)
    area = summed(phi * points.measure)  # (cell, v)
    whole = area.sum(axis=1)
    mean = area / whole[:, None]
    centred = phi - mean[cell].T
    mass = summed((centred[:, None] * centred * points.measure).reshape(count * count, -1)).reshape(-1, count, count)
    fit = _slopes(mass, area, whole)  # value at vertex v less the mean = fit (v, w) int centred_w f

    def functional(values: np.ndarray, block: slice) -> np.ndarray:
        """(pair, v, j) int psi_v f_j over the points of a block, summed for every pair of a cell and a face."""
        c = cell[block]
        dual = area[c].T * (1 / whole[c] + np.einsum("gvw,wg->vg", fit[c], centred[:, block]))
        weighted = dual * points.measure[block]
        return np.stack([np.add.reduceat(w * values, pairs, axis=1).T for w in weighted], axis=1)

    nodes, rows = np.unique(own.faces[face[:, None], own.cells[local]], return_inverse=True)
    rows = _pass_on(rows.reshape(area.shape), area, whole)
    strong, rows = np.unique(rows, return_inverse=True)
    nodes, rows = nodes[strong], rows.reshape(area.shape)
    areas = np.bincount(rows.ravel(), area.ravel(), len(nodes))
    W = sp.csr_matrix((len(nodes), own.points.shape[1]))
    W_other = sp.csr_matrix((len(nodes), other.points.shape[1]))
    apart = np.zeros((own.dim, len(nodes)))
    least, deepest = np.inf, np.zeros(own.dim)
    for start in range(0, len(cell), BLOCK):
        block = slice(start, start + BLOCK)
        pairs = np.flatnonzero(np.diff(points.cell[block], prepend=-1) | np.diff(points.face[block], prepend=-1))
        row = rows[cell[block]][pairs]
        places = []
        for surface, faces, at in ((own, points.cell // len(own.cells), points.at), (other, points.face, points.there)):
            N = surface.shapes(at[:, block])
            column = surface.faces[faces[block]][pairs]
            term = _collect(functional(N, block), row, column, (len(nodes), surface.points.shape[1]))
            if surface is own:
                W = W + term
            else:
                W_other = W_other + term
            places.append(surface.true(surface.locations(faces[block], at[:, block])[0]))
        distance = -np.sum((places[0] - places[1]) * _unit_normals(own, points, block), axis=0)
        if distance.min() < least:
            least, deepest = float(distance.min()), places[0][:, np.argmin(distance)]
        vector = functional(places[0] - places[1], block)
        for d in range(own.dim):
            apart[d] += np.bincount(row.ravel(), vector[:, :, d].ravel(), len(nodes))
    scale = sp.diags(1 / areas)
    return nodes, areas, _clean(scale @ W), _clean(scale @ W_other), apart / areas, (least, deepest)


def _pass_on(rows: np.ndarray, area: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Contacts (cell, v) at the vertices of cells, where those that a cell hardly reaches give way to the strongest there.

    Next to a sliver of a covered part, the contact beyond it would ask the same as the one before it.
    """
    count = rows.max(initial=-1) + 1
    share = np.bincount(rows.ravel(), area.ravel(), count)
    around = np.bincount(rows.ravel(), np.repeat(whole, rows.shape[1]), count)
    weak = (share < WEAK * around)[rows]
    best = np.argmax(np.where(weak, -1.0, area), axis=1)
    return np.where(weak, rows[np.arange(len(rows)), best][:, None], rows)


def _unit_normals(own: Faces, points: Overlap, block: slice) -> np.ndarray:
    """(dim, g) outward unit normals of the own faces at points of integration."""
    face = points.cell[block] // len(own.cells)
    normal = cross(own.locations(face, points.at[:, block])[1]) * own.turn[face]
    return np.asarray(normal / np.linalg.norm(normal, axis=0))


def _slopes(mass: np.ndarray, area: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """(cell, v, w) from the moments of a field with the centred hat functions to its fit at the vertices, less its mean."""
    values, vectors = np.linalg.eigh(mass)
    large = values > SLIVER * whole[:, None]
    inverse = np.where(large, 1 / np.where(large, values, 1.0), 0.0)
    plain = np.einsum("cvi,ci,cwi->cvw", vectors, inverse, vectors)
    share = area / whole[:, None]
    left = plain - np.einsum("cv,cvw->cw", share, plain)[:, None, :]
    return np.asarray(left - np.einsum("cvw,cw->cv", left, share)[:, :, None])


def _collect(values: np.ndarray, row: np.ndarray, column: np.ndarray, shape: tuple[int, int]) -> sp.csr_matrix:
    """Sparse matrix of values (pair, v, j) in rows (pair, v) and columns (pair, j)."""
    rows, columns = np.broadcast_arrays(row[:, :, None], column[:, None, :])
    return sp.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape)


def _clean(W: sp.csr_matrix) -> sp.csr_matrix:
    """Rounding made zero, and rows made to add up to one exactly, whatever the condition of a sliver."""
    W = sp.csr_matrix(W)
    W.data[np.abs(W.data) < 1e-14] = 0.0
    W.eliminate_zeros()
    return sp.csr_matrix(sp.diags(1 / np.asarray(W.sum(axis=1)).ravel()) @ W)


def _alone(own: Faces, other: Faces, points: Overlap, nodes: np.ndarray) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """The own node of every contact, and the shape functions of the other side at the place that faces it."""
    k = len(nodes)
    mine = sp.csr_matrix((np.ones(k), (np.arange(k), nodes)), (k, own.points.shape[1]))
    x = own.points[:, nodes]
    near = KDTree(own.locations(points.cell // len(own.cells), points.at)[0].T).query(x.T)[1]
    there = other.locate(points.face[near], x, points.axes[near], points.there[:, near])
    there = np.clip(there, 0.0, 1.0)
    if other.corners == 3:
        there /= np.maximum(there.sum(axis=0), 1.0)
    N = other.shapes(there)
    theirs = _collect(N.T[:, None, :], np.arange(k)[:, None], other.faces[points.face[near]], (k, other.points.shape[1]))
    return mine, _clean(theirs)


def _lever(e: np.ndarray, up: np.ndarray, gap: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """l (dim, k): the part of e that is no gap, and of the gap at most `limit`; `up` are normals along which it opens."""
    lever = e - up * (gap - np.clip(gap, -limit, limit))
    scale = ROUNDING * max(limit.max() / LEVER, np.abs(e).max())
    return np.asarray(np.where(np.linalg.norm(lever, axis=0) > scale, lever, 0.0))


def _around(own: Faces, nodes: np.ndarray) -> sp.csr_matrix:
    """(k, n) areas of the faces that contact and node have in common."""
    f, size = len(own.faces), own.points.shape[1]
    corners = own.points[:, own.faces[:, : own.corners]]
    extent = np.ptp(corners, axis=2).max(axis=0)
    incident = sp.csr_matrix(
        (np.ones(own.faces.size), (own.faces.ravel(), np.repeat(np.arange(f), own.faces.shape[1]))), (size, f)
    )
    return sp.csr_matrix(incident[nodes] @ sp.diags(extent ** (own.dim - 1)) @ incident.T)


def rotations(around: sp.csr_matrix, points: np.ndarray, lever: np.ndarray) -> list[list[sp.csr_matrix]]:
    """Matrices (k, n) from displacements d of the nodes to component c of omega_i x l_i."""
    dim, k = lever.shape
    w = sp.coo_matrix(around)
    active = np.any(lever != 0, axis=0)[w.row]
    i, j, weight = w.row[active], w.col[active], w.data[active]
    total = np.bincount(i, weight, k)
    centre = np.stack([np.bincount(i, weight * x[j], k) for x in points]) / np.where(total > 0, total, 1.0)
    rho = points[:, j] - centre[:, i]
    cross3 = np.zeros((len(i), 3, 3))  # rho x
    full = np.zeros((3, len(i)))
    full[:dim] = rho
    cross3[:, 0, 1], cross3[:, 0, 2], cross3[:, 1, 2] = -full[2], full[1], -full[0]
    cross3 -= cross3.transpose(0, 2, 1)
    moments = -np.einsum("g,gab,gbc->gac", weight, cross3, cross3)
    J = np.stack([np.bincount(i, m, k) for m in moments.reshape(len(i), 9).T], axis=1).reshape(k, 3, 3)
    inverse = np.linalg.pinv(J, rcond=1e-10, hermitian=True)
    arm = np.zeros((k, 3, 3))  # -(lever x) = x lever
    tall = np.zeros((3, k))
    tall[:dim] = lever
    arm[:, 0, 1], arm[:, 0, 2], arm[:, 1, 2] = tall[2], -tall[1], tall[0]
    arm -= arm.transpose(0, 2, 1)
    values = np.einsum("gab,gbc,gcd,g->gad", arm[i], inverse[i], cross3, weight)
    return [[sp.csr_matrix((values[:, c, d], (i, j)), around.shape) for d in range(dim)] for c in range(dim)]


def _report_overlap(least: tuple[float, np.ndarray], extent: float, pair: tuple[Faces, Faces]) -> None:
    distance, place = least
    if distance < -OVERLAP * extent:
        where = ", ".join(f"{c:.4g}" for c in place)
        _log.warning(
            "bodies '%s' and '%s' overlap initially, by up to %.3g at (%s)", *(s.name for s in pair), -distance, where
        )
