"""Worker processes seen from outside: start, watch, kill, replace; many of them on one machine, or on a Dask cluster."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from contactopt.benchmark.measure import Task, blank, short
from contactopt.errors import InputError

LIBRARIES = ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "BLIS_NUM", "NUMEXPR_NUM", "VECLIB_MAXIMUM", "RAYON_NUM")
ONE_THREAD = {f"{name}_THREADS": "1" for name in LIBRARIES}
BUILD_LIMIT = 1800.0  # s to build a problem
WARM_UP_LIMIT = 30.0  # s to import what a method needs, beyond its time limit
MARGIN, GRACE = 1.1, 0.5  # the hard limit is MARGIN * time_limit + GRACE: methods may end by themselves first
MEMORY_WORDS = (b"MemoryError", b"bad_alloc", b"out of memory", b"Out of memory", b"Cannot allocate memory")


class Worker:
    """One worker process at a time, replaced when it dies or is killed. `run` blocks; use from one thread."""

    def __init__(self) -> None:
        self.process: subprocess.Popen | None = None
        self.pipe: Connection
        self.cold: set[str] = set()  # methods that did not survive their warm-up
        self.broken: dict[str, str] = {}  # problems whose building ended the process -> how
        self.facts: dict[str, dict[str, Any]] = {}  # problem -> the columns it fills
        self.noise = tempfile.TemporaryFile(mode="a+b")  # noqa: SIM115 (what solvers print)

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *error: object) -> None:
        self.kill()
        self.noise.close()

    def run(self, task: Task) -> dict[str, Any]:
        """The row of this run, whatever happens to the process."""
        label = task.run.problem.label
        if label in self.broken:
            return blank(task) | {"status": "not_built", "message": self.broken[label]}
        task = replace(task, warm_up=task.run.method.label not in self.cold)
        begin = time.perf_counter()
        phase, end = self._watch(task)
        if isinstance(end, dict):
            if end["status"] == "out_of_memory":
                self.kill()  # its memory is fragmented at best
            return end
        status, message = end
        if phase == "warm up":  # says nothing of the run itself
            self.cold.add(task.run.method.label)
            return self.run(task)
        row = (
            blank(task)
            | self.facts.get(label, {})
            | {"status": status, "message": message, "call_seconds": time.perf_counter() - begin}
        )
        if phase == "start":
            raise RuntimeError(f"a worker process cannot start: {status}, {message}")
        if phase == "build":
            self.broken[label] = f"{status} while the problem was built: {message}".rstrip(": ")
            return row | {"status": "not_built", "message": self.broken[label]}
        return row

    def _watch(self, task: Task) -> tuple[str, dict[str, Any] | tuple[str, str]]:
        """The last phase, and the row or (status, message)."""
        if self.process is None:
            self._start()
        self.noise.truncate(0)
        hard = MARGIN * task.time_limit + GRACE
        limits = {"start": BUILD_LIMIT, "build": BUILD_LIMIT, "warm up": WARM_UP_LIMIT + hard, "solve": hard}
        phase = "start"
        try:
            self.pipe.send(task)
            deadline = time.monotonic() + limits[phase]
            while self.pipe.poll(max(0.0, deadline - time.monotonic())):
                message = self.pipe.recv()
                if isinstance(message, dict) and "key" in message:
                    return phase, message
                if isinstance(message, dict):
                    self.facts[task.run.problem.label] = message
                    continue
                phase = message
                deadline = time.monotonic() + limits[phase]
        except (EOFError, OSError):
            return phase, self._death()
        self.kill()
        return phase, ("killed", f"still running after {limits[phase]:g} s")

    def _start(self) -> None:
        self.pipe, theirs = Pipe()
        code = "from contactopt.benchmark.worker import main; main()"
        self.process = subprocess.Popen(
            [sys.executable, "-c", code, str(theirs.fileno()), str(os.getpid())],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=self.noise,
            stderr=self.noise,
            env=os.environ | ONE_THREAD,
            process_group=0,  # so that what a solver starts dies with it
        )
        theirs.close()

    def _death(self) -> tuple[str, str]:
        """How the process ended by itself: (status, message)."""
        assert self.process is not None
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(5)
        code = self.process.poll()
        self.noise.seek(0)
        said = self.noise.read()[-4000:]
        self.kill()
        last = said.strip().splitlines()[-1].decode(errors="replace") if said.strip() else ""
        if any(word in said for word in MEMORY_WORDS):
            return "out_of_memory", short(last)
        if code == -signal.SIGKILL:
            return "out_of_memory", "killed from outside, as the system does when memory runs out"
        how = signal.Signals(-code).name if code is not None and code < 0 else f"exit code {code}"
        return "crashed", short(f"{how}: {last}".rstrip(": "))

    def kill(self) -> None:
        if self.process is None:
            return
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self.pipe.close()
        self.process = None


class Shares:
    """Tasks handed out so that a worker stays with a problem, and two build the same one only if no other is left."""

    def __init__(self, tasks: Sequence[Task]):
        self.lock = threading.Lock()
        self.tasks: dict[str, deque[Task]] = {}
        for task in tasks:
            self.tasks.setdefault(task.run.problem.label, deque()).append(task)
        self.holders: dict[object, str] = {}

    def take(self, worker: object) -> Task | None:
        """The next task of this worker; None when there is none."""
        with self.lock:
            label = self.holders.get(worker)
            if label not in self.tasks:
                taken = set(self.holders.values())
                label = next((name for name in self.tasks if name not in taken), None)
                label = label or max(self.tasks, key=lambda name: len(self.tasks[name]), default=None)
            if label is None:
                return None
            self.holders[worker] = label
            task = self.tasks[label].popleft()
            if not self.tasks[label]:
                del self.tasks[label]
            return task


def run_locally(tasks: Sequence[Task], jobs: int) -> Iterator[dict[str, Any]]:
    """Rows as they are finished, by `jobs` worker processes. When the iteration is left, the workers are killed."""
    shares, rows, stop = Shares(tasks), queue.Queue[Any](), threading.Event()
    workers = [Worker() for _ in range(min(jobs, len(tasks)))]

    def serve(worker: Worker) -> None:
        try:
            while not stop.is_set() and (task := shares.take(worker)) is not None:
                rows.put(worker.run(task))
        except BaseException as error:
            rows.put(error)

    threads = [threading.Thread(target=serve, args=(worker,), daemon=True) for worker in workers]
    for thread in threads:
        thread.start()
    try:
        for _ in tasks:
            row = rows.get()
            if isinstance(row, BaseException):
                raise row
            yield row
    finally:
        stop.set()
        for worker in workers:
            if worker.process is not None:
                with suppress(ProcessLookupError):
                    os.killpg(worker.process.pid, signal.SIGKILL)
        for thread, worker in zip(threads, workers):
            thread.join(10)
            worker.kill()


_of_thread = threading.local()


def run_here(task: Task) -> dict[str, Any]:
    """One run, in a worker process that belongs to the calling thread: what a Dask worker executes."""
    if not hasattr(_of_thread, "worker"):
        _of_thread.worker = Worker()
    return _of_thread.worker.run(task)


def run_on_cluster(tasks: Sequence[Task], address: str) -> Iterator[dict[str, Any]]:
    """Rows as they are finished, by the Dask cluster whose scheduler is at `address`.

    Each thread of each Dask worker keeps a worker process of its own. Plug-in and FCLib files must be found under the same
    paths there. A run whose Dask worker is lost leaves no row: resume the campaign. Raises InputError without the cluster.
    """
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise InputError("a cluster needs Dask; install it with: pip install 'contactopt[cluster]'") from error
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at '{address}': {error}") from error
    with client:
        waiting = iter(tasks)
        ahead = 4 * max(1, sum(client.nthreads().values()))  # more would only fill the scheduler's memory
        running = as_completed([], raise_errors=False)
        for task in islice(waiting, ahead):
            running.add(client.submit(run_here, task, pure=False))
        for future in running:
            for task in islice(waiting, 1):
                running.add(client.submit(run_here, task, pure=False))
            if future.status == "finished":
                yield future.result()
