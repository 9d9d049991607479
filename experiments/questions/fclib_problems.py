"""How do the methods do on problems of other codes? `python -m experiments.questions.fclib_problems
FOLDER [FOLDER ...]`.

The folders hold FCLib files (*.hdf5) and files in Siconos' text format (*.dat), which are not part
of this project. The table of the default method beside the times of Siconos is printed first,
within seconds; the other methods follow.
"""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path
from typing import Any

from contactopt import InterfaceProblem, Solution, fclib, siconos_residual, solve
from experiments.report import markdown, write

DEFAULT, OTHERS = "auto", ("proximal", "nsgs", "admm")
TOL = 1e-8
LIMIT, SHORT_LIMIT = 20.0, 5.0  # seconds a file, of the default method and of the others
REPEATS, LONG = 3, 2.0  # a solve that takes longer than so many seconds is not repeated
SOLVERS = ("PROX", "NSGS", "ADMM", "NSN_AC")
# Seconds of four of Siconos' solvers (numerics component, August 2026, C, one core of the same kind
# of machine, tolerance
# 1e-8, at most 20 s, order of magnitude), by the beginning of the file's name; None: not certified
# or not measured.
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


def quoted(name: str) -> tuple[float | None, ...]:
    """Seconds of Siconos' solvers for the file of that name."""
    return next(
        (t for start, t in SICONOS.items() if name.startswith(start)), (None,) * len(SOLVERS)
    )


def timed(problem: InterfaceProblem, method: str, limit: float) -> tuple[Solution, float]:
    """The solution, and the median of the processor seconds."""
    times: list[float] = []
    while len(times) < REPEATS and max(times, default=0.0) < LONG:
        start = time.process_time()
        solution = solve(problem, method, tol=TOL, time_limit=limit, max_iterations=100_000)
        times.append(time.process_time() - start)
    return solution, statistics.median(times)


def beside_siconos(path: Path) -> dict[str, Any]:
    """The default method on one file, and what Siconos' solvers take for it."""
    problem = fclib.read(path)
    solution, seconds = timed(problem, DEFAULT, LIMIT)
    known = quoted(path.name)
    return {
        "folder": path.parent.resolve().name,
        "problem": path.stem,
        "contacts": problem.contacts,
        "status": str(solution.status),
        "residual": solution.residual,
        "Siconos' residual": siconos_residual(problem, solution.reactions, solution.multipliers),
        "iterations": solution.iterations,
        "seconds": seconds,
        "best of Siconos": min((t for t in known if t is not None), default="-"),
        **{solver: "-" if t is None else t for solver, t in zip(SOLVERS, known)},
    }


def of_another(path: Path, method: str) -> dict[str, Any]:
    """Another method on one file."""
    problem = fclib.read(path)
    solution, seconds = timed(problem, method, SHORT_LIMIT)
    return {
        "problem": path.stem,
        "method": method,
        "status": str(solution.status),
        "residual": solution.residual,
        "iterations": solution.iterations,
        "seconds": seconds,
    }


def totals(rows: list[dict[str, Any]], key: str) -> list[dict[str, Any]]:
    """How many files are certified, and the seconds of all, by folder or by method."""
    out = []
    for name in dict.fromkeys(row[key] for row in rows):
        chosen = [row for row in rows if row[key] == name]
        certified = sum(row["status"] == "solved" for row in chosen)
        seconds = sum(row["seconds"] for row in chosen)
        out.append(
            {key: name, "certified": f"{certified} of {len(chosen)}", "seconds in all": seconds}
        )
    return out


TEXT = """Cold start, certificate 1e-8, one BLAS thread, processor seconds of the solve alone,
medians of three (one where a solve takes more than {long:g} s). "Siconos' residual" is the
published measure, which depends on units. The last columns quote the seconds that Siconos'
solvers take for the same files on a machine of the same kind, as an order of magnitude; - where
they do not reach 1e-8 in 20 s or were not measured.

## The default method

At most {limit:g} s a file.

{{folders}}

{{default}}

## Other methods

At most {short:g} s a file.

{{methods}}

{{others}}
"""

if __name__ == "__main__":
    files = [
        path
        for folder in sys.argv[1:]
        for kind in ("*.hdf5", "*.dat")
        for path in sorted(Path(folder).glob(kind))
    ]
    if not files:
        sys.exit(
            "usage: python -m experiments.questions.fclib_problems FOLDER [FOLDER ...], with files"
            " *.hdf5 or *.dat"
        )
    default = [beside_siconos(path) for path in files]
    folders = totals(default, "folder")
    print(markdown(folders), markdown(default), sep="\n\n", flush=True)
    others = [of_another(path, method) for method in OTHERS for path in files]
    text = TEXT.format(long=LONG, limit=LIMIT, short=SHORT_LIMIT)
    tables = {
        "folders": folders,
        "default": default,
        "methods": totals(others, "method"),
        "others": others,
    }
    write("fclib_problems", "Problems of other codes", text, tables, {})
