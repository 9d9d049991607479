"""A stress in exact equilibrium in a body of revolution.

With S = r s for the stresses s_rr, s_zz and s_rz in the half plane of cylindrical coordinates, and
the force f per volume, equilibrium says that

    (div S)_z + r f_z = 0,        s_tt = (div S)_r + r f_r,

where the second equation is only what the hoop stress s_tt is. So the bodies need no balance of
forces along r. S is made of the composite stresses of contactopt.accuracy.split_triangle, of degree
1 for linear displacements and 2 for quadratic ones. Hence tractions times r are polynomials of this
degree on each edge. On the axis S is zero, which makes every stress finite.

Unknown are the tractions S n at points of the edges, so many that they determine the polynomials.
They hold every element in balance along z. Of all stresses in an element that have these tractions
that one is taken which makes the energy of s - s(u) least, and then the tractions that make it
least in the whole body: a sparse linear system.

Integrals with 1 / r are taken by a rule on each part of a triangle.

Source: Love (1927), A treatise on the mathematical theory of elasticity, section 188, for the
equations of equilibrium; else as contactopt.accuracy.split_triangle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import null_space
from scipy.sparse.linalg import splu

from contactopt.accuracy.equilibrated import Simplices
from contactopt.accuracy.split_triangle import PAIRS, SplitTriangle, split_triangle
from contactopt.errors import InputError
from contactopt.material import Material, lame

BLOCK = 1024  # elements at a time
AXIS = 1e-12  # of the largest radius
SOFT = 1e-12  # of the scaled energy: constraints leave nothing free
STIFF = 1e4  # of the balance of elements, in the same scale
BALANCED = 1e-14  # of the force on an element, so much may be missing
CORRECTIONS = 20  # of the multipliers of the balance, at most
SHARES = {1: np.array([1.0, 1.0]) / 2, 2: np.array([1.0, 4.0, 1.0]) / 6}  # integrals over edges


class _Elements(NamedTuple):
    """Some elements whose composite stresses follow from the tractions g (e, 6 (k + 1)) on their
    edges, and the energy of what they differ from s(u) by.

    stress, rest  (e, n, 6 (k + 1)), (e, n): the stress is stress g + rest
    form, slope   (e, 6 (k + 1), 6 (k + 1)), (e, 6 (k + 1)) second and first derivatives of half the
                  energy at g = 0
    """

    stress: np.ndarray
    rest: np.ndarray
    form: np.ndarray
    slope: np.ndarray


@dataclass(frozen=True, eq=False)
class Revolved(Simplices):
    """Triangles in the half plane r >= 0 of a body of revolution, and the degree of S there.

    A stress (e, s, 4) has the components rr, zz, rz and hoop at s points of each element. Integrals
    are those over an angle of one.
    """

    degree: int

    @property
    def _any(self) -> SplitTriangle:
        """Whose points are those of all."""
        return split_triangle(self.degree)

    def stress(self, material: Material, nodal: np.ndarray) -> np.ndarray:
        """The stress (e, s, 4) of a displacement (2, vertices and edges)."""
        lam, shear = lame(material)
        at = self._any.shares.transpose(1, 0, 2).reshape(3, -1)
        (i, j), edges = self.between
        own = np.concatenate(
            [nodal[:, self.mesh.t], nodal[:, self.mesh.nvertices + edges]], axis=1
        )  # (2, 6, e)
        at_vertices = np.einsum("vs,evk->vkes", 4 * at - 1, self.slopes)
        at_edges = np.einsum("js,ejk->jkes", 4 * at[i], self.slopes[:, j])
        at_edges += np.einsum("js,ejk->jkes", 4 * at[j], self.slopes[:, i])
        slopes = np.concatenate([at_vertices, at_edges])
        gradient = np.einsum("cqe,qkes->ckes", own, slopes, optimize=True)
        shapes = np.concatenate([at * (2 * at - 1), 4 * at[i] * at[j]])
        strains = gradient[0, 0], gradient[1, 1], own[0].T @ shapes / self._radius
        normal = [lam * sum(strains) + 2 * shear * strain for strain in strains]
        turn = shear * (gradient[0, 1] + gradient[1, 0])
        return np.stack([normal[0], normal[1], turn, normal[2]], axis=-1)

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
    ) -> tuple[np.ndarray, float]:
        """The stress of the head of this module that is nearest to `stress`.

        Parameters
        ----------
        material, stress, force, held : As for Simplices.equilibrated().
        moments : (facets, 2, 2) of r times the tractions on the other boundary facets, vertex by
            vertex, with the hat functions of the edge [force / length].

        Returns
        -------
        The stress (e, s, 4), and the largest force by which an element is out of balance along z
        over the largest force on one.
        """
        parts = [self._least_within(material, stress, force, *own) for own in self._pieces]
        g, (number, sign) = self._given(held, moments).ravel(), self._numbers
        free = np.isnan(g)
        g[free] = 0.0
        K, slope = sp.csr_matrix((len(g), len(g))), np.zeros(len(g))
        for (own, _), part in zip(self._pieces, parts):
            at = number[own]
            slope += np.bincount(at.ravel(), part.slope.ravel(), len(g))
            rows, columns = np.repeat(at, at.shape[1], axis=1), np.tile(at, (1, at.shape[1]))
            K = K + sp.csr_matrix((part.form.ravel(), (rows.ravel(), columns.ravel())), K.shape)
        share = np.repeat(SHARES[self.degree], 2) * np.tile([0.0, 1.0], self.degree + 1)
        starts = np.arange(len(number) + 1) * number.shape[1]
        C = sp.csr_matrix(((sign * np.tile(share, 3)).ravel(), number.ravel(), starts))
        missing = C @ g + force[1] * self.volume * self.mesh.p[0][self.mesh.t].mean(axis=0)
        rows = np.flatnonzero(abs(C) @ free)  # of elements with a traction to be found
        x, missed = _least(
            K[free][:, free], (slope + K @ g)[free], C[rows][:, free], -missing[rows]
        )
        g[free] = x
        made = self._particular(force)
        for (own, split), part in zip(self._pieces, parts):
            c = (part.stress @ g[number[own], None])[..., 0] + part.rest
            S, divergence = _by_points(split)
            made[own, :, :3] += (
                (c @ S).reshape(len(own), -1, 3)
                @ self._carried(own).swapaxes(1, 2)
                / self._radius[own, :, None]
            )
            down = self._map[own, :1] / self._ratio[own, None, None]
            made[own, :, 3:] += (c @ divergence).reshape(len(own), -1, 2) @ down.swapaxes(1, 2)
        return made, missed

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
        """(e, s) of the points."""
        r = np.einsum("ve,pvs->eps", self.mesh.p[0][self.mesh.t], self._any.shares)
        return np.asarray(r.reshape(len(r), -1))

    @cached_property
    def _weights(self) -> np.ndarray:
        """(e, s) of integrals."""
        return self._radius * self.volume[:, None] / 3 * np.tile(self._any.weights, 3)

    @cached_property
    def _axis(self) -> np.ndarray:
        """(facets,) whether an edge lies on the axis."""
        r = self.mesh.p[0]
        return np.asarray(np.all(r[self.mesh.facets] <= AXIS * r.max(), axis=0))

    @cached_property
    def _numbers(self) -> tuple[np.ndarray, np.ndarray]:
        """(e, 6 (k + 1)) the places of an element's tractions among those of all edges, which are
        (facets, k + 1, 2); and their signs.
        """
        count = self.degree + 1
        along = np.arange(count)
        backwards = self.slots[:, 0].T[..., None] == 1  # (e, 3, 1)
        point = np.where(backwards, along[::-1], along) + count * self.opposite.T[..., None]
        number = 2 * point[..., None] + np.arange(2)
        return number.reshape(len(number), -1), np.repeat(self.sign.T, 2 * count, axis=1)

    def _particular(self, force: np.ndarray) -> np.ndarray:
        """The hoop stress of a force along r."""
        out = np.zeros((*self._radius.shape, 4))
        out[..., 3] = force[0] * self._radius
        return out

    def _given(self, held: np.ndarray, moments: np.ndarray) -> np.ndarray:
        """Tractions (facets, k + 1, 2) on the boundary and the axis; else they are not a number."""
        first, second = moments[:, 0], moments[:, 1]
        ends = np.stack([4 * first - 2 * second, 4 * second - 2 * first], axis=1)
        g = ends if self.degree == 1 else np.insert(ends, 1, ends.mean(axis=1), axis=1)
        known = (self.mesh.f2t[1] < 0)[:, None] & ~held
        g = np.where(known[:, None], g, np.nan)
        g[self._axis] = 0.0
        for end, vertices in zip((0, -1), self.mesh.facets):
            g[self.mesh.p[0, vertices] <= AXIS * self.mesh.p[0].max(), end] = 0.0
        return np.asarray(g)

    def _carried(self, own: np.ndarray) -> np.ndarray:
        """(e, 3, 3) components of S by those on the reference triangle: S = B S^ B' / |det B|."""
        B = self._map[own]
        out = np.empty((len(B), 3, 3))
        for row, (i, j) in enumerate(PAIRS):
            for column, (a, b) in enumerate(PAIRS):
                out[:, row, column] = B[:, i, a] * B[:, j, b]
                if a != b:
                    out[:, row, column] += B[:, i, b] * B[:, j, a]
        return out / self._ratio[own, None, None]

    def _made(self, own: np.ndarray, split: SplitTriangle) -> np.ndarray:
        """(e, s, 4, n) the stress by the composite stresses of elements."""
        n, (S, divergence) = split.stress.shape[-1], _by_points(split)
        there, down = self._carried(own), self._map[own, 0] / self._ratio[own, None]
        out = np.empty((len(own), len(S.T) // 3, 4, n))
        out[:, :, :3] = there[:, None] @ S.T.reshape(-1, 3, n) / self._radius[own, :, None, None]
        hoop = down @ divergence.T.reshape(-1, 2, n).swapaxes(0, 1).reshape(2, -1)
        out[:, :, 3] = hoop.reshape(len(own), -1, n)
        return out

    def _least_within(
        self,
        material: Material,
        stress: np.ndarray,
        force: np.ndarray,
        own: np.ndarray,
        split: SplitTriangle,
    ) -> _Elements:
        """The stresses in some elements that make the energy of s - s(u) least."""
        n, count = split.stress.shape[-1], len(own)
        made = self._made(own, split)
        weighted = _compliance(material) @ made * self._weights[own, :, None, None]
        made, weighted = made.reshape(count, -1, n), weighted.reshape(count, -1, n).swapaxes(1, 2)
        H = weighted @ made
        h = weighted @ (self._particular(force) - stress)[own].reshape(count, -1, 1)
        tractions = split.tractions.reshape(-1, n)
        borne, inner = np.linalg.pinv(tractions), null_space(tractions, rcond=1e-9)
        up = self._map[own, 1] / self._ratio[own, None]
        Z = up @ split.nodes.reshape(-1, 2, n).swapaxes(0, 1).reshape(2, -1)
        Z = Z.reshape(count, -1, n)[:, :-1]  # the last follows from the balance of the element
        r = np.einsum("ve,pvd->epd", self.mesh.p[0][self.mesh.t[:, own]], split.lever)
        wanted = -force[1] * r.reshape(count, -1)[:, :-1, None]
        size = np.sqrt(np.trace(H, axis1=1, axis2=2))[:, None, None]
        Z, wanted = size * Z, size * wanted  # entries of one size
        system = np.zeros((count, *[inner.shape[1] + Z.shape[1]] * 2))
        y, mu = slice(0, inner.shape[1]), slice(inner.shape[1], None)
        system[:, y, y], system[:, mu, y] = inner.T @ H @ inner, Z @ inner
        system[:, y, mu] = system[:, mu, y].swapaxes(1, 2)
        right = np.concatenate(
            [np.concatenate([-inner.T @ H @ borne, -inner.T @ h], axis=2),
             np.concatenate([-Z @ borne, wanted], axis=2)], axis=1)  # fmt: skip
        found = inner @ np.linalg.solve(system, right)[:, y]
        R, rest = borne + found[..., :-1], found[..., -1:]
        back, sign = self.back[own], self._numbers[1][own]
        R = (R.reshape(count, -1, 2) @ back).reshape(R.shape) * sign[:, None]
        turned = R.swapaxes(1, 2)
        return _Elements(R, rest[..., 0], turned @ H @ R, (turned @ (H @ rest + h))[..., 0])


def _by_points(split: SplitTriangle) -> tuple[np.ndarray, np.ndarray]:
    """The stress (n, 3 s) and its divergence (n, 2 s) at all points."""
    n = split.stress.shape[-1]
    return split.stress.reshape(-1, n).T, split.divergence.reshape(-1, n).T


def _compliance(material: Material) -> np.ndarray:
    """(4, 4) strains by the stresses rr, zz, rz and hoop, with the shear strain twice."""
    out = np.full((4, 4), -material.nu)
    np.fill_diagonal(out, 1.0)
    out[2] = out[:, 2] = 0.0
    out[2, 2] = 2 * (1 + material.nu)
    return out / material.E


def _least(
    K: sp.csr_matrix, slope: np.ndarray, C: sp.csr_matrix, values: np.ndarray
) -> tuple[np.ndarray, float]:
    """The x with x' K x / 2 + slope' x least under C x = values, by an augmented Lagrangian, and
    what C x misses over the largest share of x in it.
    """
    scale = 1 / np.sqrt(K.diagonal())
    D = sp.diags(scale)
    K, C, slope = D @ K @ D, C @ D, scale * slope
    size = 1 / np.sqrt(np.asarray(C.multiply(C).sum(axis=1)).ravel())
    C, values = sp.diags(size) @ C, size * values
    system = (K + STIFF * (C.T @ C) + SOFT * sp.eye(len(slope))).tocsc()
    try:
        solve = splu(
            system, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        ).solve
    except RuntimeError as error:  # triangles without a height
        raise InputError("the mesh has triangles too thin for a bound.") from error
    x, multipliers, missed, found = np.zeros(len(slope)), np.zeros(len(values)), -values, np.inf
    for number in range(CORRECTIONS):
        x -= solve(K @ x + slope + C.T @ (multipliers + STIFF * missed))
        missed = C @ x - values
        multipliers += STIFF * missed
        largest = float((abs(C) @ np.abs(x)).max(initial=0.0)) or 1.0
        found = float(np.abs(missed).max(initial=0.0)) / largest
        if number and found < BALANCED:
            break
    return scale * x, found
