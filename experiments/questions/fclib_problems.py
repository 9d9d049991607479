"""How do the methods do on problems of other codes? `python -m experiments.questions.fclib_problems FOLDER [FOLDER ...]`.

The folders hold FCLib files (*.hdf5) and files in Siconos' text format (*.dat), which are not part of this project.
"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import statistics  # noqa: E402
import sys  # noqa: E402
import time  # noqa: E402
from pathlib import Path  # noqa: E402

from contactopt import fclib, siconos_residual, solve  # noqa: E402
from experiments.report import write  # noqa: E402

METHODS = ("auto", "proximal", "nsgs", "admm")
TOL = 1e-8
LIMIT = 20.0  # seconds
REPEATS = 3
SOLVERS = ("PROX", "NSGS", "ADMM", "NSN_AC")
# Seconds of four of Siconos' solvers (numerics component, August 2026, C, one core of the same kind of machine, tolerance
# 1e-8, at most 20 s, order of magnitude), by the beginning of the file's name; None: not certified or not measured.
SICONOS: dict[str, tuple[float | None, ...]] = {
    "Box_Stacks": (0.0, 0.0, 0.0, 0.0),
    "CubeH8": (0.0, 0.0, 0.0, 0.0),
    "LMGC_100": (1.05, 1.85, None, None),
    "local_problem": (0.04, None, 0.01, None),
    "Capsules-i97": (0.14, 0.12, 0.06, None),
    "Capsules-i100": (0.026, 1.11, 0.27, None),
    "Capsules-i122": (0.316, 7.0, 4.7, None),
    "KaplasTower": (7.6, 0.24, 0.045, None),
    "fc2d_granularflow": (None, None, None, None),
    "OneObject": (0.044, None, 0.004, 0.001),
    "FrictionContactProblem00727": (None, 0.01, None, None),
    "FrictionContactProblem00071": (None, 0.0, None, None),
    "Confeti": (0.001, 0.0, None, 0.0),
    "Rover1039": (0.001, 0.0, 0.001, 0.0),
    "Rover9770": (0.001, 0.0, 0.001, 0.0),
    "NESpheres": (0.0, 0.0, 0.0, 0.0),
}


def quoted(name: str) -> dict[str, object]:
    """What Siconos' solvers take for the file of that name."""
    times = next((t for start, t in SICONOS.items() if name.startswith(start)), (None,) * len(SOLVERS))
    return {f"Siconos {solver}": "-" if t is None else t for solver, t in zip(SOLVERS, times)}


def measure(path: Path, method: str) -> dict[str, object]:
    problem = fclib.read(path)
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        solution = solve(problem, method, tol=TOL, time_limit=LIMIT, max_iterations=100_000)
        times.append(time.perf_counter() - start)
        if times[-1] > 2:
            break
    return {
        "problem": path.stem[:24],
        "contacts": problem.contacts,
        "method": method,
        "status": str(solution.status),
        "residual": solution.residual,
        "Siconos' residual": siconos_residual(problem, solution.reactions, solution.multipliers),
        "iterations": solution.iterations,
        "median seconds": statistics.median(times),
        **quoted(path.name),
    }


def totals(rows: list[dict]) -> list[dict[str, object]]:
    out = []
    for method in METHODS:
        chosen = [row for row in rows if row["method"] == method]
        certified = sum(row["status"] == "solved" for row in chosen)
        seconds = sum(row["median seconds"] for row in chosen)
        out.append({"method": method, "certified": f"{certified} of {len(chosen)}", "seconds in all": seconds})
    return out


TEXT = """Cold start, certificate 1e-8, at most 20 s, one BLAS thread, medians of three (one where a solve takes more than
2 s). "Siconos' residual" is the published measure, which depends on units. The last columns quote what Siconos' solvers
take for the same files, as an order of magnitude; - where they do not reach 1e-8 in 20 s or were not measured.

{totals}

{rows}
"""

if __name__ == "__main__":
    files = [
        path for folder in sys.argv[1:] for kind in ("*.hdf5", "*.dat") for path in sorted(Path(folder).glob(kind))
    ]
    if not files:
        sys.exit(
            "usage: python -m experiments.questions.fclib_problems FOLDER [FOLDER ...], with files *.hdf5 or *.dat"
        )
    rows = [measure(path, method) for path in files for method in METHODS]
    write("fclib_problems", "Problems of other codes", TEXT, {"totals": totals(rows), "rows": rows}, {})
