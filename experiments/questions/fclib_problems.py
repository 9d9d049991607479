"""How do the methods do on problems of the FCLib collection? `python -m experiments.questions.fclib_problems FOLDER`.

The folder holds FCLib files (*.hdf5), which are not part of this project.
"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import statistics  # noqa: E402
import sys  # noqa: E402
import time  # noqa: E402
from pathlib import Path  # noqa: E402

from contactopt import fclib, natural_map_residual, solve  # noqa: E402
from experiments.report import write  # noqa: E402

METHODS = ("auto", "newton", "proximal", "nsgs", "admm", "acary_cadoux", "tresca", "alternating")
TOL = 1e-8
LIMIT = 20.0  # seconds
REPEATS = 3
# Seconds of Siconos' proximal-point solver, its only one to certify all of these (numerics component, August 2026, C,
# one core of the same kind of machine, tolerance 1e-8, order of magnitude), by the beginning of the file's name.
SICONOS = {"Box_Stacks": 0.0, "CubeH8": 0.0, "LMGC_100": 1.05, "local_problem": 0.04, "Capsules": 0.14}


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
        "residual, rho = 1": natural_map_residual(problem, solution.reactions, rho=1.0),
        "iterations": solution.iterations,
        "median seconds": statistics.median(times),
    }


def totals(rows: list[dict]) -> list[dict[str, object]]:
    out = []
    for method in METHODS:
        chosen = [row for row in rows if row["method"] == method]
        certified = sum(row["status"] == "solved" for row in chosen)
        seconds = sum(row["median seconds"] for row in chosen)
        out.append({"method": method, "certified": f"{certified} of {len(chosen)}", "seconds in all": seconds})
    known = [t for name, t in SICONOS.items() if any(row["problem"].startswith(name) for row in rows)]
    out.append(
        {"method": "Siconos PROX (quoted)", "certified": f"{len(known)} of {len(known)}", "seconds in all": sum(known)}
    )
    return out


TEXT = """Cold start, certificate 1e-8, at most 20 s, one BLAS thread, medians of three (one where a solve takes more than
2 s). "residual, rho = 1" is the published, unit-dependent measure. The last line quotes what Siconos' most robust
solver takes for the same files, as an order of magnitude.

{totals}

{rows}
"""

if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) == 2 else None
    files = sorted(folder.glob("*.hdf5")) if folder else []
    if not files:
        sys.exit("usage: python -m experiments.questions.fclib_problems FOLDER, a folder with FCLib files (*.hdf5)")
    rows = [measure(path, method) for path in files for method in METHODS]
    write("fclib_problems", "Problems of the FCLib collection", TEXT, {"totals": totals(rows), "rows": rows}, {})
