"""How often does each method fail on rigid bodies with more contacts than freedom?"""

from __future__ import annotations

import time

import numpy as np

from contactopt import solve
from contactopt.benchmark.problems import rigid_bodies
from experiments.report import write

METHODS = ("auto", "newton", "proximal", "acary_cadoux", "admm", "nsgs")
SIZES = ((10, 30), (10, 40), (15, 90))  # bodies, contacts
FRICTION = (0.3, 1.0, 3.0)
SEEDS = range(15)
TOL, LIMIT, ITERATIONS = 1e-8, 1.0, 2000


def measure(method: str, mu: float) -> dict[str, object]:
    solved, seconds = 0, []
    for bodies, contacts in SIZES:
        for seed in SEEDS:
            problem = rigid_bodies(bodies, contacts, mu, seed)
            start = time.perf_counter()
            solution = solve(problem, method, tol=TOL, time_limit=LIMIT, max_iterations=ITERATIONS)
            seconds.append(time.perf_counter() - start)
            solved += solution.solved
    return {
        "method": method,
        "mu": mu,
        "certified": f"{solved} of {len(seconds)}",
        "median seconds": float(np.median(seconds)),
        "largest": max(seconds),
    }


TEXT = """Which methods solve problems whose contact forces are not unique? The problems are random
rigid bodies: {sizes} (bodies, contacts), with {seeds} seeds each. Their matrix Q does not have full
rank, and friction is strong or very strong. The certificate is 1e-8. Each method has at most
{limit:g} s and {iterations} iterations per problem, and one BLAS thread.

{{rows}}
"""

if __name__ == "__main__":
    rows = [measure(method, mu) for method in METHODS for mu in FRICTION]
    sizes = ", ".join(map(str, SIZES))
    text = TEXT.format(sizes=sizes, seeds=len(SEEDS), limit=LIMIT, iterations=ITERATIONS)
    write("robustness", "Robustness on rank-deficient problems", text, {"rows": rows}, {})
