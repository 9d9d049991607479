"""Q before condensation: the equilibrium of the bodies beside the contact forces, for methods that iterate on both at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from contactopt.problem.counter import Counter

Act = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class CoupledForm:
    """Q = trace A^-1 trace' + rest, without a solve with A.

    The N unknowns X are the free displacements of all bodies that are solved by iteration, one body after the other. They
    are in equilibrium with the contact forces r (n,) where A X = trace' r, and then Q r = trace X + rest r.

    trace      (n, N) sparse map from the displacements X to u
    stiffness  X (N,) -> A X, symmetric positive definite [force]
    cycle      F (N,) -> B F, symmetric positive definite and close to A^-1 F, e.g. one V-cycle of multigrid per body
    rest       r (n,) -> the part of Q r that needs no iteration: plates on supports, bodies with factors [length]
    diagonal   (N,) diagonal of A [force / length]
    counter    counts the applications of B; scaled forms share it
    """

    trace: sp.csr_matrix
    stiffness: Act
    cycle: Act
    rest: Act
    diagonal: np.ndarray
    counter: Counter = field(default_factory=Counter)

    @property
    def size(self) -> int:
        """Number N of displacement unknowns."""
        return self.trace.shape[1]

    @property
    def cycles(self) -> int:
        """Number of applications of B so far."""
        return self.counter.total

    def approximate(self, F: np.ndarray) -> np.ndarray:
        """B F (N,), counted."""
        self.counter.add()
        return self.cycle(F)

    def moved(self, X: np.ndarray, r: np.ndarray) -> np.ndarray:
        """trace X + rest r (n,), which is Q r in equilibrium."""
        return np.asarray(self.trace @ X + self.rest(r))

    def unbalanced(self, X: np.ndarray, r: np.ndarray) -> np.ndarray:
        """trace' r - A X (N,), the forces that are missing to equilibrium."""
        return np.asarray(self.trace.T @ r - self.stiffness(X))

    def scaled(self, factor: float, added: np.ndarray) -> CoupledForm:
        """The form of factor Q + diag(added), whose displacements X are in units in which A is A / factor."""
        stiffness, cycle, rest = self.stiffness, self.cycle, self.rest
        return replace(
            self,
            stiffness=lambda X: stiffness(X) / factor,
            cycle=lambda F: factor * cycle(F),
            rest=lambda r: factor * rest(r) + added * r,
            diagonal=self.diagonal / factor,
        )
