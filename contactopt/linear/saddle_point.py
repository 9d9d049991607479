"""Q before condensation, for methods that iterate on bodies and contact forces at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.linear.counter import Counter
from contactopt.linear.deadline import check_time
from contactopt.linear.stacked import Stacked

Act = Callable[[np.ndarray], np.ndarray]
MOST_ITERATIONS = 60  # conjugate gradient iterations towards equilibrium


@dataclass(frozen=True, eq=False)
class BodyTerm:
    """What one body with N displacement unknowns X adds to the coupled form.

    With A its stiffness and T (n, N) the map from X to u, the body's part of Q is T A^-1 T' + L R'.

    trace      T
    stiffness  A X [force] for a displacement X (N,) [length]
    cycle      B F [length] for forces F (N,), with B positive definite and close to A^-1
    diagonal   that of A (N,) [force / length]
    low_rank   L and R (n, i)
    """

    trace: sp.csr_matrix
    stiffness: Act
    cycle: Act
    diagonal: np.ndarray
    low_rank: tuple[np.ndarray, np.ndarray]

    @property
    def size(self) -> int:
        return self.trace.shape[1]


@dataclass(frozen=True, eq=False)
class CoupledForm:
    """Q = factor sum T A^-1 T' + rest over the bodies that are solved by iteration, without a solve
    with any A.

    The unknowns X are the free displacements of these bodies, one part for each. They are in
    equilibrium with the contact forces r (n,) where A X = factor T' r in every body, and then Q r =
    sum T X + rest r. In the methods below, A stands for A / factor and B for factor B.

    terms   of the bodies
    rest    r (n,) -> the part of Q r that needs no iteration: plates on supports, bodies with
            factors [length]
    factor  of the units of Q
    counter counts the applications of B; scaled forms share it
    """

    terms: tuple[BodyTerm, ...]
    rest: Act
    factor: float = 1.0
    counter: Counter = field(default_factory=Counter)

    @property
    def size(self) -> int:
        """Number of the unknowns X."""
        return sum(term.size for term in self.terms)

    @property
    def cycles(self) -> int:
        """Number of applications of B so far."""
        return self.counter.total

    def _each(self, act: Callable[..., Any], *columns: Stacked) -> Stacked:
        """A vector in parts, of a function of each term and its parts."""
        return Stacked(tuple(map(act, self.terms, *(column.parts for column in columns))))

    def diagonal(self) -> Stacked:
        """Give the diagonal of A in all bodies, as a vector in parts."""
        return self._each(lambda term: term.diagonal / self.factor)

    def pulled(self, r: np.ndarray) -> Stacked:
        """Take contact forces r (n,) to the bodies: T' r, as a vector in parts."""
        return self._each(lambda term: term.trace.T @ r)

    def stiffness(self, X: Stacked) -> Stacked:
        """Multiply displacements X of the bodies with A."""
        return self._each(lambda term, own: term.stiffness(own) / self.factor, X)

    def approximate(self, F: Stacked) -> Stacked:
        """B F [length] for forces F on the bodies, which is counted."""
        self.counter.total += 1
        return self._each(lambda term, own: term.cycle(own) * self.factor, F)

    def moved(self, X: Stacked, r: np.ndarray) -> np.ndarray:
        """T X + rest r (n,) [length], which is Q r in equilibrium."""
        own = (term.trace @ part for term, part in zip(self.terms, X.parts))
        return np.asarray(sum(own, self.rest(r)))

    def unbalanced(self, X: Stacked, r: np.ndarray) -> Stacked:
        """T' r - A X: the forces that are missing to equilibrium."""
        return self.pulled(r) - self.stiffness(X)

    def scaled(self, factor: float, added: np.ndarray) -> CoupledForm:
        """The form of factor Q + diag(added), added (n,), with X in units where A is A / factor."""
        rest = self.rest
        return replace(
            self, rest=lambda r: factor * rest(r) + added * r, factor=factor * self.factor
        )


def in_equilibrium(
    form: CoupledForm, r: np.ndarray, rtol: float, first: Stacked | None = None
) -> Stacked:
    """X close to A^-1 T' r, by conjugate gradients from `first` on, to rtol in energy."""
    pulled = form.pulled(r.ravel())
    X = 0.0 * pulled if first is None else first
    residual = pulled if first is None else pulled - form.stiffness(first)
    size, p, whole = 1.0, X, X.dot(pulled)
    for step in range(MOST_ITERATIONS):
        check_time()
        z = form.approximate(residual)
        size, previous = residual.dot(z), size
        whole = whole if step or first is not None else size
        if not size > rtol**2 * whole:
            break
        p = z + (size / previous if step else 0.0) * p
        Ap = form.stiffness(p)
        alpha = size / p.dot(Ap)
        X = X + alpha * p
        residual = residual - alpha * Ap
    return X
