"""What does the benchmark harness itself cost? 10,000 runs of next to nothing: time and memory per run."""

from __future__ import annotations

import resource
import tempfile
import time
from pathlib import Path

from contactopt import benchmark
from experiments.report import write

RUNS, JOBS, PROBLEMS = 10_000, 2, 10
EXPERIMENT = f"""
name = "overhead"
plugins = ["nothing.py"]
settings = ["mid"]
repeats = {RUNS // PROBLEMS}
[[problems]]
family = "rigid_bodies"
bodies = 3
contacts = 10
seed = {{from = 0, to = {PROBLEMS - 1}, steps = {PROBLEMS}}}
[[methods]]
method = "nothing"
"""
PLUGIN = """
import numpy as np
from contactopt.benchmark import method

@method
def nothing(problem):
    return np.zeros(problem.q.shape)
"""


def measure(jobs: int) -> dict[str, object]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "nothing.py").write_text(PLUGIN)
        (folder / "overhead.toml").write_text(EXPERIMENT)
        start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        out = benchmark.run_campaign(folder / "overhead.toml", folder / "out", jobs=jobs, quiet=True)
        wall = time.perf_counter() - start
        rows = benchmark.load(out)
    spent = rows["call_seconds"].sum()
    tenth = len(rows) // 10
    return {
        "runs": len(rows),
        "worker processes": jobs,
        "seconds in all": wall,
        "of them in the method": float(spent),
        "overhead per run, ms of one worker": 1e3 * (wall * jobs - spent) / len(rows),
        "worker, MB after a tenth": float(rows["base_mb"].iloc[:tenth].max()),
        "worker, MB at the end": float(rows["base_mb"].iloc[-tenth:].max()),
        "parent grew by, MB": (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e3,
    }


TEXT = """A method that returns zeros at once, on ten problems of ten contacts. The overhead counts everything but the method's
own call: starting the workers, building problems, handing over runs, certificates, rows on disk, and the Parquet file at the
end. Memory is resident; the parent's grows by Pandas and the table of all rows.

{rows}
"""

if __name__ == "__main__":
    write("harness_overhead", "Overhead of the benchmark harness", TEXT, {"rows": [measure(j) for j in (1, JOBS)]}, {})
