"""The form in which methods work: without units, with friction the same in all directions."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag

from contactopt.linear.operators import (
    NOISE,
    Interface,
    diagonal,
    form,
    has_entries,
    row_sizes,
    turned,
)
from contactopt.problem.interface_problem import InterfaceProblem


@dataclass(frozen=True)
class Scales:
    """Units in which a problem is dimensionless: force, length, and one length per multiplier.

    stretch  (k, dim - 1, dim - 1) the S of `isotropic`, which multiplies tangential forces to
             get those of the problem; None where friction is the same in all directions
    basis    (p, m) of the multipliers that the dimensionless problem has, or None for all
    """

    force: float
    length: float
    multipliers: np.ndarray
    stretch: np.ndarray | None = None
    basis: np.ndarray | None = None

    def to_physical(
        self, reactions: np.ndarray, multipliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Dimensionless reactions (k, dim) and multipliers (p,), in the units of the problem."""
        if self.stretch is not None:
            tangential = np.einsum("kab,kb->ka", self.stretch, reactions[:, 1:])
            reactions = np.column_stack([reactions[:, 0], tangential])
        multipliers = multipliers * self.multipliers
        if self.basis is not None:
            multipliers = self.basis @ multipliers
        return reactions * self.force, multipliers

    def to_dimensionless(
        self, reactions: np.ndarray, multipliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Reactions (k, dim) and multipliers (p,) without units, the inverse of `to_physical`."""
        if self.stretch is not None:
            tangential = np.linalg.solve(self.stretch, reactions[:, 1:, None])[:, :, 0]
            reactions = np.column_stack([reactions[:, 0], tangential])
        if self.basis is not None:
            multipliers = np.linalg.lstsq(self.basis, multipliers, rcond=None)[0]
        return reactions / self.force, multipliers / self.multipliers


def isotropic(problem: InterfaceProblem) -> InterfaceProblem:
    """The problem in variables in which friction is the same in all directions; the problem itself
    where it is so already.

    With S from `Law.stretch`, r = S y and v = S u give v = S Q S y + S V lambda + S q.
    """
    stretch = problem.law.stretch(problem.dim)
    if stretch is None:
        return problem
    blocks = np.tile(np.eye(problem.dim), (problem.contacts, 1, 1))
    blocks[:, 1:, 1:] = stretch
    places = np.arange(problem.contacts + 1)
    S = sp.csr_array(sp.bsr_array((blocks, places[:-1], places), 2 * (problem.q.size,)))
    return problem.altered(
        Q=turned(problem.Q, S),
        q=(S @ problem.q.ravel()).reshape(problem.q.shape),
        V=S @ problem.V,
        law=problem.law.plain,
    )


def dimensionless(problem: InterfaceProblem) -> tuple[InterfaceProblem, Scales]:
    """Scale a problem so that the mean diagonal of Q is one, forces are of order one and the
    columns of V have length one, in all units alike. The Scales take its answers back.

    The force scale is the mean force that the balance asks of a node or, where that is nothing or
    rounding, that which removes the root-mean-square overlap. Components that cannot move get a
    unit compliance.
    """
    scales, held = scales_of(problem), immovable(problem)
    compliance, columns = scales.length / scales.force, scales.length / scales.multipliers
    Q: Interface
    if not has_entries(problem.Q):
        Q = problem.Q.scaled(1 / compliance, held.astype(float))
    elif form(problem.Q) == "sparse":
        rows = problem.Q
        Q = sp.csr_array((rows.data / compliance, rows.indices, rows.indptr), shape=rows.shape)
        if held.any():
            Q = sp.csr_array(Q + sp.diags_array(held.astype(float)))
    else:
        Q = problem.Q / compliance
        Q[held, held] = 1.0
    scaled = problem.altered(
        Q=Q,
        q=problem.q / scales.length,
        V=without_rounding(problem.V) / columns,
        s=problem.s / (columns * scales.force),
        law=problem.law.scaled(scales.force),
    )
    scaled.__dict__["origin"] = problem
    return scaled, scales


def scales_of(problem: InterfaceProblem) -> Scales:
    """The units in which `dimensionless` writes a problem."""
    d, V = diagonal(problem.Q), without_rounding(problem.V)
    columns = np.linalg.norm(V, axis=0)
    total = np.abs(V).sum(axis=0)
    resultant = np.divide(np.abs(problem.s), total, out=np.zeros(len(problem.s)), where=total > 0)
    balanced = float(resultant.max(initial=0.0))
    if np.any(d > 0):
        compliance = float(np.mean(d[d > 0]))
    else:  # rigid bodies: only gaps have a length
        compliance = (float(np.abs(problem.q).max(initial=0.0)) or 1.0) / (balanced or 1.0)
    closing = _closing(problem) / compliance
    force = (balanced if balanced > NOISE * closing else closing) or 1.0
    length = force * compliance
    return Scales(force, length, length / np.where(columns > 0, columns, 1.0))


def without_rounding(V: np.ndarray) -> np.ndarray:
    """V (n, p) without entries that are rounding beside the largest of their column."""
    size = np.abs(V)
    return np.where(size > NOISE * size.max(axis=0, initial=0.0), V, 0.0)


def immovable(problem: InterfaceProblem) -> np.ndarray:
    """The mask (k dim,) of components that neither forces nor multipliers nor q move, and whose
    forces move nothing. A normal force that bounds the friction of a moving component is not among
    them.
    """
    d, law = np.abs(diagonal(problem.Q)), problem.law
    moves = [d, *np.abs(problem.V.T), np.abs(problem.q.ravel())]
    held = np.all([size <= NOISE * size.max(initial=0.0) for size in moves], axis=0)
    if held.any() and has_entries(problem.Q):
        for entries in (problem.Q, problem.Q.T):  # which differ where Q is unsymmetric
            rows = np.flatnonzero(held)
            own = sp.csr_array(entries[rows]) if sp.issparse(entries) else entries[rows]
            held[rows] = row_sizes(own) <= NOISE * d.max(initial=0.0)
    held = held.reshape(problem.q.shape)
    held[:, 0] &= held[:, 1:].all(axis=1) | ~law.rough | (not law.proportional)
    return held.ravel()


def _closing(problem: InterfaceProblem) -> float:
    """Root mean square of the overlaps at r = 0 above rounding; without any, the least |q_i|."""
    normal, sizes = problem.q[:, 0], np.linalg.norm(problem.q, axis=1)
    overlap = np.where(problem.law.lowest < 0, np.abs(normal), -normal)
    least = NOISE * sizes.max(initial=0.0)
    if np.any(overlap > least):
        return float(np.sqrt(np.mean(overlap[overlap > least] ** 2)))
    return float(sizes[sizes > least].min()) if np.any(sizes > least) else 0.0


def along_rest(
    problem: InterfaceProblem, reactions: np.ndarray
) -> tuple[InterfaceProblem, np.ndarray]:
    """The problem and its forces (k, dim) with tangents turned to those along which nothing moves,
    where supports leave any: forces along them are no part of the answer. As it is if Q is no
    symmetric array, or if the law tells one tangent from the other.
    """
    k, dim = problem.q.shape
    alike = dim == 3 and k and problem.law.stretch(dim) is None
    if not alike or form(problem.Q) != "array" or not problem.symmetric:
        return problem, reactions
    own = np.asarray(problem.Q).reshape(k, dim, k, dim)[np.arange(k), :, np.arange(k)]
    sizes, axes = np.linalg.eigh(own[:, 1:, 1:])
    least = NOISE * sizes[:, 1]
    still = (sizes[:, 0] <= least) & (np.abs(own[:, 1, 2]) > least)
    if not still.any():
        return problem, reactions
    turn = np.broadcast_to(np.eye(dim), own.shape).copy()
    turn[still, 1:, 1:] = axes[still]
    whole = block_diag(*turn)
    q, r = (np.einsum("kdc,kd->kc", turn, own) for own in (problem.q, reactions))
    Q, V = whole.T @ problem.Q @ whole, whole.T @ problem.V
    return problem.altered(Q=Q, q=q, V=V), r
