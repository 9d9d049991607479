"""Runs made by worker processes: problems built, methods run, answers certified; on one machine, or
on a Dask cluster.
"""

from __future__ import annotations

import multiprocessing
import queue
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

from contactopt.benchmark import worker
from contactopt.benchmark.measure import Answer, Task, blank, judge
from contactopt.benchmark.problems import FAMILIES
from contactopt.benchmark.process import START, Ended, Process, one_line
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem

BUILD_LIMIT = 1800.0  # s to build a problem
# s at least for the first call of a method of this package, which imports what it needs
WARM_UP = 30.0
PLUGIN_WARM_UP = 3.0  # s the same for a plug-in, whose file was loaded before
# the hard limit is MARGIN * time_limit + GRACE: methods may end by themselves first
MARGIN, GRACE = 1.1, 0.5
DIAGNOSED = ("rank", "condition", "guaranteed_mu", "alternating_mu", "tresca_mu")
_cold: set[str] = set()  # methods that did not survive their warm-up, in any worker of this process


@dataclass(frozen=True, eq=False)
class Built:
    """A problem as the campaign holds it, by which answers are judged; the columns that it fills."""

    label: str
    problem: InterfaceProblem
    facts: dict[str, Any]


class NotBuilt(Exception):
    """A problem could not be built; the message says how."""


class Worker:
    """Two processes: one builds problems and never runs a method, one runs methods and never builds
    a problem.

    Between them the problem is held here, where no plug-in runs, and every answer is judged by it.
    `run` blocks; use from one thread.
    """

    def __init__(self) -> None:
        self.builder, self.solver = Process(), Process()
        self.held: Built | None = None
        self.sent = ""  # label of the problem that the solver keeps
        self.warm: set[tuple[str, int]] = set()  # methods and dimensions that were warmed up there
        self.doubted = ""  # method that failed in the process and may have left it in disorder
        self.broken: dict[str, str] = {}  # problems that cannot be built -> how

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        self.builder.kill()
        self.solver.kill()

    def interrupt(self) -> None:
        """Let `run` end soon, from another thread."""
        self.builder.interrupt()
        self.solver.interrupt()

    def run(self, task: Task) -> dict[str, Any]:
        """The row of this run, whatever happens to the processes."""
        row = blank(task)
        try:
            built = self._build(task)
        except NotBuilt as error:
            return row | {"status": "not_built", "message": str(error)}
        row |= built.facts
        try:
            row["backend"] = task.run.method.backends(built.problem.dim)
        except InputError as error:
            return row | {"status": "refused", "message": one_line(error)}
        begin = time.perf_counter()
        try:
            row |= judge(task, built.problem, self._answer(task, built))
        except Ended as end:
            if end.phase == "neighbour":
                end.status, end.message = (
                    "not_built",
                    f"{end.status} while its warm start was sought: {end.message}",
                )
            return row | {
                "status": end.status,
                "message": end.message,
                "call_seconds": time.perf_counter() - begin,
            }
        if task.run.method.plugin is not None and not row["success"] and row["status"] != "refused":
            self.doubted = task.run.method.label
        return row

    def _build(self, task: Task) -> Built:
        """The task's problem, held or built anew."""
        spec = task.run.problem
        if spec.label in self.broken:
            raise NotBuilt(self.broken[spec.label])
        if self.held is not None and self.held.label == spec.label:
            return self.held
        self.held = None
        self.solver.start()  # imports at the same time
        foreign = spec.kind == "family" and spec.name not in FAMILIES
        request = (spec, task.plugins if foreign else (), task.diagnose, task.memory_limit)
        try:
            found = self.builder.ask(BUILD_LIMIT, "build", worker.build, *request)
            how = one_line(found.get("error", ""))
        except Ended as end:
            how = f"{end.status} while the problem was built: {end.message}".rstrip(": ")
        finally:
            if foreign:  # a plug-in may have changed the library there
                self.builder.kill()
        if how:
            self.broken[spec.label] = how
            raise NotBuilt(how)
        problem = found["problem"]
        facts = {
            "fingerprint": problem.fingerprint,
            "contacts": problem.contacts,
            "dim": problem.dim,
        }
        facts |= {
            "plates": len(problem.s),
            "build_seconds": found["build_seconds"],
            **found["diagnosis"],
        }
        self.held = Built(spec.label, problem, facts)
        return self.held

    def _answer(self, task: Task, built: Built) -> Answer:
        """What the method answers. Raises Ended if its process did not outlive it."""
        if self.doubted not in ("", task.run.method.label):
            self._restart()
        answer = None
        while answer is None:  # its process may have been replaced since it got the problem
            try:
                self._prepare(task, built)
                hard = MARGIN * task.time_limit + GRACE
                answer = self.solver.ask(hard, "solve", worker.execute, task)
            except Ended as end:
                self._restart()
                if end.phase == START:
                    raise InputError(
                        f"a worker process cannot start ({end.status}, {end.message}); is there"
                        " memory enough?"
                    ) from end
                if end.phase != "warm up":  # which says nothing of the run itself
                    raise
                _cold.add(task.run.method.name)
            if answer is None:
                self.sent = ""
        if answer.status == "out_of_memory":
            self._restart()  # its memory is fragmented at best
        return answer

    def _prepare(self, task: Task, built: Built) -> None:
        """Give the process the problem, a warm start if one is asked for, and the imports of the
        method.
        """
        method, dim = task.run.method, built.problem.dim
        if self.sent != built.label or not self.solver.running:
            self.warm = self.warm if self.solver.running else set()
            self.solver.ask(
                BUILD_LIMIT, "send", worker.hold, built.label, built.problem, task.plugins
            )
            self.sent = built.label
        if task.run.start == "warm":
            self.solver.ask(BUILD_LIMIT, "neighbour", worker.find_start, built.label)
        if (method.label, dim) not in self.warm and method.name not in _cold:
            limit = max(
                MARGIN * task.time_limit + GRACE,
                WARM_UP if method.plugin is None else PLUGIN_WARM_UP,
            )
            self.solver.ask(limit, "warm up", worker.warm_up, task, dim)
            self.warm.add((method.label, dim))

    def _restart(self) -> None:
        self.solver.kill()
        self.sent = self.doubted = ""
        self.warm = set()


class Shares:
    """Tasks handed out so that a worker stays with a problem, and two build the same one only if no
    other is left.
    """

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
                label = label or max(
                    self.tasks, key=lambda name: len(self.tasks[name]), default=None
                )
            if label is None:
                return None
            self.holders[worker] = label
            task = self.tasks[label].popleft()
            if not self.tasks[label]:
                del self.tasks[label]
            return task


def run_locally(tasks: Sequence[Task], jobs: int) -> Iterator[dict[str, Any]]:
    """Execute runs by worker processes of this machine.

    When the iteration is left, the workers are killed.

    Parameters
    ----------
    tasks : The runs.
    jobs : Number of worker processes.

    Yields
    ------
    The row of each run as it is finished.
    """
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
            worker.interrupt()
        for thread, worker in zip(threads, workers):
            thread.join(10)
            worker.close()


_of_thread = threading.local()


def _run_here(task: Task) -> dict[str, Any]:
    """One run, in a worker process that belongs to the calling thread: what a Dask worker executes."""
    if not hasattr(_of_thread, "worker"):
        multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]  # it may have children
        _of_thread.worker = Worker()
    return _of_thread.worker.run(task)


def run_on_cluster(tasks: Sequence[Task], address: str) -> Iterator[dict[str, Any]]:
    """Execute runs by a Dask cluster.

    Each thread of each Dask worker keeps a worker process of its own. Plug-in and FCLib files must
    be found under the same paths there. A run whose Dask worker is lost leaves no row: resume the
    campaign.

    Parameters
    ----------
    tasks : The runs.
    address : Of the Dask scheduler.

    Yields
    ------
    The row of each run as it is finished.

    Raises
    ------
    InputError : If Dask is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise InputError(
            "a cluster needs Dask; install it with: pip install 'contactopt[cluster]'"
        ) from error
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at '{address}': {error}") from error
    with client:
        waiting = iter(tasks)
        # more would only fill the scheduler's memory
        ahead = 4 * max(1, sum(client.nthreads().values()))
        running = as_completed([], raise_errors=False)
        for task in islice(waiting, ahead):
            running.add(client.submit(_run_here, task, pure=False))
        for future in running:
            for task in islice(waiting, 1):
                running.add(client.submit(_run_here, task, pure=False))
            if future.status == "finished":
                yield future.result()
