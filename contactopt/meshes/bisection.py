"""Tetrahedra divided by longest-edge bisection; each new boundary facet knows the old one it is of.

A marked tetrahedron is halved at its longest edge, and so is, again and again, every other one of
which an edge is divided. If edges are equally long, the one with the largest numbers comes first:
so elements agree and the division ends. Source: Rivara (1984), Algorithms for refining
triangular grids suitable for adaptive and multigrid techniques, Int. J. Numer. Meth. Engng 20.
"""

from typing import NamedTuple

import numpy as np
from skfem import Mesh, MeshTet

from contactopt.meshes.cells import knowing

ENDS = np.array([[0, 0, 0, 1, 1, 2], [1, 2, 3, 2, 3, 3]])  # of the edges of a tetrahedron
OPPOSITE = [3, 2, 1, 0]  # vertex opposite to each facet in the order of scikit-fem


class Cut(NamedTuple):
    """Divided tetrahedra.

    p       (3, n) nodes, those of the undivided mesh first;   t  (4, e) elements
    facets  (4, e) facet of the undivided mesh that holds the one opposite to each vertex, -1 inside
    """

    p: np.ndarray
    t: np.ndarray
    facets: np.ndarray

    def mesh(self, old: Mesh) -> MeshTet:
        """The mesh with the names of the boundaries of the undivided one."""
        order = np.argsort(self.t, axis=0)
        t = np.take_along_axis(self.t, order, axis=0).astype(np.int32)
        facets = np.take_along_axis(self.facets, order, axis=0)[OPPOSITE]
        made = MeshTet(np.ascontiguousarray(self.p), np.ascontiguousarray(t))
        parent = np.full(made.nfacets, -1)
        outer = facets >= 0
        parent[made.t2f[outer]] = facets[outer]
        names = {
            name: np.flatnonzero(np.isin(parent, members)).astype(np.int32)
            for name, members in (old.boundaries or {}).items()
        }
        return knowing(made.with_boundaries(names), made) if names else made


def uncut(mesh: Mesh) -> Cut:
    """The tetrahedra of a mesh as they are."""
    facets = mesh.t2f[OPPOSITE].astype(np.int64)
    return Cut(mesh.p, mesh.t.astype(np.int64), np.where(mesh.f2t[1, facets] < 0, facets, -1))


def bisected(old: Cut, marked: np.ndarray) -> Cut:
    """The marked elements (by number) halved, and others as far as it takes to stay conforming."""
    p, t, facets = old
    known, middles = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    while len(marked):
        begin, end = np.sort(t[:, marked][ENDS], axis=0)
        key = begin << 32 | end
        length = np.sum((p[:, begin] - p[:, end]) ** 2, axis=0)
        longest = np.argmax(np.where(length == length.max(axis=0), key, -1), axis=0)
        each = np.arange(len(marked))
        mine = key[longest, each]
        new = np.setdiff1d(mine, known)
        count = p.shape[1]
        p = np.hstack([p, (p[:, new >> 32] + p[:, new & 0xFFFFFFFF]) / 2])
        known, middles = np.append(known, new), np.append(middles, count + np.arange(len(new)))
        order = np.argsort(known)
        known, middles = known[order], middles[order]
        middle = middles[np.searchsorted(known, mine)]
        halves = []
        for keep, leave in (ENDS[:, longest], ENDS[::-1, longest]):
            half, sides = t[:, marked].copy(), facets[:, marked].copy()
            half[leave, each], sides[keep, each] = middle, -1
            halves.append((half, sides))
        (half, sides), rest = halves
        t, facets = t.copy(), facets.copy()
        t[:, marked], facets[:, marked] = half, sides
        t, facets = np.hstack([t, rest[0]]), np.hstack([facets, rest[1]])
        touched = np.zeros(p.shape[1], dtype=bool)
        touched[known >> 32] = touched[known & 0xFFFFFFFF] = True
        near = np.flatnonzero(touched[t].sum(axis=0) > 1)
        begin, end = np.sort(t[:, near][ENDS], axis=0)
        marked = near[np.isin(begin << 32 | end, known).any(axis=0)]
    return Cut(p, t, facets)
