"""Recovered stress at chosen places: a linear map of the displacement, more accurate than the
stress inside the elements.

Around a place x the stresses s_h of the elements near it are fitted by a polynomial P a of the
degree of the displacement,

    a = argmin sum_q w_q |s_h(x_q) - P(x_q - x) a|^2,      s*(x) = P(0) a = sum_q c_q s_h(x_q),

with one coefficient vector a per component. The points x_q are those at which the stress of an
element is most accurate: its centre where the displacement is linear, the Gauss points of order two
where it is quadratic. The patch of a vertex is made of the elements around it; that of a vertex on
the boundary also of the elements around its neighbours, since there the fit looks from one side.
The weights w_q are 1. But in a wide patch of quadratic elements what is farther counts less, since
the stress of a fillet falls off within few elements: w_q = exp(-STEEP |x_q - x|^2 / L^2) with the
distance L of the farthest point. (Linear elements have one stress each, and need the mean of many.)
The patch of another point is made of the elements around the vertices of the element that holds it.
A patch at a plane of symmetry holds the mirror images of its elements, too: the shear across the
plane, which changes its sign there, is zero, and the other components are fitted from both sides.

The element stress is linear in the displacement, s_h = D U, and the coefficients c depend on the
mesh alone: s* = R D U. So a function f of the recovered stress has the derivative D' R' df/ds* by
U. The load of its adjoint problem is the transpose of the recovery.

Source: Zienkiewicz, Zhu (1992), The superconvergent patch recovery and a posteriori error
estimates, Int. J. Numer. Methods Eng. 33.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np
import scipy.sparse as sp
import skfem
from skfem import Mesh
from skfem.quadrature import get_quadrature

from contactopt.bodies.assembly import Assembly
from contactopt.bodies.element_stress import stress_of
from contactopt.bodies.fields import PLACES, Region
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.meshes.cells import straight
from contactopt.meshes.structured import simplices
from contactopt.scenes.kinds import Constants

POINTS = 1.5  # least number of points in a patch, over the number of coefficients
STEEP = 12.0  # of the weights: `pytest tests/test_recovery.py -k hole`, error 0.08, with 0: 0.20


@dataclass(frozen=True, eq=False)
class StressMap:
    """The recovered stress at m places of a body as a linear map of its displacement, as at the
    top of this module.

    places     (dim, m) [length];   sources  (m,) vertices of the mesh, -1 for a place that is none
    fit        of the stresses of the elements around each place
    used       numbers of the elements whose stresses are fitted
    even       (m, 4 or 6) 0 for the shear across a plane of symmetry at a place in it, else 1
    basis      of the element stress at its quadrature points;   constants  of Hooke's law
    """

    places: np.ndarray
    sources: np.ndarray
    fit: PatchFit
    used: np.ndarray
    even: np.ndarray
    body: Assembly
    basis: skfem.CellBasis
    constants: Constants

    @property
    def mesh(self) -> skfem.Mesh:
        return self.body.basis.mesh

    def stress(self, U: np.ndarray) -> np.ndarray:
        """The recovered stress (m, 4 or 6) at every place under a displacement U (n,)."""
        return (
            np.stack([self.weights @ (rows @ U) for rows in self._element_stress], axis=1)
            * self.even
        )

    def deviation(self, U: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Standard error (m,) at every place of a function of the recovered stress with the
        derivatives `slopes` (m, 4 or 6) by it.

        The stresses of the elements around a place scatter about the fit, and what is fitted is as
        uncertain as that.
        """
        columns = zip(self._element_stress, (slopes * self.even).T)
        return np.asarray(
            np.sqrt(sum((slope * self.fit.deviation(rows @ U)) ** 2 for rows, slope in columns))
        )

    def elements(self, places: np.ndarray) -> np.ndarray:
        """Numbers of the elements around some of the places, given by their numbers."""
        chosen = np.isin(self.fit.row, places)
        return np.asarray(self.used[np.unique(self.fit.column[chosen] // len(self.basis.W))])

    def transposed(self, slopes: np.ndarray) -> np.ndarray:
        """The derivative by U (n,), from that by the recovered stress (m, 4 or 6)."""
        columns = zip(self._element_stress, (slopes * self.even).T)
        return np.asarray(sum(rows.T @ (self.weights.T @ slope) for rows, slope in columns))

    def size(self, number: int) -> float:
        """Mean size of the elements in the patch of the place of a number [length]."""
        own = np.unique(self.weights[number].indices // len(self.basis.W))
        volume = np.asarray(self.basis.dx)[own].sum(axis=1)
        return float(np.mean(volume) ** (1 / len(self.places)))

    @cached_property
    def weights(self) -> sp.csr_matrix:
        """R (m, points): what the stresses of the elements contribute to each place."""
        shape = (len(self.sources), self.basis.nelems * len(self.basis.W))
        return sp.csr_matrix((self.fit.weights, (self.fit.row, self.fit.column)), shape)

    @cached_property
    def _element_stress(self) -> tuple[sp.csr_matrix, ...]:
        """D, one matrix (points, n) per component."""
        basis, dofs = self.basis, self.basis.element_dofs
        shape = (basis.nelems * len(basis.W), self.body.basis.N)
        radius = np.asarray(basis.global_coordinates())[0] if self.body.weight[1] else None
        places = PLACES[len(self.body.unknowns)]
        entries: list[list[np.ndarray]] = [[] for _ in places]
        for number in range(basis.Nbfun):
            field = basis.basis[number][0]
            hoop = None if radius is None else np.asarray(field)[0] / radius
            stress = stress_of(self.constants, np.asarray(field.grad), hoop)
            for own, (i, j) in zip(entries, places):
                own.append(stress[i, j])
        row = np.tile(np.arange(shape[0]), basis.Nbfun)
        column = np.repeat(dofs[:, :, None], len(basis.W), axis=2).ravel()
        return tuple(
            sp.csr_matrix((np.stack(own).ravel(), (row, column)), shape) for own in entries
        )


def stress_map(body: Assembly, region: Region, by_poisson: bool = False) -> StressMap:
    """The recovered stress in a region of a body, at the vertices of the mesh there; a point is a
    place by itself.

    by_poisson asks for its derivative by Poisson's ratio instead. InputError for a boundary that
    the body does not have, and for a point outside the body.
    """
    mesh = straight(body.basis.mesh)
    places, sources, seeds = _places(body.name, mesh, region)
    terms = _terms(len(mesh.p), body.degree)
    reference = get_quadrature(body.basis.mesh.refdom, 2 if body.degree == 2 else 1)
    in_plane = body.mirrored[:, sources] & (sources >= 0)
    patches, wide = _patches(
        mesh, seeds, sources, body.mirrored, POINTS * len(terms) / len(reference[1])
    )
    steep = STEEP * wide * (body.degree == 2)
    used = np.unique(patches.indices)
    basis = skfem.Basis(body.basis.mesh, body.basis.elem, elements=used, quadrature=reference)
    row = np.repeat(np.arange(len(sources)), np.diff(patches.indptr))
    count = basis.X.shape[-1]
    points = (np.searchsorted(used, patches.indices)[:, None] * count + np.arange(count)).ravel()
    row = np.repeat(row, count)
    at = np.asarray(basis.global_coordinates()).reshape(len(mesh.p), -1)
    fit = _fit(*_both_sides(at[:, points] - places[:, row], row, points, in_plane), steep, terms)
    kind = body.kind
    constants = (kind.constants_by_poisson if by_poisson else kind.constants)(body.material)
    mirrored = np.concatenate([in_plane, np.zeros((3 - len(in_plane), len(sources)), dtype=bool)])
    even = np.stack([~(mirrored[i] ^ mirrored[j]) for i, j in PLACES[len(mesh.p)]], axis=1).astype(
        float
    )
    return StressMap(places, sources, fit, used, even, body, basis, constants)


def _both_sides(
    offset: np.ndarray, row: np.ndarray, column: np.ndarray, in_plane: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of patches with their mirror images in the planes (dim, m) through their places."""
    for axis, there in enumerate(in_plane):
        images = np.flatnonzero(there[row])
        other = offset[:, images].copy()
        other[axis] *= -1
        offset = np.concatenate([offset, other], axis=1)
        row, column = np.concatenate([row, row[images]]), np.concatenate([column, column[images]])
    return offset, row, column


def _places(name: str, mesh: Mesh, region: Region) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Places (dim, m), the vertices there or -1 (m,), and the vertices of each patch."""
    count = mesh.p.shape[1]
    vertices, point = np.unique(mesh.t), np.asarray(region.point, dtype=float)
    if region.boundary:
        known = mesh.boundaries or {}
        if region.boundary not in known:
            raise InputError(
                f"body '{name}' has no boundary {region.boundary!r}; it has"
                f" {', '.join(sorted(known)) or 'none'}."
            )
        vertices = np.unique(mesh.facets[:, known[region.boundary]])
    elif region.radius is not None:
        vertices = vertices[
            np.linalg.norm(mesh.p[:, vertices] - point[:, None], axis=0) <= region.radius
        ]
    elif len(point):
        vertices = vertices[:0]
    seeds = sp.csr_matrix(
        (np.ones(len(vertices)), (np.arange(len(vertices)), vertices)), (len(vertices), count)
    )
    places = mesh.p[:, vertices]
    if len(point):
        corners, beyond = _holder(mesh, point)
        if beyond <= 0.2:  # of its size: an arc lies beyond a coarse mesh
            own = sp.csr_matrix(
                (np.ones(len(corners)), (np.zeros(len(corners), int), corners)), (1, count)
            )
            seeds, places = sp.vstack([seeds, own]).tocsr(), np.column_stack([places, point])
            vertices = np.append(vertices, -1)
        elif not len(vertices):
            place = ", ".join(f"{x:g}" for x in point)
            raise InputError(
                f"the point ({place}) lies outside body '{name}'; give one inside it or on its"
                " surface."
            )
    return places, vertices, seeds


def _holder(mesh: Mesh, point: np.ndarray) -> tuple[np.ndarray, float]:
    """The corners of the simplex nearest to a point, and by how much of its size it misses it."""
    cells = simplices(mesh)
    origin = cells.p[:, cells.t[0]]
    edges = cells.p[:, cells.t[1:]] - origin[:, None]
    shares = np.linalg.solve(np.moveaxis(edges, 2, 0), (point[:, None] - origin).T[..., None])[
        ..., 0
    ]
    beyond = -np.minimum(shares.min(axis=1), 1 - shares.sum(axis=1))
    best = int(np.argmin(beyond))
    return cells.t[:, best], float(beyond[best])


def _patches(
    mesh: Mesh, seeds: sp.csr_matrix, sources: np.ndarray, mirrored: np.ndarray, least: float
) -> tuple[sp.csr_matrix, np.ndarray]:
    """Mask (m, elements) of the elements that make each patch, and which patches (m,) are wide.
    With their mirror images beyond the planes of symmetry of `mirrored` (dim, nodes) they are at
    least `least` where the mesh has them.
    """
    count = mesh.t.shape[1]
    around = sp.csr_matrix(
        (np.ones(mesh.t.size), (mesh.t.ravel(), np.tile(np.arange(count), len(mesh.t)))),
        (mesh.p.shape[1], count),
    )
    patches = seeds @ around
    rim = mesh.facets[:, mesh.boundary_facets()]
    rim = np.unique(rim[:, ~np.any(np.all(mirrored[:, rim], axis=1), axis=0)])
    images = 2.0 ** np.where(sources >= 0, mirrored[:, sources].sum(axis=0), 0)
    small = np.isin(sources, rim) | (images * np.diff(patches.indptr) < least)
    wide = small
    for _ in range(3):
        if not small.any():
            break
        wider = patches[small] @ around.T @ around
        patches = _replaced(patches, small, wider)
        small = images * np.diff(patches.indptr) < min(least, count)
    return patches, wide


def _replaced(rows: sp.csr_matrix, chosen: np.ndarray, others: sp.csr_matrix) -> sp.csr_matrix:
    stacked = sp.vstack([rows, others]).tocsr()
    order = np.arange(rows.shape[0])
    order[chosen] = rows.shape[0] + np.arange(others.shape[0])
    return stacked[order]


def _terms(dim: int, degree: int) -> list[tuple[int, ...]]:
    """The monomials up to a degree as tuples of axes, the constant first."""
    return [
        axes
        for order in range(degree + 1)
        for axes in combinations_with_replacement(range(dim), order)
    ]


@dataclass(frozen=True, eq=False)
class PatchFit:
    """The weighted least-squares fits around m places.

    row     (p,) the place of each point of a patch;   column  (p,) its number among all points
    powers  (p, t) monomials of the offsets;   weight  (p,) of each point
    inverse  (m, t, t) inverse of the weighted moments of the monomials
    """

    row: np.ndarray
    column: np.ndarray
    powers: np.ndarray
    weight: np.ndarray
    inverse: np.ndarray

    @property
    def weights(self) -> np.ndarray:
        """(p,) what the value at each point contributes to the fit at its place."""
        return np.asarray(self.weight * np.sum(self.inverse[self.row, 0] * self.powers, axis=1))

    def deviation(self, values: np.ndarray) -> np.ndarray:
        """Standard error (m,) of the fit of values (points,), from what the fit leaves.

        If the values are noise of variance v, sum_q w_q (what the fit leaves)^2 has the mean
        v (sum_q w_q - tr(M1^-1 M2)), where M1 and M2 are the moments with the weights w and w^2.
        """
        count, own, w = len(self.inverse), values[self.column], self.weight
        sums = [np.bincount(self.row, w * own * power, count) for power in self.powers.T]
        coefficients = np.einsum("mab,bm->ma", self.inverse, np.array(sums))
        left = own - np.sum(coefficients[self.row] * self.powers, axis=1)
        twice = _moments(self.powers.T, w**2, self.row, count)
        free = np.bincount(self.row, w, count) - np.einsum("mab,mab->m", self.inverse, twice)
        variance = np.bincount(self.row, w * left**2, count) / np.where(free > EQUAL, free, 1.0)
        return np.asarray(np.sqrt(np.bincount(self.row, self.weights**2, count) * variance))


def _fit(
    offset: np.ndarray,
    row: np.ndarray,
    column: np.ndarray,
    steep: np.ndarray,
    terms: list[tuple[int, ...]],
) -> PatchFit:
    """The fits of points at `offset` from the places `row`, with weights as `steep` (m,) says."""
    size = np.zeros(len(steep))
    np.maximum.at(size, row, np.linalg.norm(offset, axis=0))
    scaled = offset / size[row]
    powers = np.stack([np.prod(scaled[list(axes)], axis=0) for axes in terms])
    weight = np.exp(-steep[row] * np.sum(scaled**2, axis=0))
    moments = _moments(powers, weight, row, len(steep))
    inverse = np.linalg.pinv(moments, rcond=1e-10, hermitian=True)
    return PatchFit(row, column, powers.T, weight, inverse)


def _moments(powers: np.ndarray, weight: np.ndarray, row: np.ndarray, count: int) -> np.ndarray:
    """(m, t, t) weighted sums of products of the monomials (t, p) of each place."""
    made = np.zeros((count, len(powers), len(powers)))
    for i, first in enumerate(powers):
        for j, second in enumerate(powers[: i + 1]):
            made[:, i, j] = made[:, j, i] = np.bincount(row, weight * first * second, count)
    return made
