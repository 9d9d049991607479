"""Where a body is thin beneath its surface: thinner than a part of one facet.

A plate of thickness h that is pressed between points at a distance L bends like (L / h)^3, a thick
body does not. So contact forces must control every displacement of the surface of a thin body. If
a displacement of its nodes moves no contact, it costs next to no energy, and the smallest load
along it bends the plate by as much as you like: the coupling is coercive on the displacements that
no contact sees, but with a constant that falls like (h / L)^3 (the first of Brezzi's conditions).

Source: Boffi, Brezzi, Fortin (2013), Mixed Finite Element Methods and Applications, Springer,
section 5.1.
"""

import numpy as np
import skfem
from scipy.spatial import KDTree

from contactopt.meshes.cells import area_vectors, outer_corners

# thickness over the length of a facet: at .2 a layer of quadratic triangles has the stresses of one
# of quadrilaterals, at .1 half as much again (tests/test_thin_layers.py)
THIN = 0.25
NEAREST = 16  # facets of the other side among which the one beneath is looked for


def thin_facets(mesh: skfem.Mesh, facets: np.ndarray) -> np.ndarray:
    """Which facets (f,) of a boundary have another boundary close beneath them."""
    facets = np.asarray(facets)
    middle, normal, size = _measured(mesh, facets)
    corners = mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]]  # (dim, v, f)
    height = np.max(np.sum((middle[:, None] - corners) * normal[:, None], axis=0), axis=0)
    thin = np.zeros(len(facets), dtype=bool)
    flat = np.flatnonzero(height < THIN * size)  # others have an element as high as that
    others = np.setdiff1d(mesh.boundary_facets(), facets)
    if not len(flat) or not len(others):
        return thin
    there, turned, width = _measured(mesh, others)
    count = min(NEAREST, len(others))
    near = KDTree(there.T).query(middle[:, flat].T, k=np.arange(1, count + 1))[1].T  # (k, f)
    apart = middle[:, None, flat] - there[:, near]
    depth = np.sum(apart * normal[:, None, flat], axis=0)
    aside = np.linalg.norm(apart - depth * normal[:, None, flat], axis=0)
    beneath = np.sum(turned[:, near] * normal[:, None, flat], axis=0) < -0.9  # cosine of two sides
    beneath &= (depth > 0) & (depth < THIN * size[flat]) & (aside < size[flat] + width[near])
    thin[flat] = beneath.any(axis=0)
    return thin


def _measured(mesh: skfem.Mesh, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middles (dim, f), outward unit normals (dim, f) and longest edges (f,) of boundary facets."""
    x = mesh.p[:, outer_corners(mesh, facets)]  # (dim, v, f)
    size = np.linalg.norm(np.roll(x, 1, axis=1) - x, axis=0).max(axis=0)
    normal = area_vectors(x)
    return x.mean(axis=1), normal / np.linalg.norm(normal, axis=0), size
