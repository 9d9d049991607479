"""Vectors in parts: one array for each body, some in other processes, where what is done with them
is only ordered (contactopt.bodies.remote.Field): so the orders go out first, and all work at the
same time. Sums are made part by part, so that the result does not depend on it.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

Act = Callable[..., Any]


def in_turn(act: Act, *columns: Iterable[Any]) -> list[Any]:
    """Apply a function row by row, first where the first column's entry is elsewhere."""
    rows = list(zip(*columns))
    made = {
        i: act(*rows[i])
        for here in (False, True)
        for i, row in enumerate(rows)
        if _here(row[0]) is here
    }
    return [made[i] for i in range(len(rows))]


def _here(part: Any) -> bool:
    return not getattr(part, "elsewhere", False)


@dataclass(frozen=True, eq=False)
class Stacked:
    """A vector in parts, with the operators of an array: entry by entry, or with a number."""

    parts: tuple[Any, ...]
    __array_ufunc__ = None  # NumPy's numbers leave the operators to this class

    def _each(self, act: Act, other: Any) -> Stacked:
        others = other.parts if isinstance(other, Stacked) else (other,) * len(self.parts)
        return Stacked(tuple(in_turn(act, self.parts, others)))

    def __add__(self, other: Any) -> Stacked:
        return self._each(operator.add, other)

    def __sub__(self, other: Any) -> Stacked:
        return self._each(operator.sub, other)

    def __mul__(self, other: Any) -> Stacked:
        return self._each(operator.mul, other)

    def __rmul__(self, factor: float) -> Stacked:
        return self._each(operator.mul, factor)

    def __truediv__(self, other: Any) -> Stacked:
        return self._each(operator.truediv, other)

    def __pow__(self, power: float) -> Stacked:
        return self._each(operator.pow, power)

    def __neg__(self) -> Stacked:
        return self._each(operator.mul, -1.0)

    def astype(self, kind: Any) -> Stacked:
        """The vector in another precision."""
        return self._each(lambda part, kind: part.astype(kind), kind)

    def dot(self, other: Stacked) -> float:
        """The scalar product with a vector in the same parts."""
        return sum(own() for own in in_turn(_started_dot, self.parts, other.parts))


Vector: TypeAlias = Any  # an array (n,) or a Stacked


def _started_dot(x: Any, y: Any) -> Callable[[], float]:
    """The scalar product of two parts without BLAS, whose threads would spin till the next call."""
    if not _here(x):
        started: Callable[[], float] = x.started_dot(y)
        return started
    made = float(np.einsum("i,i", x, y))
    return lambda: made


def dot(x: Vector, y: Vector) -> float:
    """The scalar product of two arrays, or of two vectors in the same parts, wherever these are."""
    return float(x.dot(y)) if isinstance(x, Stacked) else float(np.einsum("i,i", x, y))


def norm(x: Vector) -> float:
    """The Euclidean norm of an array, or of a vector in parts."""
    return float(np.sqrt(dot(x, x)))
