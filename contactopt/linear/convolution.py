"""Interface operators that are convolutions over a regular grid of contacts, by fast Fourier
transforms.

The displacement of a contact then depends on the forces through distances alone, as on a
half-space:

    u_a(x) = sum_b sum_y K_ab(x - y) r_b(y),        a, b the components n, t1[, t2],

where t1 and t2 lie along the axes of the grid. K_ab is even in the distance along an axis, or odd
if exactly one of a and b lies along it. On a grid that does not repeat itself the forces are padded
by zeros to at least twice its size. Only the Fourier transforms of K are kept: real numbers times 1
or i, M0 (M1 / 2 + 1) of them for each pair (a, b).
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from contactopt.linear.concurrency import cores
from contactopt.linear.counter import Counter
from contactopt.linear.operators import Form, InterfaceOperator, check_dense

LEVELS = 4  # halvings of the grid that its padding allows for
LARGE = 2**16  # points from which on transforms use all processors
Symbols = dict[tuple[int, int], np.ndarray]  # (a, b) with a <= b -> real array


def embedding(grid: tuple[int, ...]) -> tuple[int, ...]:
    """The size M, easy to transform, of the padded grid along each axis: twice that of the grid."""
    from scipy.fft import next_fast_len

    return tuple(
        2 ** (LEVELS + 1) * int(next_fast_len(-(-n // 2**LEVELS), real=True)) for n in grid
    )


def _odd_axes(a: int, b: int, axes: int) -> tuple[bool, ...]:
    """Along which axes of the grid K_ab is odd."""
    return tuple((a == c + 1) != (b == c + 1) for c in range(axes))


def _unit(a: int, b: int, axes: int) -> complex:
    """What the real symbol of K_ab is multiplied with."""
    return (1j if a < b else -1j) if sum(_odd_axes(a, b, axes)) == 1 else 1.0


@dataclass(frozen=True, eq=False)
class Kernel:
    """The kernel K of a convolution by its Fourier transform.

    grid      number of contacts along each axis of the grid; contacts are numbered as in C arrays
              of that shape
    padded    number of points along each axis of the transform; the grid's own where it repeats
              itself periodically
    symbols   for each pair of components (a, b), a <= b, the transform (M0, M1 / 2 + 1) over 1 or,
              where K_ab is odd along one axis, over i [length / force]; pairs that are left out are
              zero
    """

    grid: tuple[int, ...]
    padded: tuple[int, ...]
    symbols: Symbols

    @classmethod
    def of_coefficients(cls, grid: tuple[int, ...], coefficients: Symbols) -> Kernel:
        """From K_ab [length / force], a <= b, at distances 0 to M / 2 along each axis."""
        from scipy.fft import dct, dst

        padded, symbols = embedding(grid), {}
        for (a, b), part in coefficients.items():
            odd, symbol = _odd_axes(a, b, len(grid)), part
            for axis in range(len(grid)):
                if odd[axis]:
                    inner = (slice(None),) * axis + (slice(1, -1),)
                    values, symbol = dst(symbol[inner], 1, axis=axis), np.zeros(symbol.shape)
                    np.negative(values, out=symbol[inner])
                else:
                    symbol = dct(symbol, 1, axis=axis)
            if len(grid) == 2:  # the frequencies beyond the middle
                half, sign = len(symbol), -1.0 if all(odd) else 1.0
                part, symbol = symbol, np.empty((2 * half - 2, symbol.shape[1]))
                np.multiply(part, sign, out=symbol[:half])
                np.multiply(part[-2:0:-1], -sign if odd[0] else sign, out=symbol[half:])
            symbols[a, b] = symbol
        return cls(grid, padded, symbols)

    @property
    def dim(self) -> int:
        return len(self.grid) + 1

    def __add__(self, other: Kernel) -> Kernel:
        """The sum on the same grid, without pairs that cancel but for rounding."""
        symbols = dict(self.symbols)
        for pair, symbol in other.symbols.items():
            symbols[pair] = symbols[pair] + symbol if pair in symbols else symbol
        every = (*self.symbols.values(), *other.symbols.values())
        least = 1e-14 * max(float(np.abs(symbol).max()) for symbol in every)
        kept = {pair: own for pair, own in symbols.items() if np.abs(own).max() > least}
        return Kernel(self.grid, self.padded, kept)

    def scaled(self, factor: float) -> Kernel:
        symbols = {pair: factor * symbol for pair, symbol in self.symbols.items()}
        return Kernel(self.grid, self.padded, symbols)

    @cached_property
    def diagonal(self) -> np.ndarray:
        """(dim,) of the operator: K_aa(0), the mean of the transform."""
        size = self.padded[-1]
        twice = np.full(size // 2 + 1, 2.0)
        twice[[0, size // 2]] = 1.0
        if size % 2:
            twice[-1] = 2.0
        means = [(self.symbols[a, a] @ twice).sum() / np.prod(self.padded) for a in range(self.dim)]
        return np.array(means)

    @cached_property
    def single(self) -> Symbols:
        """The symbols in single precision."""
        return {pair: symbol.astype(np.float32) for pair, symbol in self.symbols.items()}

    @property
    def halves(self) -> bool:
        """Whether a grid of half as many contacts along each axis exists for `coarse`."""
        doubled = all(m % 4 == 0 and m >= 2 * n for m, n in zip(self.padded, self.grid))
        periodic = all(m == n and n % 4 == 0 for m, n in zip(self.padded, self.grid))
        return doubled or periodic

    def coarse(self) -> Kernel:
        """The kernel between pairs (in 2D) or squares of four contacts, on which forces are spread
        evenly: K_c(I) = (K(2 I - 1) + 2 K(2 I) + K(2 I + 1)) / 4 along each axis, which is a
        product with cos^2, then the sum over the two frequencies that fall on one.
        """
        symbols = {}
        for pair, symbol in self.symbols.items():
            odd = _odd_axes(*pair, len(self.grid))
            for axis, size in enumerate(self.padded):
                final = axis == len(self.padded) - 1
                count = size // 2 + 1 if final else size
                shape = [count if i == axis else 1 for i in range(symbol.ndim)]
                weighted = symbol * (np.cos(np.pi * np.arange(count) / size) ** 2).reshape(shape)
                low = np.take(weighted, range(size // 4 + 1 if final else size // 2), axis)
                if final:  # the frequency k + M / 2 is minus the frequency M / 2 - k
                    high = np.take(weighted, range(size // 2, size // 4 - 1, -1), axis)
                    high = -high if odd[axis] else high
                else:
                    high = np.take(weighted, range(size // 2, size), axis)
                symbol = (low + high) / 2
            symbols[pair] = np.ascontiguousarray(symbol)
        halved = tuple(m // 2 for m in self.padded)
        return Kernel(tuple(-(-n // 2) for n in self.grid), halved, symbols)

    def act(
        self,
        x: Iterable[np.ndarray],
        rows: tuple[int, ...],
        columns: tuple[int, ...],
        single: bool = False,
    ) -> np.ndarray:
        """Displacements (rows, n0[, n1]) [length] under forces x (columns, n0[, n1]) [force]."""
        symbols, kind = (self.single, np.float32) if single else (self.symbols, np.float64)
        spectra = {
            b: forward(part.astype(kind, copy=False), self.padded)
            for b, part in zip(columns, x)
            if np.any(part)
        }
        out = np.zeros((len(rows), *self.grid), kind)
        for place, a in enumerate(rows):
            total: np.ndarray | None = None
            for b, spectrum in spectra.items():
                pair = (min(a, b), max(a, b))
                if pair not in symbols:
                    continue
                term, unit = symbols[pair] * spectrum, _unit(a, b, len(self.grid))
                if unit != 1.0:
                    term *= np.array(unit, term.dtype)
                total = term if total is None else np.add(total, term, out=total)
            if total is not None:
                out[place] = backward(total, self.padded, self.grid)
        return out

    def entries(self, contacts: np.ndarray | None = None) -> np.ndarray:
        """Q between contacts (k,) as an array (k dim, k dim); InputError if too large."""
        numbers = np.arange(np.prod(self.grid)) if contacts is None else contacts
        k, dim = len(numbers), self.dim
        check_dense(k * dim)
        places = np.array(np.unravel_index(numbers, self.grid))
        apart = places[:, :, None] - places[:, None, :]
        Q = np.zeros((k, dim, k, dim))
        for (a, b), symbol in self.symbols.items():
            transform = _unit(a, b, len(self.grid)) * symbol
            values = backward(transform, self.padded, self.padded)[tuple(apart)]
            Q[:, a, :, b] = values
            Q[:, b, :, a] = values.T
        return Q.reshape(k * dim, k * dim)


def serves_single(accuracy: float | None) -> bool:
    """Whether products in single precision are accurate enough."""
    return accuracy is not None and accuracy >= 2e-6


def forward(x: np.ndarray, padded: tuple[int, ...]) -> np.ndarray:
    """The transform of real values on a grid, padded by zeros to (M0[, M1]), in their precision."""
    from scipy.fft import fft, rfft

    workers = _workers_for(padded)
    spectrum = rfft(x, n=padded[-1], axis=-1, workers=workers)
    if len(padded) == 2:
        spectrum = fft(spectrum, n=padded[0], axis=0, overwrite_x=True, workers=workers)
    return np.asarray(spectrum)


def backward(spectrum: np.ndarray, padded: tuple[int, ...], grid: tuple[int, ...]) -> np.ndarray:
    """Transform back what `forward` gives, which is overwritten, and keep the part of the grid."""
    from scipy.fft import ifft, irfft

    workers = _workers_for(padded)
    if len(padded) == 2:
        spectrum = ifft(spectrum, axis=0, overwrite_x=True, workers=workers)[: grid[0]]
    return np.asarray(irfft(spectrum, n=padded[-1], axis=-1, workers=workers))[..., : grid[-1]]


def _workers_for(padded: tuple[int, ...]) -> int:
    """Number of processors for transforms of that size; OMP_NUM_THREADS bounds it."""
    if np.prod(padded) < LARGE:
        return 1
    available = cores()
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return min(available, int(asked)) if asked.isdigit() and int(asked) > 0 else available


class Convolution(InterfaceOperator):
    """The operator of a kernel, in double precision, or single where that is accurate enough."""

    def __init__(
        self, kernel: Kernel, accuracy: float | None = None, counter: Counter | None = None
    ):
        self.kernel = kernel
        diagonal = np.tile(kernel.diagonal, int(np.prod(kernel.grid)))
        super().__init__(self._product, diagonal, kernel.entries, accuracy, counter=counter)

    @property
    def form(self) -> Form:
        return "convolution"

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes: the kernel is all there is to it."""
        return Convolution, (self.kernel, self.accuracy)

    def _product(self, X: np.ndarray, accuracy: float | None) -> np.ndarray:
        every = tuple(range(self.kernel.dim))
        single = serves_single(accuracy)
        out = np.empty(X.shape)
        for column in range(X.shape[1]):
            parts = X[:, column].reshape(*self.kernel.grid, self.kernel.dim)
            moved = self.kernel.act(np.moveaxis(parts, -1, 0), every, every, single)
            out[:, column] = np.moveaxis(moved, 0, -1).ravel()
        return out

    def scaled(
        self, factor: float, added: np.ndarray, counter: Counter | None = None
    ) -> InterfaceOperator:
        if np.any(added):
            return super().scaled(factor, added, counter)
        return Convolution(self.kernel.scaled(factor), self.accuracy, counter)
