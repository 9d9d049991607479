"""The rotation of a surface about its contacts, which carries displacements along levers."""

import numpy as np
import scipy.sparse as sp

from contactopt.coupling.faces import Faces

# of the size of a contact's cells: larger gaps are levers of the geometry, not of the faces
SHARE = 1 / 8
ROUNDING = 1e-11  # shorter levers, over the size of faces, are rounding


def levers(e: np.ndarray, up: np.ndarray, gap: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """The levers l_i (dim, k) [length]: the part of e_i that is no gap, and a share of the gap;
    zero where they would be rounding alone. The vectors e (dim, k) lead from the other side to the
    own one and open the gap (k,) along the unit normals `up`; `sizes` (k,) are those of the cells.
    """
    limit = SHARE * sizes
    lever = e - up * (gap - np.clip(gap, -limit, limit))
    scale = ROUNDING * max(sizes.max(), np.abs(e).max())
    return np.asarray(np.where(np.linalg.norm(lever, axis=0) > scale, lever, 0.0))


def rotations_times(lever: np.ndarray, own: Faces, nodes: np.ndarray) -> list[list[sp.csr_matrix]]:
    """Matrices [c][d] (k, n) from the component d of the displacement of a surface to the component
    c of omega_i x l_i at the contacts, its points `nodes` (k,).

    omega_i is the mean rotation of the nodes of all faces around contact i, by the areas of the
    faces; in a plane of symmetry it turns about the normal alone.
    """
    # Weight of node j around contact i: the sizes of the faces that hold both, summed.
    f, size = len(own.faces), own.points.shape[1]
    corners = own.points[:, own.faces[:, : own.corners]]
    radius = np.linalg.norm(corners - corners.mean(axis=2, keepdims=True), axis=0).max(axis=1)
    columns = np.repeat(np.arange(f), own.faces.shape[1])
    incident = sp.csr_matrix((np.ones(own.faces.size), (own.faces.ravel(), columns)), (size, f))
    needed = sp.diags(np.any(lever != 0, axis=0).astype(float))
    around = sp.csr_matrix(
        needed @ incident[nodes] @ sp.diags(radius ** (own.dim - 1)) @ incident.T
    )
    # the axes about which the surface turns at a contact
    about = np.ones((3, len(nodes)), dtype=bool)
    for c, there in enumerate(own.mirror[:, nodes] if own.mirror is not None else ()):
        about[np.arange(3) != c] &= ~there
    return _rotations(around, own.points, lever, about)


def _rotations(
    around: sp.csr_matrix, points: np.ndarray, lever: np.ndarray, about: np.ndarray
) -> list[list[sp.csr_matrix]]:
    """The same from the weights (k, n) of the nodes around every contact, and axes (3, k)."""
    dim, k = lever.shape
    w = sp.coo_matrix(around)
    active = w.data > 0
    i, j, weight = w.row[active], w.col[active], w.data[active]
    # rho_j, the places of the nodes from their weighted mean.
    total = np.bincount(i, weight, k)
    centre = np.stack([np.bincount(i, weight * x[j], k) for x in points])
    rho = points[:, j] - (centre / np.where(total > 0, total, 1.0))[:, i]
    rho_x = _crossing(rho)
    # J = sum_j w_j (rho_j^2 - rho_j rho_j') is the sum of -w_j (rho_j x)^2; axes that do not turn
    # are left out.
    moments = -np.einsum("g,gab,gbc->gac", weight, rho_x, rho_x).reshape(len(i), 9)
    J = np.stack([np.bincount(i, m, k) for m in moments.T], axis=1).reshape(k, 3, 3)
    J = np.where(about.T[:, :, None] & about.T[:, None, :], J, 0.0)
    inverse = np.linalg.pinv(J, rcond=1e-10, hermitian=True)
    # omega x l = -l x omega with omega = J^-1 sum_j w_j rho_j x u_j: the product of four factors
    # for every node.
    values = -np.einsum("gab,gbc,gcd,g->gad", _crossing(lever)[i], inverse[i], rho_x, weight)
    return [
        [sp.csr_matrix((values[:, c, d], (i, j)), around.shape) for d in range(dim)]
        for c in range(dim)
    ]


def _crossing(vectors: np.ndarray) -> np.ndarray:
    """Matrices (m, 3, 3) of the cross product v x with vectors (dim, m)."""
    x, y, z = np.pad(vectors, ((0, 3 - len(vectors)), (0, 0)))
    zero = 0 * x
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.array(rows).transpose(2, 0, 1)
