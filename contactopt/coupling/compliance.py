"""Q, the compliance of the bodies at the contacts: an array, sparse rows, or its products."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.protocol import Body, Seen
from contactopt.coupling.coupling import Coupling
from contactopt.errors import InputError
from contactopt.linear.budget import spend
from contactopt.linear.concurrency import each
from contactopt.linear.convolution import Convolution
from contactopt.linear.operators import Interface, InterfaceOperator, Product, dense
from contactopt.linear.saddle_point import BodyTerm, CoupledForm
from contactopt.problem.chart import nodal_weights

# share of the entries of Q that may be other than zero for it to be kept by sparse rows
SPARSE = 0.25
Maps = Sequence[sp.csr_matrix]  # the signed map B (k dim, n) of each body


def compliance(
    bodies: Sequence[Body], maps: Maps, couplings: Sequence[Coupling], implicit: bool
) -> Interface:
    """Q = sum B_b C_b B_b' by its products (`implicit`) or by its entries."""
    return operator(bodies, maps, couplings) if implicit else _entries(bodies, maps)


def filling(maps: Maps) -> int:
    """Number of the entries of Q between contacts that share a body."""
    return min(sum(len(_rows(B)) ** 2 for B in maps), maps[0].shape[0] ** 2)


def _entries(bodies: Sequence[Body], maps: Maps) -> np.ndarray | sp.csr_array:
    """Q by its entries, symmetric to the last digit: sparse where most pairs share no body."""
    n = maps[0].shape[0]
    moving = _moving(bodies, maps, [body.through(B) for body, B in zip(bodies, maps)])
    made = each(lambda term: term[0].through(term[1]).entries(), moving, _parallel(moving))
    parts = [(rows, own) for (*_, rows), own in zip(moving, made)]
    if filling(maps) < SPARSE * n**2:
        rows = np.concatenate([np.repeat(rows, len(rows)) for rows, _ in parts])
        columns = np.concatenate([np.tile(rows, len(rows)) for rows, _ in parts])
        values = np.concatenate([own.ravel() for _, own in parts])
        return sp.csr_array((values, (rows, columns)), (n, n))
    Q = np.zeros((n, n))
    for rows, own in parts:
        if len(rows) == n:
            Q += own
        else:
            Q[np.ix_(rows, rows)] += own
    return Q


def operator(
    bodies: Sequence[Body], maps: Maps, couplings: Sequence[Coupling]
) -> InterfaceOperator:
    """Q by its products: a convolution if every body has one, else with an estimated diagonal."""
    seen = [body.through(B) for body, B in zip(bodies, maps)]
    kernels = [own.kernel for own in seen if own.moved.any()]
    known = [kernel for kernel in kernels if kernel is not None]
    if known and len(known) == len(kernels):
        if len({kernel.padded for kernel in known}) > 1:
            raise InputError(
                "one half-space repeats itself periodically and the other does not; make both"
                " periodic or none."
            )
        return Convolution(sum(known[1:], known[0]))
    moving = _moving(bodies, maps, seen)
    parallel = _parallel(moving)
    acts = each(lambda term: term[0].through(term[1]).product, moving, parallel)
    terms = [(act, rows) for act, (*_, rows) in zip(acts, moving)]
    iterative = any(body.way.iterative for body in bodies)
    unknowns = sum(B.shape[1] for B in maps)

    def product(X: np.ndarray, accuracy: float | None) -> np.ndarray:
        def moves(term: tuple[Product, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
            """The columns that load a body at all, and what they make of it."""
            act, rows = term
            load, columns = X[rows], np.arange(X.shape[1])
            if len(couplings) > 1:
                columns = np.flatnonzero(load.any(axis=0))
            return columns, act(load[:, columns], accuracy) if len(columns) else load[:, columns]

        if not iterative:  # V-cycles are counted where they are made
            spend(X.shape[1] * unknowns)
        out = np.zeros(X.shape)
        for (_, rows), (columns, own) in zip(terms, each(moves, terms, parallel)):
            out[np.ix_(rows, columns)] += own
        return out

    weights = [nodal_weights(made.chart, made.areas) for made in couplings]
    moved = np.any([own.moved for own in seen], axis=0)
    complete = all(body.way.complete for body in bodies)
    return InterfaceOperator(
        product,
        estimate_diagonal(product, weights, moved),
        (lambda: dense(_entries(bodies, maps))) if complete else None,
        None,
        iterative,
        _before_condensation(seen) if iterative else None,
    )


def _before_condensation(seen: Sequence[Seen]) -> CoupledForm:
    """Q from the equilibrium of the iterative bodies, and from products with the others."""
    terms: list[BodyTerm] = []
    others = []
    for own in seen:
        if own.term is not None:
            terms.append(own.term)
        elif own.moved.any():
            others.append(own.product)
    L, R = (np.concatenate([term.low_rank[side] for term in terms], axis=1) for side in (0, 1))

    def rest(r: np.ndarray) -> np.ndarray:
        total = L @ (R.T @ r)
        for product in others:
            total += product(r[:, None], None)[:, 0]
        return np.asarray(total)

    return CoupledForm(tuple(terms), rest)


def _moving(
    bodies: Sequence[Body], maps: Maps, seen: Sequence[Seen]
) -> list[tuple[Body, sp.csr_matrix, np.ndarray]]:
    """The bodies that contact forces move, their maps' needed rows, and these rows of Q."""
    needed = [(body, B, _rows(B)) for body, B, own in zip(bodies, maps, seen) if own.moved.any()]
    return [(body, B[rows], rows) for body, B, rows in needed]


def _parallel(moving: list[tuple[Body, sp.csr_matrix, np.ndarray]]) -> list[bool]:
    return [body.way.parallel for body, *_ in moving]


def _rows(B: sp.csr_matrix) -> np.ndarray:
    """The rows of a map that are not empty; all of them where most are not."""
    filled = np.flatnonzero(np.diff(B.indptr))
    return filled if 4 * len(filled) < 3 * B.shape[0] else np.arange(B.shape[0])


def estimate_diagonal(
    product: Product, weights: Sequence[np.ndarray], moves: np.ndarray
) -> np.ndarray:
    """The diagonal (k dim,) of Q from one product with a column for each pair of surfaces; exactly
    0 outside the mask `moves`.

    The trace on each pair of surfaces is estimated with random signs (Hutchinson 1989) and shared
    out by its weights, those of `nodal_weights`. Each pair has signs of its own: a thin body
    between two pairs moves one of them by forces on the other as far as by its own, and such a
    share may be negative.
    """
    dim = len(moves) // max(sum(len(own) for own in weights), 1)
    ends = np.cumsum([0, *(dim * len(own) for own in weights)])
    signs = np.where(np.random.default_rng(0).random(len(moves)) < 0.5, -1.0, 1.0) * moves
    columns = np.zeros((len(moves), len(weights)))
    for i, (first, stop) in enumerate(pairwise(ends)):
        columns[first:stop, i] = signs[first:stop]
    traces = np.einsum("ij,ij->j", columns, product(columns, 1e-2))
    diagonal = np.zeros(len(moves))
    for own, trace, (first, stop) in zip(weights, traces, pairwise(ends)):
        shares = np.repeat(own**-2, dim) * moves[first:stop]
        if shares.any():
            diagonal[first:stop] = shares * (trace / shares.sum())
    return diagonal
