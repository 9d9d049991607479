"""Contact problems whose Q is a convolution, on a grid and on coarser ones, and Newton's steps for
them.

A Level holds a problem component by component, r (c, k), for the components that its law makes
matter: the normal one alone where there is no friction. A coarse level lumps pairs or squares of
contacts; its kernel follows from the finer one.

A step solves  (I - D) dr + D rho (Q dr + V dlambda) = error,  V' dr = -balance  on the contacts
               with D != 0; all others have
dr = error. Products with Q are taken in single precision, which is enough for a correction. Without
friction the system is symmetric and solved by projected PCG, otherwise by GMRES. Both are
preconditioned by the inverse of the symbol of Q on the grid without padding, restricted to the
contacts that are closed and to the directions that are held.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from contactopt.linear.convolution import Convolution, Kernel, backward, forward
from contactopt.linear.counter import Counter
from contactopt.linear.deadline import check_time
from contactopt.methods.constants import (
    COARSEST,
    FIRST_SHIFT,
    LEAST_DETERMINANT,
    LEAST_SYMBOL,
    SHIFT_RATIO,
)
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.law import Law

RESTART, CYCLES = 40, 3  # of GMRES
ITERATIONS = 100  # of PCG

Point = tuple[np.ndarray, np.ndarray]  # reactions (c, k), multipliers (p,)


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
        assert isinstance(problem.Q, Convolution)
        kernel, law = problem.Q.kernel, problem.law
        smooth = law.proportional and not law.rough.any()
        components = (0,) if smooth else tuple(range(problem.dim))
        V = problem.V.reshape(problem.contacts, problem.dim, -1)
        rho = 1 / float(kernel.diagonal.mean())
        pick = list(components)
        return cls(
            kernel,
            components,
            np.ascontiguousarray(problem.q.T[pick]),
            np.ascontiguousarray(V.transpose(1, 0, 2)[pick]),
            problem.s,
            law,
            rho,
            problem.Q.counter,
        )

    @property
    def halves(self) -> bool:
        return self.kernel.halves and min(self.kernel.grid) >= 2 * COARSEST

    def coarse(self) -> Level:
        """The problem for contacts lumped along each axis in pairs."""
        kernel = self.kernel.coarse()
        V = np.stack(
            [self._means(column) for column in np.moveaxis(self.V, 2, 0)] or [np.zeros((0, 0))],
            axis=-1,
        )
        V = V if len(self.s) else np.zeros((len(self.components), int(np.prod(kernel.grid)), 0))
        first = np.arange(np.prod(self.kernel.grid)).reshape(self.kernel.grid)[
            (slice(None, None, 2),) * len(kernel.grid)
        ]
        law = self.law.lumped(first.ravel(), 2 ** len(kernel.grid))
        return Level(
            kernel,
            self.components,
            self._means(self.q),
            V,
            self.s,
            law,
            1 / float(kernel.diagonal.mean()),
        )

    def _means(self, x: np.ndarray) -> np.ndarray:
        """(c, k) -> (c, k of the coarse level): means over the lumped contacts."""
        x = x.reshape(-1, *self.kernel.grid)
        for axis, n in enumerate(self.kernel.grid, 1):
            even = np.take(x, range(0, n, 2), axis)
            odd = np.take(x, range(1, n, 2), axis)
            if n % 2:
                odd = np.concatenate([odd, np.take(even, [-1], axis)], axis)
            x = (even + odd) / 2
        return np.asarray(x.reshape(len(x), -1))

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
            self.counter.add()
        grid = self.kernel.grid
        return self.kernel.act(
            r.reshape(-1, *grid), self.components, self.components, single
        ).reshape(r.shape)

    def evaluate(self, r: np.ndarray, lam: np.ndarray) -> Evaluation:
        """Errors of the equations r = P(r - rho u), V' r + s = 0, and the derivative of P."""
        u = self.product(r) + self.V @ lam + self.q
        y = r - self.rho * u
        error = -r
        if len(r) == 1 and self.law.unilateral:
            closed = np.flatnonzero(y[0] > 0)
            D = np.ones((len(closed), 1, 1))
            error[0, closed] += y[0, closed]
        else:
            busy = np.flatnonzero(~self.law.idle(y.T))
            whole = (
                y[:, busy].T if len(r) == self.law_dim else np.pad(y[:, busy].T, ((0, 0), (0, 1)))
            )
            P, D = self.law.select(busy).project(np.ascontiguousarray(whole))
            P, D = P[:, : len(r)], D[:, : len(r), : len(r)]
            error[:, busy] += P.T
            moves = np.any(D != 0, axis=(1, 2))
            closed, D = busy[moves], D[moves]
        balance = np.einsum("ckp,ck->p", self.V, r) + self.s
        return Evaluation(error, balance, closed, D)

    @property
    def law_dim(self) -> int:
        return self.kernel.dim

    @cached_property
    def inverse(self) -> dict[tuple[int, int], np.ndarray]:
        """Symbols of an approximate inverse of Q, without the coupling of normal and tangential
        components.
        """
        return self.inverse_symbols(self.components[:1]) | self.inverse_symbols(self.components[1:])

    @cached_property
    def largest(self) -> float:
        """The largest value of the symbol of Q [length / force]."""
        return float(max(self.kernel.symbols[a, a].max() for a in self.components))

    def inverse_symbols(
        self, components: tuple[int, ...], shift: float = 0.0
    ) -> dict[tuple[int, int], np.ndarray]:
        """Symbols of an approximate inverse of Q + shift on the grid without padding, for (0,),
        (1,) or (1, 2).

        The symbol on the smaller grid is that of the kernel that repeats itself there.
        """
        symbols = self.kernel.symbols
        every = (slice(None, None, 1 if self.periodic else 2),) * len(self.kernel.grid)

        def positive(symbol: np.ndarray) -> np.ndarray:
            symbol = symbol[every].copy()
            low = symbol.ravel()[1:].min() if self.periodic else 0.0
            if self.periodic:
                symbol.flat[0] = 2 * symbol.max()
            return np.maximum(symbol, max(low, LEAST_SYMBOL * float(np.median(symbol)))) + shift

        if not components:
            return {}
        first = positive(symbols[components[0], components[0]])
        if len(components) == 1:
            return {(components[0], components[0]): (1 / first).astype(np.float32)}
        second, mixed = (
            positive(symbols[2, 2]),
            symbols[1, 2][every] if (1, 2) in symbols else 0.0 * first,
        )
        determinant = np.maximum(first * second - mixed**2, LEAST_DETERMINANT * first * second)
        inverse = {
            (1, 1): second / determinant,
            (2, 2): first / determinant,
            (1, 2): -mixed / determinant,
        }
        return {pair: symbol.astype(np.float32) for pair, symbol in inverse.items()}

    def rough_solve(
        self,
        x: np.ndarray,
        closed: np.ndarray,
        components: tuple[int, ...],
        symbols: dict[tuple[int, int], np.ndarray] | None = None,
    ) -> np.ndarray:
        """An approximate inverse on the closed contacts, x (components, m) -> (components, m); by
        default that of Q.
        """
        inverse, grid = self.inverse if symbols is None else symbols, self.kernel.grid
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
    """Errors at a point: error (c, k), balance (p,), the m contacts with a derivative D (m, c, c)
    that is not zero.
    """

    error: np.ndarray
    balance: np.ndarray
    closed: np.ndarray
    D: np.ndarray

    @cached_property
    def residual(self) -> float:
        return float(np.sqrt(np.sum(self.error**2) + np.sum(self.balance**2)))


def step(level: Level, at: Evaluation, rtol: float) -> tuple[Point, int]:
    """Solve for a Newton step on one grid.

    Parameters
    ----------
    level : The problem on its grid, of c components and k contacts.
    at : The equations at the present point.
    rtol : Relative accuracy of the step.

    Returns
    -------
    The step, dr (c, k) and dlambda (p,), and the number of iterations that it took.
    """
    known = at.error.copy()
    known[:, at.closed] = 0.0
    moved = (
        level.product(known, single=True)[:, at.closed]
        if np.any(known)
        else np.zeros((len(known), len(at.closed)))
    )
    V = level.V[:, at.closed]
    balance = -at.balance - np.einsum("ckp,ck->p", level.V, known)
    identity = np.array_equal(at.D, np.broadcast_to(np.eye(len(known)), at.D.shape))
    solve = _symmetric if identity else _unsymmetric
    dr, lam, count = solve(level, at, moved, V, balance, rtol)
    known[:, at.closed] = dr
    return (known, lam), count


def _act(
    level: Level, closed: np.ndarray, shape: tuple[int, int]
) -> Callable[[np.ndarray], np.ndarray]:
    """Products with Q on the closed contacts, (c, m) -> (c, m), in single precision."""

    def act(x: np.ndarray) -> np.ndarray:
        full = np.zeros(shape, np.float32)
        full[:, closed] = x
        return level.product(full, single=True)[:, closed]

    return act


def _symmetric(
    level: Level, at: Evaluation, moved: np.ndarray, V: np.ndarray, balance: np.ndarray, rtol: float
) -> tuple[np.ndarray, np.ndarray, int]:
    """Q dr + V dlambda = error / rho - Q known, V' dr = balance on the closed contacts, by
    projected PCG.
    """
    c, m = moved.shape
    act = _act(level, at.closed, at.error.shape)
    # W holds the columns of the balance; N is the rough inverse, normal and tangential components
    # by themselves.
    right = (at.error[:, at.closed] / level.rho - moved).ravel()
    W = V.reshape(c * m, -1)
    normal, tangential = (level.components[:1], level.components[1:])

    def near(x: np.ndarray) -> np.ndarray:
        parts = x.reshape(c, m)
        out = [level.rough_solve(parts[:1], at.closed, normal)]
        if tangential:
            out.append(level.rough_solve(parts[1:], at.closed, tangential))
        return np.concatenate(out).astype(float).ravel()

    # Y = N W and K = (W'N W)^-1. The start x = Y K balance meets the balance W'x; all corrections
    # keep it.
    Y = np.stack([near(w) for w in W.T], axis=1) if W.shape[1] else W
    K = np.linalg.pinv(W.T @ Y)
    x = Y @ (K @ balance)
    residual = right - (act(x.reshape(c, m)).ravel() if np.any(x) else 0.0)

    def projected(residual: np.ndarray) -> np.ndarray:
        # I - Y K W' takes the part out of N residual that would change the balance.
        z = near(residual)
        return np.asarray(z - Y @ (K @ (W.T @ z)))

    # Conjugate gradients among the x that meet the balance, until residual' N residual has fallen
    # enough.
    z = projected(residual)
    gamma = float(residual @ z)
    aim, p, count = rtol**2 * abs(gamma), z, 0
    while count < ITERATIONS and gamma > aim:
        product = act(p.reshape(c, m)).ravel().astype(float)
        work = float(p @ product)
        if not work > 0:  # forces that move nothing
            break
        alpha = gamma / work
        x = x + alpha * p
        residual = residual - alpha * product
        z = projected(residual)
        new = float(residual @ z)
        p, gamma, count = z + (new / gamma) * p, new, count + 1
    # What is left of the residual is W lambda; least squares in the norm of N give lambda.
    lam = K @ (Y.T @ residual) if W.shape[1] else balance
    return x.reshape(c, m), np.asarray(lam), count


def _unsymmetric(
    level: Level, at: Evaluation, moved: np.ndarray, V: np.ndarray, balance: np.ndarray, rtol: float
) -> tuple[np.ndarray, np.ndarray, int]:
    """(I - D) dr + D rho (Q dr + V dlambda) = error - D rho Q known, V' dr = balance, by GMRES."""
    c, m = moved.shape
    act, rho, D = _act(level, at.closed, at.error.shape), level.rho, at.D
    p, n = len(balance), c * m

    def rows(dr: np.ndarray, w: np.ndarray) -> np.ndarray:
        return np.asarray(dr - np.einsum("kab,bk->ak", D, dr - rho * w))

    def system(x: np.ndarray) -> np.ndarray:
        x = x.ravel()
        dr = x[:n].reshape(c, m)
        return np.concatenate(
            [rows(dr, act(dr) + V @ x[n:]).ravel(), np.einsum("ckp,ck->p", V, dr)]
        )

    near = _rough_inverse(level, at, V)
    count = [0]

    def counted(residual: float) -> None:
        count[0] += 1

    right = np.concatenate([(at.error[:, at.closed] - rows(0 * moved, moved)).ravel(), balance])
    x, _ = gmres(
        LinearOperator((n + p, n + p), matvec=system, dtype=float),
        right,
        rtol=rtol,
        restart=min(n + p, RESTART),
        maxiter=CYCLES,
        M=LinearOperator((n + p, n + p), matvec=near, dtype=float),
        callback=counted,
        callback_type="pr_norm",
    )
    return x[:n].reshape(c, m), x[n:], count[0]


def _rough_inverse(
    level: Level, at: Evaluation, V: np.ndarray
) -> Callable[[np.ndarray], np.ndarray]:
    """An approximate inverse of the system of `_unsymmetric`: first the normal forces, then those
    that hold or slip.

    With the derivative [[1, 0], [D_tn, D_tt]] of a contact, its tangential row is
    (I - D_tt) dr_t + D_tt rho w_t = right + D_tn (dr_n - rho w_n). For an eigenvalue d > 0 of D_tt
    it is

        (sigma + rho Q) dr = right / d,   sigma = (1 - d) / d,

    where sigma is zero for contacts that stick and grows with the slip, without bound on ever finer
    grids. The symbol of Q is inverted for a few shifts sigma, and each contact takes part in the
    two next to its own, in shares that sum to one. Beyond the last shift rho Q hardly matters.
    """
    c, m = V.shape[:2]
    D, rho, tangential = at.D, level.rho, level.components[1:]
    values, vectors = np.linalg.eigh(D[:, 1:, 1:])
    values = np.clip(values, 1e-12, 1.0)
    pressed = D[:, 0, 0] > 0
    shifts, shares = _shift_shares((1 - values) / values, rho * level.largest)

    def turned(weights: np.ndarray) -> np.ndarray:
        return np.einsum("kab,kb,kcb->kac", vectors, weights, vectors)

    parts_of = [
        (
            turned(np.sqrt(share)),
            turned(np.sqrt(share) / values),
            level.inverse_symbols(tangential, shift / rho),
        )
        for shift, share in zip(shifts, shares)
        if share.any()
    ]
    free = turned(1 - np.sum(shares, axis=0))

    def apply(x: np.ndarray) -> np.ndarray:
        parts = x.reshape(c, m)
        out = np.empty((c, m))
        out[:1] = np.where(
            pressed, level.rough_solve(parts[:1] * pressed / rho, at.closed, (0,)), parts[:1]
        )
        right = parts[1:] + np.einsum("ka,k->ak", D[:, 1:, 0], out[0] - parts[0])
        out[1:] = np.einsum("kab,bk->ak", free, right)
        for back, forth, symbols in parts_of:
            inner = level.rough_solve(
                np.einsum("kab,bk->ak", forth, right) / rho, at.closed, tangential, symbols
            )
            out[1:] += np.einsum("kab,bk->ak", back, inner)
        return out.ravel()

    W = V.reshape(c * m, -1)
    border = rho * np.einsum("kab,bkp->akp", D, V).reshape(c * m, -1)
    Y = np.stack([apply(column) for column in border.T], axis=1) if W.shape[1] else W
    K = np.linalg.pinv(W.T @ Y)

    def solve(x: np.ndarray) -> np.ndarray:
        x = x.ravel()
        y = apply(x[: c * m])
        lam = K @ (W.T @ y - x[c * m :])
        return np.concatenate([y - Y @ lam, lam])

    return solve


def _shift_shares(sigma: np.ndarray, largest: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Shifts from 0 to beyond `largest`, and the share (k, j) that each sigma (k, j) has in each of
    them.

    The shares are hat functions of log(FIRST_SHIFT + sigma); those of sigma beyond the last shift
    sum to less than one.
    """
    count = int(np.ceil(np.log(1 + largest / FIRST_SHIFT) / np.log(SHIFT_RATIO)))
    place = np.log1p(sigma / FIRST_SHIFT) / np.log(SHIFT_RATIO)
    shares = [np.maximum(0.0, 1 - np.abs(place - j)) for j in range(count + 1)]
    return FIRST_SHIFT * (SHIFT_RATIO ** np.arange(count + 1) - 1.0), shares
