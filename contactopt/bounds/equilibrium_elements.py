"""A stress in exact equilibrium in a plane section: of plane strain, or of a body of revolution.

In plane strain it is S = s with div S + f = 0 for the force f per volume. In the half plane of
cylindrical coordinates let S = r s for the stresses s_rr, s_zz and s_rz. Equilibrium then says that

    (div S)_z + r f_z = 0,        s_tt = (div S)_r + r f_r,

where the second equation is only what the hoop stress s_tt is, so that the bodies need no balance
of forces along r. S is made of the composite stresses of contactopt.bounds.split_triangle, of
degree 1 for linear displacements and 2 for quadratic ones. Hence tractions, times r in bodies of
revolution, are polynomials of this degree on each edge. On the axis S is zero, which makes every
stress finite.

Unknown are the tractions S n at points of the edges, so many that they determine the polynomials.
They hold every element in balance. Among all stresses in an element with these tractions, the one
with the smallest energy of s - s(u) is taken, and then the tractions for which this energy is
smallest in the whole body: a sparse linear system. Any displacement u is allowed.

Integrals with 1 / r are taken by a rule on each part of a triangle.

Source: Fraeijs de Veubeke (1965), Displacement and equilibrium models in the finite element method,
for tractions as unknowns; Love (1927), A treatise on the mathematical theory of elasticity, section
188, for bodies of revolution; else as contactopt.bounds.split_triangle.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import null_space, qr

from contactopt.bounds.displaced_stress import bilinear, displaced_stress
from contactopt.bounds.least_in_balance import LeastInBalance
from contactopt.bounds.simplices import Simplices
from contactopt.bounds.split_triangle import PAIRS, SplitTriangle, split_triangle
from contactopt.defaults import EQUAL, ROUNDED
from contactopt.material import Material

BLOCK = 1024  # elements at a time
# integrals over an edge of the hat functions of its ends times the shape functions of its points
LEVERS = {
    1: np.array([[2.0, 1.0], [1.0, 2.0]]) / 6,
    2: np.array([[1.0, 2.0, 0.0], [0.0, 2.0, 1.0]]) / 6,
}


class _Elements(NamedTuple):
    """Some elements whose n composite stresses follow from the tractions g (e, 6 (k + 1)) on their
    edges, from the works h (e, j) of the j without tractions, and from divergences w (e, m).

    stress, by_work, by_load  (e, n, 6 (k + 1)), (e, j, j), (e, j, m): the stress is stress g, and
                              by_work h + by_load w of those without tractions
    form                      (e, 6 (k + 1), 6 (k + 1)) second derivative of half the energy by g
    """

    stress: np.ndarray
    by_work: np.ndarray
    by_load: np.ndarray
    form: np.ndarray


class _System(NamedTuple):
    """All elements, half the energy's second derivative by tractions, and the program for these."""

    parts: list[_Elements]
    K: sp.csr_matrix
    program: LeastInBalance


@dataclass(frozen=True, eq=False)
class EquilibriumElements(Simplices):
    """Triangles of a plane section, and the degree of S there.

    revolved  whether the section is the half plane r >= 0 of a body of revolution
    corners   (4, e) of the quadrilaterals that the triangles are halves of, if displacements are
              bilinear there

    A stress (e, s, 4) has the components rr, zz, rz and hoop, in plane strain xx, yy, xy and zz, at
    s points of each element. Integrals are those over an angle or a thickness of one.
    """

    degree: int
    revolved: bool
    corners: np.ndarray | None = None

    @property
    def _any(self) -> SplitTriangle:
        """Whose points are those of all."""
        return split_triangle(self.degree)

    def stress(self, material: Material, nodal: np.ndarray) -> np.ndarray:
        """The stress (e, s, 4) of a displacement (2, vertices and edges)."""
        return displaced_stress(
            self, material, nodal, self._points, self._radius if self.revolved else None
        )

    @cached_property
    def _points(self) -> np.ndarray:
        """(3, s) shares of the vertices."""
        return self._any.shares.transpose(1, 0, 2).reshape(3, -1)

    @cached_property
    def bilinear(self) -> tuple[np.ndarray, np.ndarray]:
        """Shape functions (e, 4, s) and slopes (e, 4, 2, s) of quadrilaterals."""
        places = np.einsum("dve,vs->des", self.mesh.p[:, self.mesh.t], self._points)
        N, slopes = bilinear(self.mesh.p[:, self.corners], places)
        return np.ascontiguousarray(N.swapaxes(0, 1)), np.ascontiguousarray(
            slopes.transpose(2, 0, 1, 3)
        )

    def data_of(self, stress: np.ndarray) -> np.ndarray:
        """A stress is its own data."""
        return stress

    def products(self, material: Material, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(e,) integrals of s : C^-1 : s' of two stresses."""
        own = one @ _compliance(material)
        return np.asarray(np.einsum("es,esc,esc->e", self._weights, own, other, optimize=True))

    def equilibrated(
        self,
        material: Material,
        stress: np.ndarray,
        force: np.ndarray,
        held: np.ndarray,
        moments: np.ndarray,
        answer: object = None,
    ) -> tuple[np.ndarray, float]:
        """The stress (e, s, 4) defined at the top that is nearest to `stress`, and the largest
        force out of balance over the largest one. Arguments as in Tetrahedra.equilibrated(), but
        `moments` (facets, 2, 2) take hat functions, if revolved times r.
        """
        g, number = self._given(held, moments).ravel(), self._numbers[0]
        free = np.isnan(g)
        g[free] = 0.0
        C, load = self._balance(force)
        rows = np.flatnonzero(abs(C) @ free)  # of elements with a traction to be found
        key = material, free.tobytes()
        system = self._once(key, lambda: self._system(material, free, C[rows][:, free]))
        made, slope, rest = self._particular(force), np.zeros(len(g)), []
        for (own, split), part in zip(self._pieces, system.parts):
            off = made[own] - stress[own]
            Z, w = self._divergences(own, split, force)
            h = self._work(own, split, material, off)
            inner = _without_tractions(split)
            y = part.by_work @ (h @ inner)[..., None]
            for _ in range(2):  # the second time against rounding
                y += part.by_load @ (w[..., None] - Z @ (inner @ y))
            c = y[..., 0] @ inner.T
            h = self._work(own, split, material, off + self._combined(own, split, material, c))
            by_traction = part.stress.swapaxes(1, 2) @ h[..., None]
            slope += np.bincount(number[own].ravel(), by_traction.ravel(), len(g))
            rest.append(c)
        left = -(C @ g + load)[rows]
        g[free], missed = system.program.find((slope + system.K @ g)[free], left)
        for (own, split), part, c in zip(self._pieces, system.parts, rest):
            c = c + (part.stress @ g[number[own], None])[..., 0]
            made[own] += self._combined(own, split, material, c)
        return made, missed

    def _system(self, material: Material, free: np.ndarray, C: sp.csr_matrix) -> _System:
        number, K = self._numbers[0], sp.csr_matrix(2 * free.shape)
        parts = [self._within(material, *own) for own in self._pieces]
        for (own, _), part in zip(self._pieces, parts):
            at = number[own]
            rows, columns = np.repeat(at, at.shape[1], axis=1), np.tile(at, (1, at.shape[1]))
            K = K + sp.csr_matrix((part.form.ravel(), (rows.ravel(), columns.ravel())), K.shape)
        return _System(parts, K, LeastInBalance(K[free][:, free], C))

    @cached_property
    def _pieces(self) -> list[tuple[np.ndarray, SplitTriangle]]:
        """Some elements at a time and their composite stresses, which are zero on the axis."""
        found: list[tuple[np.ndarray, SplitTriangle]] = []
        edge = self._axis[self.opposite]
        for free in (None, 0, 1, 2):
            own = np.flatnonzero(~edge.any(axis=0) if free is None else edge[free])
            pieces = np.split(own, range(BLOCK, len(own), BLOCK)) if len(own) else []
            found += [(piece, split_triangle(self.degree, free)) for piece in pieces]
        return found

    @cached_property
    def _radius(self) -> np.ndarray:
        """(e, s) of the points; one in plane strain."""
        if not self.revolved:
            return np.ones((len(self.volume), self._any.shares.size // 3))
        r = np.einsum("ve,pvs->eps", self.mesh.p[0][self.mesh.t], self._any.shares)
        return np.asarray(r.reshape(len(r), -1))

    @cached_property
    def _weights(self) -> np.ndarray:
        """(e, s) of integrals."""
        return self._radius * self.volume[:, None] / 3 * np.tile(self._any.weights, 3)

    @cached_property
    def _axis(self) -> np.ndarray:
        """(facets,) whether an edge lies on the axis."""
        r = self.mesh.p[0] if self.revolved else np.ones(self.mesh.nvertices)
        return np.asarray(np.all(r[self.mesh.facets] <= ROUNDED * r.max(), axis=0))

    @cached_property
    def _numbers(self) -> tuple[np.ndarray, np.ndarray]:
        """(e, 6 (k + 1)) the places among all (facets, k + 1, 2) tractions; signs."""
        count = self.degree + 1
        along = np.arange(count)
        backwards = self.slots[:, 0].T[..., None] == 1  # (e, 3, 1)
        point = np.where(backwards, along[::-1], along) + count * self.opposite.T[..., None]
        number = 2 * point[..., None] + np.arange(2)
        return number.reshape(len(number), -1), np.repeat(self.sign.T, 2 * count, axis=1)

    def _particular(self, force: np.ndarray) -> np.ndarray:
        """The hoop stress of a force along r."""
        out = np.zeros((*self._radius.shape, 4))
        if self.revolved:
            out[..., 3] = force[0] * self._radius
        return out

    def _balance(self, force: np.ndarray) -> tuple[sp.csr_matrix, np.ndarray]:
        """Forces on elements by tractions, and by the load: also about centroids."""
        number, sign = self._numbers
        count, lever = self.degree + 1, LEVERS[self.degree]
        corners = self.mesh.p[:, self.mesh.t]
        middle = corners.mean(axis=1)
        arms = np.einsum(
            "dove,vp->edop", (corners - middle[:, None])[:, self.others], lever, optimize=True
        )  # of each traction
        way = np.zeros((3, len(number), 3, count, 2))
        for c in range(2):
            way[c, ..., c] = lever.sum(axis=0)
        way[2, ..., 0], way[2, ..., 1] = -arms[:, 1], arms[:, 0]
        load = np.stack([force[0] * self.volume, force[1] * self.volume, 0 * self.volume])
        if self.revolved:
            way, load = way[1:2], load[1:2] * middle[0]
        value = way.reshape(len(way), *number.shape) * sign
        starts = np.arange(value[..., 0].size + 1) * number.shape[1]
        columns = np.broadcast_to(number, value.shape)
        size = self.mesh.facets.shape[1] * count * 2
        C = sp.csr_matrix((value.ravel(), columns.ravel(), starts), (len(starts) - 1, size))
        return C, load.ravel()

    def _given(self, held: np.ndarray, moments: np.ndarray) -> np.ndarray:
        """Tractions (facets, k + 1, 2) on the boundary and the axis; else they are not a number."""
        first, second = moments[:, 0], moments[:, 1]
        ends = np.stack([4 * first - 2 * second, 4 * second - 2 * first], axis=1)
        g = ends if self.degree == 1 else np.insert(ends, 1, ends.mean(axis=1), axis=1)
        known = (self.mesh.f2t[1] < 0)[:, None] & ~held
        g = np.where(known[:, None], g, np.nan)
        g[self._axis] = 0.0
        on_axis = np.isin(self.mesh.facets, self.mesh.facets[:, self._axis])
        for end, there in zip((0, -1), on_axis):
            g[there, end] = 0.0
        return np.asarray(g)

    def _carried(self, own: np.ndarray) -> np.ndarray:
        """(e, 3, 3) components of S by those on the reference triangle: S = B S^ B' / |det B|."""
        B = self.map[own]
        out = np.empty((len(B), 3, 3))
        for row, (i, j) in enumerate(PAIRS):
            for column, (a, b) in enumerate(PAIRS):
                out[:, row, column] = B[:, i, a] * B[:, j, b]
                if a != b:
                    out[:, row, column] += B[:, i, b] * B[:, j, a]
        return out / self.ratio[own, None, None]

    def _combined(
        self, own: np.ndarray, split: SplitTriangle, material: Material, c: np.ndarray
    ) -> np.ndarray:
        """The stress (e, s, 4) of c (e, n) times the composite stresses of elements."""
        n = split.stress.shape[-1]
        S = (c @ split.stress.reshape(-1, n).T).reshape(len(own), -1, 3)
        out = np.empty((*S.shape[:2], 4))
        out[..., :3] = S @ self._carried(own).swapaxes(1, 2) / self._radius[own, :, None]
        if not self.revolved:
            out[..., 3] = material.nu * (out[..., 0] + out[..., 1])
            return out
        divergence = (c @ split.divergence.reshape(-1, n).T).reshape(len(own), -1, 2)
        down = self.map[own, 0] / self.ratio[own, None]
        out[..., 3] = (divergence @ down[..., None])[..., 0]
        return out

    def _made(self, own: np.ndarray, split: SplitTriangle, material: Material) -> np.ndarray:
        """(e, s, 4, n) the stress by the composite stresses of elements."""
        n = split.stress.shape[-1]
        S, r = split.stress.reshape(-1, 3, n), self._radius[own, :, None, None]
        out = np.empty((len(own), len(S), 4, n))
        out[:, :, :3] = self._carried(own)[:, None] @ S / r
        if self.revolved:
            down = self.map[own, 0] / self.ratio[own, None]
            by_point = split.divergence.reshape(-1, 2, n).swapaxes(0, 1).reshape(2, -1)
            out[:, :, 3] = (down @ by_point).reshape(len(own), -1, n)
        else:
            out[:, :, 3] = material.nu * (out[:, :, 0] + out[:, :, 1])
        return out

    def _work(
        self, own: np.ndarray, split: SplitTriangle, material: Material, stress: np.ndarray
    ) -> np.ndarray:
        """(e, n) integrals of s : C^-1 : s' of a stress (e, s, 4) and all composite stresses."""
        strain = (stress @ _compliance(material)) * self._weights[own, :, None]
        across = strain[..., 3]
        if not self.revolved:
            strain[..., :2] += material.nu * across[..., None]
        S = strain[..., :3] / self._radius[own, :, None] @ self._carried(own)
        n = split.stress.shape[-1]
        h = S.reshape(len(own), -1) @ split.stress.reshape(-1, n)
        if self.revolved:
            down = self.map[own, 0] / self.ratio[own, None]
            along = across[..., None] * down[:, None]
            h += along.reshape(len(own), -1) @ split.divergence.reshape(-1, n)
        return np.asarray(h)

    def _divergences(
        self, own: np.ndarray, split: SplitTriangle, force: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """(e, m, n) and (e, m) the wanted divergences; others follow from an element's balance."""
        n, ratio = split.stress.shape[-1], self.ratio[own]
        if self.revolved:
            by_node = split.nodes.reshape(-1, 2, n).swapaxes(0, 1).reshape(2, -1)
            up = self.map[own, 1] / ratio[:, None]
            r = np.einsum("ve,pvd->epd", self.mesh.p[0][self.mesh.t[:, own]], split.lever)
            Z = (up @ by_node).reshape(len(own), -1, n)
            return Z[:, :-1], -force[1] * r.reshape(len(own), -1)[:, :-1]
        every, inner = split.nodes.reshape(-1, n), _without_tractions(split)
        _, left, order = qr((every @ inner).T, mode="economic", pivoting=True)
        chosen = order[: np.count_nonzero(np.abs(left.diagonal()) > EQUAL)]
        wanted = -(self.back[own] @ force) * ratio[:, None]
        return (
            np.broadcast_to(every[chosen], (len(own), len(chosen), n)),
            np.tile(wanted, (1, len(every) // 2))[:, chosen],
        )

    def _within(self, material: Material, own: np.ndarray, split: SplitTriangle) -> _Elements:
        """The stresses in some elements that make the energy least."""
        n, count = split.stress.shape[-1], len(own)
        made = self._made(own, split, material)
        weighted = _compliance(material) @ made * self._weights[own, :, None, None]
        H = weighted.reshape(count, -1, n).swapaxes(1, 2) @ made.reshape(count, -1, n)
        borne, inner = np.linalg.pinv(split.tractions.reshape(-1, n)), _without_tractions(split)
        Z, _ = self._divergences(own, split, np.zeros(2))
        size = np.sqrt(np.trace(H, axis1=1, axis2=2))[:, None, None]  # entries of one size
        system = np.zeros((count, *[inner.shape[1] + Z.shape[1]] * 2))
        y, mu = slice(0, inner.shape[1]), slice(inner.shape[1], None)
        system[:, y, y], system[:, mu, y] = inner.T @ H @ inner, size * (Z @ inner)
        system[:, y, mu] = system[:, mu, y].swapaxes(1, 2)
        inverse = np.linalg.inv(system)
        by_work, by_load = -inverse[:, y, y], size * inverse[:, y, mu]
        R = borne + inner @ (by_work @ (inner.T @ H @ borne))
        for _ in range(2):  # the second time against rounding
            R -= inner @ (by_load @ (Z @ R))
        back, sign = self.back[own], self._numbers[1][own]
        R = (R.reshape(count, -1, 2) @ back).reshape(R.shape) * sign[:, None]
        return _Elements(R, by_work, by_load, R.swapaxes(1, 2) @ H @ R)


def _without_tractions(split: SplitTriangle) -> np.ndarray:
    """(n, j) the composite stresses that have no tractions on the boundary."""
    return null_space(split.tractions.reshape(-1, split.stress.shape[-1]), rcond=EQUAL)


def _compliance(material: Material) -> np.ndarray:
    """(4, 4) strains by the stresses, with the shear strain twice."""
    out = np.full((4, 4), -material.nu)
    np.fill_diagonal(out, 1.0)
    out[2] = out[:, 2] = 0.0
    out[2, 2] = 2 * (1 + material.nu)
    return out / material.E
