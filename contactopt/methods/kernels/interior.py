"""An interior-point method for Coulomb friction, on a symmetric or unsymmetric Q, sparse or an
array.

With the cones K of forces and K* dual to them, De Saxce's form of Coulomb's law is
    r in K,   z = u + mu |u_t| n in K*,   r' z = 0  at each contact,   u = Q r + V lambda + q,   V'
              r + s = 0.
In x = (mu r_n, r_t) and (z_n / mu, z_t) both cones are Lorentz's. Each iteration is one Newton step
on z = u + mu |u_t| n with |u_t| linearised (where that led to a short step: as it is), the balance,
and x o z = sigma (x'z / k) e in the scaling of Nesterov and Todd, predictor and corrector from one
factorisation of Q + blocks, whose pattern is that of Q. It tells open, sticking and slipping
contacts apart in few iterations where Newton's method cycles, and the null space of Q does not
disturb it; the last digits are left to Newton's method. For Coulomb's law it is a method without a
proof of convergence; it ends when it makes no progress. Source: Acary, Armand, Nguyen, Shpakovych
(2024), Second-order cone programming for frictional contact mechanics using interior point
algorithm; Nesterov, Todd (1997); Mehrotra (1992) for the corrector.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import sqrt

import numpy as np

from contactopt.methods import constants
from contactopt.methods.kernels.semismooth import RIDGE
from contactopt.methods.kernels.sparse_blocks import Blocks, Solver, bordered
from contactopt.methods.method import Iterate
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import coulomb_cone, lengths

NEAR = 1e-9  # complementarity and residual at which it ends
TINY = 1e-20  # added to |u_t|^2, whose root has no derivative at zero


@dataclass(frozen=True, eq=False)
class Path:
    """Which path to a solution is followed; on jammed packings many end early.

    full    |u_t| is linearised in every step; else not after a step that had to be short
    smooth  |u_t| becomes (|u_t|^2 + (smooth z_n)^2)^1/2, without a kink where slip turns round; the
            end is a solution up to terms of order smooth^2
    first   r_n mu and z_n / mu of the first point, (2,) or (2, k)
    """

    full: bool = True
    smooth: float = 0.0
    first: np.ndarray = field(default_factory=lambda: np.full((2, 1), constants.START))

    @classmethod
    def random(cls, rng: np.random.Generator, contacts: int) -> Path:
        """A path drawn at random."""
        size = constants.START ** rng.uniform() * np.exp(rng.normal(size=(2, contacts)))
        smooth = np.exp(rng.uniform(*np.log((constants.LEAST_SMOOTHING, constants.MOST_SMOOTHING))))
        return cls(smooth=float(smooth), first=size)


class Lorentz:
    """A dimensionless problem in Lorentz's cones: r = scale x and z = scale (u + mu |u_t| n).

    matrix  its Q, ready for block systems
    scale   (k, d);  kept  mask (k, d) of what friction leaves free;  rough  (k,) contacts with
            friction
    V       rows of the problem's V that are kept
    """

    def __init__(self, problem: InterfaceProblem, matrix: Blocks):
        self.problem, self.matrix = problem, matrix
        self.scale, self.kept = np.ones(problem.q.shape), np.ones(problem.q.shape, dtype=bool)
        self.rough = problem.mu >= constants.FRICTIONLESS
        self.scale[:, 0] = 1 / np.where(self.rough, np.minimum(problem.mu, constants.ROUGHEST), 1.0)
        self.kept[~self.rough, 1:] = False
        self.V = problem.V[self.kept.ravel()]
        self.square = self.scale[:, :, None] * self.scale[:, None, :]

    def gap(self, x: np.ndarray, z: np.ndarray, lam: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """By how much z misses u of x and lam (k, d), plus slip (k,) where there is friction."""
        r = (self.scale * x).ravel()
        u = self.problem.q + (self.matrix.Q @ r + self.problem.V @ lam).reshape(x.shape)
        gap = self.scale * u - z
        gap[self.rough, 0] += slip[self.rough]
        return np.where(self.kept, gap, 0.0)

    def unbalanced(self, x: np.ndarray) -> np.ndarray:
        """V' r + s (p,)."""
        return np.asarray(self.problem.V.T @ (self.scale * x).ravel() + self.problem.s)

    def answer(
        self, x: np.ndarray, z: np.ndarray, lam: np.ndarray, gap: np.ndarray
    ) -> tuple[Iterate, float]:
        """Forces in the cone, multipliers, and their error (`interior_iterates`)."""
        error = max(
            float(np.vdot(x, z)) / len(x),
            sqrt(np.vdot(gap, gap) / len(x)),
            float(np.abs(self.unbalanced(x)).max(initial=0.0)),
        )
        return (coulomb_cone(self.scale * x, self.problem.mu), lam), error

    def linearised(self, x: np.ndarray, z: np.ndarray, slopes: np.ndarray) -> System | None:
        """The factorised system at a point, with slopes (k, d) of the slip by z, or None."""
        scaling = Scaling(x, z)
        # The scaling gives dz = target - F dx, and z - slip n changes by S dz, S = I - n slopes'.
        # Put into the linearised z the system for dr is (Q + S F / scale^2) dr + V dlambda = right,
        # with one block added per contact.
        added = scaling.F.copy()
        added[:, 0] -= np.einsum("ki,kij->kj", slopes, added)
        added /= self.square
        added += RIDGE * np.eye(x.shape[1])
        solve = self.matrix.factor(None, added, self.kept.ravel())
        return None if solve is None else System(self, scaling, slopes, solve)


@dataclass(frozen=True, eq=False)
class System:
    """The linear system of one point: its scaling, slopes (k, d) of the slip by z, and factors."""

    cones: Lorentz
    scaling: Scaling
    slopes: np.ndarray
    solve: Solver

    def direction(
        self, gap: np.ndarray, unbalanced: np.ndarray, target: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """dx, dz (k, d), dlambda (p,) with F dx + dz = target; None if there are none."""
        scale, kept, V = self.cones.scale, self.cones.kept, self.cones.V
        right = target - gap
        right[:, 0] -= np.vecdot(self.slopes, target)
        right = (right / scale).ravel()[kept.ravel()]
        answer = bordered(self.solve, right, V, V, -unbalanced)
        if answer is None:
            return None
        dr = np.zeros(kept.size)
        dr[kept.ravel()] = answer[0]
        dx = dr.reshape(kept.shape) / scale
        dz = target - np.einsum("kij,kj->ki", self.scaling.F, dx)
        return dx, np.where(kept, dz, 0.0), answer[1]


def interior_iterates(
    problem: InterfaceProblem, matrix: Blocks, path: Path | None = None
) -> Iterator[tuple[Iterate, float]]:
    """Points in the cones, and the largest of complementarity and errors of law and balance [-]."""
    path, cones = path or Path(), Lorentz(problem, matrix)
    # The first point lies on the axes of both cones, so that it is in their middle.
    x, z, lam = np.zeros(problem.q.shape), np.zeros(problem.q.shape), np.zeros(len(problem.s))
    x[:, 0], z[:, 0] = path.first
    best, since, length = np.inf, 0, 1.0
    for _ in range(constants.INTERIOR_STEPS):
        slip = np.sqrt(np.vecdot(z[:, 1:], z[:, 1:]) + (path.smooth * z[:, 0]) ** 2 + TINY)
        gap = cones.gap(x, z, lam, slip)
        point, error = cones.answer(x, z, lam, gap)
        yield point, error
        since = 0 if error < constants.PROGRESS * best else since + 1
        best = min(best, error)
        if error < NEAR or since >= constants.STALLED or not np.isfinite(error):
            return
        bent, slopes = path.full or length > constants.STUCK, np.zeros_like(z)
        if bent:  # linearise |u_t| = |z_t|
            slopes[cones.rough, 1:] = (z[:, 1:] / slip[:, None])[cones.rough]
        system = cones.linearised(x, z, slopes)
        step = None if system is None else _centred_step(system, gap, bent)
        if system is None or step is None:
            return
        boundary = constants.SHORT if path.full else constants.BOUNDARY
        length = _way(system.scaling, step[0], step[1], boundary)
        x, z, lam = x + length * step[0], z + length * step[1], lam + length * step[2]


def _centred_step(
    system: System, gap: np.ndarray, bent: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Mehrotra's predictor and corrector with one factorisation."""
    scaling = system.scaling
    x, z, k = scaling.x, scaling.z, len(scaling.x)
    mean, unbalanced = float(np.vdot(x, z)) / k, system.cones.unbalanced(x)
    # Predictor: the step towards complementarity zero, as far as it stays in the cones.
    first = system.direction(gap, unbalanced, -z)
    if first is None:
        return None
    length = min(1.0, constants.PREDICTED * scaling.longest(first[0], first[1]))
    # The better the predictor, the less the next step is centred.
    ahead = float(np.vdot(x + length * first[0], z + length * first[1])) / k
    least = constants.LEAST_CENTERING if bent else constants.STUCK_CENTERING
    centering = min(max(min(max(ahead / mean, 0.0), 1.0) ** 3, least), constants.MOST_CENTERING)
    # Corrector: the same system with the centring and the second-order term of the predictor.
    second = scaling.corrector(first[0], first[1]) if length > constants.CORRECTED else 0.0
    return system.direction(gap, unbalanced, centering * mean * scaling.inverse - z - second)


def _way(scaling: Scaling, dx: np.ndarray, dz: np.ndarray, boundary: float) -> float:
    """That share of the way to the boundary of the cones, less if a contact comes near it early."""
    x, z, k = scaling.x, scaling.z, len(scaling.x)
    mean = float(np.vdot(x, z)) / k
    length = min(1.0, boundary * scaling.longest(dx, dz))
    least = np.minimum(constants.CENTRAL, constants.CENTRAL_KEPT * scaling.centrality / mean)
    for _ in range(30):  # shortenings of a step, which leave a thousandth of it
        ahead = x + length * dx, z + length * dz
        centrality = np.sqrt(np.maximum(det(ahead[0]) * det(ahead[1]), 0.0))
        if np.all(centrality >= least * np.vdot(*ahead) / k):
            break
        length *= constants.BACKTRACK
    return length


class Scaling:
    """Nesterov and Todd's scaling F = M M of points inside Lorentz's cones, M x = M^-1 z (k, d)."""

    def __init__(self, x: np.ndarray, z: np.ndarray):
        d = x.shape[1]
        self.x, self.z, self.sign = x, z, np.where(np.arange(d) == 0, 1.0, -1.0)
        # Both points divided by the root of their determinant lie on the hyperboloid det = 1.
        det_x, root_z = det(x), np.sqrt(det(z))
        root_x = np.sqrt(det_x)
        unit_x, unit_z = x / root_x[:, None], z / root_z[:, None]
        # The scaling point w lies half-way between z and the inverse of x; F is the quadratic map
        # of w, times the ratio of sizes.
        w = unit_z + self.sign * unit_x
        w /= np.sqrt(2 * (1 + np.vecdot(unit_x, unit_z)))[:, None]
        size = root_z / root_x
        self.F = (2 * size[:, None] * w)[:, :, None] * w[:, None, :]
        self.F.reshape(len(x), d * d)[:, :: d + 1] -= size[:, None] * self.sign
        # M is the square root of F: the quadratic map of the root of w.
        w[:, 0] += 1
        self.half, self.root = w / np.sqrt(2 * w[:, 0])[:, None], np.sqrt(size)[:, None]
        self.inverse = self.sign * x / det_x[:, None]  # of x in Jordan's algebra
        self.centrality = root_x * root_z

    def scaled(self, dx: np.ndarray) -> np.ndarray:
        """M dx (k, d), in the variables in which x and z are one point."""
        turned = 2 * self.half * np.vecdot(self.half, dx)[:, None] - self.sign * dx
        return np.asarray(self.root * turned)

    def unscaled(self, dz: np.ndarray) -> np.ndarray:
        """M^-1 dz (k, d), in the same variables."""
        half = self.sign * self.half
        return np.asarray((2 * half * np.vecdot(half, dz)[:, None] - self.sign * dz) / self.root)

    def corrector(self, dx: np.ndarray, dz: np.ndarray) -> np.ndarray:
        """Mehrotra's second-order term of the predictor (dx, dz), in the units of z."""
        # In scaled variables x and z are one point c. With the product o of Jordan's algebra the
        # term y solves c o y = dx o dz.
        a, b, c = self.scaled(dx), self.unscaled(dz), self.scaled(self.x)
        product = a[:, :1] * b + b[:, :1] * a
        product[:, 0] = np.vecdot(a, b)
        # The product with c is an arrow matrix, which is solved by elimination.
        out = np.empty_like(product)
        out[:, 0] = np.vecdot(self.sign * c, product) / det(c)
        out[:, 1:] = (product[:, 1:] - out[:, :1] * c[:, 1:]) / c[:, :1]
        return self.scaled(out)

    def longest(self, dx: np.ndarray, dz: np.ndarray) -> float:
        """The longest step that keeps both points in the cones."""
        return _longest(np.concatenate([self.x, self.z]), np.concatenate([dx, dz]))


def det(x: np.ndarray) -> np.ndarray:
    """Determinants (k,) x_n^2 - |x_t|^2 of points in Jordan's algebra."""
    length = lengths(x[:, 1:])
    return np.asarray((x[:, 0] - length) * (x[:, 0] + length))


def _longest(x: np.ndarray, dx: np.ndarray) -> float:
    a, c = det(dx), np.maximum(det(x), 0.0)
    b = 2 * x[:, 0] * dx[:, 0] - 2 * np.vecdot(x[:, 1:], dx[:, 1:])
    square = b * b - 4 * a * c
    root = -0.5 * (b + np.copysign(np.sqrt(np.maximum(square, 0.0)), b))
    with np.errstate(all="ignore"):
        ends = np.concatenate([root / a, c / root])
    ends = ends[(ends > 0) & np.isfinite(ends) & np.tile(square >= 0, 2)]
    return float(ends.min(initial=np.inf))
