"""What a solve keeps of its iterates: history, certificate, best answer, and when it ends."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from contactopt.defaults import TOL
from contactopt.linear.operators import diagonal, loosened
from contactopt.linear.stacked import Stacked
from contactopt.methods.method import Iterate, Known
from contactopt.problem import InterfaceProblem, Scales, Status, natural_map_residual
from contactopt.problem.certificate import Moved

ROUGH = 1e-5  # accuracy of products in a rough certificate
LEAST_PROOF = 0.3  # seconds for a proof past the time limit
SAME = 1e-11  # relative distance at which two iterates are the same state
LOST = 1e15  # dimensionless size of an iterate beyond which rounding leaves no digit
State = tuple[np.ndarray, float]  # forces and multipliers in one array, and its norm


@dataclass(frozen=True)
class Limits:
    """When a solve ends, as `solve` says, and whom it tells of each iteration."""

    tol: float
    change_tol: float | None
    max_iterations: int
    time_limit: float
    progress: Callable[[int, float], None] | None


class Recorder:
    """Certificate, history and stopping rule of one solve. Without an iterate the answer is
    `first`.
    """

    def __init__(self, problem: InterfaceProblem, scales: Scales, limits: Limits, first: Iterate):
        self.began = time.perf_counter()
        self.problem, self.scales, self.limits = problem, scales, limits
        self.reactions, self.multipliers = scales.to_physical(*first)
        self.displacements: Stacked | None = None
        self.residual, self.lost = np.inf, False
        self.history: list[dict[str, float]] = []
        self.recent: list[State] = [(np.zeros(problem.q.size + len(problem.s)), 0.0)]
        self.best = self._now()
        self.clock, self.certified = 0.0, 0.0
        self.repeated = 0
        self.lengthless = not np.any(diagonal(problem.Q)) and not np.any(problem.q)

    def certify(self, known: Sequence[Moved]) -> None:
        """Judge the present iterate."""
        begin = time.perf_counter()
        self.residual = self._certificate(known)
        if not self.lost:
            self.best = min(self.best, self._now(), key=lambda point: point[0])
        self.certified += time.perf_counter() - begin

    def _now(self) -> tuple[float, np.ndarray, np.ndarray, Stacked | None]:
        return self.residual, self.reactions, self.multipliers, self.displacements

    def return_to_best(self) -> None:
        """Make the iterate with the least certificate the present one."""
        self.residual, self.reactions, self.multipliers, self.displacements = self.best

    def _certificate(self, known: Sequence[Moved]) -> float:
        """The natural-map residual by the method's own Q r, cheaply far from the tolerance."""
        self.displacements, point = None, (self.reactions, self.multipliers)
        if known:
            length, X = self.scales.length, known[0].displacements
            self.displacements = None if X is None else X * length
            moved = replace(known[0], value=known[0].value * length)
            return natural_map_residual(self.problem, *point, moved=moved)
        rough = loosened(self.problem.Q, ROUGH)
        if rough is not self.problem.Q:
            residual = natural_map_residual(self.problem.altered(Q=rough), *point)
            if residual > max(100 * ROUGH, 10 * self.limits.tol):
                return residual
        return natural_map_residual(self.problem, *point)

    @np.errstate(all="ignore")  # numbers beyond the range of floats have no certificate
    def record(self, iterate: Iterate | Known, counts: dict[str, float]) -> Status | None:
        """Take one iterate (dimensionless); the status with which the solve ends, or None."""
        r, lam, *known = iterate
        if np.abs(r).max(initial=0.0) <= np.finfo(float).eps:
            r = np.zeros_like(r)  # rounding beside the unit of force, as after a load is taken off
        self.lost = bool(max(np.abs(r).max(initial=0.0), np.abs(lam).max(initial=0.0)) > LOST)
        previous, limits = self.reactions, self.limits
        self.reactions, self.multipliers = self.scales.to_physical(r, lam)
        if self.lengthless:
            # The same forces solve the problem with u = V lambda = 0, and rounding has no length to
            # be small beside.
            self.multipliers = np.zeros(len(self.problem.s))
        self.certify(known)
        change = _relative(self.reactions[:, 1:], previous[:, 1:])
        state = np.concatenate([r.ravel(), lam])
        now = state, float(np.linalg.norm(state))
        same = [_same(now, old) for old in reversed(self.recent)]
        self.recent = [*self.recent[1 - 12 :], now]  # longest cycle that is looked for
        row = {"residual": self.residual, "change": change, "seconds": self.clock}
        self.history.append(row | counts)
        if limits.progress is not None:
            limits.progress(len(self.history), self.residual)
            if watch := getattr(limits.progress, "watch", None):
                watch(self.reactions, self.multipliers)
        if self.residual <= limits.tol and not self.lost:  # what is lost is not the answer
            return Status.SOLVED
        if limits.change_tol is not None and len(self.history) > 1 and change <= limits.change_tol:
            return Status.SETTLED
        self.repeated = self.repeated + 1 if any(same) else 0
        if self.repeated >= 8:  # repeated states in a row of a method that goes nowhere
            return Status.STALLED if same[0] else Status.CYCLING
        return self.late

    @property
    def late(self) -> Status | None:
        """Which limit is reached, if one is."""
        if len(self.history) >= self.limits.max_iterations:
            return Status.ITERATION_LIMIT
        return Status.TIME_LIMIT if self.left() <= 0 else None

    @property
    def enough(self) -> float:
        """Share of the residual that a step may leave; 0 in a last one that needs all digits."""
        return self.limits.tol / self.residual if self.limits.tol > TOL else 0.0

    def left(self) -> float:
        """Seconds that the time limit leaves."""
        return self.limits.time_limit - (time.perf_counter() - self.began)


def _same(new: State, old: State) -> bool:
    """Whether two states are one: their sizes tell at once that most are not."""
    close = abs(new[1] - old[1]) <= SAME * new[1]
    return close and _relative(new[0], old[0]) < SAME


def _relative(new: np.ndarray, old: np.ndarray) -> float:
    size = float(np.linalg.norm(new))
    return float(np.linalg.norm(new - old)) / size if size > 0 else float(np.linalg.norm(old) > 0)
