"""Cross-points: where the edge of a tied seam meets a contact, other seams, or itself at a corner.

There the bodies are joined more than once. Two tied bodies that both stand on a floor have three
conditions at the end of their seam: each of them touches the floor, and both move alike. These
conditions depend on each other, exactly where nodes match and nearly so with mortar. Forces at the
end of the seam then are not unique or alternate. As in the mortar method, the seam gives up its
multiplier there, and the contacts stay. Those dual functions of the seam that are left still add up
to one,

    psi~_k = psi_k + sum_i w_ik psi_i,   sum_k w_ik = 1   (i gives up, k are contacts next to it),

so that a constant traction over the seam is exact. The mean displacement that belongs to psi~_k is
u~_k = (a_k u_k + sum_i w_ik a_i u_i) / a~_k with the area a~_k = a_k + sum_i w_ik a_i.

Which contacts give up:

1. Nodes that ties join one to one become one node. A tie whose two nodes are one already, by ties
   before it, gives up. What is left of these ties joins the same nodes.
2. A contact of a tie at its edge gives up if other contacts join its two bodies there: directly, or
   through further bodies. A chain of contacts that have nodes in common shows that. What a support
   holds is joined to the rigid bodies that do not move.

A tie that keeps fewer contacts than hold a body gives up none of them. Their forces may alternate
then, which contactopt.readings.resolution looks for in the solution.

Sources: Bernardi, Maday, Patera (1994), A new nonconforming approach to domain decomposition: the
mortar element method, in: Nonlinear partial differential equations and their applications, Pitman,
13-51 (fewer multipliers at cross-points); Wohlmuth (2000), A mortar finite element method using
dual spaces for the Lagrange multiplier, SIAM J. Numer. Anal. 38, 989-1012 (dual functions that add
up to one); Kim, Lazarov, Pasciak, Vassilevski (2001), Multiplier spaces for the mortar finite
element method in three dimensions, SIAM J. Numer. Anal. 39, 519-538 (edges and corners in space);
Puso, Laursen (2003), Mesh tying on curved interfaces in 3D, Eng. Comput. 20, 305-319.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.spatial import KDTree

from contactopt.bodies.assembled import AssembledBody
from contactopt.coupling.coupling import Coupling
from contactopt.meshes.cells import joined, rim
from contactopt.scenes.contact import Contact

_Node: TypeAlias = tuple[str, int]  # a body and the first unknown of one of its nodes
MAIN = 0.5  # a node moves a contact mainly if its weight is more than this part of the largest one
SAME = 1e-9  # contacts are at one place within this fraction of the size of their surface
FLAT = 1e-6  # points are on one line within this fraction of their extent


def independent(
    pairs: Sequence[Contact], couplings: Sequence[Coupling], bodies: Iterable[AssembledBody]
) -> tuple[Coupling, ...]:
    """The couplings of pairs, where ties gave up contacts at cross-points, or could not."""
    tied = [number for number, pair in enumerate(pairs) if pair.law == "tied"]
    if not tied:
        return tuple(couplings)
    seams = [_Seam(*both, number) for number, both in enumerate(zip(pairs, couplings))]
    for number, rows in _known_already([s for s in seams if s.one_to_one]).items():
        seams[number].left[rows] = False
    pieces = [
        (seam, rows)
        for seam in seams
        for piece in np.unique(seam.pieces)
        if len(rows := np.flatnonzero((seam.pieces == piece) & seam.left))
    ]
    held = {body.name: (body.held, body.meshed) for body in bodies}
    given = {number: _joined_elsewhere(seams[number], pieces, held) for number in tied}
    return tuple(
        _reduced(seams[number], given[number]) if number in given else made
        for number, made in enumerate(couplings)
    )


def _reduced(tie: _Seam, given: np.ndarray) -> Coupling:
    """The coupling of a tie whose contacts `given` give up, unless it keeps too few."""
    kept = tie.left.copy()
    kept[given] = False
    made = tie.made
    if not tie.holds(kept):
        kept, made = tie.left, replace(made, tight=~kept & tie.left)
    return made if kept.all() or not kept.any() else _without(made, kept)


@dataclass(frozen=True, eq=False)
class _Seam:
    """A pair of surfaces with k contacts, seen as rows that join the unknowns of two bodies."""

    pair: Contact
    made: Coupling
    number: int

    @cached_property
    def left(self) -> np.ndarray:
        """(k,) the contacts that no tie before makes superfluous."""
        return np.ones(len(self.made.gap), dtype=bool)

    @property
    def one_to_one(self) -> bool:
        """Whether it ties nodes one to one."""
        return self.pair.law == "tied" and self.made.kind == "matching"

    @cached_property
    def own(self) -> int:
        """The side that carries the contacts: 0 the upper body, 1 the lower one."""
        return ("upper", "lower").index(self.made.carrier)

    @cached_property
    def all(self) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """For each body (k, n) how much each of its unknowns moves each contact."""
        k, dim = self.made.frames.shape[:2]
        add = sp.csr_matrix((np.ones(k * dim), (np.repeat(np.arange(k), dim), np.arange(k * dim))))
        return tuple(sp.csr_matrix(add @ abs(T)) for T in (self.made.upper, self.made.lower))

    @cached_property
    def main(self) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """The same for the unknowns that move a contact mainly."""
        return tuple(_mainly(moved) for moved in self.all)

    @cached_property
    def near(self) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """The unknowns that count for each body: on the other side of a mortar the weights of one
        contact are spread over many nodes, so that all count.
        """
        if self.made.kind == "matching":
            return self.main
        return tuple((self.main if side == self.own else self.all)[side] for side in (0, 1))

    @cached_property
    def _moved(self) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """For each body (n, k), which contacts each unknown moves."""
        return tuple(sp.csr_matrix(near.T) for near in self.near)

    def at(self, side: int, unknowns: np.ndarray) -> np.ndarray:
        """The contacts that some unknowns of a body move."""
        return np.unique(self._moved[side][unknowns].indices)

    @cached_property
    def pieces(self) -> np.ndarray:
        """(k,) the number of the piece of the surface that each contact is on, where it has pieces
        that meet in one place: cut at its corners. Otherwise there is one piece.
        """
        points, cells = self.made.positions.T, self.made.cells
        size = np.ptp(points, axis=0).max(initial=0.0)
        if not cells.size or not len(KDTree(points).query_pairs(SAME * size)):
            return np.zeros(len(points), dtype=int)
        mates = np.concatenate([cells[[0, i]] for i in range(1, len(cells))], axis=1)
        piece, inside = joined(mates, len(points)), np.unique(cells)
        return np.asarray(piece[inside[KDTree(points[inside]).query(points)[1]]])

    @cached_property
    def edge(self) -> np.ndarray:
        """(k,) whether contacts are at the edge of the surface."""
        found = np.ones(len(self.made.gap), dtype=bool)
        found[self.made.cells] = False
        found[rim(self.made.cells)] = True
        return found

    def holds(self, kept: np.ndarray) -> bool:
        """Whether some contacts hold a body in as many directions as all do."""

        def directions(some: np.ndarray) -> int:
            points = self.made.positions[:, some]
            if points.shape[1] < 2:
                return -1 + points.shape[1]
            values = np.linalg.svd(points - points.mean(axis=1, keepdims=True), compute_uv=False)
            return int(np.sum(values > FLAT * values[0]))

        pieces = [self.pieces == piece for piece in np.unique(self.pieces)]
        return all(directions(kept & own) >= directions(own & self.left) for own in pieces)


def _mainly(moved: sp.csr_matrix) -> sp.csr_matrix:
    """The entries of a matrix above MAIN of the largest in their row."""
    most = np.asarray(moved.max(axis=1).todense()).ravel()
    entries = sp.coo_matrix(moved)
    large = entries.data > MAIN * most[entries.row]
    where = entries.row[large], entries.col[large]
    return sp.csr_matrix((entries.data[large], where), moved.shape)


def _known_already(ties: Sequence[_Seam]) -> dict[int, np.ndarray]:
    """By tie with matching nodes, the contacts that ties or contacts before it make one."""
    ends: list[tuple[int, int, tuple[_Node, _Node]]] = []
    for tie in ties:
        (upper, first), (lower, second) = zip(tie.pair.bodies, map(_first, tie.main))
        for row in np.flatnonzero((first >= 0) & (second >= 0)).tolist():
            nodes = (upper, int(first[row])), (lower, int(second[row]))
            ends.append((tie.number, row, nodes))
    count = Counter(node for *_, nodes in ends for node in nodes)
    head: dict[_Node, _Node] = {}

    def top(node: _Node) -> _Node:
        while node in head:
            node = head[node]
        return node

    found: dict[int, list[int]] = {}
    for number, row, nodes in ends:
        if min(count[node] for node in nodes) > 1:
            one, other = map(top, nodes)
            if one == other:
                found.setdefault(number, []).append(row)
            else:
                head[one] = other
    return {number: np.array(rows) for number, rows in found.items()}


def _first(main: sp.csr_matrix) -> np.ndarray:
    """The first column with an entry in each row, -1 without any."""
    main.sort_indices()
    filled = np.diff(main.indptr) > 0
    first = np.full(main.shape[0], -1)
    first[filled] = main.indices[main.indptr[:-1][filled]]
    return first


def _joined_elsewhere(
    tie: _Seam,
    pieces: Sequence[tuple[_Seam, np.ndarray]],
    held: Mapping[str, tuple[np.ndarray, bool]],
) -> np.ndarray:
    """The contacts of a tie whose two bodies are joined at their places by other pieces of
    surfaces, each given as a pair and some of its contacts.

    What supports hold and rigid bodies that do not move are one. `held` are the prescribed unknowns
    of each body, and whether it has a mesh.
    """
    walls = {name: own for name, (own, meshed) in held.items() if len(own) and not meshed}
    mine, theirs = tie.pair.bodies[tie.own], tie.pair.bodies[1 - tie.own]
    own, other = tie.near[tie.own], tie.near[1 - tie.own]
    touched = np.zeros(own.shape[1])  # how many pieces move each unknown of the own body
    for seam, rows in pieces:
        for side in (0, 1):
            if seam.pair.bodies[side] == mine:
                touched[np.unique(seam.near[side][rows].indices)] += 1
    found = []
    for row in np.flatnonzero(tie.edge & tie.left).tolist():
        start, goal = np.unique(own[row].indices), other[row].indices
        fixed = [np.isin(at, held[body][0]).any() for at, body in ((start, mine), (goal, theirs))]
        if np.all(touched[start] < 2) and not fixed[0]:
            continue
        others = [(seam, rows) for seam, rows in pieces if seam is not tie or row not in rows]
        first = {mine: start} | (walls if fixed == [True, False] else {})
        reached = _reached(first, others)
        at_wall = fixed == [False, True] and not walls.keys().isdisjoint(reached)
        if at_wall or np.isin(goal, reached.get(theirs, goal[:0])).any():
            found.append(row)
    return np.array(found, dtype=int)


def _reached(
    start: Mapping[str, np.ndarray], pieces: Sequence[tuple[_Seam, np.ndarray]]
) -> dict[str, np.ndarray]:
    """The unknowns of each body that pieces of surfaces join to some unknowns to start with."""
    reached, new = dict(start), True
    ways = [(seam, rows, here) for seam, rows in pieces for here in (0, 1)]
    while new:
        new, left = False, []
        for seam, rows, here in ways:
            at, there = reached.get(seam.pair.bodies[here]), seam.pair.bodies[1 - here]
            touching = rows[:0] if at is None else np.intersect1d(rows, seam.at(here, at))
            if len(touching):
                more, new = seam.near[1 - here][touching].indices, True
                reached[there] = np.union1d(reached.get(there, more), more)
            else:
                left.append((seam, rows, here))
        ways = left
    return reached


def _without(made: Coupling, kept: np.ndarray) -> Coupling:
    """The coupling with some contacts (k,) only, next to which the others are shared out."""
    k, dim = made.frames.shape[:2]
    number = np.flatnonzero(kept)
    areas = sp.diags(made.areas)
    M = sp.csr_matrix(_shares(made, kept).T @ areas)[number]
    areas = np.asarray(M.sum(axis=1)).ravel()
    M = sp.coo_matrix(sp.diags(1 / areas) @ M)
    turned = made.frames[number[M.row]] @ made.frames[M.col].swapaxes(1, 2)
    blocks = M.data[:, None, None] * turned
    i, j = np.arange(dim)[:, None], np.arange(dim)
    rows, columns = np.broadcast_arrays(
        M.row[:, None, None] * dim + i, M.col[:, None, None] * dim + j
    )
    shape = len(number) * dim, k * dim
    R = sp.csr_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape)
    gap = np.bincount(M.row, blocks[:, 0, 0] * made.gap[M.col], len(number))
    new = np.cumsum(kept) - 1

    def left(cells: np.ndarray) -> np.ndarray:
        return np.asarray(new[cells[:, np.all(kept[cells], axis=0)]])

    chart = made.chart
    cells = None if chart.cells is None else left(chart.cells)
    return replace(
        made,
        upper=sp.csr_matrix(R @ made.upper),
        lower=sp.csr_matrix(R @ made.lower),
        frames=made.frames[number],
        gap=gap,
        areas=areas,
        positions=made.positions[:, number],
        chart=replace(chart, places=chart.places[:, number], cells=cells, grid=None),
        cells=left(made.cells),
        share=None if made.share is None else 1 / (M @ (1 / made.share)),  # of all faces
        tight=None if made.tight is None else made.tight[number],
    )


def _shares(made: Coupling, kept: np.ndarray) -> sp.csr_matrix:
    """(k, k) which part of each contact every kept one takes over: all of itself, and equal parts
    of its neighbours that give up. Those without a kept neighbour are shared out like these.
    """
    k, cells = len(kept), made.cells
    ends = np.concatenate([np.stack([c, np.roll(c, 1)]) for c in cells.T], axis=1)
    near = sp.csr_matrix((np.ones(ends.shape[1]), tuple(ends)), (k, k))
    near = (near + near.T) > 0
    done, W = kept.copy(), sp.diags(kept.astype(float)).tocsr()
    while not done.all():
        known = sp.csr_matrix(near @ sp.diags(done.astype(float)))
        count = np.asarray(known.sum(axis=1)).ravel()
        new = ~done & (count > 0)
        if not new.any():  # on no cell with others: to the nearest one
            lost, number = np.flatnonzero(~done), np.flatnonzero(done)
            nearest = KDTree(made.positions[:, number].T).query(made.positions[:, lost].T)[1]
            known = sp.csr_matrix((np.ones(len(lost)), (lost, number[nearest])), (k, k))
            count, new = np.ones(k), ~done
        W = W + sp.diags(new / np.maximum(count, 1.0)) @ known @ W
        done |= new
    return sp.csr_matrix(W)
