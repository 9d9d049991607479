"""The interface problem of frictional contact. Knows nothing of finite elements.

    u = Q r + V lambda + q,      V' r + s = 0,                                     (paper, eq (14))
    and at every contact a law, by default Coulomb's (contactopt.problem.laws has others):
    u_n >= 0,  r_n >= 0,  u_n r_n = 0,                                                (Signorini)
               (15)
    |r_t| <= mu r_n,  and where u_t != 0:  r_t = -mu r_n u_t / |u_t|.                 (Coulomb)
                      (16)-(17)

One block per contact node, normal component first. r is the force on the upper body, r_n >= 0 in
compression; u is the relative displacement plus the initial gap, so that u_n is the gap that
remains. In the paper's letters R_n = -r_n and w_n - d = -u_n. V holds the rigid motions that
nothing but contact resists, of plates under a total force and of bodies without enough supports:
lambda is how far each of them goes, s collects minus what r must balance.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.cards import card, count, line
from contactopt.checks import given, real_array
from contactopt.errors import InputError
from contactopt.linear.operators import (
    Interface,
    InterfaceOperator,
    asymmetry,
    dense,
    diagonal,
    row_sizes,
    sparse,
)
from contactopt.problem.chart import Chart
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.problem.laws.law import Law
from contactopt.problem.pairs import Pair

# largest |Q - Q'|, over the largest |Q|, that counts as rounding of the code that wrote Q
SYMMETRIC = 1e-2


@dataclass(frozen=True, eq=False, init=False)
class InterfaceProblem:
    """Contact at k nodes in `dim` dimensions, as in the head of this module.

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
        Q: Any,
        q: Any,
        law: Any = None,
        V: Any = (),
        s: Any = (),
        areas: Any = (),
        coordinates: Any = (),
        chart: Chart | None = None,
        pairs: tuple[Pair, ...] = (),
        motions: tuple[str, ...] = (),
        *,
        mu: Any = None,
    ):
        if (law is None) == (mu is None):
            raise InputError("give either a law or a friction coefficient mu.")
        fields = {"Q": Q, "q": q, "law": mu if law is None else law, "V": V, "s": s, "areas": areas}
        for name, value in (
            fields
            | {
                "coordinates": coordinates,
                "chart": chart,
                "pairs": pairs,
                "motions": motions,
            }
        ).items():
            object.__setattr__(self, name, value)
        self._check()

    def _check(self) -> None:
        q = np.atleast_2d(real_array("q", self.q))
        k, dim = q.shape if q.ndim == 2 else (len(q), 0)
        if dim not in (2, 3):
            raise InputError(
                "q must have 2 or 3 columns (normal first), one row per contact; got shape"
                f" {q.shape}."
            )
        for name in ("V", "s", "areas", "coordinates"):
            if given(getattr(self, name)):
                object.__setattr__(self, name, real_array(name, getattr(self, name)))
        if np.size(self.V) and not np.size(self.s):
            raise InputError(
                "V has columns but s is empty; give the resultant s of every column of V."
            )
        law = self.law if isinstance(self.law, Law) else Coulomb(self.law)
        object.__setattr__(self, "law", law.spread(k))
        places = np.atleast_2d(self.coordinates if np.size(self.coordinates) else np.arange(k))
        implicit = isinstance(self.Q, InterfaceOperator)
        arrays: dict[str, tuple[Any, tuple[int, ...]]] = {
            "Q": (self.Q, (k * dim, k * dim)),
            "q": (q, (k, dim)),
            "s": (self.s, (np.size(self.s),)),
            "V": (
                self.V if np.size(self.s) else np.zeros((k * dim, 0)),
                (k * dim, np.size(self.s)),
            ),
            "areas": (self.areas if np.size(self.areas) else np.ones(k), (k,)),
            "coordinates": (places, (len(places), k)),
        }
        for name, (value, shape) in arrays.items():
            array = self.Q if name == "Q" and implicit else _numbers(name, value)
            if array.shape != shape:
                raise InputError(f"{name} must have shape {shape}; got {array.shape}.")
            if array is self.Q:
                continue
            (array.data if sp.issparse(array) else array).setflags(write=False)
            object.__setattr__(self, name, array)
        if self.chart is None:
            object.__setattr__(self, "chart", Chart.of_points(self.coordinates, dim))
        elif not isinstance(self.chart, Chart):
            raise InputError(f"chart must be a Chart; got {type(self.chart).__name__}.")
        elif self.chart.places.shape != (dim - 1, k):
            raise InputError(
                f"the chart must have places of shape {(dim - 1, k)}; got"
                f" {self.chart.places.shape}."
            )
        pairs = self.pairs
        if len(pairs) < 2:  # the only pair is all of the problem, whatever was replaced in it
            pairs = (Pair(pairs[0].name if pairs else "contact", 0, k, self.chart),)
        if [pair.start for pair in pairs] + [k] != [0] + [pair.stop for pair in pairs]:
            raise InputError(
                f"the pairs of surfaces must follow each other from contact 0 to contact {k - 1}."
            )
        object.__setattr__(self, "pairs", pairs)
        if self.motions and len(self.motions) != len(self.s):
            raise InputError(
                f"motions must name the {len(self.s)} columns of V; got {len(self.motions)} names."
            )
        if isinstance(self.Q, InterfaceOperator):
            return
        if diagonal(self.Q).min(initial=0.0) < -1e-12 * row_sizes(self.Q).max(initial=0.0):
            raise InputError(
                "Q must be positive semidefinite, but it has a negative diagonal entry; check its"
                " sign."
            )

    def __repr__(self) -> str:
        facts = (count(self.contacts, "contact"), f"{self.dim}D", self._law, self._form)
        return line(
            "InterfaceProblem", *facts, count(len(self.s), "free motion") if len(self.s) else ""
        )

    def _repr_html_(self) -> str:
        rows: dict[str, object] = {
            "contacts": self.contacts,
            "dimension": self.dim,
            "law": self._law,
            "Q": self._form,
        }
        rows["free motions"] = ", ".join(self.motions) or len(self.s)
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
        form = (
            "by products"
            if isinstance(self.Q, InterfaceOperator)
            else "sparse"
            if sp.issparse(self.Q)
            else "array"
        )
        return f"Q {form} of {self.q.size} x {self.q.size}"

    @property
    def contacts(self) -> int:
        return len(self.q)

    @property
    def dim(self) -> int:
        return int(self.q.shape[1])

    @property
    def mu(self) -> np.ndarray:
        """(k,) friction coefficients of the law, 0 where it has none."""
        return self.law.coefficient

    @cached_property
    def symmetric(self) -> bool:
        """Whether Q is symmetric to 1 %: methods that minimise an energy need it, and use (Q + Q')
        / 2.
        """
        return asymmetry(self.Q) <= SYMMETRIC

    @cached_property
    def fingerprint(self) -> str:
        """Digest of the problem's data, for caching and for naming it in tables."""
        digest = hashlib.sha256(self.law.digest)
        implicit = isinstance(self.Q, InterfaceOperator)
        if implicit:
            known = [self.Q @ np.random.default_rng(0).normal(size=self.q.size)]
        else:  # the same for an array and for sparse rows
            rows = sparse(self.Q)
            known = [rows.indptr.astype(np.int64), rows.indices.astype(np.int64), rows.data]
        for array in (*known, self.q, self.V, self.s):
            digest.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()[:16]

    def explicit(self) -> InterfaceProblem:
        """Make the same problem with Q an array.

        Returns
        -------
        The problem itself if its Q is an array.

        Raises
        ------
        InputError : If that would be too large (contactopt.linear.operators.MOST_BYTES).
        """
        return self if isinstance(self.Q, np.ndarray) else replace(self, Q=dense(self.Q))

    def displacements(self, reactions: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """Compute the relative displacements u = Q r + V lambda + q.

        Parameters
        ----------
        reactions : (k, dim) contact forces, normal first [force].
        multipliers : (p,) multipliers lambda.

        Returns
        -------
        (k, dim) displacements, normal first [length].
        """
        return (self.Q @ reactions.ravel() + self.V @ multipliers).reshape(self.q.shape) + self.q


def _numbers(name: str, value: Any) -> Any:
    """The value as a real finite array of its own, or a sparse Q as sparse rows; InputError if it
    is neither.
    """
    if name != "Q" or not sp.issparse(value):
        return real_array(name, value)
    if np.iscomplexobj(value):
        raise InputError("Q must be real; got complex numbers.")
    rows = sparse(value)
    if not np.all(np.isfinite(rows.data)):
        raise InputError("Q holds a number that is not finite.")
    return rows
