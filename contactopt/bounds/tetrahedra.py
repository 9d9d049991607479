"""A stress on tetrahedra in exact equilibrium with loads and contact pressure.

The stress s(u) of finite elements jumps between elements. Here a symmetric stress s* close to it is
made, for which in every element and across every facet

    div s* + f = 0,    s* n = t on loaded and contact boundaries,    s* n continuous,

exactly so for constant body forces f and tractions t that are linear on each facet. There are three
steps.

1. Tractions between elements. On each facet F the traction is linear, and known by its moments m_Fa
   (dim,) with the hat functions phi_a of the vertices a of F. They hold every element E in balance
   if at each of its vertices a

       sum over the facets F of E at a  of  +-m_Fa  =  int_E s(u) grad phi_a - f phi_a.

   Rigid motions of E are combinations of its hat functions, so forces and moments on E balance.
   The equations of one vertex have a solution because u balances the hat function there
   (Galerkin); of all solutions the one is taken that is nearest to the mean of s(u) n from both
   sides.
2. The stress within elements, by the composite elements of Johnson and Mercier: each
   tetrahedron is cut at its centroid into four parts, on which s* is linear. Tractions on the
   boundary and f determine it. It is the image of a stress on the reference element,
   s = B s^ B' / |det B|, where x = B x^ + b, which keeps symmetry, divergence and tractions. So one
   small matrix, made once, serves all elements: H gives the energy int s : C^-1 : s = y' H y of
   the data y of an element, its tractions and body force.
3. A stress nearer to s(u). Conjugate gradients make the energy of s* - s(u) less
   (contactopt.bounds.nearest_tractions), from a stress that is averaged at the vertices and brought
   into balance by one solve.

Sources: Ladeveze, Leguillon (1983), Error estimate procedure in the finite element method and
applications, SIAM J. Numer. Anal. 20, for the tractions; Johnson, Mercier (1978), Some equilibrium
finite element methods for two-dimensional elasticity problems, Numer. Math. 30; Gopalakrishnan,
Guzman, Lee (2024), The Johnson-Mercier elasticity element in any dimensions.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from contactopt.bounds.composite_element import WEIGHT, components, reference_stress
from contactopt.bounds.nearest_tractions import BalancedMoments, Energy, ForceResponse
from contactopt.bounds.simplices import Simplices
from contactopt.bounds.vertex_balance import Balance
from contactopt.material import Material, lame

BLOCK = 8192  # elements at a time


@dataclass(frozen=True, eq=False)
class Tetrahedra(Simplices):
    """Straight-edged tetrahedra, with displacements and stresses on them."""

    def stress(self, material: Material, nodal: np.ndarray) -> np.ndarray:
        """The stress (e, dim + 1, dim, dim) at vertices, of displacements of vertices and edges."""
        lam, shear = lame(material)
        d, t, G = self.dim, self.mesh.t, self.slopes
        ends, edges = self.between
        at_vertex, at_edge = nodal[:, t], nodal[:, self.mesh.nvertices + edges]
        at_edge = at_edge - (at_vertex[:, ends[0]] + at_vertex[:, ends[1]]) / 2
        gradient = np.repeat((at_vertex.transpose(2, 0, 1) @ G)[:, None], d + 1, axis=1)
        for (i, j), bubbles in zip(ends.T, at_edge.transpose(1, 2, 0)):
            there = np.flatnonzero(bubbles.any(axis=1))  # few of linear displacements
            own = 4 * bubbles[there, :, None]
            # the bubble 4 l_i l_j has the slope 4 grad l_j at vertex i
            gradient[there, i] += own * G[there, j, None, :]
            gradient[there, j] += own * G[there, i, None, :]
        strain = (gradient + gradient.swapaxes(2, 3)) / 2
        trace = np.trace(strain, axis1=2, axis2=3)[..., None, None]
        return 2 * shear * strain + lam * trace * np.eye(d)

    def data(self, moments: np.ndarray, force: np.ndarray) -> np.ndarray:
        """(e, inputs) of the reference element: force per volume, and moments of tractions."""
        own = moments.reshape(-1, *moments.shape[2:])
        body = np.broadcast_to(self.ratio[:, None] * force, own.shape[1:])
        both = np.concatenate([own, body[None]]).transpose(1, 2, 0)  # in the axes of space
        return (self.back @ both).transpose(0, 2, 1).reshape(len(self.ratio), -1)

    @cached_property
    def by_moments(self) -> sp.bsr_array:
        """(e inputs, facets dim dim) the data by the moments of facets, without the body force."""
        d, count = self.dim, len(self.volume)
        n = (d + 1) * d  # vertices of facets
        column = (self.opposite[:, None] * d + self.slots).reshape(n, count).T
        value = np.repeat(self.sign.T, d, axis=1)[..., None, None] * self.back[:, None]
        shape = (count * n * d, self.mesh.facets.shape[1] * d * d)
        return sp.bsr_array(
            (value.reshape(-1, d, d), column.ravel(), np.arange(count * n + 1)), shape
        )

    def data_of(self, stress: np.ndarray) -> np.ndarray:
        """The same for a stress (e, dim + 1, dim, dim) that is linear on each element."""
        force = -(stress * self.slopes[:, :, None]).sum(axis=(1, 3))
        return self.data(self._moments(stress), force)

    def _moments(self, stress: np.ndarray) -> np.ndarray:
        """(dim + 1, dim, e, dim) as in data(), of a linear stress."""
        found = []
        for own, normal in zip(self.others, self.outward):
            t = (stress[:, own] * normal[:, None, None]).sum(axis=3).swapaxes(0, 1)
            found.append((t + t.sum(axis=0)) / (self.dim * (self.dim + 1)))
        return np.array(found)

    def form(self, material: Material, chosen: slice | np.ndarray) -> np.ndarray:
        """(e, component, component) the energy by integrals of products of reference components."""
        d, (E, nu) = self.dim, (material.E, material.nu)
        pairs = components()
        base = np.zeros((len(pairs), d, d))
        for number, (i, j) in enumerate(pairs):
            base[number, i, j] = base[number, j, i] = 1.0
        B, ratio = self.map[chosen], self.ratio[chosen]
        G = B.swapaxes(1, 2) @ B
        turned = G[:, None] @ base
        traces = np.trace(turned, axis1=2, axis2=3)
        rows = turned.reshape(-1, len(pairs), d * d)
        columns = turned.swapaxes(2, 3).reshape(rows.shape)
        form = (1 + nu) * rows @ columns.swapaxes(1, 2)
        form -= nu * traces[:, :, None] * traces[:, None]
        form *= (self.volume[chosen] / ratio**2 / E)[:, None, None]
        return form

    def products(self, material: Material, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(e,) integrals of s : C^-1 : s' of two composite stresses by their data."""
        stress, out = reference_stress(), np.zeros(len(one))
        by_inputs, shape = stress.reshape(-1, stress.shape[2]).T, (-1, *stress.shape[:2])
        there = np.flatnonzero(np.any(one != 0, axis=1) & np.any(other != 0, axis=1))
        for own in np.split(there, range(BLOCK, len(there), BLOCK)):
            a, b = ((y[own] @ by_inputs).reshape(shape) for y in (one, other))
            out[own] = np.sum(self.form(material, own) * (a.swapaxes(1, 2) @ b), axis=(1, 2))
        return out * WEIGHT

    @property
    def blocks(self) -> list[slice]:
        """Some elements at a time."""
        return [slice(i, i + BLOCK) for i in range(0, len(self.volume), BLOCK)]

    def equilibrated(
        self,
        material: Material,
        stress: np.ndarray,
        force: np.ndarray,
        held: np.ndarray,
        moments: np.ndarray,
        answer: ForceResponse,
    ) -> tuple[np.ndarray, float]:
        """The data (e, inputs) of the stress s*, and the largest force out of balance at a vertex
        over that of an element.

        `stress` (e, dim + 1, dim, dim) is that of finite elements at vertices, `force` (dim,) per
        volume. Boundary facets are `held` (facets, dim) where tractions are unknown; `moments`
        (facets, dim, dim) are those of the others, vertex by vertex [force per thickness].
        """
        known = (self.mesh.f2t[1] < 0)[:, None] & ~held
        balance = self._once(known.tobytes(), lambda: Balance(self.forces_of_moments, known))
        space = BalancedMoments(self, material, balance, answer)
        near, mean = space.smooth(stress)
        given = np.where(known[:, None], moments, np.nan)
        m, unbalanced = self._tractions(near, mean, force, given, balance)
        missing = self.data(self.seen(m), force) - self.data_of(stress)
        m += space.nearest(self._energy(material, missing)).reshape(m.shape)
        return self.data(self.seen(m), force), unbalanced

    @cached_property
    def arms(self) -> np.ndarray:
        """(e, dim, dim + 1) from the centroid to the vertices."""
        x = self.mesh.p[:, self.mesh.t]
        return np.ascontiguousarray(np.moveaxis(x - x.mean(axis=1, keepdims=True), 2, 0))

    @cached_property
    def forces_of_moments(self) -> sp.csc_matrix:
        """(e (dim + 1), facets dim) from moments to the forces at the vertices."""
        d, count = self.dim, len(self.volume)
        rows, columns, signs = [], [], []
        for o, own in enumerate(self.others):
            for a, slot in zip(own, self.slots[o]):
                rows.append(np.arange(count) * (d + 1) + a)
                columns.append(self.opposite[o] * d + slot)
                signs.append(self.sign[o])
        entries = np.concatenate(signs), (np.concatenate(rows), np.concatenate(columns))
        return sp.csc_matrix(entries, (count * (d + 1), self.mesh.facets.shape[1] * d))

    def seen(self, m: np.ndarray) -> np.ndarray:
        """Moments (facets, dim, dim) as the elements see them."""
        return np.asarray(m[self.opposite[:, None], self.slots] * self.sign[:, None, :, None])

    def _energy(self, material: Material, missing: np.ndarray) -> Energy:
        """The energy of the stress with the data `missing`, by the moments of facets. Single
        precision is enough: it says how far the energy can fall, and nothing about balance.
        """
        d, count, stress = self.dim, self.mesh.facets.shape[1], reference_stress()
        inputs, back = (d + 1) * d * d, self.by_moments.T.tobsr((d, d))  # without the body force
        form = WEIGHT * self.form(material, slice(None))
        size = float(np.abs(form).max()) or 1.0
        single = (form / size).astype(np.float32)
        values = stress.reshape(-1, stress.shape[2]).astype(np.float32)

        def forces(y: np.ndarray) -> np.ndarray:
            turned = []
            for own in self.blocks:
                s = y[own].astype(np.float32) @ values[:, : y.shape[1]].T
                s = s.reshape(-1, *stress.shape[:2]) @ single[own]
                turned.append(s.reshape(len(s), -1) @ values[:, :inputs])
            return size * np.asarray(back @ np.concatenate(turned).ravel()).reshape(-1, d)

        def product(m: np.ndarray) -> np.ndarray:
            return forces((self.by_moments @ m.ravel()).reshape(-1, inputs))

        own = stress[:, :, :inputs].reshape(*stress.shape[:2], -1, d)
        blocks = np.einsum("vani,vbnj->abnij", own, own, optimize=True)
        H = (form.reshape(len(form), -1) @ blocks.reshape(form[0].size, -1)).reshape(-1, d, d)
        B = np.repeat(self.back, inputs // d, axis=0)
        share = np.sum(B * (H @ B), axis=(1, 2)).reshape(-1, d + 1, d) / d
        diagonal = np.zeros((count, d))
        np.add.at(diagonal, (self.opposite[:, None], self.slots), np.moveaxis(share, 0, 2))
        twice = float(self.products(material, missing, missing).sum())
        return Energy(product, diagonal.reshape(-1, 1), forces(missing), twice)

    def _tractions(
        self,
        stress: np.ndarray,
        mean: np.ndarray,
        force: np.ndarray,
        given: np.ndarray,
        balance: Balance,
    ) -> tuple[np.ndarray, float]:
        """Moments (facets, dim, dim) near those of a stress, with `given` ones where not nan, that
        hold all elements in balance at these `mean` stresses (e, dim, dim), and by how much they do
        not.
        """
        d, mesh = self.dim, self.mesh
        m = np.zeros(given.shape)
        for o, own in enumerate(self._moments(stress)):
            share = self.sign[o] * np.where(mesh.f2t[1, self.opposite[o]] >= 0, 0.5, 1.0)
            for slot, moment in zip(self.slots[o], own):
                np.add.at(m, (self.opposite[o], slot), share[:, None] * moment)
        m = np.where(np.isnan(given), m, given)
        needed = self.volume[:, None, None] * (self.slopes @ mean - force / (d + 1))
        needed = needed.reshape(-1, d)
        left = needed - balance.matrix @ m.reshape(-1, d)
        change = balance.made(left)
        left = left - balance.matrix @ change
        size = float(np.abs(needed).max(initial=0.0)) or 1.0
        return m + change.reshape(m.shape), float(np.abs(left).max(initial=0.0)) / size
