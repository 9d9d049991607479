"""Does a path that may turn back solve jammed packings where interior points do not?"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from contactopt import InterfaceProblem, solve
from contactopt.benchmark.families.packings import packing
from contactopt.methods.kernels.homotopy import homotopy_iterates
from contactopt.methods.kernels.interior import Path, interior_iterates
from contactopt.methods.kernels.sparse_blocks import Blocks, block_matrix
from contactopt.problem import dimensionless
from experiments.report import write

# dimension, bodies, contacts of a pair of bodies
FAMILIES = ((2, 25, 1), (2, 64, 2), (3, 18, 3), (3, 27, 2))
FRICTION, SEEDS = (0.5, 0.8, 1.5), range(4)
# error of a path's end; linear systems of it; iterations of auto
REACHED, SYSTEMS, LIMIT = 1e-8, 1000, 1000


def interior(problem: InterfaceProblem, matrix: Blocks) -> float:
    """The least error on the two interior-point paths that the default method begins with."""
    return min(
        error
        for full in (True, False)
        for _, error in interior_iterates(problem, matrix, Path(full))
    )


def turning(problem: InterfaceProblem, matrix: Blocks) -> float:
    """The least error on the path that turns back where it must."""
    return min((error for _, error in homotopy_iterates(problem, matrix, SYSTEMS)), default=np.inf)


def reached(
    problem: InterfaceProblem, follow: Callable[[InterfaceProblem, Blocks], float]
) -> tuple[bool, float]:
    """Whether the path ends at a solution, and the processor seconds."""
    scaled = dimensionless(problem)[0]
    matrix = block_matrix(scaled.Q, scaled.dim)
    start = time.process_time()
    with np.errstate(all="ignore"):
        ends = follow(scaled, matrix) <= REACHED
    return ends, time.process_time() - start


def certified(problem: InterfaceProblem) -> tuple[bool, float]:
    """Whether the default method certifies an answer, and the processor seconds."""
    start = time.process_time()
    solved = solve(problem, max_iterations=LIMIT).solved
    return solved, time.process_time() - start


def measure(dim: int, bodies: int, points: int, mu: float) -> dict[str, Any]:
    """One row: packings that differ by their seed."""
    problems = [packing(dim, bodies, seed, mu, points) for seed in SEEDS]
    row: dict[str, Any] = {
        "dimension": dim,
        "bodies": bodies,
        "contacts of a pair": points,
        "mu": mu,
    }
    row["contacts"] = round(statistics.mean(problem.contacts for problem in problems))
    for label, found in (
        ("interior points", [reached(problem, interior) for problem in problems]),
        ("path that turns", [reached(problem, turning) for problem in problems]),
        ("auto", [certified(problem) for problem in problems]),
    ):
        row[label] = f"{sum(ends for ends, _ in found)} of {len(found)}"
        row[f"{label} [s]"] = statistics.median(seconds for _, seconds in found)
    print(row, flush=True)
    return row


TEXT = """Packings of {seeds} seeds in each row. How many end at a solution: on the two
interior-point paths that the default method begins with, and on the path that turns back where
it must (`contactopt.methods.kernels.homotopy`, at most {systems} linear systems), with an error of
at most {reached:g}; and how many the default method certifies within {limit} iterations. Medians of
processor seconds, one thread.

{{rows}}
"""

if __name__ == "__main__":
    rows = [measure(*family, mu) for family in FAMILIES for mu in FRICTION]
    text = TEXT.format(seeds=len(SEEDS), systems=SYSTEMS, reached=REACHED, limit=LIMIT)
    write("jammed", "Jammed packings", text, {"rows": rows}, {})
