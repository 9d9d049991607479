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

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sp
import skfem
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine, RefQuad, RefTri

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
# cells whose nodes are all those of a quadratic face: a tied surface must leave no node of it
# behind
TIED = {
    "RefTri": FACES["RefQuad"][3],
    "RefTet": np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]),
}
Weight: TypeAlias = tuple[float, bool]  # of integrals: a factor, and whether they carry r as well
Rule: TypeAlias = tuple[np.ndarray, np.ndarray]  # places and weights of a quadrature
NOISE = 1e-14  # what rounding leaves of a zero


class Trace(NamedTuple):
    """The displacement on the contact surface, as in the head of this module.

    nodes    (k,) contact nodes of the body
    areas    (k,) nodal areas, the integrals of the hat functions
    normals  (dim, k) outward unit normals there, averaged over the facets
    weights  (k, nodes of the body) the matrix W
    cells    (v, c) contacts, as places in `nodes`, at the corners of the linear cells
    """

    nodes: np.ndarray
    areas: np.ndarray
    normals: np.ndarray
    weights: sp.csr_matrix
    cells: np.ndarray


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


def forget(mapping: skfem.mapping.Mapping) -> None:
    """Free the Jacobians that scikit-fem keeps: a quarter of the stiffness's memory."""
    getattr(mapping, "_cache", {}).clear()


class LeanBasis(skfem.CellBasis):
    """A CellBasis that evaluates each shape function when it is asked for: the values of all would
    take more memory than the stiffness matrix.
    """

    def __init__(self, mesh: skfem.Mesh, element: skfem.Element, order: int):
        super(skfem.CellBasis, self).__init__(mesh, element, intorder=order, refdom=mesh.refdom)
        self.tind, self.nelems = None, mesh.nelements
        self.dx = self._volumes() * np.broadcast_to(self.W, (self.nelems, len(self.W)))
        self.basis = _Shapes(element, self.mapping, self.X, self.Nbfun)

    def _volumes(self) -> np.ndarray:
        """Volume per reference volume (element, point); InputError for a flat or folded element."""
        bad = np.zeros(self.nelems, dtype=bool)
        with np.errstate(all="ignore"):
            try:
                ratio = np.broadcast_to(self.mapping.detDF(self.X), (self.nelems, len(self.W)))
                bad = ~((ratio.min(axis=1) > 0) | (ratio.max(axis=1) < 0))
            except Exception as error:  # scikit-fem has no name for it
                raise InputError(
                    f"the mesh has an element without volume, or one that folds over: {error}."
                ) from error
        if np.any(bad):
            corners = self.mesh.p[:, self.mesh.t[:, np.argmax(bad)]]
            place = ", ".join(f"{x:g}" for x in corners.mean(axis=1))
            raise InputError(
                f"the mesh has an element without volume, or one that folds over, at ({place})."
            )
        forget(self.mapping)
        return np.asarray(np.abs(ratio))


@dataclass(frozen=True)
class _Shapes(Sequence[Any]):
    element: skfem.Element
    mapping: skfem.mapping.Mapping
    points: np.ndarray
    functions: int

    def __len__(self) -> int:
        return self.functions

    def __getitem__(self, number: Any) -> Any:
        if not -self.functions <= number < self.functions:
            raise IndexError(number)
        return self.element.gbasis(self.mapping, self.points, number % self.functions)


def node_unknowns(basis: skfem.CellBasis) -> np.ndarray:
    """The unknowns (dim, N / dim) of every node of a basis, vertices first."""
    kinds = (basis.nodal_dofs, basis.edge_dofs, basis.facet_dofs, basis.interior_dofs)
    return np.concatenate([np.asarray(dofs) for dofs in kinds if np.size(dofs)], axis=1)


def contact_trace(
    basis: skfem.CellBasis, degree: int, boundary: np.ndarray, weight: Weight, tied: bool = False
) -> Trace:
    """The trace of the displacement on a boundary of facets (f,), with the measure `weight`. If
    `tied`, every node of the boundary is a contact, as where it is tied to another body.
    """
    name = basis.mesh.refdom.__name__
    shape, places, cells = SHAPES[name][1][degree](), FACES[name][2], FACES[name][3]
    if degree == 1:
        cells = np.arange(cells.shape[1])[None]  # the whole face
        places = places[:, cells[0]]
    elif tied:
        cells = TIED.get(name, cells)
    # Values phi_v of the hat functions at the quadrature points of a cell, N_j of the shape
    # functions at all of them.
    phi, rule = _cell_rule(name, places, cells, degree)
    at = face_basis(basis.mesh, shape, boundary, rule)
    N, node = _face_shapes(at, shape, boundary, places)
    split = (len(boundary), len(cells), phi.shape[1])  # face, cell, point
    flat = np.asarray(at.dx)
    measure = (flat * weight_at(weight, np.asarray(at.global_coordinates()))).reshape(split)
    # For every face f and cell c: int phi_v, int phi_v phi_w and int phi_v N_j.
    area = np.einsum("vq,fcq->fcv", phi, measure)
    mass = np.einsum("vq,wq,fcq->fcvw", phi, phi, measure)
    mixed = np.einsum("vq,fjcq,fcq->fcvj", phi, N.reshape(len(boundary), -1, *split[1:]), measure)
    # psi_v = sum_w c_vw phi_w with int psi_v phi_w = delta_vw int phi_v gives c = diag(area)
    # mass^-1 on every cell.
    dual = area[..., None] * np.linalg.solve(mass, mixed)  # int psi_v N_j
    # Normals are averaged with the hat functions, and areas summed, over the cells that meet in a
    # contact.
    normal = np.einsum("vq,dfcq->dfcv", phi, (np.asarray(at.normals) * flat).reshape(-1, *split))
    nodes, rows = np.unique(node[:, cells], return_inverse=True)
    rows = rows.reshape(area.shape)
    areas = np.bincount(rows.ravel(), area.ravel())
    normals = np.stack([np.bincount(rows.ravel(), n.ravel()) for n in normal])
    normals = normals / np.linalg.norm(normals, axis=0)
    # W_ij = int psi_i N_j / A_i, summed over the cells as the sparse matrix is made.
    value, row, column = np.broadcast_arrays(
        dual / areas[rows][..., None], rows[..., None], node[:, None, None, :]
    )
    size = len(nodes), node_unknowns(basis).shape[1]
    W = sp.csr_matrix((value.ravel(), (row.ravel(), column.ravel())), size)
    W.data = _clean(W.data)
    W.eliminate_zeros()
    corners = rows.reshape(-1, rows.shape[2]).T
    return Trace(nodes, areas, _clean(normals), W, corners)  # exact axes stay exact


def face_nodes(
    basis: skfem.CellBasis, degree: int, boundary: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (f, j) of a boundary's faces, corners first and cyclic; outward normals (dim, f)."""
    name = basis.mesh.refdom.__name__
    shape, places = SHAPES[name][1][degree](), FACES[name][2]
    if degree == 1:
        places = places[:, : FACES[name][1].doflocs.shape[0]]
    at = face_basis(basis.mesh, shape, boundary, (places, np.ones(places.shape[1])))
    return _face_shapes(at, shape, boundary, places)[1], np.asarray(at.normals).mean(axis=2)


def _cell_rule(
    name: str, places: np.ndarray, cells: np.ndarray, degree: int
) -> tuple[np.ndarray, Rule]:
    """Hat functions (v, point) on a cell, and the reference face's rule of one rule per cell."""
    face, hat = FACES[name][:2]
    points, share = get_quadrature(face, degree + 2)
    phi = np.stack([hat.lbasis(points, v)[0] for v in range(cells.shape[1])])
    everywhere = np.concatenate([places[:, cell] @ phi for cell in cells], axis=1)
    return phi, (everywhere, np.tile(share / len(cells), len(cells)))


def face_basis(
    mesh: skfem.Mesh, shape: skfem.Element, boundary: np.ndarray, rule: Rule
) -> skfem.FacetBasis:
    """FacetBasis that finds the places on elements to the rounding of the coordinates; scikit-fem
    asks for 1e-12 of an element, out of reach for small elements far from the origin.
    """
    mapping = mesh._mapping()
    if not isinstance(mapping, skfem.MappingAffine):
        corners = mesh.p[:, mesh.facets[:, boundary]]
        least = np.ptp(corners, axis=1).max(axis=0).min()
        rounding = np.finfo(float).eps * np.abs(corners).max() / least
        tolerance = max(1e-12, 16 * rule[0].shape[1] * rounding)
        mapping = copy(mapping)  # the mesh keeps its own
        mapping.invF = partial(type(mapping).invF, mapping, newton_tol=tolerance)
    return skfem.FacetBasis(mesh, shape, mapping, facets=boundary, quadrature=rule)


def _face_shapes(
    at: skfem.FacetBasis, shape: skfem.Element, boundary: np.ndarray, places: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Values (face, j, point) of the face's shape functions at `at`, and their nodes."""
    nodal = face_basis(at.mesh, shape, boundary, (places, np.ones(places.shape[1])))
    # Of the element's shape functions, the one of a node is that which is 1 there.
    local = np.argmax(np.stack([np.asarray(f[0]) for f in nodal.basis], axis=1), axis=1)
    N = np.take_along_axis(
        np.stack([np.asarray(f[0]) for f in at.basis], axis=1), local[:, :, None], axis=1
    )
    unknowns = np.take_along_axis(nodal.element_dofs.T, local, axis=1)
    return N, np.argsort(node_unknowns(nodal)[0])[unknowns]


def _clean(values: np.ndarray) -> np.ndarray:
    """The values with those that are only rounding errors set to zero."""
    return np.where(np.abs(values) < NOISE, 0.0, values)
