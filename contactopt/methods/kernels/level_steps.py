"""Newton's steps on one grid of contacts, whose Q is a convolution
(contactopt.methods.kernels.levels).

A step solves (I - D) dr + D rho (Q dr + V dlambda) = error, V' dr = -balance on the contacts with D
!= 0; all others have dr = error. Products with Q are taken in single precision. Where every closed
contact has D = I the system is symmetric and solved by projected PCG, otherwise by GMRES, whose
residual is that of Newton's equations. Both are preconditioned by the inverse of the symbol of Q on
the grid without padding, restricted to the contacts that are closed and to the directions that are
held.
"""

import logging
from collections.abc import Callable

import numpy as np

from contactopt.linear.flexible_gmres import flexible_gmres
from contactopt.linear.stacked import norm
from contactopt.methods import constants
from contactopt.methods.constants import FIRST_SHIFT, SHIFT_RATIO
from contactopt.methods.kernels.elimination import eliminated
from contactopt.methods.kernels.levels import Evaluation, Level, Point
from contactopt.methods.kernels.linearised import Border
from contactopt.methods.kernels.newton_loop import Forcing, Unknowns

logger = logging.getLogger(__name__)

ENOUGH = 0.5  # of what is enough that a step aims at, for linear systems are not solved in its norm

Act = Callable[[np.ndarray], np.ndarray]


class GridSteps:
    """Newton's method on one grid, until the residual is `enough` of the forces, which count as
    `least` at least. Where it does not fall, the contacts to blame are solved by themselves.
    """

    def __init__(self, level: Level, enough: float, least: float = 0.0):
        self.level, self.enough, self.least = level, enough, least
        loosest = constants.LOOSEST
        self.accuracy = Forcing(loosest, loosest, constants.TIGHTEST, constants.GRID_ORDER)

    def near(self, r: np.ndarray) -> float:
        """The residual that is enough at forces r."""
        return self.enough * max(self.least, float(np.linalg.norm(r)))

    def evaluate(self, point: Unknowns) -> Evaluation:
        at = self.level.evaluate(*point)
        some = at.residual > constants.SLOW * self.accuracy.last
        return eliminated(self.level, at) if some and at.residual > self.near(point[0]) else at

    def change(self, at: Evaluation) -> Point:
        worth, near = self.accuracy(at.residual), self.near(at.point[0])
        if at.residual > near:
            worth = max(worth, min(ENOUGH * near / at.residual, constants.LOOSEST))
        known = at.error.copy()
        known[:, at.closed] = 0.0
        balance = -at.balance - np.einsum("ckp,ck->p", self.level.V, known)
        identity = np.array_equal(at.D, np.broadcast_to(np.eye(len(known)), at.D.shape))
        solve = _symmetric if identity else _unsymmetric
        dr, lam, count = solve(self.level, at, known, balance, worth)
        known[:, at.closed] = dr
        told = self.level.kernel.grid, len(at.closed), count, at.residual
        logger.info("grid %s: %d closed, %d iterations from residual %.1e", *told)
        return known, lam


def _act(level: Level, at: Evaluation) -> Callable[..., np.ndarray]:
    """Products (c, m) with Q on the closed contacts, in single precision."""

    def act(x: np.ndarray, others: np.ndarray | None = None) -> np.ndarray:
        full = np.zeros(at.error.shape, np.float32) if others is None else others.astype(np.float32)
        full[:, at.closed] = x
        if others is not None and not np.any(full):
            return np.zeros(x.shape)
        return level.product(full, single=True)[:, at.closed]

    return act


def _symmetric(
    level: Level, at: Evaluation, known: np.ndarray, balance: np.ndarray, rtol: float
) -> tuple[np.ndarray, np.ndarray, int]:
    """Q dr + V dlambda = error / rho - Q known, V' dr = balance on closed contacts, by PCG."""
    (c, m), act = (len(known), len(at.closed)), _act(level, at)
    # W holds the columns of the balance; N is the rough inverse, normal and tangential components
    # by themselves.
    W = level.V[:, at.closed].reshape(c * m, len(balance))

    def near(x: np.ndarray) -> np.ndarray:
        parts = x.reshape(c, m)
        out = [level.rough_solve(parts[:1], at.closed, level.components[:1], level.inverse)]
        if c > 1:
            tangential = level.components[1:]
            out.append(level.rough_solve(parts[1:], at.closed, tangential, level.inverse))
        return np.concatenate(out).astype(float).ravel()

    # The start meets the balance W'x; all corrections keep it.
    border = Border(near, W, W)
    x = border.Y @ (border.K @ balance)
    residual = (at.error[:, at.closed] / level.rho - act(x.reshape(c, m), known)).ravel()
    # Conjugate gradients among the x that meet the balance, until residual' N residual has fallen
    # enough.
    z = border.off(near(residual))
    gamma = float(residual @ z)
    aim, p, count = rtol**2 * abs(gamma), z, 0
    while count < 100 and gamma > aim:  # of PCG
        product = act(p.reshape(c, m)).ravel().astype(float)
        work = float(p @ product)
        if not work > 0:  # forces that move nothing
            break
        alpha = gamma / work
        x = x + alpha * p
        residual = residual - alpha * product
        z = border.off(near(residual))
        new = float(residual @ z)
        p, gamma, count = z + (new / gamma) * p, new, count + 1
    # What is left of the residual is W lambda; least squares in the norm of N give lambda.
    return x.reshape(c, m), np.asarray(border.K @ (border.Y.T @ residual)), count


def _unsymmetric(
    level: Level, at: Evaluation, known: np.ndarray, balance: np.ndarray, rtol: float
) -> tuple[np.ndarray, np.ndarray, int]:
    """(I - D) dr + D rho (Q dr + V dlambda) = error - D rho Q known, V' dr = balance, by GMRES."""
    (c, m), act, V = (len(known), len(at.closed)), _act(level, at), level.V[:, at.closed]
    n, p, used = c * m, len(balance), 0
    D = np.ascontiguousarray(at.D.transpose(1, 2, 0))

    def rows(dr: np.ndarray, w: np.ndarray) -> np.ndarray:
        return np.asarray(dr - np.einsum("abk,bk->ak", D, dr - level.rho * w))

    def system(x: np.ndarray, others: np.ndarray | None = None) -> np.ndarray:
        nonlocal used
        used += 1
        dr = np.asarray(x[:n], float).reshape(c, m)
        left = rows(dr, act(dr, others) + V @ x[n:]).ravel()
        return np.concatenate([left, np.einsum("ckp,ck->p", V, dr)])

    DrhoV = level.rho * np.einsum("kab,bkp->akp", at.D, V).reshape(n, p)
    border = Border(_rough_inverse(level, at), DrhoV, V.reshape(n, p))
    right = np.concatenate([at.error[:, at.closed].ravel(), balance])
    x, rest = 0 * right, right
    if np.any(known):  # one product for the known changes and a first guess of the others
        x = border.solve(right)
        rest = right - system(x, known)
    goal = rtol * norm(right) / (norm(rest) or 1.0)
    if goal < 1:
        x = x + flexible_gmres(system, border.solve, rest, np.ones(len(right)), goal)
    return x[:n].reshape(c, m), x[n:], used


def _rough_inverse(level: Level, at: Evaluation) -> Act:
    """An approximate inverse of the system of `_unsymmetric` without its border, on arrays (c m,):
    first the normal forces, then those that hold or slip.

    With the derivative [[1, 0], [D_tn, D_tt]] of a contact, its tangential row is
    (I - D_tt) dr_t + D_tt rho w_t = right + D_tn (dr_n - rho w_n). For an eigenvalue d > 0 of D_tt
    it is

        (sigma + rho Q) dr = right / d,   sigma = (1 - d) / d,

    where sigma is zero for contacts that stick and grows with the slip, without bound on ever finer
    grids. The symbol of Q is inverted for a few shifts sigma, and each contact takes part in the
    two next to its own, in shares that sum to one. Beyond the last shift rho Q hardly matters.
    """
    D, rho, tangential = at.D, level.rho, level.components[1:]
    shape = at.D.shape[1], len(at.closed)
    values, vectors = np.linalg.eigh(D[:, 1:, 1:])
    values = np.clip(values, 1e-12, 1.0)
    pressed = D[:, 0, 0] > 0
    shifts, shares = _shift_shares((1 - values) / values, rho * level.largest)

    def turned(weights: np.ndarray) -> np.ndarray:
        matrices = np.einsum("kab,kb,kcb->ack", vectors, weights, vectors)
        return np.ascontiguousarray(matrices, np.float32)

    parts_of = [
        (
            turned(np.sqrt(share)),
            turned(np.sqrt(share) / values / rho),
            level.inverse_symbols(tangential, shift / rho),
        )
        for shift, share in zip(shifts, shares)
        if share.any()
    ]
    free = turned(1 - np.sum(shares, axis=0))

    def apply(x: np.ndarray) -> np.ndarray:
        parts, out = x.reshape(shape), np.empty(shape)
        normal = level.rough_solve(parts[:1] * pressed / rho, at.closed, (0,), level.inverse)
        out[:1] = np.where(pressed, normal, parts[:1])
        right = parts[1:] + np.einsum("ka,k->ak", D[:, 1:, 0], out[0] - parts[0])
        out[1:] = np.einsum("abk,bk->ak", free, right)
        for back, forth, symbols in parts_of:
            force = np.einsum("abk,bk->ak", forth, right)
            inner = level.rough_solve(force, at.closed, tangential, symbols)
            out[1:] += np.einsum("abk,bk->ak", back, inner)
        return out.ravel()

    return apply


def _shift_shares(sigma: np.ndarray, largest: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Shifts up to `largest`, and the share (k, j) of each sigma in each: hats of its logarithm."""
    count = int(np.ceil(np.log(1 + largest / FIRST_SHIFT) / np.log(SHIFT_RATIO)))
    place = np.log1p(sigma / FIRST_SHIFT) / np.log(SHIFT_RATIO)
    shares = [np.maximum(0.0, 1 - np.abs(place - j)) for j in range(count + 1)]
    return FIRST_SHIFT * (SHIFT_RATIO ** np.arange(count + 1) - 1.0), shares
