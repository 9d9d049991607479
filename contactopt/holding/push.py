"""The ends of statics, the push and the trial on one mesh, as contactopt.holding derives them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from contactopt.bodies.views import energy
from contactopt.coupling.reduction import Reduction
from contactopt.defaults import EQUAL
from contactopt.errors import Unbalanced
from contactopt.linear.operators import dense
from contactopt.methods.driver import solve
from contactopt.problem import InterfaceProblem
from contactopt.problem.scaling import scales_of

GROWTH = 4.0  # of the prescribed motion from push to push
EARLY = 6  # pushes that need not be solved while the motion is small
SMALL = 0.1  # motion over the extent of the contacts, beyond which it is not small
STEADY = 1e-5  # relative growth of the force below which it no longer grows
ALIKE = 1e-3  # relative difference by which forces are a multiple of others, or two limits the same
Note = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Push:
    """The problem at f = 0, and g (k dim,), l (p,) and c as in contactopt.holding."""

    problem: InterfaceProblem
    g: np.ndarray
    load: np.ndarray
    c: float

    @classmethod
    def of(cls, base: Reduction, loaded: Reduction) -> Push | None:
        """From the reduced scene without and with the load; None if it moves nothing freely."""
        load = loaded.problem.s - base.problem.s
        size = np.abs([loaded.problem.s, base.problem.s]).max(initial=0.0)
        if not np.abs(load).max(initial=0.0) > EQUAL * size:
            return None
        bodies = zip(base.bodies, loaded.bodies)
        work = [
            2 * energy(old, moved := new.at_rest - old.at_rest, 0 * moved) for old, new in bodies
        ]
        return cls(base.problem, (loaded.problem.q - base.problem.q).ravel(), load, sum(work))

    @property
    def nothing(self) -> float:
        """The factor below which the load is rounding beside the loads that stay."""
        return float(EQUAL * (1 + np.abs(self.problem.s).sum() / np.linalg.norm(self.load)))

    def end(self, largest: bool) -> float:
        """An end of the interval of statics, infinite if it has none, nan if it is empty."""
        import cvxpy as cp

        from contactopt.models.static_limit import static_limit

        made = static_limit(self.problem, self.load, largest)
        made.problem.solve(solver=cp.CLARABEL)
        if made.problem.status in ("infeasible", "infeasible_inaccurate"):
            return np.nan
        if made.problem.status in ("unbounded", "unbounded_inaccurate"):
            return np.inf if largest else -np.inf
        found = float(made.variables["f"].value)
        return 0.0 if abs(found) <= 1e2 * self.nothing else found

    def rests(self, f: float) -> bool:
        """Whether the problem with f times the load is solved."""
        old = self.problem
        q = old.q + f * self.g.reshape(old.q.shape)
        try:
            return bool(solve(old.altered(q=q, s=old.s + f * self.load)).solved)
        except Unbalanced:
            return False

    def least(self, upper: float, note: Note) -> float:
        """The least positive f with a solution, by halving one that has it; else -infinity."""
        first = (upper * share for share in (0.999, 0.9, 0.4))
        low, high = 0.0, next((f for f in first if self.rests(f)), 0.0)
        while high - low > ALIKE / 10 * high and high > self.nothing:
            middle = (low + high) / 2
            low, high = (low, middle) if self.rests(middle) else (middle, high)
            note(f"trial: {low:.6g} to {high:.6g}")
        return high if low > 0 else -np.inf

    def force(self, slipped: np.ndarray | float, note: Note) -> tuple[float, bool]:
        """The largest f while motions are small, infinite if it grows for ever, not a number if a
        push is not solved; and whether it grows again when they are not.
        """
        old, size = self.problem, float(np.linalg.norm(self.load))
        turn = la.qr(self.load[:, None])[0]
        turn[:, 0] = self.load / size
        V, s = old.V @ turn, turn.T @ old.s
        v, g, rest = V[:, 0] / size, self.g, s[0] / size
        Q = dense(old.Q) - np.outer(v, g) - np.outer(g, v) + self.c * np.outer(v, v)
        q = old.q + (v * self.c * rest - g * rest).reshape(old.q.shape)
        pushed = old.altered(V=V[:, 1:], s=s[1:], Q=Q, q=q, motions=())
        loaded = old.altered(s=np.abs(old.s) + np.abs(self.load))
        first = size * max(scales_of(own).length for own in (old, loaded))
        d, f, r, start, steepest, still = 0.0, np.nan, np.zeros(q.shape), None, 0.0, np.nan
        bound, at_first = SMALL * np.ptp(old.coordinates, axis=1).max(), None
        for push in range(20):  # so that the last one is 1e12 times the first
            q_d = q + d * v.reshape(q.shape)
            step = q_d.copy()
            step[:, 1:] -= slipped
            now = solve(pushed.altered(q=step), start=start)
            if not now.solved:
                note(f"push {push + 1}: {now.message}")
                if start is None and push < EARLY:  # where nothing rests without the load
                    d = GROWTH * d or first
                    continue
                return np.nan, False
            before, f, last, r = f, -float(v @ now.reactions.ravel()) - rest, r, now.reactions
            f = f if abs(f) > self.nothing else 0.0
            note(f"push {push + 1}: {f:.6g} times the load")
            slope = abs(f - before) / ((1 - 1 / GROWTH * (push > 1)) * d or np.inf)
            steepest = np.fmax(steepest, slope)
            small = STEADY * abs(f) + self.nothing
            if abs(f - before) <= small and (slope <= ALIKE * steepest or abs(f) <= small):
                return max(f, before), False
            if f - still > ALIKE * abs(f) + self.nothing:
                return still, True
            if push > 1 and np.linalg.norm(r - GROWTH * last) <= ALIKE * np.linalg.norm(r):
                break
            u = pushed.altered(q=q_d).displacements(r, now.multipliers)
            at_first = u if at_first is None else at_first
            far = np.linalg.norm(u - at_first, axis=1).max() > bound
            still = f if far and abs(f - before) <= small else np.nan
            slipped, start, d = u[:, 1:], now, GROWTH * d or first
        return np.inf, False
