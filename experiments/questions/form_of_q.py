"""The numbers of contactopt.interface.costs, measured: what an explicit and an implicit Q cost on growing punches.

`python -m experiments.questions.form_of_q [elements ...]` prints, for each mesh, the entries of the factors over the formula for them, the
products of a solve from cold, and the prices SOLVE and DENSE that the seconds of the phases imply.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

from contactopt import reduce_bodies, scenes, solve

SIZES = {2: (128, 256, 512), 3: (8, 12, 16)}
REPEATS = 3


def seconds(act: Any) -> float:
    """The least wall time of a few calls."""
    best = np.inf
    for _ in range(REPEATS):
        start = time.perf_counter()
        act()
        best = min(best, time.perf_counter() - start)
    return best


def measure(dim: int, elements: int) -> dict[str, float]:
    """One row of the table. SuperLU works in one thread, so that seconds are those of both bodies one after the other."""
    scene = scenes.flat_punch(dim, elements=elements, mu=0.3)
    explicit, implicit = (reduce_bodies(scene, Q=form, solver="superlu") for form in ("explicit", "implicit"))
    largest = max(implicit.bodies, key=lambda body: body.unknowns)
    m, n = len(largest.interface), largest.unknowns
    filled = 4 * n * np.log2(n) if dim == 2 else 17 * n ** (4 / 3)
    r = np.random.default_rng(0).normal(size=implicit.problem.q.size)
    product = seconds(lambda: implicit.problem.Q @ r)
    elimination = explicit.seconds["factorise"] - implicit.seconds["factorise"]
    dense = explicit.seconds["compliance"] + seconds(lambda: solve(explicit.problem))
    operation = max(elimination, 0.0) / (m**3 / 3)
    return {
        "dim": dim,
        "contacts": implicit.problem.contacts,
        "m": m,
        "n": n,
        "entries over formula": largest.solver.factors.L.nnz / filled,
        "PRODUCTS": solve(implicit.problem).products,
        "SOLVE": product / (4 * filled) / operation if operation else np.nan,
        "DENSE": 3 * m**3 * operation / dense,
    }


if __name__ == "__main__":
    asked = [int(word) for word in sys.argv[1:]]
    for dim, sizes in SIZES.items():
        for elements in asked or sizes:
            row = measure(dim, elements)
            print("  ".join(f"{name} {value:.4g}" for name, value in row.items()), flush=True)
