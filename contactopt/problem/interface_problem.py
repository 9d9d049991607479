"""The interface problem of frictional contact, its solution and its certificate. Knows nothing of finite elements.

    u = Q r + V lambda + q,      V' r + s = 0,                                     (paper, eq (14))
    u_n >= 0,  r_n >= 0,  u_n r_n = 0,        (Signorini; bilateral contact instead: u_n = 0)      (15)
    |r_t| <= mu |r_n|,  and where u_t != 0:  r_t = -mu |r_n| u_t / |u_t|.             (Coulomb)   (16)-(17)

One block per contact node, normal component first. r is the force on the upper body, r_n >= 0 in compression;
u is the relative displacement plus the initial gap, so that u_n is the gap that remains. In the paper's letters
R_n = -r_n and w_n - d = -u_n. V holds the rigid motions of bodies that are held only by a plate under a total force:
lambda is the plate's displacement, s collects minus what r must balance.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.errors import InputError
from contactopt.problem.chart import Chart
from contactopt.problem.operators import Interface, InterfaceOperator, asymmetry, dense, diagonal, row_sizes, sparse

SYMMETRIC = 1e-2  # largest |Q - Q'|, over the largest |Q|, that counts as rounding of the code that wrote Q


@dataclass(frozen=True, eq=False)
class InterfaceProblem:
    """Coulomb contact at k nodes in `dim` dimensions, as in the head of this module.

    Q            (k dim, k dim) compliance [length / force]: an array, a scipy sparse matrix (kept as csr_array), or an
                 InterfaceOperator that knows it by its products only. Elastic bodies make it symmetric positive
                 semidefinite; files of other codes may hold an unsymmetric one, which is solved as it stands by the
                 methods that need no symmetry (`symmetric`)
    q            (k, dim) displacement at r = 0, lambda = 0 [length]; q_n holds the initial gap
    mu           (k,) friction coefficients
    V, s         (k dim, p) rigid motions and (p,) resultants [force]; p = 0 without a plate
    areas        (k,) nodal areas, force / area = traction; ones by default
    coordinates  (d, k) positions of the nodes in space, for output only; 0, 1, 2, ... by default
    chart        the nodes' places on the contact surface; by default read from the coordinates (Chart.of_points)
    bilateral    no separation: u_n = 0, friction bound mu |r_n|
    Raises InputError on wrong shapes, numbers that are not finite or not real, negative mu, a plate V without s, or a Q
    with a negative diagonal (an indefinite Q is not looked for: its answers are certified like any other; an operator is
    taken at its word).
    """

    Q: Interface
    q: np.ndarray
    mu: np.ndarray
    V: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    s: np.ndarray = field(default_factory=lambda: np.zeros(0))
    areas: np.ndarray = field(default_factory=lambda: np.zeros(0))
    coordinates: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    bilateral: bool = False
    chart: Chart = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        q = np.atleast_2d(_numbers("q", self.q))
        k, dim = q.shape
        if dim not in (2, 3):
            raise InputError(f"q must have 2 or 3 columns (normal first), one row per contact; got shape {q.shape}.")
        places = np.atleast_2d(self.coordinates if np.size(self.coordinates) else np.arange(k))
        implicit = isinstance(self.Q, InterfaceOperator)
        arrays: dict[str, tuple[Any, tuple[int, ...]]] = {
            "Q": (self.Q, (k * dim, k * dim)),
            "q": (q, (k, dim)),
            "mu": (np.broadcast_to(self.mu, (k,)) if np.ndim(self.mu) == 0 else self.mu, (k,)),
            "s": (self.s, (np.size(self.s),)),
            "V": (self.V if np.size(self.s) or np.size(self.V) else np.zeros((k * dim, 0)), (k * dim, np.size(self.s))),
            "areas": (self.areas if np.size(self.areas) else np.ones(k), (k,)),
            "coordinates": (places, (len(places), k)),
        }
        for name, (value, shape) in arrays.items():
            array = self.Q if name == "Q" and implicit else _numbers(name, value)
            if array.shape != shape:
                raise InputError(f"{name} must have shape {shape}; got {array.shape}.")
            if array is self.Q:
                continue
            entries = array.data if sp.issparse(array) else array
            if not np.all(np.isfinite(entries)):
                raise InputError(f"{name} holds a number that is not finite.")
            entries.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.chart is None:
            object.__setattr__(self, "chart", Chart.of_points(self.coordinates, dim))
        elif self.chart.places.shape != (dim - 1, k):
            raise InputError(f"the chart must have places of shape {(dim - 1, k)}; got {self.chart.places.shape}.")
        if np.any(self.mu < 0):
            raise InputError(f"the friction coefficient mu must not be negative; its least value is {self.mu.min():g}.")
        if isinstance(self.Q, InterfaceOperator):
            return
        if diagonal(self.Q).min(initial=0.0) < -1e-12 * row_sizes(self.Q).max(initial=0.0):
            raise InputError("Q must be positive semidefinite, but it has a negative diagonal entry; check its sign.")

    @property
    def contacts(self) -> int:
        return len(self.q)

    @property
    def dim(self) -> int:
        return int(self.q.shape[1])

    @cached_property
    def symmetric(self) -> bool:
        """Whether Q is symmetric to 1 %: methods that minimise an energy need it, and use (Q + Q') / 2."""
        return asymmetry(self.Q) <= SYMMETRIC

    @cached_property
    def fingerprint(self) -> str:
        """Digest of the problem's data, for caching and for naming it in tables."""
        digest = hashlib.sha256(bytes([self.bilateral]))
        implicit = isinstance(self.Q, InterfaceOperator)
        if implicit:
            known = [self.Q @ np.random.default_rng(0).normal(size=self.q.size)]
        else:  # the same for an array and for sparse rows
            rows = sparse(self.Q)
            known = [rows.indptr.astype(np.int64), rows.indices.astype(np.int64), rows.data]
        for array in (*known, self.q, self.mu, self.V, self.s):
            digest.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()[:16]

    def explicit(self) -> InterfaceProblem:
        """The same problem with Q an array."""
        return self if isinstance(self.Q, np.ndarray) else replace(self, Q=dense(self.Q))

    def displacements(self, reactions: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """u = Q r + V lambda + q, (k, dim) [length]."""
        return (self.Q @ reactions.ravel() + self.V @ multipliers).reshape(self.q.shape) + self.q


def _numbers(name: str, value: Any) -> Any:
    """The value as an array of floats of its own, or Q as sparse rows; InputError if it is not made of real numbers."""
    try:
        if name == "Q" and sp.issparse(value):
            if np.iscomplexobj(value):
                raise InputError("Q must be real; take its real part.")
            return sparse(value)
        if np.iscomplexobj(value):
            raise InputError(f"{name} must be real; take its real part.")
        return np.array(value, dtype=float)
    except InputError:
        raise
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers; got {type(value).__name__} ({error}).") from error
