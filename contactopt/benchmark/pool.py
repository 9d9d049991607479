"""Runs made by worker processes, each within its limit of time, and certified."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Generator, Iterable, Mapping, Sequence
from typing import Any

from contactopt.benchmark import worker
from contactopt.benchmark.measure import Task, blank, judge
from contactopt.benchmark.peers import Answer
from contactopt.benchmark.problems import FAMILIES
from contactopt.benchmark.process import KILLED, START, Ended, Process, one_line
from contactopt.benchmark.runs import Run
from contactopt.benchmark.sequences import Sequence as States
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem

BUILD_LIMIT = 1800.0  # s to build a problem
# s at least for the first call of a method of this package, which imports what it needs
WARM_UP = 30.0
PLUGIN_WARM_UP = 3.0  # s the same for a plug-in, whose file was loaded before
# the hard limit is MARGIN * time_limit + GRACE: methods may end by themselves first
MARGIN, GRACE = 1.1, 0.5
# s of CPU, and of the clock, of a run above which it is not repeated: on a busy machine short runs
# take long by the clock
LONG, LONG_WAIT = 1.0, 10.0
_cold: set[str] = set()  # methods that did not survive their warm-up, in any worker of this process


class Worker:
    """Two processes: one builds problems and never runs a method, one runs methods and never builds
    a problem.

    Between them the problem is held here, where no plug-in runs, and every answer is judged by it.
    `run` blocks; use from one thread.
    """

    def __init__(self) -> None:
        self.builder, self.solver = Process(), Process()
        self.held = ""  # label of the problem that is held, with the columns that it fills
        self.problem: InterfaceProblem | States
        self.facts: dict[str, Any]
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

    def row(self, task: Task, known: History) -> dict[str, Any] | None:
        """The row of this run, which `known` then knows; None if it needs no repeat."""
        if known.repeated(task.run):
            return None
        row = self.run(task, known.hopeless(task.run))
        known.add(row)
        return row

    def run(self, task: Task, hopeless: bool = False) -> dict[str, Any]:
        """The row of a run, whatever happens to the processes; a `hopeless` one is not started."""
        row = blank(task)
        self._build(task)
        if (label := task.run.problem.label) in self.broken:
            return row | {"status": "not_built", "message": self.broken[label]}
        row |= self.facts
        try:
            row["backend"] = task.run.method.backends(self.problem.dim)
        except InputError as error:
            return row | {"status": "refused", "message": one_line(error)}
        if hopeless:
            words = "not made: a looser tolerance already took more than the time limit"
            return row | {"status": "time_limit", "message": words, "call_seconds": task.time_limit}
        # a plug-in may keep answers, and what it does to its process, to itself; a peer has another
        alone = task.run.method.foreign and not task.run.method.peer
        begin = time.perf_counter()
        try:
            answer = self._answer(task)
        except Ended as end:
            spent = time.perf_counter() - begin
            leaked = end.held > 0.8 * task.memory_limit  # Python holds less when a request fails
            status = "out_of_memory" if leaked else end.status
            return row | {"status": status, "message": str(end), "call_seconds": spent}
        if alone:
            self.solver.kill()
            self.solver.start()
        return row | judge(task, self.problem, answer)

    def _build(self, task: Task) -> None:
        """Hold the task's problem, or why it cannot be built."""
        spec = task.run.problem
        if spec.label in (self.held, *self.broken):
            return
        self.solver.start()  # imports at the same time
        foreign = spec.kind == "family" and spec.name not in FAMILIES
        request = (spec, task.plugins if foreign else (), task.diagnose, task.memory_limit)
        for _ in range(2):  # killed once may be chance, and would cost all runs of the problem
            try:
                found = self.builder.ask(BUILD_LIMIT, "build", worker.build, *request)
                break
            except Ended as end:
                found = one_line(f"{end.status} while the problem was built: {end}".rstrip(": "))
                if str(end) != KILLED:
                    break
        if foreign:  # a plug-in may have changed the library there
            self.builder.kill()
        if isinstance(found, str):
            self.broken[spec.label] = found
        else:
            self.held, (self.problem, self.facts) = spec.label, found

    def _answer(self, task: Task) -> Answer:
        """What the method answers. Raises Ended if its process did not outlive it."""
        answer = None
        while answer is None:  # its process may have been replaced since it got the problem
            try:
                self._prepare(task)
                hard = MARGIN * task.time_limit + GRACE
                hard += 30.0 if task.run.method.peer else 0.0  # s to start and take the problem
                answer = self.solver.ask(hard, "solve", worker.execute, task)
            except Ended as end:
                self.solver.kill()
                if end.phase == START:
                    raise InputError(
                        f"a worker process cannot start ({end.status},"
                        f" {end}); is there memory enough?"
                    ) from end
                if end.phase != "warm up":  # which says nothing of the run itself
                    raise
                _cold.add(task.run.method.name)
        if answer.status == "out_of_memory":
            self.solver.kill()  # its memory is fragmented at best
        return answer

    def _prepare(self, task: Task) -> None:
        """Give the process the problem, and let it import what the method needs."""
        method, dim = task.run.method, self.problem.dim
        if self.solver.known.get("problem") != self.held:
            given = (self.held, self.problem, task.plugins)
            self.solver.ask(BUILD_LIMIT, "send", worker.hold, *given)
            self.solver.known["problem"] = self.held
        warm = f"warm {method.label} {dim}"
        if warm not in self.solver.known and method.name not in _cold:
            least = PLUGIN_WARM_UP if method.foreign else WARM_UP
            limit = max(MARGIN * task.time_limit + GRACE, least)
            self.solver.ask(limit, "warm up", worker.warm_up, task, dim)
            self.solver.known[warm] = method.label


class Shares:
    """Tasks dealt so that workers stay with a problem, and share one only at the end."""

    def __init__(self, tasks: Sequence[Task]):
        self.lock = threading.Lock()
        self.tasks: dict[str, list[Task]] = {}  # of each problem, the next one last
        for task in reversed(tasks):
            self.tasks.setdefault(task.run.problem.label, []).append(task)
        self.holders: dict[object, str] = {}

    def take(self, worker: object) -> Task | None:
        """The next task of this worker; None when there is none."""
        with self.lock:
            own, others = self.holders.pop(worker, ""), {*self.holders.values()}
            left = [name for name, tasks in self.tasks.items() if tasks]
            if not left:
                return None
            free = [name for name in reversed(left) if name not in others]
            most = max(left, key=lambda name: len(self.tasks[name]))
            self.holders[worker] = own if own in left else next(iter(free), most)
            return self.tasks[self.holders[worker]].pop()


class History:
    """What earlier runs say of later ones.

    A run that took longer than LONG, was refused or ended at its limit of time is not repeated, and
    none along a sequence, whose time is a sum over many states. At tighter tolerances a limit of
    time would end it too, so that these runs are not made.
    """

    def __init__(self, rows: Iterable[Mapping[str, Any]] = ()):
        self.once: set[tuple[str, ...]] = set()
        self.ended: dict[tuple[str, ...], float] = {}  # -> the tolerance
        for row in rows:
            self.add(row)

    def add(self, row: Mapping[str, Any]) -> None:
        """Take a row into account."""
        key = row["problem"], row["method"]
        long = row["cpu_seconds"] > LONG or row["call_seconds"] > LONG_WAIT
        late = row["status"] in ("time_limit", "killed")
        if long or late or row["states"] > 1 or row["status"] == "refused":
            self.once.add((*key, row["setting"]))
        if late:
            self.ended[key] = max(row["tolerance"], self.ended.get(key, 0.0))

    def repeated(self, run: Run) -> bool:
        """Whether a run is a repeat of one that is made once."""
        key = run.problem.label, run.method.label, run.setting
        return run.repeat > 0 and key in self.once

    def hopeless(self, run: Run) -> bool:
        """Whether the same method had not enough time for a looser tolerance."""
        return run.tolerance < self.ended.get((run.problem.label, run.method.label), 0.0)


def run_locally(
    tasks: Sequence[Task], jobs: int, history: History | None = None
) -> Generator[dict[str, Any] | None]:
    """The row of each run as it is finished, None for one that is not repeated, made by `jobs`
    workers.

    `history` knows the rows that were made before. When the iteration is left, the workers are
    killed.
    """
    known = history or History()
    shares, rows, stop = Shares(tasks), queue.Queue[Any](), threading.Event()
    workers = [Worker() for _ in range(min(jobs, len(tasks)))]

    def serve(worker: Worker) -> None:
        try:
            while not stop.is_set() and (task := shares.take(worker)) is not None:
                rows.put(worker.row(task, known))
        except BaseException as error:
            rows.put(error)
        finally:  # Linux kills a process with the thread that started it: it is ended before, whole
            worker.close()

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
