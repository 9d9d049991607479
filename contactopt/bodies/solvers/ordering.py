"""Orders in which the unknowns of a body are eliminated.

The order decides how many entries the sparse factors have. In the plane the minimum degree order of
SuperLU leaves the fewest. In space nested dissection of the mesh by its coordinates leaves fewer.
Both work on the graph of the mesh nodes, which is smaller than the matrix by the square of the
dimension.

Sources: George (1973), Nested dissection of a regular finite element mesh, SIAM J. Numer. Anal. 10,
345-363; Liu (1985), Modification of the minimum-degree algorithm by multiple elimination, ACM
Trans. Math. Softw. 11, 141-153.
"""

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spilu

from contactopt.bodies.solvers.constants import COARSE_LEAF, LEAF


def elimination_order(
    A: sp.csr_matrix,
    node: np.ndarray,
    component: np.ndarray,
    points: np.ndarray,
    trailing: np.ndarray,
) -> np.ndarray:
    """Permutation (n,) of the unknowns with few entries in the factors and `trailing` (m,) at the
    end, in its own order: by minimum degree in the plane, in space by nested dissection. The
    unknowns of a node follow each other.

    Of A only the pattern counts; the arguments are as in contactopt.bodies.solvers.system.System.
    """
    present, own = np.unique(node, return_inverse=True)
    graph = _node_graph(A, own, len(present))
    kept = np.zeros(len(present), dtype=bool)  # nodes with an unknown in `trailing`
    kept[own[trailing]] = True
    rank = np.full(len(present), len(present))
    if len(points) == 2:
        rank[minimum_degree(graph + _clique(kept))] = np.arange(len(present))
    else:
        inside = np.flatnonzero(~kept)
        rank[inside[nested_dissection(graph[inside][:, inside], points[:, present[inside]])]] = (
            np.arange(len(inside))
        )
    order = np.lexsort((component, rank[own]))
    final = np.zeros(len(own), dtype=bool)
    final[trailing] = True
    return np.concatenate([order[~final[order]], trailing])


def minimum_degree(graph: sp.csr_matrix) -> np.ndarray:
    """Permutation (n,) that eliminates a node with the fewest neighbours at each step; of the graph
    (n, n) the symmetric pattern counts.

    SciPy hands out SuperLU's order only together with factors. The incomplete factors of a matrix
    that is nearly the identity cost next to nothing.
    """
    nearly = sp.csc_matrix((np.full(graph.nnz, 1e-9), graph.indices, graph.indptr), graph.shape)
    nearly = (nearly + sp.eye(graph.shape[0], format="csc")).tocsc()
    cheap = {"drop_tol": 1.0, "fill_factor": 1.0, "diag_pivot_thresh": 0.0}
    made = spilu(nearly, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, **cheap)
    return np.argsort(made.perm_c)


def nested_dissection(graph: sp.csr_matrix, points: np.ndarray) -> np.ndarray:
    """Permutation (n,) that eliminates both halves of a mesh before the nodes that separate them,
    and each half likewise.

    The nodes at points (dim, n) are cut by the median plane, across one of the axes, that has the
    fewest separating nodes. Their graph (n, n) is a symmetric pattern.
    """
    blocks = list(_dissected(graph, points))
    return np.concatenate(blocks[::-1]) if blocks else np.zeros(0, dtype=np.intp)


def elimination_work(
    graph: sp.csr_matrix, points: np.ndarray, kept: np.ndarray
) -> tuple[float, float]:
    """Estimate the entries of sparse factors and the multiplications that make them, of scalars,
    from the graph (n, n) of nodes at points (dim, n) that share an element; those `kept` (m,) are
    eliminated last.

    When the separator of a piece is eliminated, it fills a front with itself and with the nodes
    around the piece. With s and b nodes these are s^2 / 2 + s b entries and s^3 / 3 + s^2 b + s b^2
    operations. Pieces that are not cut any further are left out, for their work grows with the
    number of nodes alone. All pieces of one size are cut at once.
    """
    dim, n = points.shape
    rank = np.empty((dim, n), dtype=np.int32)  # places along each axis
    order = np.argsort(points, axis=1, kind="stable")
    np.put_along_axis(rank, order, np.arange(n, dtype=np.int32)[None], axis=1)
    furthest = [np.maximum.reduceat(r[graph.indices], graph.indptr[:-1]) for r in rank]
    piece = np.zeros(n, dtype=np.int64)  # of each node; -1 for those that are dealt with
    piece[kept] = -1
    live, gone, links = np.flatnonzero(piece == 0), kept, np.zeros((2, 0), dtype=np.int64)
    entries = operations = 0.0
    while len(live):
        degree = graph.indptr[gone + 1] - graph.indptr[gone]
        links = np.hstack([links, [graph[gone].indices, np.repeat(gone, degree)]])
        links = links[:, piece[links[0]] >= 0]  # from a node of a piece to one around it
        own = piece[live]
        around = np.unique(piece[links[0]] * n + links[1]) // n
        b = np.bincount(around, minlength=own.max() + 1).astype(float)
        separator, right = _cuts(own, [(r[live], far[live]) for r, far in zip(rank, furthest)])
        s = np.bincount(own, separator)
        s[s == np.bincount(own)] = 0  # no plane cuts this piece
        entries += float(np.sum(s**2 / 2 + s * b))
        operations += float(np.sum(s**3 / 3 + s**2 * b + s * b**2))
        half = 2 * own + right
        large = np.bincount(half[~separator], minlength=2 * len(b)) > COARSE_LEAF
        stays = ~separator & large[half]
        gone, piece[live] = live[separator], -1
        live = live[stays]
        piece[live] = (np.cumsum(large) - 1)[half[stays]]
    m = float(len(kept))
    return dim**2 * (entries + m**2 / 2), dim**3 * (operations + m**3 / 3)


def _cuts(
    piece: np.ndarray, axes: list[tuple[np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Masks (k,) of the separators of all pieces, and of the nodes to the right of each cut.

    piece (k,) numbers the piece of each node. For each axis come the places of the nodes along it,
    and those of their furthest neighbours. A piece is cut at its mean place on the axis on which
    the fewest nodes touch the right from the left.
    """
    size = np.bincount(piece)
    fewest = size + 1.0
    separator, right = np.zeros((2, len(piece)), dtype=bool)
    for place, furthest in axes:
        middle = (np.bincount(piece, place) / size)[piece]
        above = place > middle
        touches = ~above & (furthest > middle)
        count = np.bincount(piece, touches)
        better = (count < fewest)[piece]
        fewest = np.minimum(fewest, count)
        separator, right = np.where(better, touches, separator), np.where(better, above, right)
    return separator, right


def _dissected(graph: sp.csr_matrix, points: np.ndarray) -> Iterator[np.ndarray]:
    """Separators from the whole mesh on; a small piece, and one that no plane cuts, is its own."""
    graph = sp.csr_matrix((np.ones(graph.nnz, np.int8), graph.indices, graph.indptr), graph.shape)
    stack = [(graph, np.arange(graph.shape[0]))]
    while stack:
        piece, nodes = stack.pop()
        if len(nodes) <= LEAF:
            yield nodes
            continue
        left, separator = min(
            (_cut(piece, x) for x in points[:, nodes]), key=lambda cut: int(cut[1].sum())
        )
        right = ~(left | separator)
        if separator.sum() in (0, len(nodes)) and not (left.any() and right.any()):
            yield nodes
            continue
        yield nodes[separator]
        stack += [(piece[part][:, part], nodes[part]) for part in (left, right)]


def _cut(graph: sp.csr_matrix, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Masks of the nodes left of a separator, and of it: what touches the right of the median x."""
    below = np.zeros(len(x), dtype=bool)
    below[np.argsort(x, kind="stable")[: len(x) // 2]] = True
    separator = below & (graph @ (~below).astype(np.int8) > 0)
    return below & ~separator, separator


def _node_graph(A: sp.csr_matrix, own: np.ndarray, count: int) -> sp.csr_matrix:
    """Pattern (count, count) of nodes whose unknowns meet in A; own (n,) is each unknown's node."""
    gather = sp.csr_matrix(
        (np.ones(len(own), np.int32), (own, np.arange(len(own)))), (count, len(own))
    )
    pattern = sp.csr_matrix((np.ones(A.nnz, np.int32), A.indices, A.indptr), A.shape)
    return (gather @ pattern @ gather.T).tocsr()


def _clique(kept: np.ndarray) -> sp.csr_matrix:
    """Edges between all pairs of the nodes that are kept to the end.

    The elimination of the others connects them all. With these edges in the graph the degree of a
    node counts what its elimination adds to their rows.
    """
    nodes = np.flatnonzero(kept)
    row, column = np.repeat(nodes, len(nodes)), np.tile(nodes, len(nodes))
    return sp.csr_matrix((np.ones(len(row), np.int32), (row, column)), (len(kept), len(kept)))
