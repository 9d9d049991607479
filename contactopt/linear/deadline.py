"""The moment at which the step of a method that runs must give up. The driver looks at its clock
after each outer iteration; an inner loop that can last longer calls `check_time`.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_deadline: ContextVar[float] = ContextVar("deadline of the step that runs", default=float("inf"))


class TimeUp(Exception):
    """The time limit of the solve has passed inside a step of its method."""


def check_time() -> None:
    """Raise TimeUp if the time limit of the solve that runs has passed; costs next to nothing."""
    if time.perf_counter() > _deadline.get():
        raise TimeUp


def time_left() -> float:
    """Tell how much time is left to the solve that runs.

    Returns
    -------
    Seconds until its time limit, at least 0; infinite without a limit.
    """
    return max(_deadline.get() - time.perf_counter(), 0.0)


@contextmanager
def until(moment: float) -> Iterator[None]:
    """Set the deadline, a time.perf_counter() [s], in the block; an earlier one stays."""
    token = _deadline.set(min(moment, _deadline.get()))
    try:
        yield
    finally:
        _deadline.reset(token)
