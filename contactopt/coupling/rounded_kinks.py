"""What linear elements leave out between the nodes of the other side: rounding off the kinks of its
displacement.

A surface of linear elements stays a polygon when it is bent. Where the contacts are finer than the
other side, they would see its kinks, and pressures would have to follow them: first order in h,
however smooth the bodies' true deformation is. They see instead, on every face,

    u' + sum_e (B_e - mean of B_e) m_e,     m_e = (grad_a - grad_b) . (x_b - x_a) / 8,

with B_e the hierarchical quadratic function of edge e, which joins nodes a and b, and m_e the rise
of its middle that the recovered gradients ask for. These come from least-squares fits of quadratic
functions to the nodes around each node: quadratic displacements are rounded exactly, linear ones
not at all. The mean is that over the covered part of the face, so that a uniform pressure still
gives every node exactly the integral of its shape function. Since all is linear in the
displacements of the nodes, forces follow by transposition, and remain in equilibrium.

Beyond a plane of symmetry the surface goes on as its mirror image, and the fits use its nodes, too.
Components along the plane are there what they are on this side; the one across it is opposite about
its value in the plane, so that a rigid motion remains one. The rises then depend on the component.

Source of the recovery: Zhang, Naga (2005), A new finite element gradient recovery method:
superconvergence property, SIAM J. Sci. Comput. 26, 1192-1213.
"""

import numpy as np
import scipy.sparse as sp
from scipy.spatial import KDTree

from contactopt.coupling.faces import Faces
from contactopt.coupling.segments import Overlap

# singular values of a fit, over the largest, below which the nodes around do not determine it
FLAT = 1e-8


class Rounding:
    """The rounding of the displacement of a surface of linear elements, at the points of
    integration of an overlap.

    rises   (f e, n) from the nodes' values to m_e of the edges of every face
    across  [c] (f e, n): what is added to `rises` for component c of a displacement, which a plane
            of symmetry turns round; empty without such a plane
    """

    def __init__(self, surface: Faces, points: Overlap) -> None:
        c = surface.corners
        self.edges = np.array([(i, (i + 1) % c) for i in range(c if c > 2 else 1)])
        self.surface, self.points = surface, points
        self.rises, self.across = _rises(surface, self.edges)
        count = len(surface.faces)
        content = np.bincount(points.face, points.measure, count)
        bubbles = self._bubbles(points.there) * points.measure
        moments = [np.bincount(points.face, B, count) for B in bubbles]
        self.means = np.stack(moments) / np.where(content > 0, content, 1.0)  # (e, f)

    def values(self, block: slice) -> np.ndarray:
        """(e, g) B_e less its mean at some of the points."""
        return self._bubbles(self.points.there[:, block]) - self.means[:, self.points.face[block]]

    def columns(self, block: slice, first: np.ndarray) -> np.ndarray:
        """(p, e) rows of `rises` that belong to the points numbered `first` (p,) in a block."""
        e = len(self.edges)
        return np.asarray(self.points.face[block][first][:, None] * e + np.arange(e))

    def _bubbles(self, at: np.ndarray) -> np.ndarray:
        """(e, m) B_e at places (dim - 1, m): one in the middle of its edge, zero on the others."""
        hats = self.surface.shapes(at)
        first, second = hats[self.edges[:, 0]], hats[self.edges[:, 1]]
        both = first + second if self.surface.corners == 4 else np.ones(1)
        return np.asarray(4 * first * second / np.where(both > 0, both, 1.0))


def _rises(surface: Faces, edges: np.ndarray) -> tuple[sp.csr_matrix, list[sp.csr_matrix]]:
    """`rises` and `across` of the edges of a surface; zero where a gradient is unknown."""
    points, faces, even, odd = _with_images(surface)
    gradients = _gradients(points, faces, np.unique(surface.faces))
    a, b = (surface.faces[:, edges[:, i]].ravel() for i in (0, 1))
    along = (surface.points[:, b] - surface.points[:, a]) / 8
    determined = np.asarray(sum(np.diff(G.indptr) for G in gradients) > 0)
    known = sp.diags((determined[a] & determined[b]).astype(float))
    rises = known @ sum(sp.diags(step) @ (G[a] - G[b]) for step, G in zip(along, gradients))
    return sp.csr_matrix(rises @ even), [sp.csr_matrix(rises @ (E - even)) for E in odd]


def _with_images(
    surface: Faces,
) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix, list[sp.csr_matrix]]:
    """Points (dim, m) and faces of a surface with its mirror images; the matrix (m, n) from the
    nodes' values to those of all points, where they are the same on both sides of every plane; and
    for each component of a displacement the one that is right for it.
    """
    points, faces, mirror = surface.points, surface.faces, surface.mirror
    even = sp.identity(points.shape[1], format="csr")
    if mirror is None:
        return points, faces, even, []
    odd = [even] * surface.dim
    for c in range(surface.dim):
        count, nodes = points.shape[1], np.unique(faces)
        within, beside = nodes[mirror[c, nodes]], nodes[~mirror[c, nodes]]
        if not len(within):
            continue
        foot = within[KDTree(points[:, within].T).query(points[:, beside].T)[1]]
        image = np.arange(count)
        image[beside] = count + np.arange(len(beside))
        beyond = points[:, beside]
        beyond[c] = 2 * points[c, foot] - beyond[c]
        points, mirror = np.hstack([points, beyond]), np.hstack([mirror, mirror[:, beside]])
        faces = np.vstack([faces, image[faces]])
        odd = [
            sp.vstack([E, 2 * E[foot] - E[beside] if d == c else E[beside]], format="csr")
            for d, E in enumerate(odd)
        ]
        even = sp.vstack([even, even[beside]], format="csr")
    return points, faces, even, odd


def _gradients(points: np.ndarray, faces: np.ndarray, wanted: np.ndarray) -> list[sp.csr_matrix]:
    """Matrices (n, n), one for each component of space, from the nodes' values to the tangential
    gradient at the nodes `wanted`; empty rows elsewhere, and where too few others surround a node.
    """
    (dim, n), (f, j) = points.shape, faces.shape
    at = faces.ravel(), np.repeat(np.arange(f), j)
    incident = sp.csr_matrix((np.ones(f * j), at), (n, f))
    near = sp.csr_matrix(incident @ incident.T)
    terms = 3 if dim == 2 else 6
    wider = sp.csr_matrix(near @ near)
    few = np.diff(near.indptr) < (terms if dim == 2 else terms + 2)
    rows, columns, values = [], [], []
    for node in wanted:
        graph = wider if few[node] else near
        around = graph.indices[graph.indptr[node] : graph.indptr[node + 1]]
        fit = _fit(points[:, around] - points[:, [node]], dim - 1, terms)
        if fit is not None:
            rows.append(np.full(len(around), node))
            columns.append(around)
            values.append(fit)
    if not rows:
        return [sp.csr_matrix((n, n))] * dim
    index = np.concatenate(rows), np.concatenate(columns)
    return [sp.csr_matrix((value, index), (n, n)) for value in np.concatenate(values, axis=1)]


def _fit(apart: np.ndarray, directions: int, terms: int) -> np.ndarray | None:
    """(dim, m) weights of m nodes in the quadratic fit's gradient at `apart` = 0, or None."""
    if apart.shape[1] < terms:
        return None
    # Coordinates y in the tangent plane through the nodes, scaled to one.
    centred = apart - apart.mean(axis=1, keepdims=True)
    axes = np.linalg.svd(centred, full_matrices=False)[0][:, :directions]
    y = axes.T @ apart
    size = np.abs(y).max()
    if size == 0:
        return None
    y = y / size
    # Least squares for 1, y and the products y_i y_k; rows 1 to `directions` of the pseudo-inverse
    # give the gradient.
    squares = [y[i] * y[k] for i in range(directions) for k in range(i, directions)]
    A = np.stack([np.ones(len(y.T)), *y, *squares], axis=1)
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    if s[-1] < FLAT * s[0]:
        return None
    slopes = (Vt.T[1 : 1 + directions] / s) @ U.T / size
    return np.asarray(axes @ slopes)
