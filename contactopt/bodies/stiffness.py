"""Elastic stiffness of a mesh of displacement elements."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import skfem

from contactopt.bodies.elements import Weight, weight_at

PIECE = 2**20  # entries of element matrices that are held at the same time


def isotropic_stiffness(
    basis: skfem.CellBasis, constants: tuple[float, float], weight: Weight
) -> sp.csr_matrix:
    """Elastic stiffness (N, N) [force / length]: the integral of sigma(u) : epsilon(v), with the
    hoop strain u_r / r if axisymmetric.

    It is linear in the constants, Lame's lambda and G [stress], so that their derivatives give the
    derivative of the stiffness. The components of a node are numbered one after the other in the
    basis; weight is the measure of the integrals, see contactopt.bodies.elements.weight_at.

    The pattern of the matrix is made first, from the nodes of the elements. The element matrices
    are then added to it a piece of the mesh at a time, so that little more memory is taken than the
    matrix needs.
    """
    dim = basis.mesh.p.shape[0]
    nodes = basis.element_dofs[::dim].T // dim  # (element, i)
    graph = _node_graph(nodes, basis.N // dim)
    indices, indptr, first, step = _pattern(graph, dim)
    owner = np.repeat(np.arange(graph.shape[0]), np.diff(graph.indptr))
    known = owner * graph.shape[0] + graph.indices  # ascending
    data = np.zeros(len(indices))
    # Entry (a, b) of the block of two nodes stands at first + a step + b, and pairs of nodes are
    # found by bisection.
    a, b = np.arange(dim)[:, None, None], np.arange(dim)
    size = max(PIECE // (dim * nodes.shape[1]) ** 2, 1)
    for start in range(0, len(nodes), size):
        piece = np.arange(start, min(start + size, len(nodes)))
        own = nodes[piece].astype(np.int64)
        pair = np.searchsorted(known, own[:, :, None] * graph.shape[0] + own[:, None, :])[
            :, :, None, :, None
        ]
        K = _element_matrices(basis, piece, constants, weight)  # (element, i, a, j, b)
        np.add.at(data, (first[pair] + a * step[pair] + b).ravel(), K.ravel())
    return sp.csr_matrix((data, indices, indptr), (basis.N, basis.N))


def _element_matrices(
    basis: skfem.CellBasis, elements: np.ndarray, constants: tuple[float, float], weight: Weight
) -> np.ndarray:
    """Stiffness of some elements, (element, i, a, j, b) for component a of node i and b of node j.

    With g_ia the derivative of shape function i along a, the entry is the integral of lambda g_ia
    g_jb + G g_ib g_ja + G (g_i . g_j) delta_ab: one batched matrix product for all elements.
    """
    lam, shear = constants
    mapping, places, shape = basis.mapping, basis.X, basis.elem.elem
    fields = [
        shape.gbasis(mapping, places, i, tind=elements)[0]
        for i in range(basis.Nbfun // len(basis.mesh.p))
    ]
    x = mapping.F(places, tind=elements)
    measure = np.abs(mapping.detDF(places, tind=elements)) * basis.W * weight_at(weight, x)
    g = np.stack([np.asarray(f.grad) for f in fields])  # (i, a, element, point)
    g = np.ascontiguousarray(np.moveaxis(g, (2, 0, 1, 3), (0, 1, 2, 3)))  # (element, i, a, point)
    divergence = g
    if weight[1]:
        hoop = np.stack([np.asarray(f) for f in fields], axis=1) / x[0][:, None]
        divergence = g.copy()
        divergence[:, :, 0] += hoop
    K = lam * _pairs(divergence, measure)
    H = _pairs(g, measure)
    K += shear * H.transpose(0, 1, 4, 3, 2)
    gradients = np.einsum("eiaja->eij", H)
    for a in range(g.shape[2]):
        K[:, :, a, :, a] += shear * gradients
    if weight[1]:
        K[:, :, 0, :, 0] += 2 * shear * _pairs(hoop[:, :, None], measure)[:, :, 0, :, 0]
    return K


def _node_graph(nodes: np.ndarray, count: int) -> sp.csr_matrix:
    """Pattern (count, count), sorted, of the nodes that share an element; nodes (element, i)."""
    ones = np.ones(nodes.size, dtype=np.int32)
    member = sp.csr_matrix(
        (ones, nodes.ravel(), np.arange(0, nodes.size + 1, nodes.shape[1])), (len(nodes), count)
    )
    graph = (member.T @ member).tocsr()
    graph.sort_indices()
    return graph


def _pattern(
    graph: sp.csr_matrix, dim: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Indices and indptr of the CSR form from the pattern of its nodes, and for each pair of nodes
    the place of its first entry and the distance from one of its rows to the next.
    """
    degree = np.diff(graph.indptr)
    indptr = np.concatenate([[0], np.cumsum(np.repeat(dim * degree, dim), dtype=np.int64)])
    start = np.repeat(graph.indptr[:-1].astype(np.int64), degree)
    first = dim * dim * start + dim * (np.arange(graph.nnz) - start)
    step = dim * np.repeat(degree, degree).astype(np.int64)
    narrow = np.int32 if indptr[-1] < np.iinfo(np.int32).max else np.int64
    indices = np.empty(indptr[-1], dtype=narrow)
    for a in range(dim):
        for b in range(dim):
            indices[first + a * step + b] = dim * graph.indices + b
    return indices, indptr.astype(narrow), first, step


def _pairs(f: np.ndarray, measure: np.ndarray) -> np.ndarray:
    """Integrals of f_ia f_jb: f (element, i, a, point), measure (element, point) -> (element, i, a,
    j, b).
    """
    flat = f.reshape(len(f), -1, f.shape[3])
    return np.asarray((flat * measure[:, None]) @ flat.transpose(0, 2, 1)).reshape(
        *f.shape[:3], *f.shape[1:3]
    )
