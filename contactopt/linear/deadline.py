"""What the driver asks of the step of a method that runs: when it must give up, and how far it
needs to come. The driver looks at its clock after each outer iteration; an inner loop that can last
longer calls `check_time`, and one whose accuracy costs time asks `enough`.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_deadline: ContextVar[float] = ContextVar("deadline of the step that runs", default=float("inf"))
_enough: ContextVar[float] = ContextVar("residual at which the solve that runs ends", default=0.0)


class TimeUp(Exception):
    """The time limit of the solve has passed inside a step of its method."""


def check_time() -> None:
    """Raise TimeUp if the time limit of the solve that runs has passed; costs next to nothing."""
    if time.perf_counter() > _deadline.get():
        raise TimeUp


def time_left() -> float:
    """Seconds until the time limit of the solve that runs, at least 0; infinite without a limit."""
    return max(_deadline.get() - time.perf_counter(), 0.0)


def enough() -> float:
    """The share of the present residual that a step may leave; 0 where all digits are asked for."""
    return _enough.get()


@contextmanager
def until(moment: float, enough: float = 0.0) -> Iterator[None]:
    """Set the deadline [s of perf_counter] in the block, and the share of the residual to reach."""
    tokens = _deadline.set(min(moment, _deadline.get())), _enough.set(enough)
    try:
        yield
    finally:
        _deadline.reset(tokens[0])
        _enough.reset(tokens[1])
