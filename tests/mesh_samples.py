"""Small meshes, and integrals over them, that the tests of mesh files share."""

import meshio
import numpy as np
import skfem
import skfem.io.meshio

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0.0]])

TWO = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])

_ROUND = [(i, (i + 1) % 4) for i in range(4)]
# corners of a brick whose middles its next nodes are, as VTK and CalculiX number them
BRICK_EDGES = [*_ROUND, *((4 + i, 4 + j) for i, j in _ROUND), *((i, i + 4) for i in range(4))]


def volume(mesh):
    return skfem.Basis(mesh, mesh.elem(), intorder=6).dx.sum()


def flux(mesh, boundary=None):
    """Integral of x . n, the normal as contact uses it."""
    facets = mesh.boundary_facets() if boundary is None else mesh.boundaries[boundary]
    at = skfem.FacetBasis(mesh, mesh.elem(), facets=facets, intorder=8)
    return np.sum(np.asarray(at.normals) * np.asarray(at.global_coordinates()) * at.dx)


def write(path, points, cells, **more):
    meshio.write(path, meshio.Mesh(points, cells, **more))
    return path
