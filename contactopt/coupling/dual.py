"""Integrals of dual functions over the overlap of two surfaces: areas and weights of the contacts.

The mathematics is in contactopt.coupling.mortar. On the covered part G of a cell, the functional
int psi_v f / a_v is the value at vertex v of the best linear fit of f. Where G is a part of the
cell only, hat functions and vertices are those of the smallest similar cell around G
(Overlap.window), so that fields are nowhere continued beyond G. The functional is computed as the
mean of f plus the slopes of the fit, from hat functions less their means on G: the condition of the
system then does not depend on where G lies in the cell, but on its shape alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from contactopt.coupling.faces import Faces, cross
from contactopt.coupling.rounded_kinks import Rounding
from contactopt.coupling.segments import Overlap

SLIVER = (
    # directions in which G extends less than the square root of this, over the cell: fields are
    # constant there
    1e-11
)
WEAK = 0.2  # contacts with less than this share of their area pass it on to a neighbour
BLOCK = 200_000  # points of integration at a time


@dataclass(frozen=True, eq=False)
class Integrals:
    """What the overlap of an own surface with another one gives to k contacts.

    nodes    (k,) nodes of the own side
    areas    (k,) integrals of the hat functions over the covered part, with the weight of the
             integrals
    partial  (k,) whether a cell is covered in part only: there the contact lies where its weights
             put it, not at its node
    own      (k, nodes of the own body) and
    other    (k, nodes of the other body): weights W and W' with unit row sums
    apart    (dim, k) weighted vector from the other true surface to the own one [length]
    least    least distance of the true surfaces at a point of integration [length], negative where
             they overlap
    nearest  (dim,) this point
    """

    nodes: np.ndarray
    areas: np.ndarray
    partial: np.ndarray
    own: sp.csr_matrix
    other: sp.csr_matrix
    apart: np.ndarray
    least: float
    nearest: np.ndarray


def integrate(own: Faces, other: Faces, points: Overlap, full: np.ndarray) -> Integrals:
    """Integrate the dual functions of one surface over its overlap with another.

    Parameters
    ----------
    own : The side that carries the contacts, with n points.
    other : The other side, with n' points.
    points : The points of integration of the overlap, at least one.
    full : (n,) integrals of the hat functions over all of the own surface.

    Returns
    -------
    The contacts on the own side: nodes (k,), areas (k,), the sparse weights W (k, n) and W' (k, n')
    whose rows add up to one, and the distances between the surfaces.
    """
    count = own.cells.shape[1]
    # The cells that the other side covers at all, and the face and the place in it of each.
    used, cell = np.unique(points.cell, return_inverse=True)
    face, local = used // len(own.cells), used % len(own.cells)

    first = np.searchsorted(cell, np.arange(len(used)))  # points come in the order of the cells

    def summed(values: np.ndarray) -> np.ndarray:
        return np.add.reduceat(values, first, axis=1).T

    # Per cell: a_v = int phi_v, the mean of every hat function, and the matrix int (phi_v - mean)
    # (phi_w - mean).
    begin, width = points.window[:, :, points.cell]
    phi = own.hats((own.local(local[cell], points.at) - begin) / width)
    area = summed(phi * points.measure)  # (cell, v)
    whole = area.sum(axis=1)
    mean = area / whole[:, None]
    centred = phi - mean[cell].T
    mass = summed((centred[:, None] * centred * points.measure).reshape(count * count, -1)).reshape(
        -1, count, count
    )
    # The best linear fit of f at vertex v is the mean of f plus its slopes, fit (v, w) int
    # centred_w f.
    fit = _slopes(mass, area, whole)  # value at vertex v less the mean = fit (v, w) int centred_w f

    def functional(values: np.ndarray, block: slice) -> np.ndarray:
        """(pair, v, j) int psi_v f_j over the points of a block, summed for every pair of a cell
        and a face.
        """
        c = cell[block]
        # psi_v = a_v (1 / whole + fit centred) on the cell, times the measure of every point.
        dual = area[c].T * (1 / whole[c] + np.einsum("gvw,wg->vg", fit[c], centred[:, block]))
        weighted = dual * points.measure[block]
        return np.stack([np.add.reduceat(w * values, pairs, axis=1).T for w in weighted], axis=1)

    # Vertices of cells become contacts; those that are hardly covered pass their share on.
    nodes, rows = np.unique(own.faces[face[:, None], own.cells[local]], return_inverse=True)
    rows = _pass_on(rows.reshape(area.shape), area, full[nodes])
    strong, rows = np.unique(rows, return_inverse=True)
    nodes, rows = nodes[strong], rows.reshape(area.shape)
    areas = np.bincount(rows.ravel(), area.ravel(), len(nodes))
    partial = np.zeros(len(nodes), dtype=bool)
    partial[rows[np.any(points.window[1][:, used] < 1, axis=0)]] = True
    # Sum int psi_i N_j over blocks of points, so that memory stays bounded: W of the own side, W'
    # of the other, and
    # the mean vector x - x' between the true places on both surfaces.
    W = sp.csr_matrix((len(nodes), own.points.shape[1]))
    W_other = sp.csr_matrix((len(nodes), other.points.shape[1]))
    apart = np.zeros((own.dim, len(nodes)))
    rounding = Rounding(other, points) if other.degree == 1 else None
    least, deepest = np.inf, np.zeros(own.dim)
    for start in range(0, len(cell), BLOCK):
        block = slice(start, start + BLOCK)
        pairs = np.flatnonzero(
            np.diff(points.cell[block], prepend=-1) | np.diff(points.face[block], prepend=-1)
        )
        row = rows[cell[block]][pairs]
        places = []
        for surface, faces, at in (
            (own, points.cell // len(own.cells), points.at),
            (other, points.face, points.there),
        ):
            N = surface.shapes(at[:, block])
            column = surface.faces[faces[block]][pairs]
            term = collect(functional(N, block), row, column, (len(nodes), surface.points.shape[1]))
            if surface is own:
                W = W + term
            else:
                W_other = W_other + term
                if rounding is not None:
                    term = collect(
                        functional(rounding.values(block), block),
                        row,
                        rounding.columns(block, pairs),
                        (len(nodes), rounding.rises.shape[0]),
                    )
                    W_other = W_other + term @ rounding.rises
            places.append(surface.true(surface.locations(faces[block], at[:, block])[0]))
        # The deepest overlap of the surfaces, for a message.
        distance = -np.sum((places[0] - places[1]) * _unit_normals(own, points, block), axis=0)
        if distance.min() < least:
            least, deepest = float(distance.min()), places[0][:, np.argmin(distance)]
        vector = functional(places[0] - places[1], block)
        for d in range(own.dim):
            apart[d] += np.bincount(row.ravel(), vector[:, :, d].ravel(), len(nodes))
    scale = sp.diags(1 / areas)
    return Integrals(
        nodes, areas, partial, tidy(scale @ W), tidy(scale @ W_other), apart / areas, least, deepest
    )


def _pass_on(rows: np.ndarray, area: np.ndarray, full: np.ndarray) -> np.ndarray:
    """Contacts (cell, v) at the vertices of cells; those hardly covered give way to the strongest.

    The force of the other surface's edge would be divided by an area as small as you like.
    """
    share = np.bincount(rows.ravel(), area.ravel(), len(full)) / full
    weak = (share < WEAK)[rows]
    best = np.argmax(share[rows], axis=1)
    weak &= ~np.all(weak, axis=1)[:, None]  # on a cell that is larger than the other surface
    return np.where(weak, rows[np.arange(len(rows)), best][:, None], rows)


def _unit_normals(own: Faces, points: Overlap, block: slice) -> np.ndarray:
    """(dim, g) outward unit normals of the own faces at points of integration."""
    face = points.cell[block] // len(own.cells)
    normal = cross(own.locations(face, points.at[:, block])[1]) * own.turn[face]
    return np.asarray(normal / np.linalg.norm(normal, axis=0))


def _slopes(mass: np.ndarray, area: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """(cell, v, w) from the moments of a field with the centred hat functions to its fit at the
    vertices, less its mean.
    """
    values, vectors = np.linalg.eigh(mass)
    large = values > SLIVER * whole[:, None]
    inverse = np.where(large, 1 / np.where(large, values, 1.0), 0.0)
    plain = np.einsum("cvi,ci,cwi->cvw", vectors, inverse, vectors)
    share = area / whole[:, None]
    left = plain - np.einsum("cv,cvw->cw", share, plain)[:, None, :]
    return np.asarray(left - np.einsum("cvw,cw->cv", left, share)[:, :, None])


def collect(
    values: np.ndarray, row: np.ndarray, column: np.ndarray, shape: tuple[int, int]
) -> sp.csr_matrix:
    """Sum values into a sparse matrix.

    Parameters
    ----------
    values : (pair, v, j) values.
    row : (pair, v) rows.
    column : (pair, j) columns.
    shape : Of the matrix.

    Returns
    -------
    The matrix. Values at the same place are added.
    """
    rows, columns = np.broadcast_arrays(row[:, :, None], column[:, None, :])
    return sp.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape)


def tidy(W: sp.csr_matrix) -> sp.csr_matrix:
    """Make the rounding in weights zero, and let every row add up to one exactly, whatever the
    condition of a sliver.

    Parameters
    ----------
    W : (k, n) weights.

    Returns
    -------
    The same weights but for rounding.
    """
    W = sp.csr_matrix(W)
    W.data[np.abs(W.data) < 1e-14] = 0.0
    W.eliminate_zeros()
    return sp.csr_matrix(sp.diags(1 / np.asarray(W.sum(axis=1)).ravel()) @ W)
