"""Runs made on many machines: by the workers of a Dask scheduler, or in shards of a campaign."""

import re
import threading
import uuid
from collections.abc import Generator, Sequence
from typing import Any

from contactopt.benchmark.measure import Task
from contactopt.benchmark.pool import History, Worker
from contactopt.benchmark.runs import Run
from contactopt.benchmark.store import require
from contactopt.cards import count
from contactopt.errors import InputError

CONNECT_LIMIT = 30.0  # s for a scheduler to answer
# of each worker at least: the last one to end lets the others wait for a small part of the time
BATCHES = 8
IDLE = 30.0  # s after which processes that wait for a batch end


def shard_of(runs: Sequence[Run], shard: str) -> list[Run]:
    """The runs of shard "i/n": those of every n-th problem from the i-th on, i from 1 to n."""
    found = re.fullmatch(r"(\d{1,9})/(\d{1,9})", shard)
    i, n = map(int, found.groups()) if found else (0, 0)
    if not 1 <= i <= n:
        raise InputError(f"the shard '{shard}' must be i/n with whole numbers, i from 1 to n.")
    names = list(dict.fromkeys(run.problem.label for run in runs))
    if i > len(names):
        raise InputError(
            f"shard {shard} is empty: the run has only {count(len(names), 'problem')}."
        )
    return [run for run in runs if run.problem.label in {*names[i - 1 :: n]}]


def run_on_cluster(
    address: str, tasks: Sequence[Task], known: History
) -> Generator[dict[str, Any] | None]:
    """The rows of the runs, None for one that is not repeated, made by the workers of a Dask
    scheduler in batches, whose rows come as soon as a batch is done. Batches of a worker that is
    lost go to another one.
    """
    require("distributed", extra="cluster")
    from distributed import Client, as_completed
    from distributed.scheduler import KilledWorker

    campaign = uuid.uuid4().hex
    try:
        client = Client(address, timeout=CONNECT_LIMIT)
    except (OSError, ValueError) as error:  # TimeoutError is an OSError
        raise InputError(f"no Dask scheduler answers at '{address}': {error}.") from error
    with client:
        names = {}
        for batch in batches(tasks, BATCHES * sum(client.nthreads().values())):
            name = batch[0].run.problem.label
            future = client.submit(_made, campaign, batch, known.of(name), pure=False)
            names[future] = name
        try:
            for future in as_completed(names):
                yield from future.result()
        except KilledWorker as error:
            raise InputError(
                f"the problem '{names[future]}' was lost with {error.allowed_failures + 1} workers;"
                " look at their logs. Finished problems are kept, go on with --resume."
            ) from error
        finally:
            client.cancel(list(names))


def batches(tasks: Sequence[Task], wanted: int) -> list[list[Task]]:
    """The tasks, those of a problem together, so that a worker builds it once. If the problems are
    fewer than the batches wanted, each is split by methods, since a run may depend on earlier ones
    of its method.
    """
    problems: dict[str, list[Task]] = {}
    for task in tasks:
        problems.setdefault(task.run.problem.label, []).append(task)
    parts = -(-wanted // max(1, len(problems)))
    made: list[list[Task]] = []
    for own in problems.values():
        order = list(dict.fromkeys(task.run.method.label for task in own))
        split: dict[int, list[Task]] = {}
        for task in own:
            split.setdefault(order.index(task.run.method.label) % max(1, parts), []).append(task)
        made += split.values()
    return made


def _made(campaign: str, tasks: Sequence[Task], known: History) -> list[dict[str, Any] | None]:
    """The rows of a batch, made where this runs, in processes with the limits of the tasks."""
    worker = _waiting.take(campaign)
    try:
        rows = [worker.row(task, known) for task in tasks]
    except BaseException:
        worker.close()
        raise
    _waiting.leave(campaign, worker)
    return rows


class _Waiting:
    """Workers between two batches of a campaign, whose processes need not start again. They are
    closed if no batch comes for IDLE seconds, or one of another campaign.
    """

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.workers: list[tuple[str, Worker, threading.Timer]] = []

    def take(self, campaign: str) -> Worker:
        """A worker that waits, or a new one."""
        with self.lock:
            own = [one for one in self.workers if one[0] == campaign]
            gone = own[:1] + [one for one in self.workers if one[0] != campaign]
            self.workers = own[1:]
        for name, worker, timer in gone:
            timer.cancel()
            if name != campaign:
                worker.close()
        return own[0][1] if own else Worker()

    def leave(self, campaign: str, worker: Worker) -> None:
        """Let it wait."""
        timer = threading.Timer(IDLE, self._end, [worker])
        timer.daemon = True
        with self.lock:
            self.workers.append((campaign, worker, timer))
        timer.start()

    def _end(self, worker: Worker) -> None:
        with self.lock:
            found = [one for one in self.workers if one[1] is worker]
            self.workers = [one for one in self.workers if one[1] is not worker]
        if found:
            worker.close()


_waiting = _Waiting()
