"""Cores, and the threads of BLAS."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


def cores() -> int:
    """Number of cores that this process may use. OMP_NUM_THREADS does not bound it: that is for the threads of BLAS."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """One thread of BLAS inside.

    It is for work with many small dense products, between which further threads would only spin. The limit holds for the
    whole process, so that one thread alone may set it at a time.
    """
    with threadpool_limits(1, user_api="blas"):
        yield
