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

import numpy as np

from contactopt.methods.constants import (
    BACKTRACK,
    BOUNDARY,
    CENTRAL,
    CENTRAL_KEPT,
    CORRECTED,
    FRICTIONLESS,
    INTERIOR_PROGRESS,
    INTERIOR_STEPS,
    LEAST_CENTERING,
    LEAST_SMOOTHING,
    MOST_CENTERING,
    MOST_SMOOTHING,
    PREDICTED,
    ROUGHEST,
    SHORT,
    STALLED,
    START,
    STUCK,
    STUCK_CENTERING,
)
from contactopt.methods.kernels.sparse_blocks import Blocks, Solver, bordered
from contactopt.methods.method import Iterate
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import coulomb_cone

NEAR = 1e-9  # complementarity and residual at which it ends
RIDGE = 1e-10  # added to the diagonal of the dimensionless Q, for directions without compliance
TINY = 1e-20  # added to |u_t|^2, whose root has no derivative at zero
BACKTRACKS = 30  # shortenings of a step, which leave a thousandth of it


@dataclass(frozen=True, eq=False)
class Path:
    """Which path to a solution is followed.

    On jammed packings many paths end early, and another one does not.

    full    |u_t| is linearised in every step, with shorter steps; else not after a step that had to
            be short
    smooth  |u_t| is replaced by (|u_t|^2 + (smooth z_n)^2)^1/2, which has no kink where a contact
            begins to slip the other way; its derivative by z_n is left out. The end of the path is
            a solution but for terms of order smooth^2
    first   r_n mu and z_n / mu of the first point, (2,) or one for every contact, (2, k)
    """

    full: bool = True
    smooth: float = 0.0
    first: np.ndarray = field(default_factory=lambda: np.full((2, 1), START))

    @classmethod
    def random(cls, rng: np.random.Generator, contacts: int) -> Path:
        """A path drawn at random."""
        size = START ** rng.uniform() * np.exp(rng.normal(size=(2, contacts)))
        smooth = np.exp(rng.uniform(*np.log((LEAST_SMOOTHING, MOST_SMOOTHING))))
        return cls(smooth=float(smooth), first=size)


class Lorentz:
    """A dimensionless problem in Lorentz's cones: r = scale x and z = scale (u + mu |u_t| n).

    matrix  its Q, ready for block systems
    scale   (k, d);  kept  mask (k, d) of what friction leaves free;  rough  (k,) contacts with
            friction
    """

    def __init__(self, problem: InterfaceProblem, matrix: Blocks):
        self.problem, self.matrix = problem, matrix
        self.scale, self.kept = np.ones(problem.q.shape), np.ones(problem.q.shape, dtype=bool)
        self.rough = problem.mu >= FRICTIONLESS
        self.scale[:, 0] = 1 / np.where(self.rough, np.minimum(problem.mu, ROUGHEST), 1.0)
        self.kept[~self.rough, 1:] = False

    def gap(self, x: np.ndarray, z: np.ndarray, lam: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """By how much z misses u (k, d) of the forces x and the multipliers, with slip (k,) added
        where there is friction.
        """
        r = (self.scale * x).ravel()
        u = (self.matrix.Q @ r + self.problem.V @ lam).reshape(x.shape) + self.problem.q
        gap = self.scale * u - z
        gap[self.rough, 0] += slip[self.rough]
        return np.where(self.kept, gap, 0.0)

    def unbalanced(self, x: np.ndarray) -> np.ndarray:
        """V' r + s (p,)."""
        return np.asarray(self.problem.V.T @ (self.scale * x).ravel() + self.problem.s)

    def answer(
        self, x: np.ndarray, z: np.ndarray, lam: np.ndarray, gap: np.ndarray
    ) -> tuple[Iterate, float]:
        """Forces in the cone and multipliers, and how far they are from a solution: the largest of
        the mean complementarity, the error of the law and that of the balance.
        """
        error = max(
            float(np.sum(x * z)) / len(x),
            float(np.linalg.norm(gap)) / np.sqrt(len(x)),
            float(np.abs(self.unbalanced(x)).max(initial=0.0)),
        )
        return (coulomb_cone(self.scale * x, self.problem.mu), lam), error

    def linearised(self, x: np.ndarray, z: np.ndarray, slopes: np.ndarray) -> System | None:
        """The factorised linear system at a point, where the slip falls with z by slopes (k, d);
        None if it is singular.
        """
        k, d = x.shape
        scale, scaling = self.scale, Scaling(x, z)
        shear = np.broadcast_to(np.eye(d), (k, d, d)).copy()
        shear[:, 0] -= slopes
        # The scaling gives dz = target - F dx. Put into the linearised z the system for dr is
        # (Q + shear F / scale^2) dr + V dlambda = right, with one block added per contact.
        added = (shear @ scaling.F) / (scale[:, :, None] * scale[:, None, :]) + RIDGE * np.eye(d)
        solve = self.matrix.factor(None, added, self.kept.ravel())
        return None if solve is None else System(self, scaling, shear, solve)


@dataclass(frozen=True, eq=False)
class System:
    """The linear system of one point: its scaling, the derivative `shear` (k, d, d) of z - slip n
    by z, and the factors.
    """

    cones: Lorentz
    scaling: Scaling
    shear: np.ndarray
    solve: Solver

    def direction(
        self, gap: np.ndarray, unbalanced: np.ndarray, target: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """dx, dz (k, d) and dlambda (p,) with F dx + dz = target and the linearised equations; None
        if there are none.
        """
        scale, kept = self.cones.scale, self.cones.kept
        V = self.cones.problem.V[kept.ravel()]
        right = ((times(self.shear, target) - gap) / scale).ravel()[kept.ravel()]
        answer = bordered(self.solve, right, V, V, -unbalanced)
        if answer is None:
            return None
        dr = np.zeros(kept.size)
        dr[kept.ravel()] = answer[0]
        dx = dr.reshape(kept.shape) / scale
        return dx, np.where(kept, target - times(self.scaling.F, dx), 0.0), answer[1]


def interior_iterates(
    problem: InterfaceProblem, matrix: Blocks, path: Path | None = None
) -> Iterator[tuple[Iterate, float]]:
    """Iterate the interior-point method on a dimensionless problem whose Q is `matrix`.

    Yields a point (r (k, dim), lambda (p,)) in the cones, and how far it is from a solution: the
    largest of the mean complementarity, the error of the law and that of the balance [-].
    """
    path, cones = path or Path(), Lorentz(problem, matrix)
    # The first point lies on the axes of both cones, so that it is in their middle.
    x, z, lam = np.zeros(problem.q.shape), np.zeros(problem.q.shape), np.zeros(len(problem.s))
    x[:, 0], z[:, 0] = path.first
    best, since, length = np.inf, 0, 1.0
    for _ in range(INTERIOR_STEPS):
        slip = np.sqrt(np.sum(z[:, 1:] ** 2, axis=1) + (path.smooth * z[:, 0]) ** 2 + TINY)
        gap = cones.gap(x, z, lam, slip)
        point, error = cones.answer(x, z, lam, gap)
        yield point, error
        since = 0 if error < INTERIOR_PROGRESS * best else since + 1
        best = min(best, error)
        if error < NEAR or since >= STALLED or not np.isfinite(error):
            return
        bent, slopes = path.full or length > STUCK, np.zeros_like(z)
        if bent:  # linearise |u_t| = |z_t|
            slopes[cones.rough, 1:] = (z[:, 1:] / slip[:, None])[cones.rough]
        system = cones.linearised(x, z, slopes)
        step = None if system is None else _centred_step(system, gap, bent)
        if system is None or step is None:
            return
        boundary = SHORT if path.full else BOUNDARY
        length = _way(system.scaling, step[0], step[1], boundary)
        x, z, lam = x + length * step[0], z + length * step[1], lam + length * step[2]


def _centred_step(
    system: System, gap: np.ndarray, bent: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Mehrotra's predictor and corrector with one factorisation."""
    scaling = system.scaling
    x, z, k = scaling.x, scaling.z, len(scaling.x)
    mean, unbalanced = float(np.sum(x * z)) / k, system.cones.unbalanced(x)
    # Predictor: the step towards complementarity zero, as far as it stays in the cones.
    first = system.direction(gap, unbalanced, -z)
    if first is None:
        return None
    length = min(1.0, PREDICTED * scaling.longest(first[0], first[1]))
    # The better the predictor, the less the next step is centred.
    ahead = float(np.sum((x + length * first[0]) * (z + length * first[1]))) / k
    least = LEAST_CENTERING if bent else STUCK_CENTERING
    centering = float(np.clip(np.clip(ahead / mean, 0.0, 1.0) ** 3, least, MOST_CENTERING))
    # Corrector: the same system with the centring and the second-order term of the predictor.
    second = scaling.corrector(first[0], first[1]) if length > CORRECTED else 0.0
    return system.direction(gap, unbalanced, centering * mean * scaling.inverse - z - second)


def _way(scaling: Scaling, dx: np.ndarray, dz: np.ndarray, boundary: float) -> float:
    """The length of a step: that share of the way to the boundary of the cones, shortened until no
    contact comes near it long before the others.
    """
    x, z, k = scaling.x, scaling.z, len(scaling.x)
    mean = float(np.sum(x * z)) / k
    length = min(1.0, boundary * scaling.longest(dx, dz))
    least = np.minimum(CENTRAL, CENTRAL_KEPT * scaling.centrality / mean)
    for _ in range(BACKTRACKS):
        ahead = x + length * dx, z + length * dz
        centrality = np.sqrt(np.maximum(det(ahead[0]) * det(ahead[1]), 0.0))
        if np.all(centrality >= least * np.sum(ahead[0] * ahead[1]) / k):
            break
        length *= BACKTRACK
    return length


class Scaling:
    """Nesterov and Todd's scaling of points x, z (k, d) inside Lorentz's cones: F = M M with M x =
    M^-1 z.
    """

    def __init__(self, x: np.ndarray, z: np.ndarray):
        d = x.shape[1]
        self.x, self.z, self.sign = x, z, np.where(np.arange(d) == 0, 1.0, -1.0)
        # Both points divided by the root of their determinant lie on the hyperboloid det = 1.
        det_x, det_z = det(x), det(z)
        unit_x, unit_z = x / np.sqrt(det_x)[:, None], z / np.sqrt(det_z)[:, None]
        # The scaling point w lies half-way between z and the inverse of x; F is the quadratic map
        # of w, times the ratio of sizes.
        w = unit_z + self.sign * unit_x
        w /= np.sqrt(2 * (1 + np.sum(unit_x * unit_z, axis=1)))[:, None]
        size = np.sqrt(det_z / det_x)[:, None, None]
        self.F = size * (2 * w[:, :, None] * w[:, None, :] - np.diag(self.sign))
        # M is the square root of F: the quadratic map of the root of w.
        half = w.copy()
        half[:, 0] += 1
        half /= np.sqrt(2 * half[:, 0])[:, None]
        self.M = np.sqrt(size) * (2 * half[:, :, None] * half[:, None, :] - np.diag(self.sign))
        turned = self.sign * half
        self.M_inverse = (
            2 * turned[:, :, None] * turned[:, None, :] - np.diag(self.sign)
        ) / np.sqrt(size)
        self.inverse = self.sign * x / det_x[:, None]  # of x in Jordan's algebra
        self.centrality = np.sqrt(det_x * det_z)

    def corrector(self, dx: np.ndarray, dz: np.ndarray) -> np.ndarray:
        """Mehrotra's second-order term of the predictor (dx, dz), in the units of z."""
        # In scaled variables x and z are one point c. With the product o of Jordan's algebra the
        # term y solves c o y = dx o dz.
        a, b, c = times(self.M, dx), times(self.M_inverse, dz), times(self.M, self.x)
        product = np.concatenate(
            [np.sum(a * b, axis=1)[:, None], a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:]], axis=1
        )
        # The product with c is an arrow matrix, which is solved by elimination.
        out = np.empty_like(product)
        out[:, 0] = (c[:, 0] * product[:, 0] - np.sum(c[:, 1:] * product[:, 1:], axis=1)) / det(c)
        out[:, 1:] = (product[:, 1:] - out[:, :1] * c[:, 1:]) / c[:, :1]
        return times(self.M, out)

    def longest(self, dx: np.ndarray, dz: np.ndarray) -> float:
        """The longest step that keeps both points in the cones."""
        return min(_longest(self.x, dx), _longest(self.z, dz))


def times(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.asarray((A @ x[:, :, None])[:, :, 0])


def det(x: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(x[:, 1:], axis=1)
    return np.asarray((x[:, 0] - length) * (x[:, 0] + length))


def _longest(x: np.ndarray, dx: np.ndarray) -> float:
    a, c = det(dx), np.maximum(det(x), 0.0)
    b = 2 * (x[:, 0] * dx[:, 0] - np.sum(x[:, 1:] * dx[:, 1:], axis=1))
    square = b * b - 4 * a * c
    root = -0.5 * (b + np.where(b >= 0, 1.0, -1.0) * np.sqrt(np.maximum(square, 0.0)))
    with np.errstate(all="ignore"):
        ends = np.stack([root / a, c / root])
    return float(
        np.where((ends > 0) & np.isfinite(ends) & (square >= 0), ends, np.inf).min(initial=np.inf)
    )
