"""Cores, and the threads of BLAS."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


def cores() -> int:
    """Count the cores that this process may use.

    OMP_NUM_THREADS does not bound it: that is for the threads of BLAS.

    Returns
    -------
    The number of cores, at least 1.
    """
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread inside the block.

    It is for work with many small dense products, between which further threads would only spin.
    The limit holds for the whole process, so that one thread alone may set it at a time.

    Yields
    ------
    Nothing; the block runs under the limit.
    """
    with threadpool_limits(1, user_api="blas"):
        yield
