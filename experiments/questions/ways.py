"""Which way to the solution is cheapest: a dense Q, products with Q by factors, or bodies and contact at once by multigrid?

`python -m experiments.questions.ways` measures all ways on punches of growing size, fits the estimates of
contactopt.interface.costs to them and draws both as maps. `--fit` fits and draws what was measured before.
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import time
from itertools import product

import numpy as np
from matplotlib.figure import Figure

from contactopt import reduce_bodies, scenes, solve
from contactopt.figures.plots import BLUE, GREEN, ORANGE
from contactopt.interface.costs import WAYS, seconds
from experiments.report import REPORTS, write

SIZES = {2: (64, 128, 256, 512, 1024), 3: (6, 8, 12, 16, 20, 26)}  # elements across the half-width
FORMS = {"dense": "explicit", "products": "implicit", "coupled": "implicit"}
SOLVERS = {"dense": ("superlu", "pardiso"), "products": ("superlu", "pardiso"), "coupled": ("multigrid",)}
LONG = 40.0  # seconds after which a way is not tried on larger meshes
MU = 0.3
COLOURS = {"dense": BLUE, "products": GREEN, "coupled": ORANGE}


def once(dim: int, elements: int, way: str, solver: str) -> dict[str, object]:
    """CPU time of one run with one thread of BLAS, in a process of its own; what is imported late is imported before."""
    scene = scenes.flat_punch(dim, mu=MU)
    solve(reduce_bodies(scene, 3, Q=FORMS[way], solver=solver).problem, "newton")
    begin = time.process_time()
    reduction = reduce_bodies(scene, elements, Q=FORMS[way], solver=solver)
    made = time.process_time()
    solution = solve(reduction.problem, "newton")
    done = time.process_time()
    largest = max(reduction.bodies, key=lambda body: body.unknowns)
    return {
        "dim": dim,
        "elements": elements,
        "way": way,
        "solver": solver,
        "n": largest.unknowns,
        "m": len(largest.interface),  # type: ignore[attr-defined]
        "status": solution.status.label,
        "set-up [s]": made - begin,
        "solution [s]": done - made,
        "whole [s]": done - begin,
    }


def isolated(*run: object) -> dict[str, object]:
    command = [sys.executable, "-m", "experiments.questions.ways", "--once", *map(str, run)]
    limits = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=os.environ | limits)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def measured() -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for dim, way in product(SIZES, SOLVERS):
        for solver in SOLVERS[way]:
            for elements in SIZES[dim]:
                rows.append(isolated(dim, elements, way, solver))
                print(rows[-1], flush=True)
                if float(str(rows[-1]["whole [s]"])) > LONG:
                    break
    return rows
