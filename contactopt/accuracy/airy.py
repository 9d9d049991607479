"""The stress without loads that brings an equilibrated plane stress nearest to another one.

A plane stress without body force derives from a function A of Airy, cubic on the three parts of
each triangle and smooth across all edges. With the gradients g at the vertices and the mean h of
the gradient along an edge, whose unit tangent t points from its first vertex to the second, and R
the turn by which the outward normal is R t up to sign, the moments of the tractions on the edge are

    R (h - g_1)  and  R (g_2 - h),     h = (A_2 - A_1) / |edge| t + k n.

Unknowns are g and A at the vertices and k on the edges. Those that move a traction that is known
are zero. The energy that they make least is summed up element by element.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.material import Material

ALONG = 1e-9  # of a unit vector: components below are zero
TINY = 1e-13  # of the diagonal, added so that functions without stress do no harm


@dataclass(frozen=True)
class _Edges:
    """How the moments (f, vertex, component) of the edges depend on the unknowns.

    by_ends  (f, 2, 2, 2, 3) on g and A at either vertex;   by_k  (f, 2, 2) on k
    fixed    (3 vertices + f,) the unknowns that are zero
    """

    by_ends: np.ndarray
    by_k: np.ndarray
    fixed: np.ndarray


def least_by_airy(
    cells: Any, material: Material, missing: np.ndarray, known: np.ndarray
) -> np.ndarray:
    """What to add to the moments (f, 2, 2) of the tractions of triangles so that the energy of
    `missing`, the data of their stress less those of the other one, is least.

    known  (f, 2) whether a component of the traction is given
    """
    edges, mesh = _edges(cells.mesh, known), cells.mesh
    free = ~edges.fixed
    number = np.where(free, np.cumsum(free) - 1, free.sum())
    K, slope = _energy(cells, material, missing, edges, number)
    K += sp.diags(TINY * K.diagonal(), format="csc")
    solve = splu(K, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).solve
    x = np.append(-solve(slope), 0.0)[number]
    ends = x[: 3 * mesh.nvertices].reshape(-1, 3)[mesh.facets.T].reshape(-1, 6, 1)
    made = edges.by_ends.reshape(-1, 4, 6) @ ends
    return np.asarray(made.reshape(-1, 2, 2) + edges.by_k * x[3 * mesh.nvertices :, None, None])


def _edges(mesh: Any, known: np.ndarray) -> _Edges:
    first, second = mesh.facets
    t = mesh.p[:, second] - mesh.p[:, first]
    length = np.linalg.norm(t, axis=0)
    t = t / length
    n = np.array([t[1], -t[0]])
    owner = mesh.p[:, mesh.t[:, mesh.f2t[0]]].mean(axis=1)
    way = np.where(np.sum(n * (mesh.p[:, first] - owner), axis=0) > 0, 1.0, -1.0)
    by_ends, by_k = np.zeros((len(first), 2, 2, 2, 3)), np.zeros((len(first), 2, 2))
    for v, side in enumerate((way, -way)):
        for i, turn in enumerate((side, -side)):  # R takes component 1 - i to i
            by_ends[:, v, i, v, 1 - i] = -turn
            by_ends[:, v, i, 0, 2] = -turn * t[1 - i] / length
            by_ends[:, v, i, 1, 2] = turn * t[1 - i] / length
            by_k[:, v, i] = turn * n[1 - i]
    count = 3 * mesh.nvertices
    fixed = np.zeros(count + len(first), dtype=bool)
    for c in range(2):
        own = np.flatnonzero(known[:, c])
        fixed[3 * mesh.facets[:, own] + 1 - c] = True
        fixed[count + own[np.abs(n[1 - c, own]) > ALONG]] = True
        fixed[3 * mesh.facets[:, own[np.abs(t[1 - c, own]) > ALONG]] + 2] = True
    return _Edges(by_ends, by_k, fixed)


def _energy(
    cells: Any, material: Material, missing: np.ndarray, edges: _Edges, number: np.ndarray
) -> tuple[sp.csc_matrix, np.ndarray]:
    """Second and first derivatives of the energy by the unknowns, by their numbers; what has the
    last number is left out.
    """
    corners = (3 * cells.mesh.t.T[..., None] + np.arange(3)).reshape(-1, 9)
    at = number[np.hstack([corners, 3 * cells.mesh.nvertices + cells.opposite.T])]
    size = int((~edges.fixed).sum()) + 1
    K, slope = sp.csc_matrix((size, size)), np.zeros(size)
    for own in cells.blocks:
        change = _changes(cells, own, edges)
        H, turned = cells.metric(material, own)[:, :12], change.swapaxes(1, 2)
        g = turned @ (H @ missing[own, :, None])
        H = turned @ H[..., :12] @ change
        slope += np.bincount(at[own].ravel(), g.ravel(), size)
        rows, columns = np.repeat(at[own], 12, axis=1), np.tile(at[own], (1, 12))
        K = K + sp.csc_matrix((H.ravel(), (rows.ravel(), columns.ravel())), (size, size))
    return K[:-1, :-1], slope[:-1]


def _changes(cells: Any, own: slice, edges: _Edges) -> np.ndarray:
    """(e, 12, 12) the data of elements by g and A at their vertices and k on their edges."""
    count = len(cells.volume[own])
    out = np.zeros((count, 3, 2, 2, 12))
    for o, others in enumerate(cells.others):
        facet, slots = cells.opposite[o, own], cells.slots[o, :, own]
        for a, slot in enumerate(slots):
            for vertex, end in zip(others, slots):
                place = slice(3 * vertex, 3 * vertex + 3)
                out[:, o, a, :, place] = edges.by_ends[facet, slot, :, end]
            out[:, o, a, :, 9 + o] = edges.by_k[facet, slot]
    out *= cells.sign[:, own].T[:, :, None, None, None]
    return np.asarray(cells.back[own, None] @ out.reshape(count, 6, 2, 12)).reshape(count, 12, 12)
