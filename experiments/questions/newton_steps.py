"""How many Newton steps do the scenes take, cold and warm, at every size and friction coefficient?"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import statistics  # noqa: E402
import time  # noqa: E402

from contactopt import reduce, scenes, solve, transfer  # noqa: E402
from contactopt.scenes import make_scene  # noqa: E402
from experiments.report import PAPER, write  # noqa: E402

FRICTION = (0.0, 0.05, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
SERIES = {
    "punch-2d, mu = .3": (
        lambda n: scenes.flat_punch(2, elements=n, mu=0.3),
        (8, 16, 32, 64, 128, 256, 512, 1024),
    ),
    "rigid punch on a half-plane, mu = .3": (
        lambda n: scenes.flat_punch(
            2,
            elements=n,
            mu=0.3,
            rigid="punch",
            foundation_width=25600.0,
            foundation_height=12800.0,
        ),
        (16, 32, 64, 128, 256, 512),
    ),
    "sphere, mu = .1": (lambda n: scenes.sphere(elements=n, mu=0.1), (8, 16, 32, 64, 128, 256)),
    "punch-3d, mu = .1": (lambda n: scenes.flat_punch(3, elements=n, mu=0.1), (2, 4, 8, 16)),
    "punch-3d, mu = .5": (lambda n: scenes.flat_punch(3, elements=n), (2, 4, 8, 16)),
}
REPEATS = 3


def steps(series: str) -> list[dict[str, object]]:
    make, sizes = SERIES[series]
    rows: list[dict[str, object]] = []
    before = None
    for size in sizes:
        problem = reduce(make(size))
        times = []
        for _ in range(REPEATS):
            start = time.perf_counter()
            cold = solve(problem)
            times.append(time.perf_counter() - start)
        warm = None if before is None else solve(problem, start=transfer(*before, problem))
        rows.append(
            {
                "scene": series,
                "contacts": problem.contacts,
                "cold: steps": cold.iterations - 1,
                "residual": cold.residual,
                "median seconds": statistics.median(times),
                "warm: steps": "" if warm is None else warm.iterations - 1,
                "warm: status": "" if warm is None else str(warm.status),
            }
        )
        before = problem, cold
    return rows


def friction(name: str) -> dict[str, object]:
    row: dict[str, object] = {"scene": name}
    for mu in FRICTION:
        solution = solve(reduce(make_scene(name, mu=mu)), tol=1e-8)
        row[f"mu = {mu:g}"] = (
            f"{solution.status}, {solution.iterations - 1}, {solution.residual:.0e}"
        )
    return row


TEXT = """How many steps does Newton's method take? The method is `auto`. In all of these problems its first part, Newton's method, converges alone. The
certificate is 1e-8, and BLAS has one thread. A *cold* run starts from the solution of bonded
surfaces. The time includes this solution, but it does not count as a step. A *warm* run starts from
the tractions on the mesh before, which is half as fine. The first iterate is the start itself.

{steps}

The second table has the three scenes at their default size: status, Newton steps, certificate.

{friction}
"""

if __name__ == "__main__":
    rows = [row for series in SERIES for row in steps(series)]
    write(
        "newton_steps",
        "Newton steps",
        TEXT,
        {"steps": rows, "friction": [friction(name) for name in PAPER]},
        {},
    )
