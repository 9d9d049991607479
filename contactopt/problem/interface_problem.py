"""The interface problem of frictional contact. Knows nothing of finite elements.

    u = Q r + V lambda + q,      V' r + s = 0,                                     (paper, eq (14))
    and at every contact a law, by default Coulomb's (contactopt.problem.laws has others):
    u_n >= 0,  r_n >= 0,  u_n r_n = 0,                                        (Signorini, eq (15))
    |r_t| <= mu r_n,  and where u_t != 0:  r_t = -mu r_n u_t / |u_t|.        (Coulomb, (16)-(17))

One block per contact node, normal component first. r is the force on the upper body, r_n >= 0 in
compression; u is the relative displacement plus the initial gap, so that u_n is the gap that
remains. In the paper's letters R_n = -r_n and w_n - d = -u_n. V holds the rigid motions that
nothing but contact resists, of plates under a total force and of bodies without enough supports:
lambda is how far each of them goes, and s are the loads along them, which r must balance.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from contactopt.cards import card, count, line
from contactopt.checks import given, real_array
from contactopt.errors import InputError
from contactopt.linear.operators import (
    NOISE,
    Interface,
    InterfaceOperator,
    asymmetry,
    dense,
    diagonal,
    form,
    has_entries,
    ill_conditioned,
    row_sizes,
    sparse,
)
from contactopt.problem.chart import UNNAMED, Chart, Pair
from contactopt.problem.cones import lengths
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.problem.laws.law import Law

GENERIC = np.sqrt([1.0, 2.0, 3.0])  # a direction that no lattice of contacts repeats


@dataclass(frozen=True, eq=False, init=False)
class InterfaceProblem:
    """Contact at k nodes in `dim` dimensions, as at the top of this module.

    Q            (k dim, k dim) compliance [length / force]: an array, a scipy sparse matrix (kept
                 as csr_array), or an InterfaceOperator that knows it by its products only. Elastic
                 bodies make it symmetric positive semidefinite; files of other codes may hold an
                 unsymmetric one, which is solved as it stands by the methods that need no symmetry
                 (`symmetric`)
    q            (k, dim) displacement at r = 0, lambda = 0 [length]; q_n holds the initial gap
    law          a Law of contactopt.problem.laws, or friction coefficients, one number or (k,),
                 which mean Coulomb's law; the keyword `mu` may be given in its place
    V, s         (k dim, p) rigid motions and (p,) resultants [force]; p = 0 where all bodies are
                 held
    areas        (k,) nodal areas, force / area = traction; ones by default
    coordinates  (d, k) positions of the nodes in space, for output only; 0, 1, 2, ... by default
    chart        the nodes' places on the contact surface; by default read from the coordinates
                 (Chart.of_points). With several pairs of surfaces each of them has its own chart,
                 and this one is only an overview
    pairs        the pairs of surfaces, as consecutive contacts 0 ... k - 1; by default one
    motions      (p,) what each column of V is, for messages; may be left out
    Raises InputError on wrong shapes, numbers that are not finite or not real, negative mu, V
    without s, or a Q with a negative diagonal (an indefinite Q is not looked for: its answers are
    certified like any other; an operator is taken at its word).
    """

    Q: Interface
    q: np.ndarray
    law: Law
    V: np.ndarray
    s: np.ndarray
    areas: np.ndarray
    coordinates: np.ndarray
    chart: Chart
    pairs: tuple[Pair, ...]
    motions: tuple[str, ...]

    def __init__(
        self,
        Q: ArrayLike | Interface,
        q: ArrayLike,
        law: Law | float | np.ndarray | None = None,
        V: ArrayLike = (),
        s: ArrayLike = (),
        areas: ArrayLike = (),
        coordinates: ArrayLike = (),
        chart: Chart | None = None,
        pairs: tuple[Pair, ...] = (),
        motions: tuple[str, ...] = (),
        *,
        mu: ArrayLike | None = None,
    ):
        if (law is None) == (mu is None):
            raise InputError("give either a law or a friction coefficient mu.")
        q = np.atleast_2d(real_array("q", q))
        k, dim = q.shape if q.ndim == 2 else (len(q), 0)
        if dim not in (2, 3):
            raise InputError(
                "q must have 2 or 3 columns (normal first), one row per contact; got shape"
                f" {q.shape}."
            )
        if given(V) and not given(s):
            raise InputError(
                "V has columns but s is empty; give the resultant s of every column of V."
            )
        given_law: Any = mu if law is None else law
        law = given_law if isinstance(given_law, Law) else Coulomb(given_law)
        places = np.arange(float(k))[None]
        if given(coordinates):
            places = np.atleast_2d(real_array("coordinates", coordinates))
        arrays = {
            "q": q,
            "V": np.zeros((k * dim, 0)),
            "s": np.zeros(0),
            "areas": _shaped("areas", areas, (k,)) if given(areas) else np.ones(k),
            "coordinates": places,
        }
        if np.size(s):
            s = real_array("s", s)
            arrays["s"] = _shaped("s", s, (s.size,))
            arrays["V"] = _shaped("V", V, (k * dim, s.size))
        if places.shape != (len(places), k):
            raise InputError(f"coordinates must have shape {(len(places), k)}; got {places.shape}.")
        for array in arrays.values():
            array.setflags(write=False)
        chart = _chart(chart, arrays["coordinates"], (dim - 1, k))
        values = arrays | {
            "Q": _compliance(Q, k * dim),
            "law": law.spread(k),
            "chart": chart,
            "pairs": _consecutive(pairs, k, chart),
            "motions": motions,
        }
        if motions and len(motions) != len(arrays["s"]):
            raise InputError(
                f"motions must name the {count(len(arrays['s']), 'column')} of V; got"
                f" {count(len(motions), 'name')}."
            )
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        free = count(len(self.s), "free motion") if len(self.s) else ""
        contacts = count(self.contacts, "contact")
        return line("InterfaceProblem", contacts, f"{self.dim}D", self._law, self._form, free)

    def _repr_html_(self) -> str:
        rows: dict[str, object] = {
            "contacts": self.contacts,
            "dimension": self.dim,
            "law": self._law,
            "Q": self._form,
            "free motions": ", ".join(self.motions) or len(self.s),
        }
        if len(self.pairs) > 1:
            rows["pairs of surfaces"] = ", ".join(pair.name for pair in self.pairs)
        return card("InterfaceProblem", rows)

    @property
    def _law(self) -> str:
        low, high = float(self.mu.min(initial=np.inf)), float(self.mu.max(initial=0.0))
        friction = f"mu = {high:g}" if low >= high else f"mu = {low:g} to {high:g}"
        return f"{type(self.law).__name__} {friction}" if self.contacts else type(self.law).__name__

    @property
    def _form(self) -> str:
        kind = form(self.Q) if has_entries(self.Q) else "by products"
        return f"Q {kind} of {self.q.size} x {self.q.size}"

    @property
    def contacts(self) -> int:
        return len(self.q)

    @property
    def dim(self) -> int:
        return int(self.q.shape[1])

    @property
    def mu(self) -> np.ndarray:
        """The friction coefficients (k,) of the law; 0 where it has none."""
        return self.law.coefficient

    @cached_property
    def symmetric(self) -> bool:
        """Whether Q is symmetric to 1 %, as methods that minimise an energy need it."""
        return asymmetry(self.Q) <= 1e-2  # rounding of the code that wrote Q

    @cached_property
    def fingerprint(self) -> str:
        """Digest of the problem's data, for caching and for naming it in tables."""
        digest = hashlib.sha256(self.law.digest)
        implicit = not has_entries(self.Q)
        if implicit:
            known = [self.Q @ np.random.default_rng(0).normal(size=self.q.size)]
        else:  # the same for an array and for sparse rows
            rows = sparse(self.Q)
            known = [rows.indptr.astype(np.int64), rows.indices.astype(np.int64), rows.data]
        for array in (*known, self.q, self.V, self.s):
            digest.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()[:16]

    @cached_property
    def compliances(self) -> np.ndarray:
        """The mean (k,) of the positive diagonal entries of each block [length / force], or 0."""
        entries = np.asarray(diagonal(self.Q), dtype=float).reshape(self.q.shape)
        entries = np.where(entries > NOISE * entries.max(initial=0.0), entries, 0.0)
        return np.asarray(entries.sum(axis=1) / np.maximum(np.count_nonzero(entries, axis=1), 1))

    @cached_property
    def stiffnesses(self) -> np.ndarray:
        """One over each of the `compliances` (k,) [force / length]; 0 where these are 0."""
        c = self.compliances
        return np.divide(1.0, c, out=np.zeros(len(c)), where=c > 0)

    @cached_property
    def gaps(self) -> np.ndarray:
        """The lengths (k,) of the vectors q at the contacts [length]."""
        return lengths(self.q)

    @cached_property
    def shared_places(self) -> list[np.ndarray]:
        """The groups of contacts that lie at one place. Empty for a problem whose pairs have no
        names.
        """
        x = self.coordinates
        if x.shape[1] != self.contacts or self.contacts < 2 or self.pairs[0].name == UNNAMED:
            return []
        near = 1e-9 * (x.max(axis=1) - x.min(axis=1)).max()  # of the extent: one place
        line = GENERIC[: len(x)] @ x  # no two points of a grid fall together
        line.sort()
        if (line[1:] - line[:-1]).min() > GENERIC.sum() * near:
            return []
        cell = np.round(x.T / (near or 1.0))
        own, counts = np.unique(cell, axis=0, return_inverse=True, return_counts=True)[1:]
        own = own.ravel()
        order = np.argsort(own, kind="stable")
        return [one for one in np.split(order, np.cumsum(counts)[:-1]) if len(one) > 1]

    @cached_property
    def nearly_singular(self) -> bool:
        """Whether an array Q is ill-conditioned as it is and, without the tangents along which
        nothing moves, with a diagonal of ones. Most have neither, and the first costs less.
        """
        Q = np.asarray(self.Q)
        if not ill_conditioned(Q):
            return False
        free = row_sizes(Q) > NOISE * np.abs(Q).max()
        free[:: self.dim] = True
        size = np.sqrt(np.abs(Q.diagonal()[free]))
        return not size.all() or ill_conditioned(Q[np.ix_(free, free)] / np.outer(size, size))

    @cached_property
    def reach(self) -> np.ndarray:
        """The largest size (p,) of the entries of each column of V."""
        return np.asarray(np.abs(self.V).max(axis=0, initial=0.0))

    def altered(self, **values: object) -> InterfaceProblem:
        """The same problem with other values of its fields, which must fit and are not checked."""
        other = object.__new__(InterfaceProblem)
        other.__dict__.update({name: self.__dict__[name] for name in self.__dataclass_fields__})
        other.__dict__.update(values)
        return other

    def explicit(self) -> InterfaceProblem:
        """The same problem with Q an array. InputError if that would be too large."""
        return self if form(self.Q) == "array" else self.altered(Q=dense(self.Q))

    def displacements(self, reactions: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """The relative displacements u = Q r + V lambda + q (k, dim) [length], normal first."""
        return (self.Q @ reactions.ravel() + self.V @ multipliers).reshape(self.q.shape) + self.q


def check_problem(problem: object) -> None:
    """Raise InputError for what is no interface problem, such as a scene."""
    if not isinstance(problem, InterfaceProblem):
        raise InputError(
            f"the problem must be an InterfaceProblem, not {type(problem).__name__};"
            " contactopt.reduce makes one of a scene."
        )


def _shaped(name: str, value: ArrayLike, shape: tuple[int, ...]) -> np.ndarray:
    """The value as a real finite array of its own, of that shape."""
    array = real_array(name, value)
    if array.shape != shape:
        raise InputError(f"{name} must have shape {shape}; got {array.shape}.")
    return array


def _compliance(Q: ArrayLike | Interface, n: int) -> Interface:
    """Q (n, n) in one of its three forms, as an array or rows of its own."""
    if sp.issparse(Q):
        if np.iscomplexobj(Q):
            raise InputError("Q must be real; got complex numbers.")
        Q = sparse(Q)
        if not np.all(np.isfinite(Q.data)):
            raise InputError("Q holds a number that is not finite.")
        Q.data.setflags(write=False)
    elif not isinstance(Q, InterfaceOperator):
        Q = real_array("Q", Q)
        Q.setflags(write=False)
    if Q.shape != (n, n):
        raise InputError(f"Q must have shape {(n, n)}; got {Q.shape}.")
    if isinstance(Q, InterfaceOperator):
        return Q
    if diagonal(Q).min(initial=0.0) < -1e-12 * row_sizes(Q).max(initial=0.0):
        raise InputError(
            "Q must be positive semidefinite, but it has a negative diagonal entry; check its sign."
        )
    return Q


def _chart(chart: object, coordinates: np.ndarray, shape: tuple[int, int]) -> Chart:
    if chart is None:
        return Chart.of_points(coordinates, shape[0] + 1)
    if not isinstance(chart, Chart):
        raise InputError(f"chart must be a Chart; got {type(chart).__name__}.")
    if chart.places.shape != shape:
        raise InputError(f"the chart must have places of shape {shape}; got {chart.places.shape}.")
    return chart


def _consecutive(pairs: tuple[Pair, ...], k: int, chart: Chart) -> tuple[Pair, ...]:
    if len(pairs) < 2:  # the only pair is all of the problem, whatever was replaced in it
        return (Pair(pairs[0].name if pairs else UNNAMED, 0, k, chart),)
    if [pair.start for pair in pairs] + [k] != [0] + [pair.stop for pair in pairs]:
        raise InputError(
            f"the pairs of surfaces must follow each other from contact 0 to contact {k - 1}."
        )
    return pairs
