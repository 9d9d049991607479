"""What a solution may cost before another way to it is the better bargain.

Work is counted in V-cycles, or in products with Q by factors, times the unknowns of the bodies that
they go over. Whoever solves a scene opens a budget, and the choice of the way fills it in. Every
V-cycle of multigrid and every product by factors draws on it, wherever it is made.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

import numpy as np

LAST_STEPS = 1.5  # factor on the limit of work for the last steps of an iteration


@dataclass(frozen=True)
class NextBest:
    """The way to take if the steps of another way cost more than was predicted.

    left : The way that is left then: 'coupled' or 'products'.
    Q, solver : The form of Q and the solver of the bodies to take instead.
    expected : Work [steps times unknowns] of the way that is left, by its estimate.
    most : Work that costs as much as both ways were estimated to cost. Who gives up after it has
        spent at most twice what the better of the two would have taken. An iteration that is close
        to its end may take LAST_STEPS times this work.
    then : What takes the place of this way in turn; None where nothing does.
    """

    left: str
    Q: str
    solver: str
    expected: float
    most: float
    then: NextBest | None


@dataclass(eq=False)
class Budget:
    """The work done so far, the way to take once it becomes too much, and by how much the limit of
    work was stretched.
    """

    spent: float = 0.0
    instead: NextBest | None = None
    stretched: float = 1.0

    def check(self, work: float) -> None:
        """Raise TooDear if this work in all is too much."""
        if self.instead is not None and work > self.stretched * self.instead.most:
            raise TooDear(self.instead)


class TooDear(Exception):
    """More work is needed than another way to the solution would cost.

    instead  the other way
    reached  certificate, forces (k, dim) and multipliers of the best iterate so far; None if there
             is none
    """

    reached: tuple[float, np.ndarray, np.ndarray] | None = None

    def __init__(self, instead: NextBest):
        super().__init__(instead)
        self.instead = instead


_open: ContextVar[Budget | None] = ContextVar("budget of the scene that is solved", default=None)


def _present() -> Budget:
    """The budget that is open, or one that nobody looks at."""
    return _open.get() or Budget()


@contextmanager
def open_budget(instead: NextBest | None = None) -> Iterator[None]:
    """Count the work inside the block from zero on, without a limit until `fill` names one."""
    token = _open.set(Budget(instead=instead))
    try:
        yield
    finally:
        _open.reset(token)


def fill(instead: NextBest | None) -> None:
    """Say which way to take, if there is one, when the open budget is used up."""
    if instead is not None:
        _present().instead = instead


def spend(work: float) -> None:
    """Draw on the budget; TooDear when it is used up."""
    budget = _present()
    budget.spent += work
    budget.check(budget.spent)


def finish() -> None:
    """Let an iteration that is close to its end come there."""
    _present().stretched = LAST_STEPS


def spent() -> float:
    """The work so far; 0 where no budget is open."""
    return _present().spent


def expect(slower: float) -> None:
    """TooDear if the budget does not allow `slower` times the work that was expected."""
    budget = _present()
    if budget.instead is not None:
        budget.check(budget.instead.expected * slower)
