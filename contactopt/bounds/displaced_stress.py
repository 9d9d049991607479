"""The stress of a quadratic displacement, or of a bilinear one in halved quadrilaterals."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from skfem import Mesh, MeshTri

from contactopt.material import Material, lame
from contactopt.meshes.cells import facets_at

if TYPE_CHECKING:
    from contactopt.bounds.equilibrium_elements import EquilibriumElements

CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])  # of a quadrilateral
STEPS = 8  # of Newton's method for a place in a quadrilateral, at most


class Halves(NamedTuple):
    """Quadrilaterals that a diagonal cuts into triangles.

    mesh     triangles, with the vertices of the quadrilaterals and their named boundaries
    corners  (4, e) the vertices of the quadrilateral of each triangle, around it; None if the
             triangles are elements themselves
    """

    mesh: Mesh
    corners: np.ndarray | None = None


def halved(mesh: Mesh) -> Halves:
    """Cut a mesh of quadrilaterals."""
    t = np.concatenate([mesh.t[[0, 1, 3]], mesh.t[[1, 2, 3]]], axis=1)
    made = MeshTri(mesh.p, t)
    named = {
        name: facets_at(made, mesh.facets[:, at]) for name, at in (mesh.boundaries or {}).items()
    }
    return Halves(made.with_boundaries(named), np.tile(mesh.t, 2))


def displaced_stress(
    cells: EquilibriumElements,
    material: Material,
    nodal: np.ndarray,
    at: np.ndarray,
    r: np.ndarray | None,
) -> np.ndarray:
    """Components xx, yy, xy and the one across (e, s, 4) of the stress under displacements (2,
    vertices and edges), at shares (3, s) of the vertices; `r` (e, s) radii, if revolved.
    """
    lam, shear = lame(material)
    (i, j), edges = cells.between
    own = np.concatenate([nodal[:, cells.mesh.t], nodal[:, cells.mesh.nvertices + edges]], axis=1)
    if cells.corners is not None:  # bilinear, but for bubbles on the edges
        own[:, 3:] -= (own[:, i] + own[:, j]) / 2
        own[:, :3] = 0.0
    shapes = np.concatenate([at * (2 * at - 1), 4 * at[i] * at[j]])  # (q, s)
    by_share = np.zeros((len(shapes), 3, at.shape[1]))
    by_share[np.arange(3), np.arange(3)] = 4 * at - 1
    for q, (one, other) in enumerate(zip(i, j), 3):
        by_share[q, one], by_share[q, other] = 4 * at[other], 4 * at[one]
    nodes = np.ascontiguousarray(own.transpose(2, 0, 1))  # (e, c, q)
    turned = (nodes @ by_share.reshape(len(shapes), -1)).reshape(-1, 2, 3, at.shape[1])
    gradient = cells.slopes.swapaxes(1, 2)[:, None] @ turned  # (e, c, k, s)
    along = nodes[:, 0] @ shapes
    if cells.corners is not None:
        N, slopes = cells.bilinear
        values = np.ascontiguousarray(nodal[:, cells.corners].transpose(2, 0, 1))
        gradient += (values @ slopes.reshape(*slopes.shape[:2], -1)).reshape(gradient.shape)
        along += (values[:, :1] @ N)[:, 0]
    across = np.zeros(along.shape) if r is None else along / r
    strains = gradient[:, 0, 0], gradient[:, 1, 1], across
    normal = [lam * sum(strains) + 2 * shear * strain for strain in strains]
    turn = shear * (gradient[:, 0, 1] + gradient[:, 1, 0])
    return np.stack([normal[0], normal[1], turn, normal[2]], axis=-1)


def bilinear(x: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bilinear shape functions (4, e, s) and slopes (4, 2, e, s) at points of quadrilaterals."""
    place, reach = np.full(wanted.shape, 0.5), np.abs(wanted).max(initial=0.0)
    for _ in range(STEPS):
        N, by_place = _shapes(place)
        left = wanted - sum(x[:, q, :, None] * N[q] for q in range(4))
        place = place + np.sum(_inverse(x, by_place) * left, axis=1)
        if np.abs(left).max(initial=0.0) <= 1e-14 * reach:  # of the coordinates
            break
    N, by_place = _shapes(place)
    inverse = _inverse(x, by_place)
    return N, by_place[:, 0, None] * inverse[0] + by_place[:, 1, None] * inverse[1]


def _shapes(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same by the coordinates (2, e, s) of the quadrilateral."""
    one = [(1 - own, own) for own in place]
    sides = [[int(c) for c in corner] for corner in CORNERS]
    N = np.stack([one[0][i] * one[1][j] for i, j in sides])
    slopes = [[(2 * i - 1) * one[1][j], (2 * j - 1) * one[0][i]] for i, j in sides]
    return N, np.array(slopes)


def _inverse(x: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """(2, 2, e, s) slopes of the coordinates of quadrilaterals with corners x (2, 4, e)."""
    (a, b), (c, d) = (
        [sum(x[k, q, :, None] * slopes[q, i] for q in range(4)) for i in range(2)] for k in range(2)
    )
    return np.array([[d, -b], [-c, a]]) / (a * d - b * c)
