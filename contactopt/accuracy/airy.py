"""The stress without loads that brings an equilibrated plane stress nearest to another one.

A plane stress without body force derives from a function A of Airy, cubic on the three parts of
each triangle and smooth across all edges. With the gradients g at the vertices and the mean h of
the gradient along an edge, whose unit tangent t points from its first vertex to the second, and R
the turn by which the outward normal is R t up to sign, the moments of the tractions on the edge are

    R (h - g_1)  and  R (g_2 - h),     h = (A_2 - A_1) / |edge| t + k n.

Unknowns are g and A at the vertices and k on the edges. Those that move a traction that is known
are zero. The energy that they make least is summed up element by element.

On the reference triangle, x = B x^ + b, gradients are B' g and B' h. Since B^-1 R = R B' / det B,
the moments there are those of B' h and B' g over |det B|, by a matrix that is the same for all
elements.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.bodies.solvers.constants import PARDISO_FROM
from contactopt.bodies.solvers.pardiso import PardisoSolver
from contactopt.bodies.solvers.system import System

ALONG = 1e-9  # of a unit vector: components below are zero
TINY = 1e-13  # of the diagonal, added so that functions without stress do no harm
TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])


def _moments() -> np.ndarray:
    """(12, 12) moments on the reference triangle, on each edge (1 2), (0 2), (0 1) for each end its
    components, by the gradients at the vertices and on these edges.
    """
    out = np.zeros((3, 2, 2, 6, 2))
    for o, (a, b, way) in enumerate(((1, 2, 1), (0, 2, -1), (0, 1, 1))):
        out[o, 0, :, a], out[o, 1, :, b] = -way * TURN, way * TURN
        out[o, 0, :, 3 + o], out[o, 1, :, 3 + o] = way * TURN, -way * TURN
    return out.reshape(12, 12)


MOMENTS = _moments()


class Airy:
    """Functions of Airy on triangles, and the energy y' H y of the stress of data y.

    form   (e, p) weights of the `parts` (p, 12, 12) of H, by the moments of tractions on the
           reference triangle;   known  (f, 2) whether a component of a traction is given
    """

    def __init__(self, cells: Any, form: np.ndarray, parts: np.ndarray, known: np.ndarray):
        self.cells, mesh = cells, cells.mesh
        t = mesh.p[:, mesh.facets[1]] - mesh.p[:, mesh.facets[0]]
        self.length = np.linalg.norm(t, axis=0)
        self.t = t / self.length
        self.n = TURN @ self.t
        free = ~self._fixed(known)
        self.size = int(free.sum())
        self.number = np.where(free, np.cumsum(free) - 1, self.size)
        corners = (3 * mesh.t[:, None] + np.arange(3)[:, None]).reshape(9, -1)
        self.at = self.number[np.concatenate([corners, 3 * mesh.nvertices + cells.opposite])]
        self.B = np.ascontiguousarray(np.moveaxis(cells.map, 0, 2))
        table = (MOMENTS.T @ parts @ MOMENTS).reshape(len(parts), -1)
        i, j = np.triu_indices(12)
        shape = (self.size + 1, self.size + 1)  # the last one is left out
        K = sp.csr_matrix(shape)
        for own in cells.blocks:
            H = (table.T @ (form[own].T / cells.ratio[own] ** 2)).reshape(12, 12, -1)
            H = self._by_unknowns(self._by_unknowns(H, own).swapaxes(0, 1), own)
            one, other = self.at[i, own], self.at[j, own]
            place = np.minimum(one, other).ravel(), np.maximum(one, other).ravel()
            K = K + sp.csr_matrix((H[i, j].ravel(), place), shape)
        self.solve = _inverse(K[:-1, :-1])

    def least(self, slope: np.ndarray) -> np.ndarray:
        """What to add to the moments (f, 2, 2), from half the derivative of the energy (e, 12) by
        the moments on the reference triangle.
        """
        mesh = self.cells.mesh
        found = self._by_unknowns(MOMENTS.T @ (slope.T / self.cells.ratio), slice(None))
        left = np.bincount(self.at.ravel(), found.ravel(), self.size + 1)
        x = np.append(-self.solve(left[:-1]), 0.0)[self.number]
        x, k = x[: 3 * mesh.nvertices].reshape(-1, 3).T, x[3 * mesh.nvertices :]
        (g, h), A = x[:2, mesh.facets].swapaxes(0, 1), x[2, mesh.facets]
        owner = mesh.p[:, mesh.t[:, mesh.f2t[0]]].mean(axis=1) - mesh.p[:, mesh.facets[0]]
        way = -np.sign(np.sum(self.n * owner, axis=0))
        mean = (A[1] - A[0]) / self.length * self.t + k * self.n
        made = way * np.stack([TURN @ (mean - g), TURN @ (h - mean)])  # (end, component, f)
        return np.moveaxis(made, 2, 0)

    def _fixed(self, known: np.ndarray) -> np.ndarray:
        """(3 vertices + f,) the unknowns that are zero."""
        mesh = self.cells.mesh
        count = 3 * mesh.nvertices
        fixed = np.zeros(count + len(known), dtype=bool)
        for c in range(2):
            own = np.flatnonzero(known[:, c])
            fixed[3 * mesh.facets[:, own] + 1 - c] = True
            fixed[count + own[np.abs(self.n[1 - c, own]) > ALONG]] = True
            fixed[3 * mesh.facets[:, own[np.abs(self.t[1 - c, own]) > ALONG]] + 2] = True
        return fixed

    def _by_unknowns(self, X: np.ndarray, chosen: slice) -> np.ndarray:
        """Derivatives (12, ..., e) by g, A at the vertices and k on the edges from those by the
        gradients on the reference triangle, of some elements.
        """
        out, cells, B = np.empty(X.shape), self.cells, self.B[..., chosen]
        corners = cells.mesh.p[:, cells.mesh.t[:, chosen]]
        for v in range(3):
            for i in range(2):
                out[3 * v + i] = B[i, 0] * X[2 * v] + B[i, 1] * X[2 * v + 1]
        out[2:9:3] = 0.0
        for o, (a, b) in enumerate(cells.others):
            facet = cells.opposite[o, chosen]
            x = (corners[:, b] - corners[:, a]) / self.length[facet] ** 2
            n = self.n[:, facet]
            p, q = (np.sum(B * own[:, None], axis=0) for own in (x, n))
            mean = X[6 + 2 * o : 8 + 2 * o]
            along = p[0] * mean[0] + p[1] * mean[1]
            out[3 * a + 2] -= along
            out[3 * b + 2] += along
            out[9 + o] = q[0] * mean[0] + q[1] * mean[1]
        return out


class _InPlane(PardisoSolver):
    """Minimum degree, which in the plane takes half the time of METIS."""

    order = 0


def _inverse(upper: sp.csr_matrix) -> Callable[[np.ndarray], np.ndarray]:
    """The inverse of a symmetric matrix of a plane mesh, from its upper triangle."""
    upper = (upper + sp.diags(TINY * upper.diagonal())).tocsr()
    if upper.shape[0] > PARDISO_FROM and find_spec("pypardiso"):
        from pypardiso.pardiso_wrapper import PyPardisoError

        none = np.zeros(upper.shape[0], dtype=int)
        with suppress(PyPardisoError):  # rounding may leave a pivot that is not positive
            return _InPlane(System(upper, none, none, np.zeros((2, 1)))).solve
    full = (upper + sp.triu(upper, 1).T).tocsc()
    order = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
    solve: Callable[[np.ndarray], np.ndarray] = splu(full, diag_pivot_thresh=0.0, **order).solve
    return solve
