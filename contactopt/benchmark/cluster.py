"""Runs made on many machines: by the workers of a Dask scheduler, or in shards of a campaign."""

import re
from collections.abc import Generator, Sequence
from typing import Any

from contactopt.benchmark.measure import Task
from contactopt.benchmark.pool import History, Worker
from contactopt.benchmark.runs import Run
from contactopt.benchmark.store import require
from contactopt.cards import count
from contactopt.errors import InputError

CONNECT_LIMIT = 30.0  # s for a scheduler to answer


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
    scheduler: all runs of a problem one after the other on one of them. They come as soon as a
    problem is done. Problems of a worker that is lost go to another one.
    """
    require("distributed", extra="cluster")
    from distributed import Client, as_completed
    from distributed.scheduler import KilledWorker

    batches: dict[str, list[Task]] = {}
    for task in tasks:
        batches.setdefault(task.run.problem.label, []).append(task)
    try:
        client = Client(address, timeout=CONNECT_LIMIT)
    except (OSError, ValueError) as error:  # TimeoutError is an OSError
        raise InputError(f"no Dask scheduler answers at '{address}': {error}.") from error
    with client:
        names = {client.submit(_made, b, known, pure=False): name for name, b in batches.items()}
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


def _made(tasks: Sequence[Task], known: History) -> list[dict[str, Any] | None]:
    """The rows of a problem, made where this runs, in processes with the limits of the tasks."""
    with Worker() as worker:
        return [worker.row(task, known) for task in tasks]
