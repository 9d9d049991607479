"""Contact problems whose Q is a convolution, on a grid and on coarser ones, which lump pairs or
squares of contacts. A Level holds the components, r (c, k), that its law makes matter: the normal
one alone where there is no friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contactopt.linear.convolution import Kernel, backward, forward
from contactopt.linear.counter import Counter
from contactopt.linear.deadline import check_time
from contactopt.linear.operators import form
from contactopt.methods.constants import COARSEST, LEAST_DETERMINANT, LEAST_SYMBOL
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.law import Law

Point = tuple[np.ndarray, np.ndarray]  # reactions (c, k), multipliers (p,)
Symbols = dict[tuple[int, int], np.ndarray]  # of pairs of components (a, b) with a <= b


@dataclass(frozen=True, eq=False)
class Level:
    """A dimensionless problem on one grid.

    kernel  of Q;  components  (c of them) that are solved for
    q       (c, k);  V (c, k, p);  s (p,);  law  of the k contacts;  rho  step of the natural map
    counter counts the products on the finest grid; None on the others
    """

    kernel: Kernel
    components: tuple[int, ...]
    q: np.ndarray
    V: np.ndarray
    s: np.ndarray
    law: Law
    rho: float
    counter: Counter | None = None

    @classmethod
    def of_problem(cls, problem: InterfaceProblem) -> Level:
        """The finest level; problem.Q is a Convolution."""
        assert form(problem.Q) == "convolution"
        kernel, law = problem.Q.kernel, problem.law
        smooth = law.proportional and not law.rough.any()
        components = (0,) if smooth else tuple(range(problem.dim))
        V = problem.V.reshape(problem.contacts, problem.dim, -1).transpose(1, 0, 2)
        return cls(
            kernel,
            components,
            np.ascontiguousarray(problem.q.T[: len(components)]),
            np.ascontiguousarray(V[: len(components)]),
            problem.s,
            law,
            1 / float(kernel.diagonal.mean()),
            problem.Q.counter,
        )

    @property
    def halves(self) -> bool:
        return self.kernel.halves and min(self.kernel.grid) >= 2 * COARSEST

    def coarse(self) -> Level:
        """The problem for contacts lumped along each axis in pairs."""
        kernel, (c, k, p) = self.kernel.coarse(), self.V.shape
        V = self._means(self.V.transpose(0, 2, 1).reshape(c * p, k))
        V = np.ascontiguousarray(V.reshape(c, p, int(np.prod(kernel.grid))).transpose(0, 2, 1))
        every_second = (slice(None, None, 2),) * len(kernel.grid)
        first = np.arange(k).reshape(self.kernel.grid)[every_second].ravel()
        law = self.law.lumped(first, 2 ** len(kernel.grid))
        rho = 1 / float(kernel.diagonal.mean())
        return Level(kernel, self.components, self._means(self.q), V, self.s, law, rho)

    def _means(self, x: np.ndarray) -> np.ndarray:
        """(c, k) -> (c, k of the coarse level): means over the lumped contacts."""
        x = x.reshape(len(x), *self.kernel.grid)
        for axis, n in enumerate(self.kernel.grid, 1):
            even = np.take(x, range(0, n, 2), axis)
            odd = np.take(x, range(1, n, 2), axis)
            if n % 2:
                odd = np.concatenate([odd, np.take(even, [-1], axis)], axis)
            x = (even + odd) / 2
        return np.asarray(x.reshape(len(x), int(np.prod(x.shape[1:]))))

    def restricted(self, point: Point) -> Point:
        """A point of this level on the coarse one: the same total forces."""
        return self._means(point[0]) * 2 ** len(self.kernel.grid), point[1]

    def refined(self, point: Point, coarse: Level) -> Point:
        """A point of the coarse level on this one: tractions are interpolated linearly."""
        x = point[0].reshape(-1, *coarse.kernel.grid)
        for axis, n in enumerate(self.kernel.grid, 1):
            ends = [np.take(x, [0], axis), np.take(x, [-1], axis)]
            if self.periodic:
                ends.reverse()
            before = np.concatenate([ends[0], np.take(x, range(x.shape[axis] - 1), axis)], axis)
            after = np.concatenate([np.take(x, range(1, x.shape[axis]), axis), ends[1]], axis)
            fine = np.stack([0.75 * x + 0.25 * before, 0.75 * x + 0.25 * after], axis + 1) / 2
            shape = [*x.shape]
            shape[axis] *= 2
            x = np.take(fine.reshape(shape), range(n), axis)
        return x.reshape(len(x), -1), point[1]

    @property
    def periodic(self) -> bool:
        return self.kernel.padded == self.kernel.grid

    def product(self, r: np.ndarray, single: bool = False) -> np.ndarray:
        """Q r (c, k)."""
        check_time()
        if self.counter is not None:
            self.counter.total += 1
        x = r.reshape(-1, *self.kernel.grid)
        return self.kernel.act(x, self.components, self.components, single).reshape(r.shape)

    def evaluate(self, r: np.ndarray, lam: np.ndarray) -> Evaluation:
        """Errors of the equations r = P(r - rho u), V' r + s = 0, and the derivative of P."""
        u = self.product(r) + self.V @ lam + self.q
        y, error = r - self.rho * u, -r
        if len(r) == 1 and self.law.unilateral:
            closed = np.flatnonzero(y[0] > 0)
            D = np.ones((len(closed), 1, 1))
            error[0, closed] += y[0, closed]
        else:
            busy = np.flatnonzero(~self.law.idle(y.T))
            whole = np.pad(y[:, busy].T, ((0, 0), (0, self.kernel.dim - len(r))))
            P, D = self.law.select(busy).project(np.ascontiguousarray(whole))
            P, D = P[:, : len(r)], D[:, : len(r), : len(r)]
            error[:, busy] += P.T
            moves = np.any(D != 0, axis=(1, 2))
            closed, D = busy[moves], D[moves]
        balance = np.einsum("ckp,ck->p", self.V, r) + self.s
        return Evaluation((r, lam), u, error, balance, closed, D)

    @cached_property
    def inverse(self) -> Symbols:
        """Symbols of an approximate inverse of Q without normal-tangential coupling."""
        return self.inverse_symbols(self.components[:1]) | self.inverse_symbols(self.components[1:])

    @cached_property
    def largest(self) -> float:
        """The largest value of the symbol of Q [length / force]."""
        return float(max(self.kernel.symbols[a, a].max() for a in self.components))

    def inverse_symbols(self, components: tuple[int, ...], shift: float = 0.0) -> Symbols:
        """Symbols, on the bare grid, of an approximate inverse of Q + shift by components."""
        symbols = self.kernel.symbols
        every = (slice(None, None, 1 if self.periodic else 2),) * len(self.kernel.grid)

        def positive(a: int) -> np.ndarray:
            symbol, low = symbols[a, a][every].copy(), 0.0
            if self.periodic:
                low = symbol.ravel()[1:].min()
                symbol.flat[0] = 2 * symbol.max()
            return np.maximum(symbol, max(low, LEAST_SYMBOL * float(np.median(symbol)))) + shift

        diagonal = {a: positive(a) for a in components}
        inverse = {(a, a): 1 / symbol for a, symbol in diagonal.items()}
        if len(components) == 2:
            first, second = diagonal[1], diagonal[2]
            mixed = symbols[1, 2][every] if (1, 2) in symbols else 0.0 * first
            determinant = np.maximum(first * second - mixed**2, LEAST_DETERMINANT * first * second)
            inverse = {
                (1, 1): second / determinant,
                (2, 2): first / determinant,
                (1, 2): -mixed / determinant,
            }
        return {pair: symbol.astype(np.float32) for pair, symbol in inverse.items()}

    def rough_solve(
        self, x: np.ndarray, closed: np.ndarray, components: tuple[int, ...], inverse: Symbols
    ) -> np.ndarray:
        """An approximate inverse by its symbols, on closed contacts, (components, m)."""
        grid = self.kernel.grid
        padded = grid if self.periodic else tuple(m // 2 for m in self.kernel.padded)
        spectra = []
        for part in x:
            full = np.zeros(int(np.prod(grid)), np.float32)
            full[closed] = part
            spectra.append(forward(full.reshape(grid), padded))
        out = np.empty(x.shape, np.float32)
        for i, a in enumerate(components):
            total = sum(
                inverse[min(a, b), max(a, b)] * spectrum
                for b, spectrum in zip(components, spectra)
                if (min(a, b), max(a, b)) in inverse
            )
            out[i] = backward(total, padded, grid).ravel()[closed]
        return out


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Displacements u (c, k) and errors at a point: error (c, k), balance (p,), m contacts with a
    derivative D (m, c, c).
    """

    point: Point
    moved: np.ndarray
    error: np.ndarray
    balance: np.ndarray
    closed: np.ndarray
    D: np.ndarray

    @cached_property
    def residual(self) -> float:
        return float(np.sqrt(np.sum(self.error**2) + np.sum(self.balance**2)))
