"""Q before condensation: the equilibrium of the bodies beside the contact forces, for methods that
iterate on both at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp

from contactopt.linear.counter import Counter
from contactopt.linear.stacked import Stacked, in_turn

Act = Callable[[np.ndarray], np.ndarray]


class BodyTerm(Protocol):
    """What one body with N displacement unknowns X adds to the coupled form.

    X is an array, or a vector elsewhere.

    With A its stiffness and T (n, N) the map from X to u, the body's part of Q is T A^-1 T' + L R'.

    elsewhere  whether X lives in another process
    size       N
    low_rank   L and R (n, i)
    """

    @property
    def elsewhere(self) -> bool: ...

    @property
    def size(self) -> int: ...

    @property
    def low_rank(self) -> tuple[np.ndarray, np.ndarray]: ...

    def diagonal(self) -> Any:
        """Give the diagonal of A.

        Returns
        -------
        (N,) [force / length], or a vector elsewhere.
        """

    def stiffness(self, X: Any) -> Any:
        """Multiply with A.

        Parameters
        ----------
        X : (N,) displacement [length].

        Returns
        -------
        A X (N,) [force], or a vector elsewhere.
        """

    def cycle(self, F: Any) -> Any:
        """Multiply with B, which is symmetric positive definite and close to A^-1, such as one
        V-cycle of multigrid.

        Parameters
        ----------
        F : (N,) forces [force].

        Returns
        -------
        B F (N,) [length], or a vector elsewhere.
        """

    def pulled(self, r: np.ndarray) -> Any:
        """Take contact forces to the unknowns of the body.

        Parameters
        ----------
        r : (n,) contact forces [force].

        Returns
        -------
        T' r (N,) [force], or a vector elsewhere.
        """

    def started_trace(self, X: Any) -> Callable[[], np.ndarray]:
        """Begin to take a displacement to the contacts. Elsewhere the work is ordered at once.

        Parameters
        ----------
        X : (N,) displacement [length].

        Returns
        -------
        A function without arguments that returns T X (n,) [length].
        """


@dataclass(frozen=True, eq=False)
class LocalTerm:
    """The term of a body in this process, by its matrices and functions as in BodyTerm."""

    trace: sp.csr_matrix
    stiffness: Act
    cycle: Act
    entries: np.ndarray
    low_rank: tuple[np.ndarray, np.ndarray]
    elsewhere = False

    @property
    def size(self) -> int:
        return self.trace.shape[1]

    def diagonal(self) -> np.ndarray:
        return self.entries

    def pulled(self, r: np.ndarray) -> np.ndarray:
        return np.asarray(self.trace.T @ r)

    def started_trace(self, X: np.ndarray) -> Callable[[], np.ndarray]:
        made = np.asarray(self.trace @ X)
        return lambda: made


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
        return Stacked(tuple(in_turn(act, self.terms, *(column.parts for column in columns))))

    def diagonal(self) -> Stacked:
        """Give the diagonal of A in all bodies, as a vector in parts."""
        return self._each(lambda term: term.diagonal() / self.factor)

    def pulled(self, r: np.ndarray) -> Stacked:
        """Take contact forces r (n,) to the bodies: T' r, as a vector in parts."""
        return self._each(lambda term: term.pulled(r))

    def stiffness(self, X: Stacked) -> Stacked:
        """Multiply displacements X of the bodies with A."""
        return self._each(lambda term, own: term.stiffness(own) / self.factor, X)

    def approximate(self, F: Stacked) -> Stacked:
        """Multiply forces on the bodies with B, and count it.

        Parameters
        ----------
        F : The forces in parts, one for each body [force].

        Returns
        -------
        B F [length].
        """
        self.counter.total += 1
        return self._each(lambda term, own: term.cycle(own) * self.factor, F)

    def moved(self, X: Stacked, r: np.ndarray) -> np.ndarray:
        """Compute the displacement at the contacts from displacements of the bodies and contact
        forces.

        Parameters
        ----------
        X, r : Displacements of the bodies in parts [length], and (n,) contact forces [force].

        Returns
        -------
        T X + rest r (n,) [length], which is Q r in equilibrium.
        """
        started = in_turn(lambda term, own: term.started_trace(own), self.terms, X.parts)
        return np.asarray(sum((own() for own in started), self.rest(r)))

    def unbalanced(self, X: Stacked, r: np.ndarray) -> Stacked:
        """Compute the forces that are missing to equilibrium.

        Parameters
        ----------
        X, r : Displacements of the bodies in parts [length], and (n,) contact forces [force].

        Returns
        -------
        T' r - A X [force].
        """
        return self.pulled(r) - self.stiffness(X)

    def scaled(self, factor: float, added: np.ndarray) -> CoupledForm:
        """Make the form of factor Q + diag(added), with added (n,), whose displacements X are in
        units in which A is A / factor.
        """
        rest = self.rest
        return replace(
            self, rest=lambda r: factor * rest(r) + added * r, factor=factor * self.factor
        )
