"""Which way to the solution is the cheapest, and does contactopt take it?

`python -m experiments.questions.ways` measures all ways and the choice on meshes other than those
to which the costs of contactopt.coupling.costs were fitted.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from contactopt import Scene, reduce_bodies, solve
from contactopt.bodies import assemble
from contactopt.bodies.solvers import solvers_there
from contactopt.coupling.costs import COSTS, FORM_OF
from experiments.questions.ways.unprepared import Case, cases, scene, warm
from experiments.report import Tables, measure, template

LIMIT = 60.0  # CPU seconds after which a way is given up
SHORT, REPEATS = 0.5, 2  # the least of so many runs counts if the first one takes less seconds
WITHIN = 1.3  # times the best way that a good choice takes


def timed(made: Scene, Q: str, solver: str) -> tuple[float, str]:
    """CPU time of a run, and the way that it took."""
    begin = time.process_time()
    reduction = reduce_bodies(made, Q=Q, solver=solver)
    solution = solve(reduction.problem)
    took = time.process_time() - begin
    form = "dense" if isinstance(reduction.problem.Q, np.ndarray) else "products"
    name = reduction.bodies[0].solver.name  # type: ignore[attr-defined]
    way = f"{'coupled' if name == 'multigrid' else form} {name}"
    return (took if solution.solved else np.inf), way


@contextmanager
def limited() -> Iterator[None]:
    """TimeoutError after LIMIT seconds of CPU."""

    def out(*_: Any) -> None:
        raise TimeoutError

    signal.signal(signal.SIGPROF, out)
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def measured(case: Case) -> dict[str, Any]:
    """Times of all ways and of the choice, alternating where they are short."""
    made = scene(case)
    runs = {" ".join(way): (FORM_OF[way[0]], way[1]) for way in COSTS if way[1] in solvers_there()}
    bodies = [assemble(made, part, 16, None) for part in made.parts]
    row: dict[str, Any] = {
        "scene": case.name,
        "unknowns": sum(body.unknowns for body in bodies),
        "on the contact": len(bodies[0].body.nodes) * made.dim,
        "taken": "",
    }
    best: dict[str, float] = {}
    for again in range(REPEATS):
        for name, (Q, solver) in (runs | {"auto": ("auto", "auto")}).items():
            if again and best[name] > SHORT:
                continue
            took, way = LIMIT, ""
            with suppress(TimeoutError), limited():
                took, way = timed(made, Q, solver)
            if name == "auto":
                row["taken"] = way
            best[name] = min(took, best.get(name, np.inf))
    return row | {name: round(took, 3) for name, took in best.items()}


def judges() -> list[dict[str, Any]]:
    """All scenes, with what the choice costs over the best way; what is imported and compiled at
    first is nobody's time.
    """
    for small in warm():
        for way, solver in COSTS:
            if solver in solvers_there():
                timed(small, FORM_OF[way], solver)
    rows = []
    for case in cases():
        row = measured(case)
        ways = [" ".join(way) for way in COSTS if row.get(" ".join(way))]
        row["best"] = min(ways, key=lambda way: float(row[way]))
        row["auto / best"] = round(float(row["auto"]) / float(row[row["best"]]), 2)
        rows.append(row)
        print(row, flush=True)
    return rows


def text(tables: Tables) -> str:
    ratios = np.array([row["auto / best"] for row in tables["judges"]])
    return template(__file__).format(
        limit=LIMIT,
        count=len(ratios),
        median=np.median(ratios),
        worst=ratios.max(),
        good=np.count_nonzero(ratios <= WITHIN),
        within=WITHIN,
    )


if __name__ == "__main__":
    measure("ways", "Which way to the solution", text, {"judges": judges})
