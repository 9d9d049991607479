"""Displacement of degree 1 or 2 on simplices and bricks, and its trace on the contact surface.

Quadratic shape functions N_j cannot weigh contact forces themselves: on the faces of tetrahedra,
and next to an axis of symmetry, their integrals vanish at the vertices. So the contact surface is
covered by linear cells with hat functions phi_i and nodal areas A_i = int phi_i > 0, and their
nodes are the contacts: the halves and quarters of the faces of quadrilaterals and hexahedra, the
whole faces of triangles and tetrahedra, whose forces at vertices and edges would alternate
(tests/experiments/test_element_shapes.py). A contact force r_i acts on the nodes j by r_i W_ij, the
displacement at contact i is W_ij u_j,

    W_ij = int psi_i N_j / A_i,    psi_i linear on each cell,  int psi_i phi_j = delta_ij A_i
                                   (dual basis).

The psi_i add up to one: W has unit row sums, and A_i W_ij sums to int N_j, so that uniform pressure
is exact. At degree 1 W is the identity. Sources: Wohlmuth (2000), A mortar finite element method
using dual spaces for the Lagrange multiplier, SIAM J. Numer. Anal. 38, 989-1012; Popp, Wohlmuth,
Gee, Wall (2012), Dual quadratic mortar finite element methods for 3D finite deformation contact,
SIAM J. Sci. Comput. 34, B421-B446.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sp
import skfem
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine, RefQuad, RefTri

from contactopt.checks import place_words
from contactopt.defaults import CLOSE
from contactopt.errors import InputError
from contactopt.meshes.cells import SHAPES, is_curved

_LINE = RefLine, skfem.ElementLineP1(), np.array([[0.0, 1.0, 0.5]])
_TRIANGLE = RefTri, skfem.ElementTriP1(), np.array([[0, 2, 0, 1, 1, 0], [0, 0, 2, 0, 1, 1]]) / 2
_SQUARE = (
    RefQuad,
    skfem.ElementQuad1(),
    np.array([[0, 2, 2, 0, 1, 2, 1, 0, 1], [0, 0, 2, 2, 0, 1, 2, 1, 1]]) / 2,
)
# faces: reference cell, hat functions, places of the quadratic nodes with the vertices first; the
# cells at degree 2
FACES = {
    "RefTri": (*_LINE, np.array([[0, 1]])),
    "RefQuad": (*_LINE, np.array([[0, 2], [2, 1]])),
    "RefTet": (*_TRIANGLE, np.array([[0, 1, 2]])),
    "RefHex": (*_SQUARE, np.array([[0, 4, 8, 7], [4, 1, 5, 8], [8, 5, 2, 6], [7, 8, 6, 3]])),
}
# cells whose nodes are all those of a quadratic face: a surface that is tied, or that of a thin
# body, must leave no node of it behind
TIED = {
    "RefTri": FACES["RefQuad"][3],
    "RefTet": np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [4, 5, 3]]),
}
Density: TypeAlias = Callable[[np.ndarray, np.ndarray], np.ndarray]
Weight: TypeAlias = tuple[float, bool]  # of integrals: a factor, and whether they carry r as well


class Trace(NamedTuple):
    """The displacement on the contact surface, as at the top of this module.

    nodes    (k,) contact nodes of the body; one at a corner is named once for each side
    areas    (k,) nodal areas, the integrals of the hat functions
    normals  (dim, k) outward unit normals there, averaged over the facets
    weights  (k, nodes of the body) the matrix W
    cells    (v, c) contacts, as places in `nodes`, at the corners of the linear cells
    faces    (f, j) copies of nodes on each face: corners, edges, centre
    copies   (m,) node of the body of each copy (contactopt.bodies.corners)
    """

    nodes: np.ndarray
    areas: np.ndarray
    normals: np.ndarray
    weights: sp.csr_matrix
    cells: np.ndarray
    faces: np.ndarray
    copies: np.ndarray


def weight_at(weight: Weight, x: np.ndarray) -> np.ndarray | float:
    """The measure of the integrals at places x (dim, ...): a constant, times r if axisymmetric."""
    factor, axisymmetric = weight
    return factor * x[0] if axisymmetric else factor


def make_basis(mesh: skfem.Mesh, degree: int, axisymmetric: bool) -> skfem.CellBasis:
    """The displacement basis of a mesh; quadrature is exact on parallelepipeds but for 1/r."""
    element = SHAPES[mesh.refdom.__name__][1][degree]()
    simplex = mesh.refdom.__name__ in ("RefTri", "RefTet") and not is_curved(mesh)
    order = 2 if simplex and not axisymmetric else 2 * degree + axisymmetric
    return LeanBasis(mesh, skfem.ElementVector(element), order)


def with_jacobians(
    mapping: skfem.mapping.Mapping, X: np.ndarray, elements: slice | np.ndarray
) -> skfem.mapping.Mapping:
    """The mapping that knows its Jacobians at places X, (dim, q) or (dim, element, q), of elements.

    scikit-fem makes one entry after the other, evaluates all shape functions for each, and keeps
    them in the mesh, where they take a quarter of the memory of the stiffness.
    """
    if isinstance(mapping, skfem.MappingAffine):
        return mapping
    mesh = mapping.mesh
    corners = mesh.doflocs[:, mesh.dofs.element_dofs[:, elements]]  # (a, i, element)
    slopes = np.stack([mapping.elem.lbasis(X, i)[1] for i in range(corners.shape[1])])
    if X.ndim == 2:
        J = np.tensordot(corners, slopes, (1, 0)).swapaxes(1, 2)  # (a, b, element, q)
    else:
        J = np.einsum("aie,ibeq->abeq", corners, slopes)
    mapping = copy(mapping)  # the mesh keeps its own
    mapping.J = lambda a, b, *_, **__: J[a, b]
    return mapping


class LeanBasis(skfem.CellBasis):
    """A CellBasis without the values of shape functions, which would take more memory than the
    stiffness matrix.
    """

    def __init__(self, mesh: skfem.Mesh, element: skfem.Element, order: int):
        super(skfem.CellBasis, self).__init__(mesh, element, intorder=order, refdom=mesh.refdom)
        self.tind, self.nelems = None, mesh.nelements
        self.dx = self._volumes() * np.broadcast_to(self.W, (self.nelems, len(self.W)))

    def _volumes(self) -> np.ndarray:
        """Volume per reference volume (element, point); InputError for a flat or folded element."""
        bad = np.zeros(self.nelems, dtype=bool)
        with np.errstate(all="ignore"):
            try:
                mapping = with_jacobians(self.mapping, self.X, slice(None))
                ratio = np.broadcast_to(mapping.detDF(self.X), (self.nelems, len(self.W)))
                bad = ~((ratio.min(axis=1) > 0) | (ratio.max(axis=1) < 0))
            except Exception as error:  # scikit-fem has no name for it
                raise InputError(
                    f"the mesh has an element without volume, or one that folds over: {error}."
                ) from error
        if np.any(bad):
            corners = self.mesh.p[:, self.mesh.t[:, np.argmax(bad)]]
            place = place_words(corners.mean(axis=1))
            raise InputError(
                f"the mesh has an element without volume, or one that folds over, at ({place})."
            )
        return np.asarray(np.abs(ratio))


def interpolated(basis: skfem.CellBasis, field: np.ndarray) -> np.ndarray:
    """A displacement (n,) at the points of integration, (dim, element, point)."""
    N = _shapes(basis)
    own = field[basis.element_dofs].reshape(len(N), -1, basis.mesh.nelements)
    return np.einsum("iq,iae->aeq", N, own, optimize=True)


def nodal_forces(basis: skfem.CellBasis, force: np.ndarray, weight: Weight) -> np.ndarray:
    """The nodal forces (n,) of a force per volume (dim, element, point)."""
    x = np.asarray(basis.global_coordinates()) if weight[1] else np.zeros(1)
    measure = basis.dx * weight_at(weight, x)
    nodal = np.einsum("iq,aeq->iae", _shapes(basis), force * measure, optimize=True)
    return np.bincount(basis.element_dofs.ravel(), nodal.ravel(), basis.N)


def _shapes(basis: skfem.CellBasis) -> np.ndarray:
    shape, count = basis.elem.elem, basis.Nbfun // len(basis.mesh.p)
    return np.stack([shape.lbasis(basis.X, i)[0] for i in range(count)])


def node_unknowns(basis: skfem.CellBasis) -> np.ndarray:
    """The unknowns (dim, N / dim) of every node of a basis, vertices first."""
    kinds = (basis.nodal_dofs, basis.edge_dofs, basis.facet_dofs, basis.interior_dofs)
    return np.concatenate([np.asarray(dofs) for dofs in kinds if np.size(dofs)], axis=1)


def contact_trace(
    basis: skfem.CellBasis,
    degree: int,
    boundary: np.ndarray,
    weight: Weight,
    every: bool = False,
    copied: tuple[np.ndarray, np.ndarray] | None = None,
) -> Trace:
    """The trace of the displacement on a boundary of facets (f,), with the measure `weight`. If
    `every`, every node of the boundary is a contact, as where it is tied to another body, or thin.
    Nodes at corners are `copied` (contactopt.bodies.corners.copies).
    """
    name = basis.mesh.refdom.__name__
    places, cells = FACES[name][2:]
    if degree == 1:
        cells = np.arange(cells.shape[1])[None]  # the whole face
        places = places[:, cells[0]]
    elif every:
        cells = TIED.get(name, cells)
    # Values phi_v of the hat functions at the quadrature points of a cell, N_j of the shape
    # functions at all of them.
    phi, points, share = _cell_rule(name, places, cells, degree)
    at = Faces(basis.mesh, boundary, points)
    local, node = _numbered(basis, Faces(basis.mesh, boundary, places))
    faces, copies = copied or np.unique(node, return_inverse=True)[::-1]
    faces = faces.reshape(node.shape[0], -1)
    N = np.take_along_axis(at.values(basis.elem.elem), local[:, :, None], axis=1)
    split = (len(boundary), len(cells), phi.shape[1])  # face, cell, point
    flat = at.scale * share
    measure = (flat * weight_at(weight, at.places)).reshape(split)
    # For every face f and cell c: int phi_v, int phi_v phi_w and int phi_v N_j.
    area = np.einsum("vq,fcq->fcv", phi, measure)
    mass = np.einsum("vq,wq,fcq->fcvw", phi, phi, measure)
    mixed = np.einsum("vq,fjcq,fcq->fcvj", phi, N.reshape(len(boundary), -1, *split[1:]), measure)
    # psi_v = sum_w c_vw phi_w with int psi_v phi_w = delta_vw int phi_v gives c = diag(area)
    # mass^-1 on every cell.
    dual = area[..., None] * np.linalg.solve(mass, mixed)  # int psi_v N_j
    # Normals are averaged with the hat functions, and areas summed, over the cells that meet in a
    # contact.
    normal = np.einsum("vq,dfcq->dfcv", phi, (at.normals * flat).reshape(-1, *split))
    contacts, rows = np.unique(faces[:, cells], return_inverse=True)
    rows = rows.reshape(area.shape)
    areas = np.bincount(rows.ravel(), area.ravel())
    normals = np.stack([np.bincount(rows.ravel(), n.ravel()) for n in normal])
    normals, opposite = unit(normals)
    if opposite is not None:
        node = copies[contacts[opposite]]
        raise InputError(opposed(basis.doflocs[:, node_unknowns(basis)[0, node]]))
    # W_ij = int psi_i N_j / A_i, summed over the cells as the sparse matrix is made.
    value, row, column = np.broadcast_arrays(
        dual / areas[rows][..., None], rows[..., None], node[:, None, None, :]
    )
    size = len(contacts), node_unknowns(basis).shape[1]
    W = sp.csr_matrix((value.ravel(), (row.ravel(), column.ravel())), size)
    W.data = _clean(W.data)
    W.eliminate_zeros()
    corners = rows.reshape(-1, rows.shape[2]).T
    # exact axes stay exact
    return Trace(copies[contacts], areas, _clean(normals), W, corners, faces, copies)


def unit(normals: np.ndarray) -> tuple[np.ndarray, int | None]:
    """Sums of normals (dim, k) made to unit length, and the first place where they cancel."""
    length = np.linalg.norm(normals, axis=0)
    lost = np.flatnonzero(length <= CLOSE * length.max(initial=0.0))
    return normals / np.where(length > 0, length, 1.0), int(lost[0]) if len(lost) else None


def opposed(place: np.ndarray) -> str:
    """The sentence for a place whose normals cancel."""
    return (
        f"facets face opposite ways at ({place_words(place)}), so that the boundary has no"
        " normal there; make a boundary of each side, with a contact of its own."
    )


def surface_load(
    basis: skfem.CellBasis, boundary: np.ndarray, density: Density, weight: Weight
) -> np.ndarray:
    """The forces (N,) of a density [stress] at places and their outward normals on facets (f,)."""
    at, places, measure = _rule(basis, boundary, weight)
    stress = np.broadcast_to(density(places, at.normals), places.shape)
    forces = np.einsum("fiq,dfq,fq->idf", at.values(basis.elem.elem), stress, measure)
    dofs = basis.element_dofs[:, at.owner]  # of all components of the first shape function, ...
    return np.bincount(dofs.ravel(), forces.ravel(), minlength=basis.N)


def face_integrals(
    basis: skfem.CellBasis, boundary: np.ndarray, weight: Weight
) -> tuple[float, np.ndarray, np.ndarray]:
    """The area of facets (f,), and the integrals (dim,) of outward normals and of places there."""
    at, places, measure = _rule(basis, boundary, weight)
    return float(measure.sum()), *((own * measure).sum(axis=(1, 2)) for own in (at.normals, places))


def _rule(
    basis: skfem.CellBasis, boundary: np.ndarray, weight: Weight
) -> tuple[Faces, np.ndarray, np.ndarray]:
    """Points of a quadrature on facets (f,), their places (dim, f, q) and weights (f, q)."""
    points, share = get_quadrature(FACES[basis.mesh.refdom.__name__][0], 6)  # for curved faces
    at = Faces(basis.mesh, np.asarray(boundary), points)
    places = at.places
    return at, places, at.scale * share * weight_at(weight, places)


def nodes_on(basis: skfem.CellBasis, degree: int, boundary: np.ndarray) -> np.ndarray:
    """Nodes (f, j) of a boundary's faces, corners first and cyclic."""
    if degree == 1:
        return np.asarray(basis.mesh.facets[:, boundary].T)
    places = FACES[basis.mesh.refdom.__name__][2]
    return _numbered(basis, Faces(basis.mesh, boundary, places))[1]


def mean_normals(basis: skfem.CellBasis, degree: int, boundary: np.ndarray) -> np.ndarray:
    """The mean outward normals (dim, f) of the faces of a boundary."""
    _, hat, places, _ = FACES[basis.mesh.refdom.__name__]
    places = places if degree == 2 else places[:, : hat.doflocs.shape[0]]
    return np.asarray(Faces(basis.mesh, boundary, places).normals.mean(axis=2))


def _cell_rule(
    name: str, places: np.ndarray, cells: np.ndarray, degree: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hat functions (v, point) on a cell, and the reference face's points and weights (q,)."""
    face, hat = FACES[name][:2]
    points, share = get_quadrature(face, degree + 2)
    phi = np.stack([hat.lbasis(points, v)[0] for v in range(cells.shape[1])])
    everywhere = np.concatenate([places[:, cell] @ phi for cell in cells], axis=1)
    return phi, everywhere, np.tile(share / len(cells), len(cells))


@dataclass(frozen=True, eq=False)
class Faces:
    """Points (dim - 1, q) of the reference face, on every facet (f,) of a mesh.

    Where they lie in the elements is known at once: on the face of the reference element that has
    the same corners. (scikit-fem's FacetBasis looks for them by Newton's method, to 1e-12 of an
    element, which is out of reach for small elements far from the origin.)
    """

    mesh: skfem.Mesh
    facets: np.ndarray
    points: np.ndarray

    @cached_property
    def owner(self) -> np.ndarray:
        """(f,) the element of each facet."""
        return np.asarray(self.mesh.f2t[0, self.facets])

    @cached_property
    def inside(self) -> np.ndarray:
        """(dim, f, q) places in the reference element."""
        corners, hat = self.mesh.facets[:, self.facets], FACES[self.mesh.refdom.__name__][1]
        local = np.argmax(self.mesh.t[:, None, self.owner] == corners, axis=0)
        hats = np.stack([hat.lbasis(self.points, v)[0] for v in range(len(corners))])
        return np.einsum("dvf,vq->dfq", self.mesh.refdom.p[:, local], hats)

    @property
    def places(self) -> np.ndarray:
        """(dim, f, q) places on the facets."""
        return np.asarray(self.mesh._mapping().G(self.points, find=self.facets))

    @property
    def scale(self) -> np.ndarray:
        """(f, q) area per area of the reference face."""
        return np.abs(self.mesh._mapping().detDG(self.points, find=self.facets))

    @property
    def normals(self) -> np.ndarray:
        """(dim, f, q) outward unit normals."""
        mapping = with_jacobians(self.mesh._mapping(), self.inside, self.owner)
        known = self.inside, self.owner, self.facets, self.mesh.t2f
        return np.asarray(mapping.normals(*known))

    def values(self, shape: skfem.Element) -> np.ndarray:
        """(f, i, q) values of the shape functions of the elements."""
        functions = range(shape.doflocs.shape[0])
        return np.stack([shape.lbasis(self.inside, i)[0] for i in functions], axis=1)


def _numbered(basis: skfem.CellBasis, nodal: Faces) -> tuple[np.ndarray, np.ndarray]:
    """Which shape function of an element, and node of the mesh, is 1 at each place (f, j)."""
    dim = len(basis.mesh.p)
    local = np.argmax(nodal.values(basis.elem.elem), axis=1)
    return local, basis.element_dofs[::dim][local, nodal.owner[:, None]] // dim


def _clean(values: np.ndarray) -> np.ndarray:
    """The values with those that are only rounding errors set to zero."""
    return np.where(np.abs(values) < 1e-14, 0.0, values)  # what rounding leaves of a zero
