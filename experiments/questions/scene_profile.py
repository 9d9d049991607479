"""Where do time and memory go in the three scenes, from the command to the figures?"""

from __future__ import annotations

import json
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

from matplotlib.figure import Figure

from experiments.report import PAPER, write

REPEATS = 3
METHODS = ("auto", "alternating")
PHASES = ("assemble", "factorise", "compliance", "solve", "recover", "figures", "files")
COLOURS = ("#0072B2", "#D55E00", "#F0E442", "#009E73", "#CC79A7", "#56B4E9", "#999999", "#000000")


def measure(scene: str, method: str) -> dict[str, object]:
    runs = [once(scene, method) for _ in range(REPEATS)]
    median = {
        key: statistics.median(run[key] for run in runs) for key in runs[0] if key != "summary"
    }
    summary = runs[0]["summary"]
    return {
        "scene": scene,
        "method": method,
        "unknowns": summary["dofs"],
        "contacts": summary["contact_nodes"],
        "status": summary["status"],
        **{key: round(value, 3) for key, value in median.items()},
    }


def once(scene: str, method: str) -> dict:
    """One `contactopt run` in its own process: wall time, its phases, peak memory."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable,
            "-m",
            "contactopt",
            "run",
            scene,
            "--method",
            method,
            "--out",
            folder,
        ]
        start = time.perf_counter()
        child = os.posix_spawn(
            sys.executable,
            command,
            os.environ,
            file_actions=[(os.POSIX_SPAWN_OPEN, fd, os.devnull, os.O_WRONLY, 0) for fd in (1, 2)],
        )
        _, _, usage = os.wait4(child, 0)
        wall = time.perf_counter() - start
        summary = json.loads((Path(folder) / "summary.json").read_text())
    seconds = summary["seconds"]
    inside = {phase: seconds.get(phase, 0.0) for phase in PHASES}
    rest = wall - sum(inside.values())
    return {
        "wall [s]": wall,
        "peak [MiB]": usage.ru_maxrss / 1024,
        **inside,
        "start, imports": rest,
        "summary": summary,
    }


def draw(rows: list[dict]) -> Figure:
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    ax = figure.subplots()
    left = [0.0] * len(rows)
    for phase, colour in zip((*PHASES, "start, imports"), COLOURS):
        share = [row[phase] / sum(row[p] for p in (*PHASES, "start, imports")) for row in rows]
        ax.barh(
            [f"{row['scene']}, {row['method']}" for row in rows],
            share,
            left=left,
            color=colour,
            label=phase,
        )
        left = [a + b for a, b in zip(left, share)]
    ax.set(xlabel="share of the wall time [-]", xlim=(0, 1))
    ax.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, 1.3), ncols=4)
    return figure


TEXT = """Where do time and memory of a run go? `contactopt run SCENE --method METHOD` is measured at its default size. Each run has a process
of its own, and the time counts from the start of Python to the last file. The table has medians of
three runs in seconds, and the peak of the resident memory.

The package cvxpy is imported only where the method `alternating` has to solve programs over discs.
This import takes about a second, which counts as "solve". Two threads assemble and factorise the
two bodies.

{rows}
"""

if __name__ == "__main__":
    rows = [measure(scene, method) for scene in PAPER for method in METHODS]
    write(
        "scene_profile",
        "Time and memory of the three scenes",
        TEXT,
        {"rows": rows},
        {"shares": draw(rows)},
    )
