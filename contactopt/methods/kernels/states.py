"""Every solution of a plane problem, or a proof that there is none: a tree over the states of its
contacts.

As a linear complementarity problem (contactopt.methods.complementarity) friction in the plane is
    w = M z + q,   w, z >= 0,   and of each pair (w_i, z_i) one is zero.
Without the last condition this is a set of linear inequalities. The tree begins with it, and each
branch sets one side of one more pair to zero, first where both sides are largest. A branch ends
where its inequalities contradict each other: there is a row y with y'(w - M z) = y'q in which, of
all that is not set to zero, no term is negative on the left, and the right side is negative. This
row is computed again from M and q. When all branches have ended so, no solution exists. Feasible
points come from the dual simplex method without costs: each branch goes on from the tableau of the
one before.

Nothing is asked of Q: it may be unsymmetric, singular or indefinite. The number of branches grows
exponentially with the contacts in the worst case.

Source: Farkas' lemma; Al-Khayyal (1987), An implicit enumeration procedure for the general linear
complementarity problem.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from contactopt.linear.deadline import check_time
from contactopt.linear.operators import InterfaceOperator
from contactopt.methods.complementarity import complementarity_problem
from contactopt.problem import Infeasible, InterfaceProblem

ZERO = 1e-9  # of a dimensionless problem: what is smaller counts as zero
PIVOT = 1e-9  # least pivot
EXACT = 1e-11  # relative size of what rounding leaves of a zero in a contradiction
MARGIN = 1e-7  # least right side of a contradiction, over the size of its terms
FRESH = 50  # pivots after which a tableau is made anew from the data
SAME = 1e-7  # relative size of what counts as zero when a point is given its states
SENTENCE = (
    "whichever contacts are open, stick or slip, their forces and displacements contradict each"
    " other, so there is no solution; check the friction coefficients, the gaps and the supports."
)


@dataclass
class _Branch:
    """A tableau x_basic = T[:, -1] - T[:, :-1] x_other, and which variables (2m,) are zero."""

    T: np.ndarray
    basic: np.ndarray
    other: np.ndarray
    zero: np.ndarray
    pivots: int = 0

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

    def values(self) -> np.ndarray:
        x = np.zeros(len(self.zero))
        x[self.basic] = self.T[:, -1]
        return x

    def with_zero(self, *variables: int) -> _Branch:
        zero = self.zero.copy()
        zero[list(variables)] = True
        return _Branch(self.T.copy(), self.basic.copy(), self.other.copy(), zero, self.pivots)


@dataclass
class StateTree:
    """The tree of a dimensionless plane problem of Coulomb's law.

    done  whether all branches have been looked at
    """

    problem: InterfaceProblem
    branches: int = 0
    done: bool = False
    least: float = np.inf  # least margin of the contradictions so far
    M: np.ndarray = field(init=False)
    q: np.ndarray = field(init=False)
    C: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.M, self.q, self.C = complementarity_problem(self.problem)

    def points(self) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray] | None]:
        """Forces (k, 2), multipliers (p,) and zero sides (3 k, 2) of each branch in which all pairs
        have a zero side, and None after every other branch.
        """
        k, m = self.problem.contacts, len(self.q)
        zero = np.zeros(2 * m, dtype=bool)
        zero[3 * k : m] = True  # the balance; its multipliers are free
        smooth = np.flatnonzero(self.problem.mu == 0)
        zero[[*(m + k + smooth), *(2 * k + smooth)]] = True  # x = 0 and 2 mu r_n - x = 0
        start = _Branch(np.hstack([-self.M, self.q[:, None]]), np.arange(m), m + np.arange(m), zero)
        waiting = [start]
        while waiting:
            check_time()
            branch = waiting.pop()
            self.branches += 1
            if not self.feasible(branch):
                yield None
                continue
            sides = np.stack([branch.zero[: 3 * k], branch.zero[m : m + 3 * k]], axis=1)
            if sides.any(axis=1).all():
                yield *self.point(branch), sides
                continue
            w, z = branch.values()[[np.arange(3 * k), m + np.arange(3 * k)]]
            i = int(np.argmax(np.where(sides.any(axis=1), -np.inf, np.minimum(w, z))))
            # without pressure there is no friction either
            still = (m + i, m + k + i, 2 * k + i) if i < k else (m + i,)
            first, second = branch.with_zero(i), branch.with_zero(*still)
            waiting += [first, second] if w[i] > z[i] else [second, first]
            yield None
        self.done = True

    @property
    def proof(self) -> Infeasible:
        """What a tree without a point proves."""
        k, p = self.problem.contacts, len(self.problem.s)
        return Infeasible(np.zeros(k), np.zeros(p), self.least, SENTENCE, self.branches)

    def point(self, branch: _Branch) -> tuple[np.ndarray, np.ndarray]:
        """Forces and multipliers of a branch, as exact as its basis allows."""
        self.remade(branch)
        k, z = self.problem.contacts, branch.values()[len(self.q) :]
        z[: 3 * k] = np.maximum(z[: 3 * k], 0.0) * ~branch.zero[len(self.q) :][: 3 * k]
        a, b = np.split(z[3 * k :], 2)
        return (self.C @ z[: self.C.shape[1]]).reshape(k, 2), a - b

    def feasible(self, branch: _Branch) -> bool:
        """Whether the branch has a point, to which its tableau is brought; True also where rounding
        leaves that open.
        """
        m, doubtful = len(self.q), np.zeros(2 * len(self.q), dtype=bool)
        fresh = branch.pivots > FRESH and self.remade(branch)
        patience = branch.pivots + 5 * m
        while True:
            right, fixed = branch.T[:, -1], branch.zero[branch.basic]
            wrong = np.where(fixed, np.abs(right), -right)
            wrong[doubtful[branch.basic]] = 0.0
            rows = np.flatnonzero(wrong > ZERO)
            if len(rows) == 0:
                return True
            careful = branch.pivots > patience  # the least index cannot go round in a circle
            i = int(rows[np.argmin(branch.basic[rows])] if careful else np.argmax(wrong))
            row = branch.T[i, :-1] * (1.0 if right[i] > 0 else -1.0)
            usable = np.flatnonzero((row > PIVOT) & ~branch.zero[branch.other])
            if len(usable):
                least = np.argmin(branch.other[usable]) if careful else np.argmax(row[usable])
                branch.pivot(i, int(usable[least]))
            elif self.contradicts(branch, i):
                return False
            elif fresh or not self.remade(branch):
                doubtful[branch.basic[i]] = True
            else:
                patience, fresh = 5 * m, True

    def contradicts(self, branch: _Branch, i: int) -> bool:
        """Whether row i of the tableau, computed again from M and q, is a contradiction."""
        m = len(self.q)
        y, own = np.zeros(m), branch.other < m
        y[branch.other[own]] = branch.T[i, :-1][own]
        if branch.basic[i] < m:
            y[branch.basic[i]] = 1.0
        y *= -1.0 if y @ self.q > 0 else 1.0
        left = np.concatenate([y, -self.M.T @ y])
        size = np.concatenate([np.abs(y), np.abs(self.M).T @ np.abs(y)])
        counts = ~branch.zero
        margin, terms = -float(y @ self.q), float(np.abs(y) @ np.abs(self.q))
        y_rounding = EXACT * max(float(np.abs(y).max()), 1e-300)
        if np.any(left[counts] < -EXACT * size[counts] - y_rounding) or not margin > MARGIN * terms:
            return False
        self.least = min(self.least, margin / terms)
        return True

    def remade(self, branch: _Branch) -> bool:
        """Compute the tableau again from M and q; False if its basis is singular."""
        m = len(self.q)
        columns = np.hstack([np.eye(m), -self.M, self.q[:, None]])
        try:
            branch.T = np.linalg.solve(columns[:, branch.basic], columns[:, [*branch.other, 2 * m]])
        except np.linalg.LinAlgError:
            return False
        branch.pivots = 0
        return True


def can(problem: InterfaceProblem) -> bool:
    """Whether the tree takes a problem."""
    law = problem.law
    coulomb = law.unilateral and law.proportional and not law.dilatant
    return problem.dim == 2 and coulomb and not isinstance(problem.Q, InterfaceOperator)


def sides_of(problem: InterfaceProblem, r: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Which sides (3 k, 2) of the pairs are zero at a point, both where it is degenerate."""
    u, bound = problem.displacements(r, lam), problem.mu * r[:, 0]
    near_r = SAME * np.abs(r).max(initial=0.0)
    near_u = SAME * max(np.abs(u).max(initial=0.0), np.abs(problem.q).max(initial=0.0))
    w = np.concatenate([u[:, 0] <= near_u, u[:, 1] <= near_u, bound - r[:, 1] <= near_r])
    z = np.concatenate([r[:, 0] <= near_r, bound + r[:, 1] <= near_r, -u[:, 1] <= near_u])
    return np.stack([w, z], axis=1)
