"""Runs made by worker processes: problems built, methods run, answers certified; on one machine, or on a Dask cluster."""

from __future__ import annotations

import queue
import subprocess
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

from contactopt.benchmark.measure import Answer, Task, blank, judge
from contactopt.benchmark.problems import FAMILIES
from contactopt.benchmark.process import START, Ended, Process, one_line
from contactopt.benchmark.wire import ForeignMessage
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem

START_LIMIT = 120.0  # s until a process answers at all
BUILD_LIMIT = 1800.0  # s to build a problem
STARTS = 3  # of a process that is killed before it says a word: once may be chance, each time is its limit of memory
WARM_UP_LIMIT = 30.0  # s to import what a method needs, beyond its time limit
MARGIN, GRACE = 1.1, 0.5  # the hard limit is MARGIN * time_limit + GRACE: methods may end by themselves first
ROOM = 1e6  # bytes of a message beyond the arrays that it must hold
DIAGNOSED = ("rank", "condition", "guaranteed_mu", "alternating_mu", "tresca_mu")


@dataclass(frozen=True, eq=False)
class Built:
    """A problem as the campaign holds it, by which answers are judged; the columns that it fills."""

    label: str
    problem: InterfaceProblem
    facts: dict[str, Any]


class NotBuilt(Exception):
    """A problem could not be built; the message says how."""


class Worker:
    """Two processes: one builds problems and never runs a method, one runs methods and never builds a problem.

    Between them the problem is held here, where no plug-in runs, and every answer is judged by it. `run` blocks; use from
    one thread.
    """

    def __init__(self) -> None:
        self.builder, self.solver = Process("build"), Process("solve")
        self.held: Built | None = None
        self.sent = ""  # label of the problem that the solver keeps
        self.doubted = ""  # method that failed in the process and may have left it in disorder
        self.cold: set[str] = set()  # methods that did not survive their warm-up
        self.broken: dict[str, str] = {}  # problems that cannot be built -> how

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def process(self) -> subprocess.Popen | None:
        """The process that runs methods, if there is one now."""
        return self.solver.process

    def close(self) -> None:
        self.builder.close()
        self.solver.close()

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
            if task.run.method.plugin is not None and not row["success"] and row["status"] != "refused":
                self.doubted = task.run.method.label
            return row
        except Ended as end:
            row |= {"status": end.status, "message": end.message, "call_seconds": time.perf_counter() - begin}
            if end.phase == "neighbour":
                row |= {
                    "status": "not_built",
                    "message": f"{end.status} while its warm start was sought: {end.message}",
                }
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
        # A process that has loaded plug-ins builds nothing else: they may have changed the library there.
        foreign = spec.kind == "family" and spec.name not in FAMILIES
        if foreign:
            self.builder.kill()
        request = (spec, task.plugins if foreign else (), task.diagnose, task.memory_limit)
        try:
            found = self.builder.ask(request, {START: BUILD_LIMIT}, 1e9 * task.memory_limit)
            if "error" in found:
                raise NotBuilt(one_line(str(found["error"])))
            problem = replace(found["problem"])  # checked again, and nothing kept that was worked out elsewhere
            facts = {"fingerprint": problem.fingerprint, "contacts": problem.contacts, "dim": problem.dim}
            facts |= {"plates": len(problem.s), "build_seconds": float(found["build_seconds"])}
            facts |= {name: float(found["diagnosis"][name]) for name in DIAGNOSED if found["diagnosis"]}
        except Ended as end:
            how = f"{end.status} while the problem was built: {end.message}".rstrip(": ")
            self.broken[spec.label] = how
            raise NotBuilt(how) from end
        except NotBuilt as error:
            self.broken[spec.label] = str(error)
            raise
        except (LookupError, TypeError, ValueError) as error:
            self.broken[spec.label] = f"what was built is no problem: {one_line(error)}"
            raise NotBuilt(self.broken[spec.label]) from error
        finally:
            if foreign:
                self.builder.kill()
        self.held = Built(spec.label, problem, facts)
        return self.held

    def _answer(self, task: Task, built: Built, starts: int = 1) -> Answer:
        """What the method answers, at the first start of a process or a later one. Raises Ended if it did not outlive it."""
        method = task.run.method.label
        if self.doubted not in ("", method):
            self._restart()
        used = self.solver.running and bool(self.sent)
        known = self.solver.running and self.sent == built.label
        problem = None if known else built.problem
        hard = MARGIN * task.time_limit + GRACE
        limits = {START: START_LIMIT, "neighbour": BUILD_LIMIT, "warm up": WARM_UP_LIMIT + hard, "solve": hard}
        room = ROOM + 16.0 * (built.problem.q.size + len(built.problem.s))
        self.sent = built.label
        try:
            task = replace(task, warm_up=method not in self.cold)
            answer = Answer.of(self.solver.ask((task, problem), limits, room), built.problem)
        except ForeignMessage as error:
            self._restart()
            raise Ended("solve", "error", f"its process sent what it was not asked for: {error}") from error
        except Ended as end:
            self._restart()
            if end.phase == "warm up":  # says nothing of the run itself
                self.cold.add(method)
                return self._answer(task, built)
            if end.phase != START:
                raise
            if used:  # an earlier run left the process in disorder
                return self._answer(task, built)
            if end.status != "error" and starts < STARTS:
                return self._answer(task, built, starts + 1)
            if end.status != "error":
                raise InputError(
                    f"a worker process cannot start after {starts} trials ({end.status}, {end.message}); is memory_limit, "
                    f"{task.memory_limit:g} GB, enough?"
                ) from end
            raise
        if answer.status == "out_of_memory":
            self._restart()  # its memory is fragmented at best
        return answer

    def _restart(self) -> None:
        self.solver.kill()
        self.sent = self.doubted = ""


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
    """Execute runs by worker processes of this machine. When the iteration is left, the workers are killed.

    Parameters
    ----------
    tasks
        The runs.
    jobs
        Number of worker processes.

    Yields
    ------
    dict
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
        _of_thread.worker = Worker()
    return _of_thread.worker.run(task)


def run_on_cluster(tasks: Sequence[Task], address: str) -> Iterator[dict[str, Any]]:
    """Execute runs by a Dask cluster.

    Each thread of each Dask worker keeps a worker process of its own. Plug-in and FCLib files must be found under the
    same paths there. A run whose Dask worker is lost leaves no row: resume the campaign.

    Parameters
    ----------
    tasks
        The runs.
    address
        Of the Dask scheduler.

    Yields
    ------
    dict
        The row of each run as it is finished.

    Raises
    ------
    InputError
        If Dask is not installed, or no scheduler answers.
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
            running.add(client.submit(_run_here, task, pure=False))
        for future in running:
            for task in islice(waiting, 1):
                running.add(client.submit(_run_here, task, pure=False))
            if future.status == "finished":
                yield future.result()
