"""How do the methods do on problems of other codes? `python -m experiments.questions.fclib_problems
FOLDER [FOLDER ...]`.

The folders hold FCLib files (*.hdf5) and files in Siconos' text format (*.dat), which are not part
of this project. Where Siconos is installed, its solvers take the same files in the same run.
"""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from contactopt import InputError, InterfaceProblem, Solution, fclib, siconos_residual, solve
from experiments.peers.siconos_numerics import siconos
from experiments.report import template, write

TOL = 1e-8
LIMIT = 20.0  # seconds a file
REPEATS, LONG = 3, 2.0  # a solve that takes longer than so many seconds is not repeated
SOLVERS = ("NSGS", "PROX", "ADMM", "NSN_AC", "VI_EG", "CPG", "LEMKE")
SHIFT = 1e-3  # of the shifted geometric means [s]


def of_siconos(problem: InterfaceProblem, solver: str) -> float | None:
    """Processor seconds of one of Siconos' solvers; None where it claims no success."""
    times: list[float] = []
    while len(times) < REPEATS and max(times, default=0.0) < LONG:
        try:
            answer = siconos(problem, TOL, LIMIT, solver=solver)
        except InputError:  # not installed
            return None
        if answer.status != "solved":
            return None
        times.append(answer.measured["cpu_seconds"])
    return statistics.median(times)


def timed(problem: InterfaceProblem) -> tuple[Solution, float]:
    """The solution, and the median of the processor seconds."""
    times: list[float] = []
    while len(times) < REPEATS and max(times, default=0.0) < LONG:
        start = time.process_time()
        solution = solve(problem, tol=TOL, time_limit=LIMIT, max_iterations=100_000)
        times.append(time.process_time() - start)
    return solution, statistics.median(times)


def beside_siconos(path: Path) -> dict[str, Any]:
    """The default method on one file, and what Siconos' solvers take for it in the same run."""
    problem = fclib.read(path)
    solution, seconds = timed(problem)
    known = [of_siconos(problem, solver) for solver in SOLVERS]
    return {
        "folder": path.parent.resolve().name,
        "problem": path.stem,
        "contacts": problem.contacts,
        "status": str(solution.status),
        "residual": solution.residual,
        "Siconos' residual": siconos_residual(problem, solution.reactions, solution.multipliers),
        "iterations": solution.iterations,
        "seconds": seconds,
        "best of Siconos": min((t for t in known if t), default="-"),
        **{solver: t or "-" for solver, t in zip(SOLVERS, known)},
    }


def totals(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """How many files are certified, and the seconds of all, by folder."""
    out = []
    for name in dict.fromkeys(row["folder"] for row in rows):
        chosen = [row for row in rows if row["folder"] == name]
        certified = f"{sum(row['status'] == 'solved' for row in chosen)} of {len(chosen)}"
        seconds = sum(row["seconds"] for row in chosen)
        out.append({"folder": name, "certified": certified, "seconds in all": seconds})
    return out


def means(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Shifted geometric means over the files that a solver of Siconos certifies."""
    both = [row for row in rows if row["best of Siconos"] != "-"]
    return [
        {
            "seconds of": name,
            "files": len(both),
            "shifted geometric mean [s]": float(
                np.exp(np.mean([np.log(row[name] + SHIFT) for row in both])) - SHIFT
            ),
        }
        for name in ("seconds", "best of Siconos")
        if both
    ]


if __name__ == "__main__":
    folders = sys.argv[1:]
    files = [
        path
        for folder in folders
        for kind in ("*.hdf5", "*.dat")
        for path in sorted(Path(folder).glob(kind))
    ]
    if not files:
        sys.exit(
            "usage: python -m experiments.questions.fclib_problems FOLDER [FOLDER ...], with files"
            " *.hdf5 or *.dat"
        )
    default = [beside_siconos(path) for path in files]
    tables = {"folders": totals(default), "means": means(default), "default": default}
    text = template(__file__).format(long=LONG, limit=LIMIT)
    write("fclib_problems", "Problems of other codes", text, tables, {})
