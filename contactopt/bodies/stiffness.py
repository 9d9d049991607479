"""Elastic stiffness of a mesh of displacement elements."""

from typing import Any

import numpy as np
import scipy.sparse as sp
import skfem

from contactopt.bodies.elements import Weight, weight_at, with_jacobians
from contactopt.scenes.kinds import Constants


class Stiffness(sp.bsr_matrix):
    """A matrix in blocks of nodes, which need less memory; indexing gives compressed rows."""

    def __getitem__(self, key: Any) -> Any:
        return self.tocsr()[key]


def isotropic_stiffness(basis: skfem.CellBasis, constants: Constants, weight: Weight) -> Stiffness:
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
    # Pairs of nodes are found by bisection.
    known = np.repeat(np.arange(graph.shape[0]), np.diff(graph.indptr))
    known *= graph.shape[0]
    known += graph.indices  # ascending
    data = np.zeros((len(known), dim, dim))
    within = np.arange(dim * dim).reshape(dim, dim)
    size = max(2**18 // (dim * nodes.shape[1]) ** 2, 1)  # entries stay in the cache
    for start in range(0, len(nodes), size):
        piece = np.arange(start, min(start + size, len(nodes)))
        own = nodes[piece].astype(np.int64)
        pair = np.searchsorted(known, own[:, :, None] * graph.shape[0] + own[:, None, :])
        place = dim * dim * pair[:, None, :, None, :] + within[:, None, :, None]
        K = _element_matrices(basis, piece, constants, weight)  # (element, a, i, b, j)
        np.add.at(data.reshape(-1), place.ravel(), K.ravel())
    return Stiffness((data, graph.indices, graph.indptr), (basis.N, basis.N))


def _element_matrices(
    basis: skfem.CellBasis, elements: np.ndarray, constants: Constants, weight: Weight
) -> np.ndarray:
    """Element stiffness (element, a, i, b, j) as one product: the integral of lambda g_ia g_jb + G
    g_ib g_ja + G (g_i . g_j) delta_ab, with g_ia the derivative of N_i by a.
    """
    lam, shear, _ = constants
    places, shape, dim = basis.X, basis.elem.elem, len(basis.mesh.p)
    mapping = with_jacobians(basis.mapping, places, elements)
    values, slopes = zip(*(shape.lbasis(places, i) for i in range(basis.Nbfun // dim)))
    inverse = mapping.invDF(places, tind=elements)  # (b, a, element, point)
    g = np.einsum("baeq,ibq->eaiq", inverse, np.stack(slopes), optimize=True)
    x = mapping.F(places, tind=elements) if weight[1] else np.zeros(1)
    measure = basis.dx[elements] * weight_at(weight, x)
    H = _pairs(g, measure)
    gradients = np.einsum("eaiaj->eij", H)
    if weight[1]:
        hoop = np.stack(values) / x[0][:, None]
        divergence = g.copy()
        divergence[:, 0] += hoop
        K = lam * _pairs(divergence, measure)
        K[:, 0, :, 0, :] += 2 * shear * _pairs(hoop[:, None], measure)[:, 0, :, 0, :]
    else:
        K = lam * H
    H *= shear
    for a, b in np.ndindex(dim, dim):  # K += H.swapaxes(1, 3) takes three times as long
        K[:, a, :, b, :] += H[:, b, :, a, :] + (shear * gradients if a == b else 0.0)
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


def _pairs(f: np.ndarray, measure: np.ndarray) -> np.ndarray:
    """Integrals of f_ia f_jb (element, a, i, b, j), from f (element, a, i, point)."""
    flat = f.reshape(len(f), -1, f.shape[3])
    return np.asarray((flat * measure[:, None]) @ flat.transpose(0, 2, 1)).reshape(
        *f.shape[:3], *f.shape[1:3]
    )
