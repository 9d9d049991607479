"""Cores, memory, the threads of BLAS, and the one place where threads share work."""

import ctypes
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from contextvars import copy_context
from typing import TypeVar

from threadpoolctl import threadpool_limits

Item = TypeVar("Item")
Result = TypeVar("Result")


def cores() -> int:
    """The number of cores that this process may use, which OMP_NUM_THREADS does not bound."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread inside the block; one thread of the process alone may set it."""
    with threadpool_limits(1, user_api="blas"):
        yield


def give_back() -> None:
    """Return freed memory to the system: GNU's C library keeps it for the thread that freed it."""
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).malloc_trim(0)


def each(
    act: Callable[[Item], Result], items: Iterable[Item], parallel: Sequence[bool] | None = None
) -> tuple[Result, ...]:
    """The results of a function for every item, in order; `parallel` ones run at the same time."""
    listed = list(items)
    marked = [True] * len(listed) if parallel is None else list(parallel)
    if sum(marked) < 2:
        return tuple(act(item) for item in listed)
    with ThreadPoolExecutor(sum(marked)) as pool:
        # limits of time and work hold in the threads, too
        running = [
            pool.submit(copy_context().run, act, item) if mark else None
            for item, mark in zip(listed, marked)
        ]
        here = [act(item) if future is None else None for item, future in zip(listed, running)]
        for place, future in enumerate(running):
            if future is not None:
                here[place] = future.result()
        return tuple(here)  # type: ignore[arg-type]


class Crew:
    """Threads, one for each core but the caller's, that help with pieces of one caller's work. They
    start with the first piece, sleep in between and end with the object; a fork makes its own.
    """

    def __init__(self, size: int | None = None):
        self.size = cores() if size is None else size
        self._pool: ThreadPoolExecutor | None = None
        self._process = os.getpid()

    def each(self, acts: Sequence[Callable[[], None]]) -> None:
        """Do all of them in any order; whoever is free takes the next."""
        waiting = deque(acts)

        def work() -> None:
            while waiting:
                try:
                    act = waiting.popleft()
                except IndexError:  # another thread took the last one
                    return
                act()

        if self._pool is None or self._process != os.getpid():
            self._process = os.getpid()
            self._pool = ThreadPoolExecutor(max(self.size - 1, 1), "crew")
        helping = [self._pool.submit(work) for _ in range(min(self.size, len(acts)) - 1)]
        work()
        for future in helping:
            if not future.cancel():
                future.result()
