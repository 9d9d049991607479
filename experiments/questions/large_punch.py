"""What does friction cost beside one linear solve, up to a punch of a million unknowns in 3D?

`python -m experiments.questions.large_punch [elements ...]` measures the sizes and writes the
report.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt import scenes, solve
from contactopt.coupling.reduction import reduce_bodies
from contactopt.figures.style import draw_lines, paper_axes
from contactopt.problem.laws.coulomb import Coulomb
from experiments.report import figures_alone, merged, save_figures, stored, template, write

SIZES = (20, 32, 48, 64, 92)  # elements across the half-width of the punch
FRICTION = (0.1, 0.2, 0.3, 0.4, 0.5)
# sizes at which all friction coefficients and the products with Q are tried as well
COMPARED = (20, 32)
ACCURACY = 1e-8  # of the product whose V-cycles are counted
WAYS = {"coupled": "coupled", "products": "krylov"}  # -> Newton's linear solver
KEYS = ("elements", "way", "mu")
MODULE = "experiments.questions.large_punch"


def once(elements: int, way: str, mu: float) -> dict[str, object]:
    """punch-3d from cold, bodies by multigrid; run in a process of its own."""
    begin = time.perf_counter(), time.process_time()
    reduction = reduce_bodies(scenes.flat_punch(3), elements, solver="multigrid")
    made = time.perf_counter(), time.process_time()
    problem = replace(reduction.problem, law=Coulomb(mu))
    solution = solve(problem, "newton", linear=WAYS[way])
    done = time.perf_counter(), time.process_time()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    cycles = 2 * int(solution.history[-1]["cycles"])
    of_product = cycles_of_product(reduction)
    product = time.process_time() - done[1]
    return {
        "elements": elements,
        "way": way,
        "mu": mu,
        "unknowns": reduction.dofs,
        "contacts": reduction.problem.contacts,
        "status": solution.status.label,
        "residual": float(solution.residual),
        "steps": solution.iterations,
        "V-cycles": cycles,  # none of those inside products
        "products": solution.products,
        "V-cycles of one product": of_product,
        "CPU of one product [s]": product,
        "set-up CPU [s]": made[1] - begin[1],
        "set-up wall [s]": made[0] - begin[0],
        "CPU [s]": done[1] - begin[1],
        "wall [s]": done[0] - begin[0],
        "peak memory [GiB]": memory,
    }


def cycles_of_product(reduction) -> int:  # type: ignore[no-untyped-def]
    """V-cycles of both bodies for one product with Q at ACCURACY, on random forces."""
    from contactopt.bodies.solvers.multigrid import conjugate_gradients

    r = np.random.default_rng(0).normal(size=reduction.problem.q.size)
    total = 0
    for body, B in zip(reduction.bodies, reduction.maps):
        solver = body.solver
        total += conjugate_gradients(
            solver.A, solver.cycle, (B.T @ r)[body.body.free], ACCURACY
        ).cycles
    return total


def isolated(elements: int, way: str, mu: float) -> dict[str, object]:
    command = [sys.executable, "-m", MODULE, "--once", str(elements), way, str(mu)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def runs(sizes: list[int]) -> list[tuple[int, str, float]]:
    """All sizes with the largest friction; those COMPARED with all, and with products."""
    chosen = [(n, "coupled", FRICTION[-1]) for n in sizes]
    more = [n for n in sizes if n in COMPARED]
    chosen += [(n, "coupled", mu) for n in more for mu in FRICTION[:-1]]
    return chosen + [(n, "products", mu) for n in more for mu in (0.3, 0.5)]


def draw(rows: list[dict]) -> Any:
    figure, (ax,) = paper_axes()
    lines = []
    for way in WAYS:
        mine = [row for row in rows if row["way"] == way and float(row["mu"]) == FRICTION[-1]]
        lines.append((way, *([float(row[key]) for row in mine] for key in ("unknowns", "CPU [s]"))))
    _, n, cpu = lines[0]
    lines.append(("proportional to $n$", n, [cpu[0] * size / n[0] for size in n]))  # type: ignore[operator]
    draw_lines(ax, lines, ("o-", "s-", ":"))
    ax.set(xlabel="displacement unknowns $n$ [-]", ylabel="CPU time with set-up [s]")
    return figure


TEXT = template(__file__)


def report(rows: list[dict]) -> str:
    coupled = [row for row in rows if row["way"] == "coupled"]
    largest = [row for row in coupled if float(row["mu"]) == FRICTION[-1]]
    n, cpu = (np.log([float(row[key]) for row in largest]) for key in ("unknowns", "CPU [s]"))
    slope = np.polyfit(n, cpu, 1)[0] if len(n) > 1 else np.nan
    linear = [
        float(row["CPU [s]"])
        / (float(row["set-up CPU [s]"]) + float(row["CPU of one product [s]"]))
        for row in largest
    ]
    ratios = ", ".join(
        f"{value:.2f} ({int(row['unknowns']):,} unknowns)" for value, row in zip(linear, largest)
    )
    over = [float(row["V-cycles"]) / float(row["V-cycles of one product"]) for row in coupled]
    same = {(row["elements"], row["mu"]): float(row["CPU [s]"]) for row in coupled}
    slow = [row for row in rows if row["way"] == "products"]
    faster = ", ".join(
        f"{float(row['CPU [s]']) / same[row['elements'], row['mu']]:.1f} ({int(row['unknowns']):,}"
        f" unknowns, mu = {row['mu']})"
        for row in slow
    )
    text = (
        TEXT.replace("{slope}", f"{slope:.2f}")
        .replace("{ratios}", ratios)
        .replace("{faster}", faster)
    )
    return text.replace("{least}", f"{min(over):.1f}").replace("{most}", f"{max(over):.1f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--once"]:
        print(json.dumps(once(int(sys.argv[2]), sys.argv[3], float(sys.argv[4]))))
    elif figures_alone():
        save_figures("large_punch", {"growth": draw(stored("large_punch", "sizes"))})
    else:
        rows = [isolated(*run) for run in runs([int(size) for size in sys.argv[1:]] or list(SIZES))]
        rows = merged("large_punch", "sizes", rows, KEYS)
        rows = sorted(rows, key=lambda row: (int(row["unknowns"]), row["way"], float(row["mu"])))
        tables = {"sizes": rows}
        write(
            "large_punch",
            "Friction beside one linear solve",
            report(rows),
            tables,
            {"growth": draw(rows)},
        )
