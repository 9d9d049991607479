"""Campaigns on many machines: shards that join, and a Dask scheduler whose worker is killed."""

import os
import signal
import subprocess
import sys
import time

import pytest

from contactopt import InputError
from contactopt.benchmark import cluster as cluster_module
from contactopt.benchmark.campaign import run_campaign
from contactopt.benchmark.cluster import batches, run_on_cluster, shard_of
from contactopt.benchmark.experiment import read_experiment
from contactopt.benchmark.measure import Task
from contactopt.benchmark.merging import joined
from contactopt.benchmark.pool import History
from contactopt.benchmark.store import load
from tests.test_benchmark import SMALL, run, written

pytest.importorskip("pandas")
SAME = ["problem", "method", "setting", "repeat", "status", "residual", "iterations"]


@pytest.mark.slow
def test_shards_are_disjoint_whole_and_join_to_one_campaign(tmp_path):
    path = written(tmp_path, SMALL)
    runs = read_experiment(path).runs()
    shards = [shard_of(runs, f"{i}/2") for i in (1, 2)]
    assert sorted(run.key for part in shards for run in part) == sorted(run.key for run in runs)
    folders = [tmp_path / f"part{i}" for i in (1, 2)]
    for i, folder in enumerate(folders, 1):
        run_campaign(path, folder, jobs=1, shard=f"{i}/2", filters=["repeat=0"], quiet=True)
    table, said = joined(folders[0], folders[1:])
    assert len(table) == len(runs) / 2 and set(table["method"]) == {"auto", "nsgs"}
    assert table["success"].all() and "certificates were recomputed" in said[0]
    for wrong in ("0/2", "3/2", "2", "a/b", "4/9"):
        with pytest.raises(InputError, match="shard"):
            shard_of(runs, wrong)


def started(*command):
    return subprocess.Popen(
        [sys.executable, "-m", *command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


@pytest.fixture
def cluster(tmp_path):
    """The address of a scheduler, and two workers of one thread."""
    pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    own = ["--scheduler-file", str(file)]
    command = ["distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard"]
    processes = [started(*command, "--host", "127.0.0.1", *own)]
    try:
        for _ in range(300):
            if file.exists():
                break
            time.sleep(0.1)
        worker = ["distributed.cli.dask_worker", "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        folder = ["--local-directory", str(tmp_path)]
        processes += [started(*worker, *own, *folder) for _ in range(2)]
        from distributed import Client

        with Client(scheduler_file=str(file), timeout=60) as client:
            client.wait_for_workers(2, timeout=60)
            yield client.scheduler.address, processes[1:]
    finally:
        for process in processes:
            process.kill()
        for process in processes:
            process.wait(20)


SLOW = """
import pathlib, time
from contactopt import solve
from contactopt.benchmark import method

@method
def slow(problem):
    if problem.q.size > 10:
        pathlib.Path("STARTED").touch()
        time.sleep(0.7)
    return solve(problem).reactions
"""


@pytest.mark.slow
def test_a_killed_worker_loses_nothing_and_rows_are_those_of_one_machine(cluster, tmp_path):
    address, workers = cluster
    sign = tmp_path / "sign"
    written(tmp_path, SLOW.replace("STARTED", str(sign)), "slow.py")
    text = 'plugins = ["slow.py"]' + SMALL.replace('["auto", "nsgs"]', '["auto", "nsgs", "slow"]')
    path = written(tmp_path, text)
    far = tmp_path / "far"
    given = ["contactopt", "bench", str(path), "--out", str(far), "--scheduler", address, "-q"]
    campaign = started(*given)
    try:
        for _ in range(600):
            if sign.exists():
                break
            time.sleep(0.1)
        os.kill(workers[0].pid, signal.SIGKILL)
        assert campaign.wait(400) == 0
    finally:
        campaign.kill()
    found = load(far)
    here = run(tmp_path, text)
    assert len(found) == len(here) and found["success"].all()
    kept = [t.sort_values(SAME[:4])[SAME].to_csv(index=False) for t in (found, here)]
    assert kept[0] == kept[1]


def test_batches_keep_problems_together_and_split_few_of_them_by_methods(tmp_path):
    runs = read_experiment(written(tmp_path, SMALL)).runs()
    tasks = [Task(run, "small", (), 10.0, 4.0, 100, 0) for run in runs]
    for wanted, number in ((0, 3), (3, 3), (4, 6), (100, 6)):  # of 3 problems and 2 methods
        made = batches(tasks, wanted)
        assert len(made) == number and sum(map(len, made)) == len(tasks)
        assert all(len({task.run.problem.label for task in batch}) == 1 for batch in made)
        pairs = [{(t.run.problem.label, t.run.method.label) for t in batch} for batch in made]
        assert sum(map(len, pairs)) == len(set.union(*pairs)) == 6
        order = [[tasks.index(task) for task in batch] for batch in made]
        assert all(batch == sorted(batch) for batch in order)


class Kept:
    """A worker that only knows whether it was closed."""

    closed = False

    def close(self):
        self.closed = True


def test_a_worker_waits_for_the_next_batch_of_its_campaign_only(monkeypatch):
    monkeypatch.setattr(cluster_module, "Worker", Kept)
    waiting = cluster_module._Waiting()
    first = waiting.take("a")
    waiting.leave("a", first)
    assert waiting.take("a") is first and waiting.take("a") is not first
    waiting.leave("a", first)
    other = waiting.take("b")
    assert other is not first and first.closed and not waiting.workers
    monkeypatch.setattr(cluster_module, "IDLE", 0.01)
    waiting.leave("b", other)
    for _ in range(500):
        if other.closed:
            break
        time.sleep(0.01)
    assert other.closed and not waiting.workers


def test_an_address_without_a_scheduler_is_one_sentence(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("contactopt.benchmark.cluster.CONNECT_LIMIT", 0.5)
    for address in ("tcp://127.0.0.1:9", "nowhere"):
        with pytest.raises(InputError, match="no Dask scheduler answers"):
            list(run_on_cluster(address, [], History()))
