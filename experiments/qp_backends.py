"""Do all QP backends give the same answer at tight settings, and which needs the crossover for it?"""

from __future__ import annotations

import time

from contactopt import reduce, scenes, solve
from contactopt.backends import QP
from contactopt.methods import alternating
from experiments.report import write

REPEATS = 5


def measure(name: str, exact, problem) -> dict[str, object]:  # type: ignore[no-untyped-def]
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        solution = solve(problem, normal=name, tangential=name, tol=1e-9)
        times.append(time.perf_counter() - start)
    raw = without_crossover(name, problem)
    return {
        "backend": name,
        "version": QP[name].version,
        "status": str(solution.status),
        "residual": solution.residual,
        "approach, relative difference": abs(solution.multipliers[0] / exact.multipliers[0] - 1),
        "peak, relative difference": abs(solution.reactions[:, 0].max() / exact.reactions[:, 0].max() - 1),
        "status without crossover": str(raw.status),
        "residual without crossover": raw.residual,
        "median seconds": sorted(times)[REPEATS // 2],
    }


def without_crossover(name: str, problem):  # type: ignore[no-untyped-def]
    saved = alternating.crossover
    alternating.crossover = lambda Q, c, V, s, project, r, multipliers: (r, multipliers)
    try:
        return solve(problem, normal=name, tangential=name, tol=1e-9, max_iterations=40)
    finally:
        alternating.crossover = saved


TEXT = """The default `punch-2d` problem (17 contacts, mu = .5), normal and tangential problem both by the same backend at
the tight settings of contactopt.backends, certified at 1e-9. Differences are relative to a solve at 1e-13.
"Without crossover" takes the backend's answers as they come, for at most 40 iterations.

{rows}
"""

if __name__ == "__main__":
    problem = reduce(scenes.flat_punch(2))
    exact = solve(problem, tol=1e-13)
    rows = [measure(name, exact, problem) for name in QP if QP[name].installed]
    write("qp_backends", "The same answer from every QP backend", TEXT, {"rows": rows}, {})
