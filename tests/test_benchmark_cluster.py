"""The same experiment on a Dask cluster."""

import sys

import distributed
import pytest

from contactopt import InputError, benchmark
from tests.test_benchmark import FAKES, SMALL, written


@pytest.mark.slow
def test_a_cluster_gives_the_same_rows(tmp_path):
    """A real local cluster: scheduler and two workers in processes of their own; one method ends
    its process.
    """
    written(tmp_path, FAKES, "fakes.py")
    text = 'plugins = ["fakes.py"]' + SMALL.replace('"nsgs"]', '"nsgs", "segfaults"]')
    path = written(tmp_path, text)
    here = benchmark.load(benchmark.run_campaign(path, tmp_path / "here", jobs=2, quiet=True))
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    )
    with cluster:
        address = cluster.scheduler_address
        folder = benchmark.run_campaign(
            path, tmp_path / "there", scheduler=address, quiet=True, filters=["repeat=0"]
        )
        assert len(benchmark.load(folder)) == 9
        there = benchmark.load(
            benchmark.run_campaign(path, folder, scheduler=address, quiet=True, resume=True)
        )
    columns = ["key", "problem", "fingerprint", "method", "status", "success"]
    a, b = (table.sort_values("key")[columns].reset_index(drop=True) for table in (here, there))
    assert a.equals(b) and set(a["status"]) == {"solved", "crashed"}


def test_no_cluster_is_a_clear_error(tmp_path, monkeypatch):
    path = written(tmp_path, SMALL)
    with pytest.raises(InputError, match="no Dask scheduler"):
        benchmark.run_campaign(path, tmp_path / "out", scheduler="nonsense://here", quiet=True)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match="cluster"):
        benchmark.run_campaign(
            path, tmp_path / "out", scheduler="tcp://127.0.0.1:1", quiet=True, resume=True
        )
