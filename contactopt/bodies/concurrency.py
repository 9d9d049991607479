"""The one place where bodies work at the same time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(
    act: Callable[[Item], Result], items: Iterable[Item], parallel: Sequence[bool] | None = None
) -> tuple[Result, ...]:
    """`act` on every item, in order; those marked `parallel` (by default all) at the same time, each in its own thread.

    The threads end with the call. An exception of one item is raised here.
    """
    listed = list(items)
    marked = [True] * len(listed) if parallel is None else list(parallel)
    if sum(marked) < 2:
        return tuple(act(item) for item in listed)
    with ThreadPoolExecutor(sum(marked)) as pool:
        running = [pool.submit(act, item) if mark else None for item, mark in zip(listed, marked)]
        here = [act(item) if future is None else None for item, future in zip(listed, running)]
        return tuple(done if future is None else future.result() for future, done in zip(running, here))  # type: ignore[misc]
