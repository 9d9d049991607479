"""What does the benchmark harness itself cost? 10,000 runs of next to nothing: time and memory per
run.
"""

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


def cpu_seconds() -> float:
    """Of this process and of the workers that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def measure(jobs: int) -> dict[str, object]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "nothing.py").write_text(PLUGIN)
        (folder / "overhead.toml").write_text(EXPERIMENT)
        start, cpu, before = (
            time.perf_counter(),
            cpu_seconds(),
            resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
        )
        out = benchmark.run_campaign(
            folder / "overhead.toml", folder / "out", jobs=jobs, quiet=True
        )
        wall, cpu = time.perf_counter() - start, cpu_seconds() - cpu
        rows = benchmark.load(out)
    spent = rows["call_seconds"].sum()
    tenth = len(rows) // 10
    return {
        "runs": len(rows),
        "worker processes": jobs,
        "seconds in all": wall,
        "of them in the method": float(spent),
        "overhead per run, ms of one worker": 1e3 * (wall * jobs - spent) / len(rows),
        "CPU per run, ms of all processes": 1e3 * cpu / len(rows),
        "worker, MB after a tenth": float(rows["base_mb"].iloc[:tenth].max()),
        "worker, MB at the end": float(rows["base_mb"].iloc[-tenth:].max()),
        "parent grew by, MB": (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e3,
    }


TEXT = """How much time does the benchmark harness add to a run? A method that returns zeros at once is run on ten problems of ten contacts. The
overhead is everything but the method's own call: the start of the worker processes, the making of
the problems, the messages between processes, the certificates, the rows on disk, and the Parquet
file at the end.

On a busy machine the CPU time of the workers and the parent process together tells more than the
wall time. The memory is resident memory. That of the parent process grows by the package Pandas and
by the table of all rows.

{rows}
"""

if __name__ == "__main__":
    write(
        "harness_overhead",
        "Overhead of the benchmark harness",
        TEXT,
        {"rows": [measure(j) for j in (1, JOBS)]},
        {},
    )
