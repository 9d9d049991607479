"""The tractions between tetrahedra that bring an equilibrated stress nearest to another one.

The tractions of a facet F are known by their moments m_Fa (dim,) with the hat functions of its
vertices. At the vertex a of an element E of the volume V they make the force

    h_Ea = sum over the facets F of E at a  of  +-m_Fa.

E is in balance if h_Ea = V T grad phi_a for a symmetric matrix T, the mean stress of the element,
because these are the forces that do no work in rigid motions. T then is the symmetric part of
sum_a h_Ea (x_a - c)' / V, where c is the centroid. The forces at a vertex that is free add up to
zero, so the stresses T of all elements are in weak equilibrium: they do no work in hat functions.

Any moments m become those of elements in balance in three steps, written P m:

1. T is formed from the forces h of m by the formula for balanced ones.
2. T - C e(w) is in weak equilibrium, if w is the displacement of the body under the forces
   int T : e(phi). This takes one solve with the factors of the body.
3. The smallest change of m that leaves the forces V (T - C e(w)) grad phi_a is taken. It is found
   vertex by vertex (contactopt.bounds.vertex_balance).

The energy of the stress is minimised over balanced moments by conjugate gradients, preconditioned
by P D^-1 P' with the diagonal D of its second derivative, averaged over the components. An L2 norm
is minimised, so the number of steps does not grow with the number of elements, but with how long
they are.

Source: Ladeveze, Rougeot (1997), New advances on a posteriori error on constitutive relation in
f.e. analysis, Comput. Methods Appl. Mech. Eng. 150, for tractions of which not every force at a
vertex is that of the finite elements.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp

from contactopt.bounds.vertex_balance import Balance
from contactopt.material import Material, lame

if TYPE_CHECKING:
    from contactopt.bounds.tetrahedra import Tetrahedra


STEPS = 30  # at most


class ForceResponse(NamedTuple):
    """The degree of displacements, and those (dim, nodes) under forces per thickness."""

    degree: int
    moved: Callable[[np.ndarray], np.ndarray]


class Energy(NamedTuple):
    """Half the energy by moments (facets dim, dim): products with its second derivative, its
    diagonal averaged over components, its slope at zero, and twice the energy there.
    """

    product: Callable[[np.ndarray], np.ndarray]
    diagonal: np.ndarray
    slope: np.ndarray
    twice: float


@dataclass(frozen=True, eq=False)
class BalancedMoments:
    """The map P defined at the top, and its transpose, for the elements of a body."""

    cells: Tetrahedra
    material: Material
    balance: Balance
    answer: ForceResponse

    @cached_property
    def _slopes(self) -> sp.csr_matrix:
        """(e dim, nodes) the mean gradients of a displacement by its nodal values."""
        cells, (ends, edges) = self.cells, self.cells.between
        d, G, t = cells.dim, cells.slopes, cells.mesh.t
        if self.answer.degree == 2:  # the mean slope of l (2 l - 1), and of 4 l l' on an edge
            between = 4 / (d + 1) * (G[:, ends[0]] + G[:, ends[1]])
            G = np.concatenate([(4 / (d + 1) - 1) * G, between], axis=1)
            t = np.concatenate([t, cells.mesh.nvertices + edges])
        value = G.swapaxes(1, 2)  # (e, dim, nodes of an element)
        column = np.broadcast_to(t.T[:, None], value.shape)
        starts = np.arange(value[..., 0].size + 1) * len(t)
        shape = (len(starts) - 1, int(t.max()) + 1)
        return sp.csr_matrix((value.ravel(), column.ravel(), starts), shape)

    @cached_property
    def _back(self) -> sp.csr_matrix:
        """Its transpose."""
        return self._slopes.T.tocsr()

    def _strains(self, F: np.ndarray) -> np.ndarray:
        """The mean strains (e, dim, dim) under forces of the stresses F over the volume."""
        d = self.cells.dim
        w = self.answer.moved((self._back @ F.reshape(-1, d)).T)
        return _symmetric((self._slopes @ w.T).reshape(-1, d, d))

    def _stresses(self, strains: np.ndarray) -> np.ndarray:
        lam, shear = lame(self.material)
        trace = np.trace(strains, axis1=1, axis2=2)[:, None, None]
        return np.asarray(2 * shear * strains + lam * trace * np.eye(self.cells.dim))

    def _weakly_balanced(self, F: np.ndarray) -> np.ndarray:
        """Constant stresses less those of the displacement under their forces, over the volume."""
        return F - self.cells.volume[:, None, None] * self._stresses(self._strains(F))

    def smooth(self, stress: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The means of a stress (e, dim + 1, dim, dim) at the vertices, weighted by volume; and
        mean stresses (e, dim, dim) near these in weak equilibrium with the same loads.
        """
        t, volume = self.cells.mesh.t, self.cells.volume[:, None, None]
        total, weight = np.zeros((t.max() + 1, *stress.shape[2:])), np.zeros((t.max() + 1, 1, 1))
        for a, corner in enumerate(t):
            np.add.at(total, corner, volume * stress[:, a])
            np.add.at(weight, corner, volume)
        near = np.moveaxis((total / weight)[t], 0, 1)
        mean = stress.mean(axis=1)
        change = self._weakly_balanced(volume * (near.mean(axis=1) - mean))
        return near, mean + change / volume

    def of(self, m: np.ndarray) -> np.ndarray:
        """P m of moments (facets dim, dim)."""
        cells, balance, d = self.cells, self.balance, m.shape[1]
        h = (balance.matrix @ np.where(balance.open, m, 0.0)).reshape(-1, d + 1, d)
        F = self._weakly_balanced(_symmetric(cells.arms @ h))
        left = (h - cells.slopes @ F).reshape(-1, d)
        return np.where(balance.open, m - balance.made(left), 0.0)

    def transposed(self, m: np.ndarray) -> np.ndarray:
        """P' m."""
        cells, balance, d = self.cells, self.balance, m.shape[1]
        h = balance.transposed(np.where(balance.open, m, 0.0)).reshape(-1, d + 1, d)
        T = _symmetric(cells.slopes.swapaxes(1, 2) @ h)
        T = T - self._strains(cells.volume[:, None, None] * self._stresses(T))
        left = (h - cells.arms.swapaxes(1, 2) @ T).reshape(-1, d)
        return np.where(balance.open, m - balance.matrix.T @ left, 0.0)

    def nearest(self, energy: Energy) -> np.ndarray:
        """Balanced moments (facets dim, dim) that make the energy almost least."""
        m, left, twice = np.zeros(energy.slope.shape), -energy.slope, energy.twice
        way, size = m, 0.0
        for _ in range(STEPS):
            close = self.of(self.transposed(left) / energy.diagonal)
            before, size = size, float(np.sum(left * close))
            if size <= 0:
                break
            way = close + (size / before * way if before else 0.0)
            turned = energy.product(way)
            step = size / float(np.sum(way * turned))
            m, left = m + step * way, left - step * turned
            twice -= step * size
            if step * size < 0.05 * twice:  # the last step gains less of the energy
                break
        return m


def _symmetric(T: np.ndarray) -> np.ndarray:
    return (T + T.swapaxes(1, 2)) / 2
