"""Every solution of a small problem, or a proof that there is none: a tree over the states of its
contacts.

The tree begins with the linear inequalities that every solution obeys: u_n >= 0, friction in its
cone (in space, in the octagon around it), and the balance. Each branch adds what one more state
means, first where forces and displacements are furthest from the law:
    plane   u_n = 0 or r = 0;  u_t <= 0 or r_t = -mu r_n;  u_t >= 0 or r_t = mu r_n
    space   u_n = 0 or r = 0;  then stick, u_t = 0, or slip in one of four arcs of directions, which
            are halved up to HALVED times: u_t and -r_t lie between the ends of the arc, and r_t
            between its chord and its tangents
With unknowns x = (r, lambda), every condition is that some value a'x + b is zero or not negative. A
branch ends where its conditions contradict each other: some combination of them has no x in it, no
negative weight at a value that may be positive, and a negative constant. This is computed again
from a and b. When all branches have ended so, no solution exists. Feasible points come from the
dual simplex method without costs; each branch goes on from the tableau of the one before.

Nothing is asked of Q: it may be unsymmetric, singular or indefinite. The number of branches grows
exponentially with the contacts in the worst case. In the plane every solution is found.

Source: Farkas' lemma; Al-Khayyal (1987), An implicit enumeration procedure for the general linear
complementarity problem.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from contactopt.defaults import EQUAL
from contactopt.linear.deadline import check_time
from contactopt.linear.operators import has_entries
from contactopt.problem import Infeasible, InterfaceProblem
from contactopt.problem.feasibility import MARGIN

EXACT = 1e-10  # relative size of what rounding leaves of a zero in a contradiction
BRANCH = 3e5  # entries that pivots change in the time that the rest of a branch takes
SAME = 1e-7  # relative size of what counts as zero when a point is given its states
HALVED = 4  # how often an arc of 90 degrees is halved
FREE, SHUT, DECIDED, SLIPPING = range(4)  # what a branch says of a contact in space
SENTENCE = (
    "whichever contacts are open, stick or slip, their forces and displacements contradict each"
    " other, so there is no solution; check the friction coefficients, the gaps and the supports."
)
Point = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass
class _Branch:
    """Values A x + b, which of them are zero, and the tableau value[basic] = T[:, -1] - T[:, :-1]
    value[other].

    sides  (3 k, 2) in the plane: which sides of the pairs u_n r_n, (u_t >= 0, r_t + mu r_n),
           (mu r_n - r_t, u_t <= 0) are zero
    state  (k,) and arc (k, 2) [rad], in space
    """

    A: np.ndarray
    b: np.ndarray
    zero: np.ndarray
    T: np.ndarray
    basic: np.ndarray
    other: np.ndarray
    sides: np.ndarray
    state: np.ndarray
    arc: np.ndarray
    pivots: int = 0

    def child(self, zero: list[int] | None = None) -> _Branch:
        """A branch of its own, in which these values are zero as well."""
        own = ("zero", "T", "basic", "other", "sides", "state", "arc")
        other = replace(self, **{name: getattr(self, name).copy() for name in own})
        other.zero[zero or []] = True
        return other

    def add(self, a: np.ndarray, b: np.ndarray, zero: bool = False) -> None:
        """Add values a x + b that are not negative, or zero."""
        part = _solved(self.A[self.other], a)
        self.T = np.vstack([self.T, np.hstack([-part, (b - part @ self.b[self.other])[:, None]])])
        self.basic = np.append(self.basic, len(self.b) + np.arange(len(a)))
        self.A, self.b = np.vstack([self.A, a]), np.append(self.b, b)
        self.zero = np.append(self.zero, np.full(len(a), zero))

    def remake(self) -> None:
        """Compute the tableau again from A and b."""
        part = _solved(self.A[self.other], self.A[self.basic])
        right = self.b[self.basic] - part @ self.b[self.other]
        self.T, self.pivots = np.hstack([-part, right[:, None]]), 0

    def pivot(self, i: int, j: int) -> None:
        T, value = self.T, self.T[i, j]
        row, column = T[i] / value, T[:, j].copy()
        row[j] = 1.0 / value
        column[i] = 0.0
        T[:, j] = 0.0
        T[i] = 0.0
        T -= np.outer(column, row)
        T[i] = row
        self.basic[i], self.other[j] = self.other[j], self.basic[i]
        self.pivots += 1

    def x(self) -> np.ndarray:
        return np.linalg.lstsq(self.A[self.other], -self.b[self.other], rcond=None)[0]


def _solved(A: np.ndarray, a: np.ndarray) -> np.ndarray:
    """y with y A = a."""
    return np.linalg.lstsq(A.T, a.T, rcond=None)[0].T


class StateTree:
    """The tree of a dimensionless problem of Coulomb's law whose Q is an array.

    done      whether all branches have been looked at
    branches  how many of them so far;   work  entries of tableaus that pivots have changed, with
              BRANCH for each branch
    """

    def __init__(self, problem: InterfaceProblem):
        self.problem, self.branches, self.done, self.least = problem, 0, False, np.inf
        self.work = 0.0
        (k, dim), p, mu = problem.q.shape, len(problem.s), problem.mu
        self.n = n = k * dim
        self.unit, self.K = np.eye(n + p), np.hstack([problem.Q, problem.V])
        self.rough = np.flatnonzero(mu > 0)
        normal = self.unit[:n:dim]
        bound, start = mu[:, None] * normal, self.unit.copy()
        edges = [bound - self.unit[1:n:2]] if dim == 2 else _octagon(bound, *self._tangential())
        for c in range(1, dim):
            part = self.unit[c:n:dim]
            start[c:n:dim] = np.where(mu[:, None] > 0, bound + (1 if dim == 2 else -1) * part, part)
        rows = [self.K[::dim], np.hstack([problem.V.T, np.zeros((p, p))])]
        rest = np.vstack(rows + [edge[self.rough] for edge in edges])
        right = np.concatenate([problem.q[:, 0], problem.s, np.zeros(len(rest) - k - p)])
        zero = np.zeros(n + p + len(rest), dtype=bool)
        zero[n + p + k : n + 2 * p + k] = True  # the balance
        for c in range(1, dim):
            zero[dim * np.flatnonzero(mu == 0) + c] = True
        sides = np.zeros((3, k, 2), dtype=bool)
        sides[1, :, 1] = sides[2, :, 0] = mu == 0
        self.root = _Branch(
            np.vstack([start, rest]),
            np.concatenate([np.zeros(n + p), right]),
            zero,
            np.zeros((len(rest), n + p + 1)),
            n + p + np.arange(len(rest)),
            np.arange(n + p),
            sides.reshape(3 * k, 2),
            np.zeros(k, dtype=int),
            np.zeros((k, 2)),
        )
        self.root.remake()

    def _tangential(self) -> tuple[np.ndarray, np.ndarray]:
        return self.unit[1 : self.n : 3], self.unit[2 : self.n : 3]

    def points(self) -> Iterator[Point | None]:
        """Forces, multipliers and zero sides (3 k, 2) of solutions; None after other branches."""
        waiting = [self.root]
        while waiting:
            check_time()
            branch = waiting.pop()
            self.branches += 1
            self.work += BRANCH
            if not self.feasible(branch):
                yield None
                continue
            x = branch.x()
            r, lam = x[: self.n].reshape(self.problem.q.shape), x[self.n :]
            r[branch.sides[: len(r), 1]] = 0.0  # of open contacts, without rounding
            u = self.problem.displacements(r, lam)
            more = (self._plane if self.problem.dim == 2 else self._space)(branch, r, u)
            waiting += more
            yield None if more else (r, lam, branch.sides)
        self.done = True

    @property
    def proof(self) -> Infeasible:
        """What a tree without a point proves."""
        k, p = self.problem.contacts, len(self.problem.s)
        return Infeasible(np.zeros(k), np.zeros(p), self.least, SENTENCE, self.branches)

    def _plane(self, branch: _Branch, r: np.ndarray, u: np.ndarray) -> list[_Branch]:
        """The two branches of the pair whose sides are largest; none if all are decided."""
        k, bound = len(r), self.problem.mu * r[:, 0]
        w = np.concatenate([u[:, 0], u[:, 1], bound - r[:, 1]])
        z = np.concatenate([r[:, 0], bound + r[:, 1], -u[:, 1]])
        decided = branch.sides.any(axis=1)
        if decided.all():
            return []
        pair = int(np.argmax(np.where(decided, -np.inf, np.minimum(w, z))))
        which, i = divmod(pair, k)
        edge = len(self.root.b) - len(self.rough) + int(np.searchsorted(self.rough, i))
        rough = bool(self.problem.mu[i] > 0)
        if which == 0:
            first = branch.child([self.n + len(self.problem.s) + i])
            second = branch.child([2 * i, 2 * i + 1] + [edge] * rough)
            second.sides[k + i, 1] = second.sides[2 * k + i, 0] = True
        else:
            first, second = branch.child([edge] * (which == 2)), branch.child()
            second.zero[2 * i + 1] |= which == 1
            sign, bounded = (-1.0, first) if which == 1 else (1.0, second)
            row = slice(2 * i + 1, 2 * i + 2)
            bounded.add(sign * self.K[row], sign * self.problem.q[i, 1:])
        first.sides[pair, 0] = second.sides[pair, 1] = True
        return [first, second] if w[pair] > z[pair] else [second, first]

    def _space(self, branch: _Branch, r: np.ndarray, u: np.ndarray) -> list[_Branch]:
        """The branches of the contact furthest from the law; none at a solution."""
        mu, state = self.problem.mu, branch.state
        speed = np.linalg.norm(u[:, 1:], axis=1)
        along = u[:, 1:] / np.maximum(speed, 1e-300)[:, None]
        off = np.linalg.norm(r[:, 1:] + (mu * r[:, 0])[:, None] * along, axis=1)
        wrong = np.where(state == FREE, np.minimum(r[:, 0], u[:, 0]), 0.0)
        wide = branch.arc[:, 1] - branch.arc[:, 0] > np.pi / 2 / 2**HALVED * 1.01
        slips = (mu > 0) & ((state <= SHUT) | ((state == SLIPPING) & wide))
        wrong = np.maximum(wrong, np.where(slips, np.minimum(speed, off), 0.0))
        if wrong.max() <= EQUAL:
            return []
        i, (low, high) = int(np.argmax(wrong)), branch.arc[int(np.argmax(wrong))]
        if state[i] == FREE:
            apart, shut = branch.child([3 * i, 3 * i + 1, 3 * i + 2]), branch.child()
            shut.zero[self.n + len(self.problem.s) + i] = True
            apart.state[i], shut.state[i] = DECIDED, SHUT
            return [apart, shut] if r[i, 0] > u[i, 0] else [shut, apart]
        if state[i] == SLIPPING:
            middle = (low + high) / 2
            return [self._slip(branch, i, arc) for arc in ((low, middle), (middle, high))]
        stick, way = branch.child(), float(np.arctan2(u[i, 2], u[i, 1]))
        stick.add(self.K[3 * i + 1 : 3 * i + 3], self.problem.q[i, 1:], zero=True)
        stick.state[i] = DECIDED
        turns = np.pi / 2 * np.array([2, 1, -1, 0])
        arcs = [(way + turn - np.pi / 4, way + turn + np.pi / 4) for turn in turns]
        return [self._slip(branch, i, arc) for arc in arcs] + [stick]

    def _slip(self, branch: _Branch, i: int, arc: tuple[float, float]) -> _Branch:
        """The branch in which a contact slips in a direction of the arc."""
        other, rows = branch.child(), slice(3 * i + 1, 3 * i + 3)
        other.state[i], other.arc[i] = SLIPPING, arc
        ends = np.linalg.inv(np.stack([np.cos(arc), np.sin(arc)]))  # parts along both ends
        force, bound = -ends @ self.unit[rows], self.problem.mu[i] * self.unit[3 * i]
        chord = force.sum(axis=0) - bound
        tangents = bound / np.cos((arc[1] - arc[0]) / 2) - force.sum(axis=0)
        a = np.vstack([ends @ self.K[rows], force, chord, tangents])
        other.add(a, np.concatenate([ends @ self.problem.q[i, 1:], np.zeros(4)]))
        return other

    def feasible(self, branch: _Branch) -> bool:
        """Whether the branch may have a point, to which its tableau is brought."""
        doubtful, fresh = np.zeros(len(branch.b), dtype=bool), branch.pivots > 50
        doubtful[self.n : self.n + len(self.problem.s)] = True  # multipliers have either sign
        if fresh:
            branch.remake()
        patience = branch.pivots + 5 * len(branch.basic)
        while True:
            right, fixed = branch.T[:, -1], branch.zero[branch.basic]
            wrong = np.where(fixed, np.abs(right), -right)
            wrong[doubtful[branch.basic]] = 0.0
            rows = np.flatnonzero(wrong > EQUAL)
            if len(rows) == 0:
                return True
            careful = branch.pivots > patience  # the least index cannot go round in a circle
            if branch.pivots > 2 * patience:  # but for very long
                return True
            i = int(rows[np.argmin(branch.basic[rows])] if careful else np.argmax(wrong))
            row = branch.T[i, :-1] * (1.0 if right[i] > 0 else -1.0)
            either = (branch.other >= self.n) & (branch.other < self.n + len(self.problem.s))
            row = np.where(either, np.abs(row), row)
            usable = np.flatnonzero((row > 1e-8) & ~branch.zero[branch.other])  # least pivot
            if len(usable):
                least = np.argmin(branch.other[usable]) if careful else np.argmax(row[usable])
                branch.pivot(i, int(usable[least]))
                self.work += branch.T.size
            elif self.contradicts(branch, i):
                return False
            elif fresh:
                doubtful[branch.basic[i]] = True
            else:
                branch.remake()
                patience, fresh = 5 * len(branch.basic), True

    def contradicts(self, branch: _Branch, i: int) -> bool:
        """Whether row i of the tableau, computed again from A and b, is a contradiction."""
        y = np.zeros(len(branch.b))
        y[branch.other], y[branch.basic[i]] = branch.T[i, :-1], 1.0
        y *= -1.0 if y @ branch.b > 0 else 1.0
        counts = ~branch.zero
        counts[self.n : self.n + len(self.problem.s)] = False
        y[self.n : self.n + len(self.problem.s)] = 0.0
        largest = float(np.abs(y).max())
        left, size = np.abs(y @ branch.A), largest * np.abs(branch.A).max(axis=0)
        margin, terms = -float(y @ branch.b), float(np.abs(y) @ np.abs(branch.b))
        impossible = not np.any(y[counts] < -EXACT * largest) and np.all(left <= EXACT * size)
        if not (impossible and margin > MARGIN * terms):
            return False
        self.least = min(self.least, margin / terms)
        return True


def _octagon(bound: np.ndarray, x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
    """The edges of the octagon around the cone, besides bound - x and bound - y."""
    far = np.sqrt(2.0) * bound
    return [bound + x, bound + y, far - x - y, far + x - y, far - x + y, far + x + y]


def can(problem: InterfaceProblem) -> bool:
    """Whether the tree takes a problem."""
    law = problem.law
    coulomb = law.unilateral and law.proportional and not law.dilatant
    return coulomb and has_entries(problem.Q)


def sides_of(problem: InterfaceProblem, r: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Which sides (3 k, 2) of the pairs are zero at a point, both where it is degenerate."""
    u, bound = problem.displacements(r, lam), problem.mu * r[:, 0]
    near_r = SAME * np.abs(r).max(initial=0.0)
    near_u = SAME * max(np.abs(u).max(initial=0.0), np.abs(problem.q).max(initial=0.0))
    w = np.concatenate([u[:, 0] <= near_u, u[:, 1] <= near_u, bound - r[:, 1] <= near_r])
    z = np.concatenate([r[:, 0] <= near_r, bound + r[:, 1] <= near_r, -u[:, 1] <= near_u])
    return np.stack([w, z], axis=1)
