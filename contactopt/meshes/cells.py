"""Elements of a mesh and their corners, straight and curved."""

from __future__ import annotations

import numpy as np
import skfem

SHAPES = {
    "RefTri": (skfem.MeshTri, {1: skfem.ElementTriP1, 2: skfem.ElementTriP2}),
    "RefQuad": (skfem.MeshQuad, {1: skfem.ElementQuad1, 2: skfem.ElementQuad2}),
    "RefTet": (skfem.MeshTet, {1: skfem.ElementTetP1, 2: skfem.ElementTetP2}),
    "RefHex": (skfem.MeshHex, {1: skfem.ElementHex1, 2: skfem.ElementHex2}),
}


CURVED = {
    "RefTri": skfem.MeshTri2,
    "RefQuad": skfem.MeshQuad2,
    "RefTet": skfem.MeshTet2,
    "RefHex": skfem.MeshHex2,
}


CELLS = {  # what meshio and VTK call the elements, by whether they are of second order
    "RefTri": ("triangle", "triangle6"), "RefQuad": ("quad", "quad9"),
    "RefTet": ("tetra", "tetra10"), "RefHex": ("hexahedron", "hexahedron27"),
}  # fmt: skip


# nodes of a hexahedron of scikit-fem in the order of VTK: corners, edges, faces, centre
HEXAHEDRON = (
    0, 3, 6, 2, 1, 5, 7, 4, 10, 16, 14, 9, 12, 18, 17, 11, 8, 15, 19, 13, 20, 25, 22, 23, 21, 24, 26,
)  # fmt: skip


# nodes of a simplex numbered the other way round
TURNED = {"RefTri": (0, 2, 1, 5, 4, 3), "RefTet": (0, 2, 1, 3, 6, 5, 4, 7, 9, 8)}


def is_curved(mesh: skfem.Mesh) -> bool:
    """Say whether a mesh has nodes of its own on edges, which may lie off the straight line.

    Parameters
    ----------
    mesh : A scikit-fem mesh.

    Returns
    -------
    False for meshes whose nodes are their vertices.
    """
    return int(mesh.p.shape[1]) != int(mesh.nvertices)


def straight(mesh: skfem.Mesh) -> skfem.Mesh:
    """Make the mesh of the same vertices with straight edges. Boundaries keep their names.

    Parameters
    ----------
    mesh : A scikit-fem mesh.

    Returns
    -------
    The mesh itself if it is straight.
    """
    if not is_curved(mesh):
        return mesh
    plain = SHAPES[mesh.refdom.__name__][0](
        np.ascontiguousarray(mesh.p[:, : mesh.nvertices]), mesh.t
    )
    return plain.with_boundaries(mesh.boundaries) if mesh.boundaries else plain


def second_order(mesh: skfem.Mesh, places: np.ndarray) -> skfem.Mesh:
    """The mesh with the places (dim, n) of all nodes of a quadratic displacement, the vertices
    first; boundaries keep their names.

    Parameters
    ----------
    mesh : a scikit-fem mesh
    places : (dim, n) positions of all nodes, vertices first [length]

    Returns
    -------
    The mesh of second order.
    """
    if is_curved(mesh):
        return mesh
    made = CURVED[mesh.refdom.__name__](np.ascontiguousarray(places), mesh.t)
    return made.with_boundaries(mesh.boundaries) if mesh.boundaries else made


def elements_of(mesh: skfem.Mesh) -> tuple[str, np.ndarray]:
    """List the elements of a mesh with their nodes in the order of VTK.

    scikit-fem sorts the corners of simplices; here they are numbered so that volumes are positive.

    Parameters
    ----------
    mesh : A mesh of first or second order.

    Returns
    -------
    The name of the elements, a value of CELLS, and their nodes (e, v).
    """
    nodes = np.array(mesh.dofs.element_dofs)
    if mesh.refdom.__name__ == "RefHex":
        nodes = nodes[list(HEXAHEDRON[: len(nodes)])]
    elif mesh.refdom.__name__ in TURNED:
        sides = mesh.p[:, nodes[1 : len(mesh.p) + 1]] - mesh.p[:, nodes[:1]]
        negative = np.linalg.det(sides.transpose(2, 1, 0)) < 0
        nodes[:, negative] = nodes[list(TURNED[mesh.refdom.__name__][: len(nodes)])][:, negative]
    return CELLS[mesh.refdom.__name__][is_curved(mesh)], nodes.T


def facet_nodes(mesh: skfem.Mesh, facets: np.ndarray) -> np.ndarray:
    """Find all nodes of a mesh on some of its facets, those in the middle of edges and faces
    included.

    Parameters
    ----------
    mesh : A mesh of first or second order.
    facets : (f,) Indices of facets.

    Returns
    -------
    (n,) array : Indices of nodes, without repetition.
    """
    if not is_curved(mesh):
        return np.unique(mesh.facets[:, facets])
    return np.unique(mesh.dofs.get_facet_dofs(facets).flatten())
