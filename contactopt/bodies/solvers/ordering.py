"""Nested dissection of a mesh graph by coordinates: the elimination order behind the Schur complement."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

LEAF = 48  # nodes below which any order does


def nested_dissection(graph: sp.csr_matrix, points: np.ndarray) -> np.ndarray:
    """Elimination order of the nodes of a mesh: two halves first, then the nodes that separate them, recursively.

    graph   (n, n) adjacency, symmetric pattern
    points  (d, n) coordinates; the halves lie on both sides of a median plane, the one with the fewest separators
    Returns a permutation of 0..n-1. Source: George (1973), Nested dissection of a regular finite element mesh.
    """
    order = np.empty(graph.shape[0], dtype=np.intp)
    stack = [(graph, np.arange(graph.shape[0]), graph.shape[0])]
    while stack:  # `end`: one past the place in `order` of the last node of this piece
        piece, nodes, end = stack.pop()
        if len(nodes) <= LEAF:
            order[end - len(nodes) : end] = nodes
            continue
        left, separator = min((_cut(piece, x) for x in points[:, nodes]), key=lambda cut: int(cut[1].sum()))
        right = ~(left | separator)
        count = int(separator.sum())
        if count in (0, len(nodes)) and not (left.any() and right.any()):
            order[end - len(nodes) : end] = nodes
            continue
        order[end - count : end] = nodes[separator]
        for part, last in ((right, end - count), (left, end - count - int(right.sum()))):
            stack.append((piece[part][:, part], nodes[part], last))
    return order


def _cut(graph: sp.csr_matrix, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes left of the median of x, and those of them (the separator) with a neighbour on the right."""
    below = np.zeros(len(x), dtype=bool)
    below[np.argsort(x, kind="stable")[: len(x) // 2]] = True
    separator = below & (graph @ (~below).astype(np.int8) > 0)
    return below & ~separator, separator


def elimination_order(
    A: sp.csr_matrix, node: np.ndarray, component: np.ndarray, points: np.ndarray, last: np.ndarray
) -> np.ndarray:
    """Permutation of the unknowns: nested dissection of the nodes without any of `last`, then the rest, then `last`."""
    present, own = np.unique(node, return_inverse=True)
    inside = np.ones(len(present), dtype=bool)
    inside[own[last]] = False
    gather = sp.csr_matrix((np.ones(len(own), np.int32), (own, np.arange(len(own)))), (len(present), len(own)))
    pattern = sp.csr_matrix((np.ones(A.nnz, np.int32), A.indices, A.indptr), A.shape)
    graph = (gather @ pattern @ gather.T).tocsr()[inside][:, inside]
    graph.data = np.ones(graph.nnz, np.int8)
    rank = np.full(len(present), len(present))
    rank[np.flatnonzero(inside)[nested_dissection(graph, points[:, present[inside]])]] = np.arange(inside.sum())
    order = np.lexsort((component, rank[own]))
    final = np.zeros(len(own), dtype=bool)
    final[last] = True
    return np.concatenate([order[~final[order]], last])
