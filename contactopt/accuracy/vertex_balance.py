"""The balance of elements at their vertices, the first step of contactopt.accuracy.equilibrated."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

STEPS = 8  # of conjugate gradients: more make a stress in space no nearer


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

    def least(self, K: sp.csr_matrix, slope: np.ndarray) -> np.ndarray:
        """Moments m (facets dim dim,) that make no force, with m' K m / 2 + slope' m almost least:
        a few steps of conjugate gradients.
        """

        def kept(m: np.ndarray) -> np.ndarray:
            own = np.where(self.open, m.reshape(self.open.shape), 0.0)
            return np.asarray(own - self.made(self.matrix @ own)).ravel()

        m, left = np.zeros(len(slope)), kept(-slope)
        way, size = left, float(left @ left)
        for _ in range(STEPS):
            if size == 0:
                break
            turned = kept(K @ way)
            step = size / float(way @ turned)
            m, left = m + step * way, left - step * turned
            before, size = size, float(left @ left)
            way = left + size / before * way
        return m


def _inverse(balance: sp.csc_matrix) -> Any:
    """The inverse of D D' for the balance D of elements by facets, where the equations of a vertex
    that nothing holds have one that follows from the others.
    """
    D = (balance @ balance.T).tocsc()
    count, group = connected_components(D, directed=False)
    # where each facet at a vertex joins two elements, the sum of all equations is zero
    alone = np.abs(np.asarray(balance.sum(axis=0)).ravel())
    free = np.bincount(group, abs(balance) @ alone, count) == 0
    first = np.unique(group, return_index=True)[1][free]
    ground = np.zeros(D.shape[0])
    ground[first] = 1.0
    return splu(D + sp.diags(ground, format="csc"), permc_spec="MMD_AT_PLUS_A").solve
