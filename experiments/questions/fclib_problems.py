"""How do the methods do on problems of other codes? `python -m experiments.questions.fclib_problems
[--siconos PYTHON] FOLDER [FOLDER ...]`.

The folders hold FCLib files (*.hdf5) and files in Siconos' text format (*.dat), which are not part
of this project. PYTHON is an interpreter that can import siconos.numerics: its solvers then take
the same files in the same run. The table of the default method is printed first; the other methods
follow.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt import InterfaceProblem, Solution, fclib, siconos_residual, solve
from experiments.report import markdown, write

DEFAULT, OTHERS = "auto", ("proximal", "nsgs", "admm")
TOL = 1e-8
LIMIT, SHORT_LIMIT = 20.0, 5.0  # seconds a file, of the default method and of the others
REPEATS, LONG = 3, 2.0  # a solve that takes longer than so many seconds is not repeated
SOLVERS = ("NSGS", "PROX", "ADMM", "NSN_AC", "VI_EG")
SHIFT = 1e-3  # of the shifted geometric means [s]

# What an interpreter with Siconos runs: a file, a solver, the tolerance, the repetitions. It prints
# the median of the processor seconds of the solve alone, and the reactions.
SICONOS = """
import json, statistics, sys, time
import numpy as np
import siconos.numerics as sn
problem = sn.frictionContact_new_from_filename(sys.argv[1])
dim, times = problem.dimension, []
solve = sn.fc3d_driver if dim == 3 else sn.fc2d_driver
solver = getattr(sn, f"SICONOS_FRICTION_{dim}D_{sys.argv[2]}")
while len(times) < int(sys.argv[4]) and sum(times) < 2:
    r, v = np.zeros(problem.M.size0), np.zeros(problem.M.size0)
    options = sn.SolverOptions(solver)
    options.dparam[0], options.iparam[0] = float(sys.argv[3]), 100000
    start = time.process_time()
    solve(problem, r, v, options)
    times.append(time.process_time() - start)
print("ANSWER", json.dumps([statistics.median(times), r.tolist()]))
"""


def as_text(problem: InterfaceProblem) -> str:
    """The problem in Siconos' text format, in sparse blocks."""
    (k, d), Q = problem.q.shape, sp.bsr_array(sp.csr_array(problem.Q), blocksize=2 * (problem.dim,))
    Q.sort_indices()
    ends, blocks = d * np.arange(1, k + 1), len(Q.indices)
    head = [d, k, 1, k * d, k * d, blocks, k, k, *ends, *ends, k + 1, blocks]
    numbers = [*head, *Q.indptr, *Q.indices]
    for number, block in enumerate(Q.data):
        numbers += [number, *block.T.ravel().tolist()]
    return "\n".join(map(str, [*numbers, *problem.q.ravel().tolist(), *problem.mu.tolist()]))


def of_siconos(python: str, problem: InterfaceProblem, solver: str) -> float | None:
    """Seconds of one of Siconos' solvers; None where it is not certified by its own measure."""
    with tempfile.NamedTemporaryFile("w", suffix=".dat") as file:
        file.write(as_text(problem))
        file.flush()
        command = [python, "-c", SICONOS, file.name, solver, str(TOL), str(REPEATS)]
        with suppress(subprocess.TimeoutExpired):
            done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
            for line in done.stdout.splitlines():
                if line.startswith("ANSWER"):
                    seconds, r = json.loads(line.removeprefix("ANSWER"))
                    reactions = np.array(r).reshape(problem.q.shape)
                    good = siconos_residual(problem, reactions) <= TOL
                    return float(seconds) if good else None
    return None


def timed(problem: InterfaceProblem, method: str, limit: float) -> tuple[Solution, float]:
    """The solution, and the median of the processor seconds."""
    times: list[float] = []
    while len(times) < REPEATS and max(times, default=0.0) < LONG:
        start = time.process_time()
        solution = solve(problem, method, tol=TOL, time_limit=limit, max_iterations=100_000)
        times.append(time.process_time() - start)
    return solution, statistics.median(times)


def beside_siconos(path: Path, python: str | None) -> dict[str, Any]:
    """The default method on one file, and what Siconos' solvers take for it in the same run."""
    problem = fclib.read(path)
    solution, seconds = timed(problem, DEFAULT, LIMIT)
    known = [python and of_siconos(python, problem, solver) for solver in SOLVERS]
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


TEXT = """Cold start, certificate 1e-8, one BLAS thread, processor seconds of the solve alone,
medians of three (one where a solve takes more than {long:g} s). "Siconos' residual" is the
published measure, which depends on units. The last columns are the seconds of Siconos' solvers in
the same run, certified by that measure; - where they do not reach 1e-8 in {limit:g} s. The shifted
geometric means (1 ms) compare the default method with the best of these solvers for each file.

{{means}}

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
    folders, python = sys.argv[1:], None
    if folders[:1] == ["--siconos"]:
        python, folders = folders[1], folders[2:]
    files = [
        path
        for folder in folders
        for kind in ("*.hdf5", "*.dat")
        for path in sorted(Path(folder).glob(kind))
    ]
    if not files:
        sys.exit(
            "usage: python -m experiments.questions.fclib_problems [--siconos PYTHON] FOLDER"
            " [FOLDER ...], with files *.hdf5 or *.dat"
        )
    default = [beside_siconos(path, python) for path in files]
    certified = totals(default, "folder")
    print(markdown(certified), markdown(means(default)), markdown(default), sep="\n\n", flush=True)
    others = [of_another(path, method) for method in OTHERS for path in files]
    text = TEXT.format(long=LONG, limit=LIMIT, short=SHORT_LIMIT)
    tables = {
        "folders": certified,
        "means": means(default),
        "default": default,
        "methods": totals(others, "method"),
        "others": others,
    }
    write("fclib_problems", "Problems of other codes", text, tables, {})
