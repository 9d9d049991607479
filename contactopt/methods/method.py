"""What every method offers: it yields one iterate after the other, and says what it needs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from contactopt.problem import InterfaceProblem
from contactopt.problem.certificate import Moved

Iterate = tuple[np.ndarray, np.ndarray]  # reactions (k, dim), multipliers (p,)
Known = tuple[np.ndarray, np.ndarray, Moved]  # the same, and Q r
NATIVE = "native"  # in place of a backend's name: our own linear algebra


class Method(Protocol):
    """What every method offers, as the head of contactopt.methods says."""

    def iterate(
        self, problem: InterfaceProblem, start: Iterate | None = None
    ) -> Iterator[Iterate | Known]:
        """Iterate on a dimensionless problem until the driver stops; start None is a cold start."""
        ...

    def backends(self, dim: int) -> tuple[str, str]:
        """Name the backends that the method needs.

        Parameters
        ----------
        dim : Number of components of a contact, 2 or 3.

        Returns
        -------
        The normal and the tangential backend, NATIVE where it needs none.

        Raises
        ------
        InputError : If one cannot be used.
        """
        return NATIVE, NATIVE


def at_rest(problem: InterfaceProblem) -> Iterate:
    """No force, and no motion of the plates."""
    return np.zeros(problem.q.shape), np.zeros(len(problem.s))
