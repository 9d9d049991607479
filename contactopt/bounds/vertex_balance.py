"""The balance of elements at their vertices, the first step of contactopt.bounds.tetrahedra."""

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components


class Balance:
    """The equations of the balance of elements at their vertices.

    matrix  (elements (dim + 1), facets dim) of one component, from moments to forces
    known   (facets, dim) whether a component of the traction is given
    """

    def __init__(self, matrix: sp.csc_matrix, known: np.ndarray):
        d, self.matrix = known.shape[1], matrix
        self.open = np.repeat(~known, d, axis=0)
        self.parts: list[tuple[np.ndarray, sp.csc_matrix, Any]] = []
        for c in range(d):
            chosen = np.flatnonzero(self.open[:, c])
            if self.parts and np.array_equal(chosen, self.parts[-1][0]):
                self.parts.append(self.parts[-1])
            else:
                own = self.matrix[:, chosen]
                self.parts.append((chosen, own, _inverse(own)))

    def made(self, forces: np.ndarray) -> np.ndarray:
        """The smallest moments (facets dim, dim) that make forces (rows, dim)."""
        out = np.zeros(self.open.shape)
        for c, (chosen, own, solve) in enumerate(self.parts):
            out[chosen, c] = own.T @ solve(forces[:, c])
        return out

    def transposed(self, moments: np.ndarray) -> np.ndarray:
        """The transpose of made(), (rows, dim) of (facets dim, dim)."""
        out = np.empty((self.matrix.shape[0], moments.shape[1]))
        for c, (chosen, own, solve) in enumerate(self.parts):
            out[:, c] = solve(own @ moments[chosen, c])
        return out


def _inverse(balance: sp.csc_matrix) -> Callable[[np.ndarray], np.ndarray]:
    """The inverse of D D' in blocks for vertices; a free vertex has a dependent equation."""
    D = (balance @ balance.T).tocoo()
    count, group = connected_components(D, directed=False)
    # where each facet at a vertex joins two elements, the sum of all equations is zero
    alone = np.abs(np.asarray(balance.sum(axis=0)).ravel())
    free = np.bincount(group, abs(balance) @ alone, count) == 0
    size, order = np.bincount(group), np.argsort(group, kind="stable")
    first = np.cumsum(size) - size  # of each block in this order
    slot = np.empty(len(group), dtype=int)
    slot[order] = np.arange(len(group)) - first[group[order]]
    blocks = []
    for n in np.unique(size):
        own = np.flatnonzero(size == n)
        rows, number = order[first[own][:, None] + np.arange(n)], np.full(count, -1)
        number[own] = np.arange(len(own))
        entries = np.flatnonzero(size[group[D.row]] == n)
        block = np.zeros((len(own), n, n))
        block[number[group[D.row[entries]]], slot[D.row[entries]], slot[D.col[entries]]] = D.data[
            entries
        ]
        block[free[own], 0, 0] += 1.0
        blocks.append((rows, np.linalg.inv(block)))

    def solve(forces: np.ndarray) -> np.ndarray:
        out = np.empty(forces.shape)
        for rows, inverse in blocks:
            out[rows] = (inverse @ forces[rows][..., None])[..., 0]
        return out

    return solve
