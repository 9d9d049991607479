"""Which way to the solution is the cheapest, and does contactopt take it?

`python -m experiments.questions.ways` measures all ways on both families of meshes. The costs of
contactopt.coupling.costs are fitted to the family `fit`, and the choice is judged by the family
`judge`. `times`, `judges` and `prices` after the command choose a table alone.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from scipy.optimize import nnls

from contactopt import Scene, reduce_bodies, solve
from contactopt.bodies import assemble
from contactopt.bodies.assembled import Work
from contactopt.bodies.solvers import solvers_there
from contactopt.coupling.costs import COSTS, FORM_OF, terms
from experiments.questions.ways.unprepared import Case, cases, scene, warm
from experiments.report import Tables, measure, stored, template

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
    row: dict[str, Any] = {
        "family": case.family,
        "scene": case.name,
        "unknowns": sum(body.unknowns for body in _assembled(made)),
        "on the contact": sizes(made)[1],
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


def sizes(made: Scene) -> tuple[list[Work], int]:
    """What the estimates are made from: the work of each body, and the interface unknowns."""
    bodies = _assembled(made)
    return [body.work for body in bodies], len(bodies[0].body.nodes) * made.dim


def _assembled(made: Scene) -> list[Any]:
    return [assemble(made, part, 16, None) for part in made.parts]


def fitted(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The prices by least squares of relative errors, not negative, and how far they are off."""
    named = {case.name: case for case in cases("fit")}
    known = {row["scene"]: (*sizes(scene(named[row["scene"]])), row) for row in rows}
    found = []
    for way, solver in COSTS:
        name = f"{way} {solver}"
        mine = [one for one in known.values() if 0 < float(one[2].get(name) or 0) < LIMIT]
        if not mine:
            continue
        t = np.array([float(row[name]) for *_, row in mine])
        dims = [3 if row["scene"].startswith("solid") else 2 for *_, row in mine]
        A = np.array([terms(way, works, k, dim) for (works, k, _), dim in zip(mine, dims)])
        prices, _ = nnls(A / t[:, None], np.ones(len(t)))
        off = A @ prices / t
        found.append(
            {
                "way": name,
                "prices": " ".join(f"{price:.2e}" for price in prices),
                "estimate over measured": f"{off.min():.2f} to {off.max():.2f}",
            }
        )
    return found


def measured_all(family: str) -> list[dict[str, Any]]:
    """All scenes of a family; what is imported and compiled at first is nobody's time."""
    for small in warm():
        for way, solver in COSTS:
            if solver in solvers_there():
                timed(small, FORM_OF[way], solver)
    rows = []
    for case in cases(family):
        rows.append(measured(case))
        print(rows[-1], flush=True)
    return rows


def judges() -> list[dict[str, Any]]:
    """The scenes by which the choice is judged, with what it costs over the best way."""
    rows = measured_all("judge")
    ways = [" ".join(way) for way in COSTS if any(row.get(" ".join(way)) for row in rows)]
    for row in rows:
        row["best"] = min(ways, key=lambda way: float(row[way]))
        row["auto / best"] = round(float(row["auto"]) / float(row[row["best"]]), 2)
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
    tables = {
        "judges": judges,
        "times": lambda: measured_all("fit"),
        "prices": lambda: fitted(stored("ways", "times")),
    }
    measure("ways", "Which way to the solution", text, tables)
