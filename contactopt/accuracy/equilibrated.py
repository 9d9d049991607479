"""A stress in exact equilibrium with loads and contact pressure, made element by element.

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
2. The stress within elements, by the composite elements of Johnson and Mercier: each triangle or
   tetrahedron is cut at its centroid into dim + 1 parts, on which s* is linear. Tractions on the
   boundary and f determine it. It is the image of a stress on the reference element,
   s = B s^ B' / |det B|, where x = B x^ + b, which keeps symmetry, divergence and tractions. So one
   small matrix, made once, serves all elements: H gives the energy int s : C^-1 : s = y' H y of
   the data y of an element, its tractions and body force.
3. A stress nearer to s(u). In the plane all stresses without loads derive from functions of Airy.
   Of these the one is added that makes the energy of s* - s(u) least, a sparse linear system. Long
   thin elements, on which tractions bend, would be far from s(u) without it. In space a few steps
   of conjugate gradients make that energy less with tractions that leave every vertex in balance.

Sources: Ladeveze, Leguillon (1983), Error estimate procedure in the finite element method and
applications, SIAM J. Numer. Anal. 20, for the tractions; Johnson, Mercier (1978), Some equilibrium
finite element methods for two-dimensional elasticity problems, Numer. Math. 30; Gopalakrishnan,
Guzman, Lee (2024), The Johnson-Mercier elasticity element in any dimensions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.accuracy.composite_element import components, reference_energy
from contactopt.accuracy.vertex_balance import Balance
from contactopt.material import Material, lame

BLOCK = 8192  # elements at a time
ALONG = 1e-9  # of a unit vector: components below are zero
TINY = 1e-13  # of the diagonal, added so that functions without stress do no harm


@dataclass(frozen=True, eq=False)
class Simplices:
    """Straight-edged triangles or tetrahedra, with displacements and stresses on them.

    mesh  of scikit-fem, whose vertices are p (dim, vertices) and t (dim + 1, e)
    """

    mesh: Any

    @cached_property
    def dim(self) -> int:
        return len(self.mesh.p)

    @cached_property
    def _map(self) -> np.ndarray:
        """(e, dim, dim) the matrices B from the reference element."""
        x = self.mesh.p[:, self.mesh.t]
        return np.moveaxis(x[:, 1:] - x[:, :1], 2, 0)

    @cached_property
    def _ratio(self) -> np.ndarray:
        """(e,) |det B|."""
        return np.abs(np.linalg.det(self._map))

    @cached_property
    def volume(self) -> np.ndarray:
        """(e,) [length^dim]."""
        return self._ratio / (2 if self.dim == 2 else 6)

    @cached_property
    def slopes(self) -> np.ndarray:
        """(e, dim + 1, dim) gradients of the hat functions."""
        inner = np.linalg.inv(self._map)
        return np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)

    @cached_property
    def others(self) -> np.ndarray:
        """(dim + 1, dim) for each local vertex the others, which span the facet opposite it."""
        every = np.arange(self.dim + 1)
        return np.array([every[every != o] for o in every])

    @cached_property
    def opposite(self) -> np.ndarray:
        """(dim + 1, e) the facet of the mesh opposite each vertex."""
        local = [tuple(facet) for facet in self.mesh.refdom.facets]
        return np.asarray(self.mesh.t2f[[local.index(tuple(own)) for own in self.others]])

    @cached_property
    def slots(self) -> np.ndarray:
        """(dim + 1, dim, e) the place that each of `others` has among the vertices of its facet."""
        corners = self.mesh.facets[:, self.opposite]
        return np.stack(
            [
                [np.argmax(corners[:, o] == self.mesh.t[a], axis=0) for a in own]
                for o, own in enumerate(self.others)
            ]
        )

    @cached_property
    def sign(self) -> np.ndarray:
        """(dim + 1, e) 1 where the normal of the facet points out of the element, else -1."""
        return np.where(self.mesh.f2t[0, self.opposite] == np.arange(len(self.volume)), 1.0, -1.0)

    @cached_property
    def outward(self) -> np.ndarray:
        """(dim + 1, e, dim) outward normals times the measure of the facets."""
        return -self.dim * np.moveaxis(self.volume[:, None, None] * self.slopes, 1, 0)

    @cached_property
    def between(self) -> tuple[np.ndarray, np.ndarray]:
        """Local vertices (2, j) at the ends of the edges of an element, and the edges (j, e)."""
        flat = self.dim == 2
        ends = self.mesh.refdom.facets if flat else self.mesh.refdom.edges
        return np.array(ends).T, np.asarray(self.mesh.t2f if flat else self.mesh.t2e)

    def quadratic(self, nodal: np.ndarray) -> np.ndarray:
        """Displacements (dim, vertices and edges) of nodal ones, which may be those of vertices."""
        count = self.mesh.nvertices
        if nodal.shape[1] > count:
            return nodal
        edges = self.mesh.facets if self.dim == 2 else self.mesh.edges
        return np.concatenate([nodal, nodal[:, edges].mean(axis=1)], axis=1)

    def stress(self, material: Material, nodal: np.ndarray) -> np.ndarray:
        """The stress (e, dim + 1, dim, dim), at the vertices of each element between which it is
        linear, of a displacement of vertices and edges.
        """
        lam, shear = lame(material)
        d, t, G = self.dim, self.mesh.t, self.slopes
        ends, edges = self.between
        at_vertex, at_edge = nodal[:, t], nodal[:, self.mesh.nvertices + edges]
        at_edge = at_edge - (at_vertex[:, ends[0]] + at_vertex[:, ends[1]]) / 2
        gradient = np.repeat(np.einsum("cae,eai->eci", at_vertex, G)[:, None], d + 1, axis=1)
        for (i, j), own in zip(ends.T, at_edge.transpose(1, 2, 0)):
            # the bubble 4 l_i l_j has the slope 4 grad l_j at vertex i
            gradient[:, i] += 4 * own[:, :, None] * G[:, j, None, :]
            gradient[:, j] += 4 * own[:, :, None] * G[:, i, None, :]
        strain = (gradient + gradient.swapaxes(2, 3)) / 2
        trace = np.trace(strain, axis1=2, axis2=3)[..., None, None]
        return 2 * shear * strain + lam * trace * np.eye(d)

    def data(self, moments: np.ndarray, force: np.ndarray) -> np.ndarray:
        """(e, inputs) what determines the composite stress on the reference element.

        Parameters
        ----------
        moments : (dim + 1, dim, e, dim) of tractions with the hat functions of `others` on the
            facets of each element, whose normals point out of it.
        force : (dim,) or (e, dim) per volume.
        """
        own = moments.reshape(-1, *moments.shape[2:])
        body = np.broadcast_to(self._ratio[:, None] * force, own.shape[1:])
        both = np.concatenate([own, body[None]]).transpose(1, 2, 0)  # in the axes of space
        return np.linalg.solve(self._map, both).transpose(0, 2, 1).reshape(len(self._ratio), -1)

    def data_of(self, stress: np.ndarray) -> np.ndarray:
        """The same for a stress (e, dim + 1, dim, dim) that is linear on each element."""
        force = -np.einsum("eaij,eaj->ei", stress, self.slopes)
        return self.data(self._moments(stress), force)

    def _moments(self, stress: np.ndarray) -> np.ndarray:
        """(dim + 1, dim, e, dim) as in data(), of a linear stress."""
        found = []
        for own, normal in zip(self.others, self.outward):
            t = np.einsum("eaij,ej->aei", stress[:, own], normal)
            found.append((t + t.sum(axis=0)) / (self.dim * (self.dim + 1)))
        return np.array(found)

    def metric(self, material: Material, chosen: slice | np.ndarray) -> np.ndarray:
        """H (e, inputs, inputs): y' H y = int s : C^-1 : s for the composite stress s of data y, of
        some elements [per thickness].
        """
        d, (E, nu) = self.dim, (material.E, material.nu)
        pairs, parts = components(d), reference_energy(d)
        base = np.zeros((len(pairs), d, d))
        for number, (i, j) in enumerate(pairs):
            base[number, i, j] = base[number, j, i] = 1.0
        B, ratio = self._map[chosen], self._ratio[chosen]
        G = B.swapaxes(1, 2) @ B
        turned = G[:, None] @ base
        traces = np.trace(turned, axis1=2, axis2=3)
        # in plane strain the trace in space is 1 + nu times that in the plane
        factor = nu * (1 + nu) if d == 2 else nu
        rows = turned.reshape(-1, len(pairs), d * d)
        columns = turned.swapaxes(2, 3).reshape(rows.shape)
        form = (1 + nu) * rows @ columns.swapaxes(1, 2)
        form -= factor * traces[:, :, None] * traces[:, None]
        form *= (self.volume[chosen] / ratio**2 / E)[:, None, None]
        size = parts.shape[-1]
        flat = form.reshape(-1, len(pairs) ** 2) @ parts.reshape(-1, size * size)
        return np.asarray(flat.reshape(-1, size, size))

    def products(self, material: Material, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(e,) y' H z of all elements."""
        out = np.zeros(len(one))
        there = np.flatnonzero(np.any(one != 0, axis=1) & np.any(other != 0, axis=1))
        for own in np.split(there, range(BLOCK, len(there), BLOCK)):
            turned = self.metric(material, own) @ other[own, :, None]
            out[own] = np.sum(one[own] * turned[..., 0], axis=1)
        return out

    @property
    def _blocks(self) -> list[slice]:
        return [slice(i, i + BLOCK) for i in range(0, len(self.volume), BLOCK)]

    def equilibrated(
        self,
        material: Material,
        stress: np.ndarray,
        force: np.ndarray,
        held: np.ndarray,
        moments: np.ndarray,
    ) -> tuple[np.ndarray, float]:
        """The data (e, inputs) of the stress s* of the head of this module.

        Parameters
        ----------
        material : Of the body.
        stress : (e, dim + 1, dim, dim) of finite elements, at the vertices of each element.
        force : (dim,) per volume.
        held : (facets, dim) components in which a boundary facet is held, its traction unknown.
        moments : (facets, dim, dim) of the other boundary facets: vertex by vertex those of the
            traction with the hat functions [force per thickness].

        Returns
        -------
        The data, and the largest force by which the hat function of a vertex was out of balance,
        over that of an element.
        """
        known = (self.mesh.f2t[1] < 0)[:, None] & ~held
        balance = Balance(self._at_vertices, known)
        m, unbalanced = self._tractions(
            stress, force, np.where(known[:, None], moments, np.nan), balance
        )
        missing = self.data(self.seen(m), force) - self.data_of(stress)
        K, slope = self.facet_energy(material, missing)
        m += (self._by_airy(K, slope, known) if self.dim == 2 else balance.least(K, slope)).reshape(
            m.shape
        )
        return self.data(self.seen(m), force), unbalanced

    @cached_property
    def _at_vertices(self) -> sp.csc_matrix:
        """(e (dim + 1), facets dim) from the moments of one component of tractions to the forces at
        the vertices of the elements.
        """
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

    def _by_airy(self, K: sp.csr_matrix, slope: np.ndarray, known: np.ndarray) -> np.ndarray:
        """What to add to the moments of plane tractions so that m' K m / 2 + slope' m is least.

        A stress without body force derives from a function A of Airy, cubic on the three parts of
        each triangle and smooth across all edges. With the gradients g at the vertices and the mean
        h of the gradient along an edge, whose unit tangent t points from the first vertex to the
        second, and R the turn by which the normal is R t up to sign, the moments on the edge are

            R (h - g_1)  and  R (g_2 - h),     h = (A_2 - A_1) / |edge| t + k n.

        Unknowns are A and g at the vertices and k on the edges; those that move a traction that is
        known are zero.
        """
        mesh, count, facets = self.mesh, self.mesh.nvertices, self.mesh.facets
        t = mesh.p[:, facets[1]] - mesh.p[:, facets[0]]
        length = np.linalg.norm(t, axis=0)
        t = t / length
        n = np.array([t[1], -t[0]])
        owner = mesh.p[:, mesh.t[:, mesh.f2t[0]]].mean(axis=1)
        way = np.where(np.sum(n * (mesh.p[:, facets[0]] - owner), axis=0) > 0, 1.0, -1.0)
        D = np.zeros((facets.shape[1], 2, 2, 7))  # moments by g_1, g_2, A_1, A_2, k
        for i, turn in enumerate((1.0, -1.0)):  # R takes component 1 - i to i
            D[:, 0, i, 1 - i] = -turn
            D[:, 1, i, 3 - i] = turn
            along = turn * t[1 - i] / length
            D[:, 0, i, 4:] = np.stack([-along, along, turn * n[1 - i]], axis=1)
            D[:, 1, i, 4:] = -D[:, 0, i, 4:]
        D *= way[:, None, None, None]
        v, w = facets
        edge = np.arange(facets.shape[1])
        unknown = np.stack(
            [2 * v, 2 * v + 1, 2 * w, 2 * w + 1, 2 * count + v, 2 * count + w, 3 * count + edge]
        )
        size = 3 * count + facets.shape[1]
        fixed = np.zeros(size, dtype=bool)
        for c in range(2):
            own = np.flatnonzero(known[:, c])
            fixed[2 * facets[:, own] + 1 - c] = True
            fixed[3 * count + own[np.abs(n[1 - c, own]) > ALONG]] = True
            fixed[2 * count + facets[:, own[np.abs(t[1 - c, own]) > ALONG]]] = True
        rows = (np.arange(4 * facets.shape[1])[:, None] + np.zeros(7, dtype=int)).ravel()
        columns = np.repeat(unknown.T[:, None], 4, axis=1).ravel()
        change = sp.csr_matrix((D.ravel(), (rows, columns)), (4 * facets.shape[1], size))
        change = change[:, np.flatnonzero(~fixed)]
        reduced = (change.T @ K @ change).tocsc()
        reduced += sp.diags(TINY * reduced.diagonal(), format="csc")
        solve = splu(
            reduced, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        return np.asarray(-(change @ solve.solve(change.T @ slope)))

    def facet_energy(
        self, material: Material, missing: np.ndarray
    ) -> tuple[sp.csr_matrix, np.ndarray]:
        """Second and first derivatives of the energy of the stress by the moments of facets."""
        d, count = self.dim, len(self.volume)
        place = (self.opposite[:, None] * d + self.slots).reshape(-1, count)  # moment of each input
        index = (place[..., None] * d + np.arange(d)).transpose(1, 0, 2).reshape(count, -1)
        used, signs = index.shape[1], np.repeat(self.sign.T, d * d, axis=1)
        size = self.mesh.facets.shape[1] * d * d
        slope, K = np.zeros(size), sp.csr_matrix((size, size))
        for own in self._blocks:
            H, at, sign = self.metric(material, own), index[own], signs[own]
            back = np.linalg.inv(self._map[own])
            g = np.einsum("eij,ej->ei", H[:, :used], missing[own])
            g = (g.reshape(len(g), -1, d) @ back).reshape(len(g), -1) * sign
            slope += np.bincount(at.ravel(), g.ravel(), size)
            H = H[:, :used, :used].reshape(len(H), used // d, d, used // d, d)
            H = np.einsum("epiqj,eik,ejl->epkql", H, back, back, optimize=True)
            H = H.reshape(-1, used, used) * sign[:, :, None] * sign[:, None]
            place = np.repeat(at, used, axis=1).ravel(), np.tile(at, (1, used)).ravel()
            K = K + sp.csr_matrix((H.ravel(), place), (size, size))
        return K, slope

    def _tractions(
        self, stress: np.ndarray, force: np.ndarray, given: np.ndarray, balance: Balance
    ) -> tuple[np.ndarray, float]:
        """Moments (facets, dim, dim) of tractions that hold all elements in balance, and by how
        much they do not; nan where they are not given.
        """
        d, mesh = self.dim, self.mesh
        m = np.zeros(given.shape)
        for o, own in enumerate(self._moments(stress)):
            share = self.sign[o] * np.where(mesh.f2t[1, self.opposite[o]] >= 0, 0.5, 1.0)
            for slot, moment in zip(self.slots[o], own):
                np.add.at(m, (self.opposite[o], slot), share[:, None] * moment)
        m = np.where(np.isnan(given), m, given)
        needed = np.einsum("eij,eaj->eai", stress.mean(axis=1), self.slopes) - force / (d + 1)
        needed = (needed * self.volume[:, None, None]).reshape(-1, d)
        left = needed - balance.matrix @ m.reshape(-1, d)
        change = balance.made(left)
        left = left - balance.matrix @ change
        size = float(np.abs(needed).max(initial=0.0)) or 1.0
        return m + change.reshape(m.shape), float(np.abs(left).max(initial=0.0)) / size
