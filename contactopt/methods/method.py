"""What every method offers: it yields one iterate after the other, and says what it needs."""

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from contactopt.checks import real_array
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem, Scales, Solution
from contactopt.problem.certificate import Moved

Iterate = tuple[np.ndarray, np.ndarray]  # reactions (k, dim), multipliers (p,)
Known = tuple[np.ndarray, np.ndarray, Moved]  # the same, and Q r
NATIVE = "native"  # in place of a backend's name: our own linear algebra


class Method(Protocol):
    """What every method offers, as contactopt.methods describes it."""

    def iterate(
        self, problem: InterfaceProblem, start: Iterate | None = None
    ) -> Iterator[Iterate | Known]:
        """Iterate on a dimensionless problem until the driver stops; start None is a cold start."""
        ...

    def backends(self, dim: int) -> tuple[str, str]:
        """The normal and tangential backend for dim, NATIVE for none; InputError if unusable."""
        return NATIVE, NATIVE


def at_rest(problem: InterfaceProblem) -> Iterate:
    """No force, and no motion of the plates."""
    return np.zeros(problem.q.shape), np.zeros(len(problem.s))


def dimensionless_start(start: Solution, problem: InterfaceProblem, scales: Scales) -> Iterate:
    """Take a solution to start from to a problem's dimensionless form."""
    return scales.to_dimensionless(*checked_start(start, problem))


def checked_start(start: object, problem: InterfaceProblem) -> Iterate:
    """Forces and multipliers of a solution to start from; InputError if it does not fit."""
    if not isinstance(start, Solution):
        raise InputError(f"start must be a Solution; got {type(start).__name__}.")
    r = real_array("the start's array of reactions", start.reactions)
    multipliers = real_array("the start's array of multipliers", start.multipliers)
    if r.shape != problem.q.shape or multipliers.shape != problem.s.shape:
        raise InputError(
            f"start has reactions {r.shape} and multipliers {multipliers.shape}; this problem needs"
            f" {problem.q.shape} and {problem.s.shape}."
        )
    return r, multipliers
