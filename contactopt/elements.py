"""Displacement of degree 1 or 2 on triangles, quadrilaterals, tetrahedra and hexahedra, and its trace on the contact surface.

Contact is written at the vertices of the contact surface, with nodal areas A_i = int phi_i > 0 of the hat functions phi_i
(linear on triangles, bilinear on quadrilaterals). A contact force r_i acts on the nodes j of the body by r_i W_ij, and
W_ij u_j is the displacement at contact i; every row of W adds up to 1.

    degree 1   W_ij = delta_ij
    degree 2   W_ij = int phi_i N_j / A_i, N_j the quadratic shape functions: the traction is the piecewise linear
               function of the nodal values r_i / A_i, and the gap that may not be negative is the mean weighted by phi_i

A force at each quadratic node instead would do for lines and for the nine-node face of a brick, not for the six-node
face of a tetrahedron, where int N_j = 0 at the vertices. A piecewise linear traction is as accurate as the quadratic
displacement deserves, and stable. Source: Hueber, Mair, Wohlmuth (2005), A priori error estimates and an inexact
primal-dual active set strategy for linear and quadratic finite elements applied to multibody contact problems,
Appl. Numer. Math. 54, 555-576.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import skfem

SHAPES = {
    "RefTri": (skfem.MeshTri, {1: skfem.ElementTriP1, 2: skfem.ElementTriP2}),
    "RefQuad": (skfem.MeshQuad, {1: skfem.ElementQuad1, 2: skfem.ElementQuad2}),
    "RefTet": (skfem.MeshTet, {1: skfem.ElementTetP1, 2: skfem.ElementTetP2}),
    "RefHex": (skfem.MeshHex, {1: skfem.ElementHex1, 2: skfem.ElementHex2}),
}


def weight_at(weight: tuple[float, bool], x: np.ndarray) -> np.ndarray | float:
    """Measure of the integrals: a constant (thickness, copies), times r in an axisymmetric scene."""
    factor, axisymmetric = weight
    return factor * x[0] if axisymmetric else factor


def make_basis(mesh: skfem.Mesh, degree: int, axisymmetric: bool) -> skfem.CellBasis:
    """Vector-valued displacement; quadrature exact for the stiffness of straight-sided parallelepipeds but for 1/r."""
    element = SHAPES[mesh.refdom.__name__][1][degree]()
    simplex = mesh.refdom.__name__ in ("RefTri", "RefTet") and not is_curved(mesh)
    order = 2 if simplex and not axisymmetric else 2 * degree + axisymmetric
    return skfem.Basis(mesh, skfem.ElementVector(element), intorder=order)


def is_curved(mesh: skfem.Mesh) -> bool:
    """Whether the mesh has nodes of its own on edges, which may lie off the straight line."""
    return int(mesh.p.shape[1]) != int(mesh.nvertices)


def straight(mesh: skfem.Mesh) -> skfem.Mesh:
    """The mesh of the same vertices with straight edges; boundaries keep their names."""
    if not is_curved(mesh):
        return mesh
    plain = SHAPES[mesh.refdom.__name__][0](mesh.p[:, : mesh.nvertices], mesh.t)
    return plain.with_boundaries(mesh.boundaries) if mesh.boundaries else plain


def node_unknowns(basis: skfem.CellBasis) -> np.ndarray:
    """(dim, N / dim) unknowns of every node, one row per component; the vertices of the mesh come first."""
    kinds = (basis.nodal_dofs, basis.edge_dofs, basis.facet_dofs, basis.interior_dofs)
    return np.concatenate([np.asarray(dofs) for dofs in kinds if np.size(dofs)], axis=1)


def contact_trace(
    basis: skfem.CellBasis, degree: int, boundary: np.ndarray, weight: tuple[float, bool]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, sp.csr_matrix]:
    """Vertices (k,), areas (k,), outward unit normals (dim, k) and W (k, nodes) of a contact boundary."""
    mesh, shapes = basis.mesh, SHAPES[basis.mesh.refdom.__name__][1]
    hats = skfem.FacetBasis(mesh, shapes[1](), facets=boundary, intorder=3 if degree == 1 else 5)

    def integrate(value) -> np.ndarray:  # type: ignore[no-untyped-def]
        return skfem.LinearForm(lambda v, w: value(w) * v).assemble(hats)

    nodes = np.unique(mesh.facets[:, boundary])
    areas = integrate(lambda w: weight_at(weight, w.x))[nodes]
    normals = np.stack([integrate(lambda w, i=i: w.n[i])[nodes] for i in range(mesh.p.shape[0])])
    normals /= np.linalg.norm(normals, axis=0)
    normals = np.where(np.abs(normals) < 1e-14, 0.0, normals)  # exact axes stay exact
    if degree == 1:
        W = sp.csr_matrix((np.ones(len(nodes)), (np.arange(len(nodes)), nodes)), (len(nodes), int(mesh.nvertices)))
        return nodes, areas, normals, W
    fine = skfem.FacetBasis(mesh, shapes[degree](), facets=boundary, quadrature=hats.quadrature)
    overlap = skfem.BilinearForm(lambda u, v, w: weight_at(weight, w.x) * u * v).assemble(fine, hats)
    order = node_unknowns(fine)[0]
    return nodes, areas, normals, sp.csr_matrix(sp.diags(1 / areas) @ overlap[nodes][:, order])
