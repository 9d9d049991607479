"""The mortar matrices W and W': integrals of dual functions over the overlap of two surfaces.

The mathematics is in contactopt.coupling.mortar. On the covered part G of a cell, the functional
int psi_v f / a_v is the value at vertex v of the best linear fit of f. Where G is a part of the
cell only, hat functions and vertices are those of the smallest similar cell around G
(Overlap.window), so that fields are nowhere continued beyond G. The functional is computed as the
mean of f plus the slopes of the fit, from hat functions less their means on G: the condition of the
system then does not depend on where G lies in the cell, but on its shape alone.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from contactopt.coupling.faces import BLOCK, Faces
from contactopt.coupling.rounded_kinks import Rounding
from contactopt.coupling.segments import Overlap

# fields are constant in directions in which G extends less than the square root of this, over the
# cell
SLIVER = 1e-11
WEAK = 0.2  # contacts with less than this share of their area pass it on to a neighbour


@dataclass(frozen=True, eq=False)
class Integrals:
    """Integrals over the overlap of a surface with another one, for k contacts.

    nodes    (k,) nodes of the own side
    areas    (k,) integrals of the hat functions over the covered part, with the weight of the
             integrals
    full     (k,) the same over all of the faces
    partial  (k,) whether a cell is covered in part only: there the contact lies where its weights
             put it, not at its node
    own      (k, nodes of the own body) and
    other    (k, nodes of the other body): weights W and W' with unit row sums
    across   [c] (k, nodes of the other body): what is added to W' for component c of a
             displacement at planes of symmetry; empty without them (rounded_kinks)
    apart    (dim, k) weighted vector from the other true surface to the own one [length]
    least    least distance of the true surfaces at a point of integration [length], negative where
             they overlap
    nearest  (dim,) this point
    """

    nodes: np.ndarray
    areas: np.ndarray
    full: np.ndarray
    partial: np.ndarray
    own: sp.csr_matrix
    other: sp.csr_matrix
    across: list[sp.csr_matrix]
    apart: np.ndarray
    least: float
    nearest: np.ndarray


def integrate(own: Faces, other: Faces, points: Overlap, full: np.ndarray) -> Integrals:
    """Integrate the dual functions of one surface over its overlap with another.

    The own side, with n points, carries the contacts; `full` (n,) are the integrals of the hat
    functions over all of it. The overlap has at least one point of integration.
    """
    dual = _Dual(own, points)
    nodes, rows, areas, full, partial = _contacts_of(dual, full)
    k, sides = len(nodes), (own, other)
    # Sum int psi_i N_j over blocks of points, so that memory stays bounded: W of the own side, W'
    # of the other, and the mean vector x - x' between the true places on both surfaces.
    W = [sp.csr_matrix((k, side.points.shape[1])) for side in sides]
    apart = np.zeros((own.dim, k))
    rounding = Rounding(other, points) if other.degree == 1 else None
    across = [sp.csr_matrix(W[1].shape) for _ in (rounding.across if rounding else ())]
    least, nearest = np.inf, np.zeros(own.dim)
    for start in range(0, len(points.cell), BLOCK):
        block = slice(start, start + BLOCK)
        new_cell = np.diff(points.cell[block], prepend=-1)
        pairs = np.flatnonzero(new_cell | np.diff(points.face[block], prepend=-1))
        row = rows[dual.cell[block]][pairs]
        faces = points.cell[block] // len(own.cells), points.face[block]
        for i, at in enumerate((points.at[:, block], points.there[:, block])):
            column = sides[i].faces[faces[i]][pairs]
            values = dual.functional(sides[i].shapes(at), block, pairs)
            W[i] = W[i] + collect(values, row, column, W[i].shape)
        here = own.true(points.place[:, block])
        vector = here - other.true(other.locations(faces[1], points.there[:, block])[0])
        if rounding is not None:
            values = dual.functional(rounding.values(block), block, pairs)
            shape = k, rounding.rises.shape[0]
            term = collect(values, row, rounding.columns(block, pairs), shape)
            W[1] = W[1] + term @ rounding.rises
            across = [there + term @ more for there, more in zip(across, rounding.across)]
        # The deepest overlap of the surfaces, for a message.
        distance = -np.sum(vector * points.normal[:, block], axis=0)
        if distance.min() < least:
            least, nearest = float(distance.min()), here[:, np.argmin(distance)]
        means = dual.functional(vector, block, pairs)
        for d in range(own.dim):
            apart[d] += np.bincount(row.ravel(), means[:, :, d].ravel(), k)
    mine, theirs = (tidy(sp.diags(1 / areas) @ part) for part in W)
    across = [sp.csr_matrix(sp.diags(1 / areas) @ part) for part in across]
    apart = apart / areas
    return Integrals(nodes, areas, full, partial, mine, theirs, across, apart, least, nearest)


class _Dual:
    """The dual functions psi_v on the c cells that the other side covers at all.

    corners  (c, v) nodes of the own side at the vertices of the cells
    cell     (g,) the cell of each point of integration, from 0 to c
    area     (c, v) integrals of the hat functions over the covered part
    partial  (c,) whether a cell is covered in part only
    """

    def __init__(self, own: Faces, points: Overlap) -> None:
        used, self.cell = np.unique(points.cell, return_inverse=True)
        face, local = used // len(own.cells), used % len(own.cells)
        self.corners = own.faces[face[:, None], own.cells[local]]
        self.partial = np.any(points.window[1][:, used] < 1, axis=0)
        self.measure = points.measure
        first = np.searchsorted(self.cell, np.arange(len(used)))  # points come in order of cells

        def summed(values: np.ndarray) -> np.ndarray:
            return np.add.reduceat(values, first, axis=1).T

        # The mean of every hat function, and the matrix int (phi_v - mean) (phi_w - mean).
        begin, width = points.window[:, :, points.cell]
        phi = own.hats((own.local(local[self.cell], points.at) - begin) / width)
        self.area = summed(phi * points.measure)
        self.whole = self.area.sum(axis=1)
        self.centred = phi - (self.area / self.whole[:, None])[self.cell].T
        count = len(phi)
        products = self.centred[:, None] * self.centred * points.measure
        mass = summed(products.reshape(count**2, -1)).reshape(-1, count, count)
        # value of the best linear fit of f at vertex v, less the mean = fit (v, w) int centred_w f
        self.fit = _slopes(mass, self.area, self.whole)

    def functional(self, values: np.ndarray, block: slice, pairs: np.ndarray) -> np.ndarray:
        """(pair, v, j) int psi_v f_j from values (j, g) of a block, summed pair by pair."""
        c = self.cell[block]
        slopes = np.einsum("gvw,wg->vg", self.fit[c], self.centred[:, block])
        weighted = self.area[c].T * (1 / self.whole[c] + slopes) * self.measure[block]
        return np.stack([np.add.reduceat(w * values, pairs, axis=1).T for w in weighted], axis=1)


def _contacts_of(
    dual: _Dual, full: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The nodes (k,) of the contacts at the vertices of cells, of which those hardly covered pass
    their share on; the contact (cell, v) of every vertex; covered and full area and `partial` of
    every contact.
    """
    nodes, own = np.unique(dual.corners, return_inverse=True)
    own = own.reshape(dual.area.shape)
    share = np.bincount(own.ravel(), dual.area.ravel(), len(nodes)) / full[nodes]
    strong, rows = np.unique(_pass_on(own, share), return_inverse=True)
    nodes, rows = nodes[strong], rows.reshape(own.shape)
    areas = np.bincount(rows.ravel(), dual.area.ravel(), len(nodes))
    of_faces = dual.area / np.maximum(share[own], 1e-300)  # 0 / 0 is 0
    full = np.bincount(rows.ravel(), of_faces.ravel(), len(nodes))
    partial = np.zeros(len(nodes), dtype=bool)
    partial[rows[dual.partial]] = True
    return nodes, rows, areas, full, partial


def _pass_on(rows: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Contacts (cell, v) at the vertices of cells; those of which a small share is covered give way
    to the strongest, for an edge's force over an area as small as you like would be no pressure.
    """
    weak = (share < WEAK)[rows]
    best = np.argmax(share[rows], axis=1)
    weak &= ~np.all(weak, axis=1)[:, None]  # on a cell that is larger than the other surface
    return np.where(weak, rows[np.arange(len(rows)), best][:, None], rows)


def _slopes(mass: np.ndarray, area: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """(cell, v, w) from moments with the centred hat functions to the fit less its mean."""
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
    """The sparse matrix of values (pair, v, j) at rows (pair, v), columns (pair, j), summed."""
    rows, columns = np.broadcast_arrays(row[:, :, None], column[:, None, :])
    return sp.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape)


def tidy(W: sp.csr_matrix) -> sp.csr_matrix:
    """Weights (k, n) without rounding, whose rows add up to one exactly."""
    W = sp.csr_matrix(W)
    W.data[np.abs(W.data) < 1e-14] = 0.0
    W.eliminate_zeros()
    return sp.csr_matrix(sp.diags(1 / np.asarray(W.sum(axis=1)).ravel()) @ W)
