"""Vectors in parts: one array for each body. Sums are made part by part."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

Act = Callable[..., Any]


@dataclass(frozen=True, eq=False)
class Stacked:
    """A vector in parts, with the operators of an array: entry by entry, or with a number."""

    parts: tuple[Any, ...]
    __array_ufunc__ = None  # NumPy's numbers leave the operators to this class

    def _each(self, act: Act, other: object) -> Stacked:
        others = other.parts if isinstance(other, Stacked) else (other,) * len(self.parts)
        return Stacked(tuple(map(act, self.parts, others)))

    def __add__(self, other: Vector | float) -> Stacked:
        return self._each(operator.add, other)

    def __sub__(self, other: Vector | float) -> Stacked:
        return self._each(operator.sub, other)

    def __mul__(self, other: Vector | float) -> Stacked:
        return self._each(operator.mul, other)

    def __rmul__(self, factor: float) -> Stacked:
        return self._each(operator.mul, factor)

    def __truediv__(self, other: Vector | float) -> Stacked:
        return self._each(operator.truediv, other)

    def __pow__(self, power: float) -> Stacked:
        return self._each(operator.pow, power)

    def __neg__(self) -> Stacked:
        return self._each(operator.mul, -1.0)

    def astype(self, kind: type) -> Stacked:
        """The vector in another precision."""
        return self._each(lambda part, kind: part.astype(kind), kind)

    def dot(self, other: Stacked) -> float:
        """The scalar product with a vector in the same parts."""
        return sum(map(dot, self.parts, other.parts))


Vector: TypeAlias = Any  # an array (n,) or a Stacked


def dot(x: Vector, y: Vector) -> float:
    """The scalar product, without BLAS, whose threads would spin till the next call."""
    return float(x.dot(y)) if isinstance(x, Stacked) else float(np.einsum("i,i", x, y))


def norm(x: Vector) -> float:
    """The Euclidean norm of an array, or of a vector in parts."""
    return float(np.sqrt(dot(x, x)))
