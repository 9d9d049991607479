"""A path that turns back where it must, from a problem with one solution to Coulomb's problem.

In the cones and the scaling of contactopt.methods.kernels.interior, with x in the place of the
forces r, z in that of u + mu |u_t| n, and t from 1 to 0:

    z = u + (1 - t) mu slip(z) n + t c,    V' r + s = t b,    x o z = t m e at each contact,

where c and b are such that the first point solves it at t = 1. There it is a convex problem with
this solution alone. An interior-point method lowers t and ends where the path turns back, as it
does on jammed packings. Here the path is followed by its length, t rises where it has to, and the
end is a solution. slip is smooth inside the cones,

    slip(z)^2 = (1 - BEND^2) |z_t|^2 + BEND^2 z_n^2,

and the end solves Coulomb's problem as it is: where a contact sticks z = 0, where it slips z_n =
|z_t|, and where it is open u_n = z_n - slip(z) >= 0 as long as z_n >= |z_t|. Each step goes along
the tangent, and Newton steps across it lead back to the path; both come from one factorisation. The
sign of the determinant tells forward from backward: where it changes, t begins to rise or fall. The
path cannot come back to t = 1, where the first point is the only solution. As long as it stays
bounded it ends at t = 0, unless it has singular points, which almost every c avoids. That it stays
bounded is not proved here, and a step that is too long may land on another path. Lemke's method
follows such a path for polygonal cones. Source: Kellogg, Li, Yorke (1976), A constructive proof of
the Brouwer fixed-point theorem and computational results; Allgower, Georg (1990), Numerical
Continuation Methods, chapters 2 to 6; Acary, Cadoux, Lemarechal, Malick (2011) for existence.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from contactopt.linear.deadline import check_time
from contactopt.methods.kernels.interior import Lorentz, System, det
from contactopt.methods.kernels.sparse_blocks import Blocks
from contactopt.methods.method import Iterate
from contactopt.problem import InterfaceProblem

BEND = 0.5  # between 0, where slip has a kink at z_t = 0, and 1, where nothing is left of friction
# Newton steps, over the point: on the path, and beyond which a step along it was too long
NEAR, FAR = 0.4, 0.8
SLOW = 0.6  # a Newton step that is longer than this share of the last one does not converge
MOST = 6  # Newton steps back to the path
AIM = 0.25  # first Newton step that the length of the next step along the path aims at
# steps along the path, as the largest relative change of a contact
FIRST, LONGEST, SHORTEST = 0.3, 3.0, 1e-8
# largest growth of the step, the same after one that failed, and the cut then
GROWTH, AGAIN, CUT = 3.0, 1.5, 0.35
LEAST, SHRINK = 0.1, 0.7  # of t that one step leaves, and of a step that would leave the cones
SHARP = 1e-4  # step up to which a turn that is too sharp is taken for a step that was too long
TURN = 0.2  # least cosine between two tangents
END = 1e-9  # mean complementarity at which the path ends
START = 10.0  # size of the first point, over dimensionless forces of order one


class Point(NamedTuple):
    """x, z (k, d), lambda (p,) and t; or a change of them."""

    x: np.ndarray
    z: np.ndarray
    lam: np.ndarray
    t: float

    def times(self, factor: float) -> Point:
        """A multiple of a change."""
        return Point(factor * self.x, factor * self.z, factor * self.lam, factor * self.t)

    def plus(self, step: Point) -> Point:
        """This point after a change."""
        return Point(self.x + step.x, self.z + step.z, self.lam + step.lam, self.t + step.t)

    @property
    def inside(self) -> bool:
        """Whether x and z are inside the cones, and t is positive."""
        return self.t > 0 and all(
            bool(np.all(det(a) > 0) and np.all(a[:, 0] > 0)) for a in (self.x, self.z)
        )


Relative = tuple[np.ndarray, np.ndarray, float]


@dataclass(frozen=True, eq=False)
class Along:
    """The path near a point.

    point     at which the equations were linearised
    back      Newton's step to the path, across the tangent
    tangent   in the direction in which t grows
    system    the factorised system of the point
    mean      complementarity t m
    """

    point: Point
    back: Point
    tangent: Point
    system: System
    mean: float

    def relative(self, change: Point) -> Relative:
        """A change over the point, in Nesterov and Todd's scaling."""
        root, scaling = np.sqrt(self.mean), self.system.scaling
        x, z = scaling.scaled(change.x), scaling.unscaled(change.z)
        return x / root, z / root, change.t / self.point.t

    def size(self, change: Point) -> float:
        """The largest relative change of a contact."""
        x, z, t = self.relative(change)
        return float(np.sqrt(max(np.sum(x**2, axis=1).max(), np.sum(z**2, axis=1).max(), t**2)))

    def cosine(self, other: Point) -> float:
        """Of the angle between the tangent and another change."""
        a, b = self.relative(self.tangent), self.relative(other)
        return _inner(a, b) / np.sqrt(_inner(a, a) * _inner(b, b))

    def sign(self) -> float:
        """1 where t falls going forward, -1 where it rises: the sign of the determinant."""
        V, solve = self.system.cones.V, self.system.solve
        plates = np.sign(np.linalg.det(V.T @ solve(V))) if V.shape[1] else 1.0
        return solve.sign() * float(plates)


def _inner(a: Relative, b: Relative) -> float:
    return float(np.sum(a[0] * b[0]) + np.sum(a[1] * b[1]) + a[2] * b[2])


def _slip(z: np.ndarray) -> np.ndarray:
    square = (1 - BEND**2) * np.sum(z[:, 1:] ** 2, axis=1) + BEND**2 * z[:, 0] ** 2
    return np.asarray(np.sqrt(square))


class Homotopy:
    """The path through a first point (x, z, 0, 1) with x o z = m e; sizes (k,) of its x."""

    def __init__(self, problem: InterfaceProblem, matrix: Blocks, sizes: np.ndarray):
        self.cones, self.m = Lorentz(problem, matrix), START**2
        x, z, lam = np.zeros(problem.q.shape), np.zeros(problem.q.shape), np.zeros(len(problem.s))
        x[:, 0], z[:, 0] = sizes, self.m / sizes
        self.first = Point(x, z, lam, 1.0)
        self.c = -self.cones.gap(x, z, lam, np.zeros(len(x)))
        self.b = self.cones.unbalanced(x)

    def along(self, point: Point) -> Along | None:
        """The path near a point; None where the linear system is singular."""
        x, z, lam, t = point
        slip, mean, cones = _slip(z), t * self.m, self.cones
        gap = cones.gap(x, z, lam, (1 - t) * slip) + t * self.c
        ahead = self.c.copy()  # derivative of gap by t
        ahead[cones.rough, 0] -= slip[cones.rough]
        slopes = np.concatenate([BEND**2 * z[:, :1], (1 - BEND**2) * z[:, 1:]], axis=1)
        slopes *= (np.where(cones.rough, 1 - t, 0.0) / slip)[:, None]
        system = cones.linearised(x, z, slopes)
        if system is None:
            return None
        inverse = system.scaling.inverse
        newton = system.direction(gap, cones.unbalanced(x) - t * self.b, mean * inverse - z)
        tangent = system.direction(ahead, -self.b, self.m * inverse)
        if newton is None or tangent is None:
            return None
        step, way = Point(*newton, 0.0), Point(*tangent, 1.0)
        found = Along(point, step, way, system, mean)
        a, b = found.relative(step), found.relative(way)
        return replace(found, back=step.plus(way.times(-_inner(a, b) / _inner(b, b))))

    def answer(self, point: Point) -> tuple[Iterate, float]:
        """The forces and multipliers of a point, and how far they are from a solution."""
        x, z, lam, _ = point
        return self.cones.answer(x, z, lam, self.cones.gap(x, z, lam, _slip(z)))


def homotopy_iterates(
    problem: InterfaceProblem, matrix: Blocks, steps: int, random: np.random.Generator | None = None
) -> Iterator[tuple[Iterate, float]]:
    """Points (r (k, dim), lambda (p,)) of a dimensionless problem and how far each is from a
    solution: one at each new half of t, until the path ends or so many `steps` are factorised.
    `random` draws another first point, of another path.
    """
    spread = np.zeros(problem.contacts) if random is None else random.normal(size=problem.contacts)
    path = Homotopy(problem, matrix, START * np.exp(spread))
    best, length = 2.0, FIRST
    left = steps
    here = path.along(path.first)
    if here is None:
        return
    start, forward = here.sign(), -1.0
    while True:
        if here.point.t <= best / 2:
            best = here.point.t
            yield path.answer(here.point)
        if best * path.m < END:
            return
        way = here.tangent.times(forward / here.size(here.tangent))
        failed = False
        while True:  # shorter steps until one leads to the path ahead
            length, ahead = _inside(here, way, length)
            found, used, first = _corrected(path, ahead, left)
            left -= used
            if left <= 0:
                return
            if found is not None:
                forward = -1.0 if found.sign() == start else 1.0
                if forward * found.cosine(way) > TURN or length < SHARP:
                    break
            length, failed = CUT * length, True
            if length < SHORTEST:
                return
        here = found
        length *= float(np.clip(np.sqrt(AIM / max(first, 1e-3)), 0.5, AGAIN if failed else GROWTH))
        length = min(length, LONGEST)


def _inside(here: Along, way: Point, length: float) -> tuple[float, Point]:
    """The longest step up to `length` along the way that stays inside the cones, and its end."""
    while True:
        ahead = here.point.plus(here.back).plus(way.times(length))
        if (ahead.inside and ahead.t > LEAST * here.point.t) or length < SHORTEST:
            return length, ahead
        length *= SHRINK


def _corrected(path: Homotopy, point: Point, left: int) -> tuple[Along | None, int, float]:
    """Newton's steps back to the path: the end or None, their number, the size of the first."""
    last, first = np.inf, 0.0
    for used in range(1, min(MOST, left) + 1):
        check_time()
        found = path.along(point) if point.inside else None
        if found is None:
            return None, used, first
        size = found.size(found.back)
        if used == 1:
            first = size
        if not size < (FAR if used == 1 else SLOW * last):
            return None, used, first
        if size <= NEAR:
            return found, used, first
        fraction = min(1.0, 0.9 * found.system.scaling.longest(found.back.x, found.back.z))
        point, last = point.plus(found.back.times(fraction)), size
    return None, MOST, first
