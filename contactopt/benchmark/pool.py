"""Runs made by worker processes, each within its limit of time, and certified."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Generator, Iterable, Mapping, Sequence
from typing import Any

from contactopt.benchmark import worker
from contactopt.benchmark.families import FAMILIES
from contactopt.benchmark.measure import Task, blank, judge
from contactopt.benchmark.peers import Answer
from contactopt.benchmark.process import KILLED, LOAD_LIMIT, START, Ended, Process, one_line
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
    """Three processes: one builds problems and never runs a method, one runs methods of this
    package, and one runs plug-ins, which no other process loads.

    Between them the problem is held here, where no plug-in runs, and every answer is judged by it.
    `run` blocks; use from one thread.
    """

    def __init__(self) -> None:
        self.builder, self.solver, self.guest = self.processes = Process(), Process(), Process()
        self.held = ""  # label of the problem that is held, with the columns that it fills
        self.problem: InterfaceProblem | States
        self.facts: dict[str, Any]
        self.broken: dict[str, str] = {}  # problems that cannot be built -> how

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        for process in self.processes:
            process.kill()

    def interrupt(self) -> None:
        """Let `run` end soon, from another thread."""
        for process in self.processes:
            process.interrupt()

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
        process = self._process(task)
        alone = process is self.guest and not task.run.method.peer
        begin = time.perf_counter()
        try:
            answer = self._answer(task, process)
        except RuntimeError as error:  # a plug-in cannot be loaded any more
            return row | {"message": one_line(str(error))}
        except Ended as end:
            spent = time.perf_counter() - begin
            leaked = end.held > 0.8 * task.memory_limit  # Python holds less when a request fails
            status = "out_of_memory" if leaked else end.status
            return row | {"status": status, "message": str(end), "call_seconds": spent}
        if alone:  # the next one starts when it is asked: until then another run may be timed
            process.kill()
        return row | judge(task, self.problem, answer)

    def _process(self, task: Task) -> Process:
        """The process that runs the method."""
        return self.guest if task.run.method.foreign else self.solver

    def _build(self, task: Task) -> None:
        """Hold the task's problem, or why it cannot be built."""
        spec = task.run.problem
        if spec.label in (self.held, *self.broken):
            return
        self._process(task).start()  # imports at the same time
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

    def _answer(self, task: Task, process: Process) -> Answer:
        """What the method answers. Raises Ended if its process did not outlive it."""
        answer = None
        while answer is None:  # its process may have been replaced since it got the problem
            try:
                self._prepare(task, process)
                hard = MARGIN * task.time_limit + GRACE
                hard += 30.0 if task.run.method.peer else 0.0  # s to start and take the problem
                answer = process.ask(hard, "solve", worker.execute, task)
            except Ended as end:
                process.kill()
                if end.phase == START:
                    raise InputError(
                        f"a worker process cannot start ({end.status},"
                        f" {end}); is there memory enough?"
                    ) from end
                if end.phase != "warm up":  # which says nothing of the run itself
                    raise
                _cold.add(task.run.method.name)
        if answer.status == "out_of_memory":
            process.kill()  # its memory is fragmented at best
        return answer

    def _prepare(self, task: Task, process: Process) -> None:
        """Give the process the problem, and let it import what the method needs."""
        method, dim = task.run.method, self.problem.dim
        if method.foreign and "plug-ins" not in process.known:
            process.ask(LOAD_LIMIT, "load", worker.load, task.plugins)
            process.known["plug-ins"] = "loaded"
        if process.known.get("problem") != self.held:
            process.ask(BUILD_LIMIT, "send", worker.hold, self.held, self.problem)
            process.known["problem"] = self.held
        warm = f"warm {method.label} {dim}"
        if warm not in process.known and method.name not in _cold:
            least = PLUGIN_WARM_UP if method.foreign else WARM_UP
            limit = max(MARGIN * task.time_limit + GRACE, least)
            process.ask(limit, "warm up", worker.warm_up, task, dim)
            process.known[warm] = method.label


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

    def of(self, problem: str) -> History:
        """What they say of the runs of one problem."""
        made = History()
        made.once = {key for key in self.once if key[0] == problem}
        made.ended = {key: by for key, by in self.ended.items() if key[0] == problem}
        return made

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
