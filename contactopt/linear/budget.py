"""What a solution by V-cycles may cost before another way to it is the better bargain.

Work is counted in V-cycles times the unknowns of their body. Whoever solves a scene opens a budget,
the choice of the way fills it in, and every V-cycle of multigrid draws on it, wherever it is made.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any


@dataclass(eq=False)
class Budget:
    """Work that was done, that was expected, that may be done, and what is done instead of more."""

    spent: float = 0.0
    expected: float = 0.0
    most: float = float("inf")
    instead: Any = None

    def check(self, work: float) -> None:
        """TooDear if so much work in all is too much."""
        if work > self.most:
            raise TooDear(self.instead)


class TooDear(Exception):
    """More V-cycles are needed than another way to the solution would cost.

    instead  the other way
    """

    def __init__(self, instead: Any):
        super().__init__(instead)
        self.instead = instead


_open: ContextVar[Budget | None] = ContextVar("budget of the scene that is solved", default=None)


def _present() -> Budget:
    """The budget that is open, or one that nobody looks at."""
    return _open.get() or Budget()


@contextmanager
def open_budget() -> Iterator[None]:
    """Count the V-cycles inside the block from zero on, and without a limit until `fill`."""
    token = _open.set(Budget())
    try:
        yield
    finally:
        _open.reset(token)


def fill(expected: float, most: float, instead: Any) -> None:
    """Say what the budget that is open is made for, and what is done where it is too low."""
    budget = _present()
    budget.expected, budget.most, budget.instead = expected, most, instead


def spend(work: float) -> None:
    """Draw on the budget; TooDear where nothing is left."""
    budget = _present()
    budget.spent += work
    budget.check(budget.spent)


def spent() -> float:
    """The work so far; 0 where no budget is open."""
    return _present().spent


def expect(slower: float) -> None:
    """TooDear if the budget does not allow `slower` times the work that was expected."""
    budget = _present()
    budget.check(budget.expected * slower)
