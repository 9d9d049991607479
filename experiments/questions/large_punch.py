"""How does the implicit path with multigrid bodies grow, up to a punch of a million unknowns in 3D?"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time

import numpy as np
from matplotlib.figure import Figure

from contactopt import scenes
from contactopt.analysis.solve_scene import Options
from contactopt.analysis.zone import solve_zone
from contactopt.figures.plots import BLUE, GREY, ORANGE
from experiments.report import merged, write

SIZES = (32, 48, 64, 92)  # elements across the half-width of the punch


def once(elements: int) -> dict[str, object]:
    """punch-3d, bodies by multigrid, from nested meshes; run in a process of its own."""
    wall, cpu = time.perf_counter(), time.process_time()
    solved = solve_zone(scenes.flat_punch(3, elements=elements), options=Options(solver="multigrid"))
    reduction, solution = solved.reduction, solved.solution
    seconds = {"wall [s]": time.perf_counter() - wall, "CPU [s]": time.process_time() - cpu}
    phases = {f"{name} [s]": value for name, value in solution.seconds.items()}
    return {
        "elements": elements,
        "unknowns": reduction.dofs,
        "contacts": reduction.problem.contacts,
        "status": solution.status.label,
        "residual": float(solution.residual),
        "steps": solution.iterations,
        "products": solution.products,
        **seconds,
        "peak memory [GiB]": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        **phases,
    }


def isolated(elements: int) -> dict[str, object]:
    command = [sys.executable, "-m", "experiments.questions.large_punch", "--once", str(elements)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def draw(rows: list[dict]) -> Figure:
    figure = Figure(figsize=(6.5, 4.2), layout="constrained")
    ax = figure.subplots()
    n = np.array([row["unknowns"] for row in rows], dtype=float)
    for key, colour in (("wall [s]", ORANGE), ("CPU [s]", BLUE)):
        ax.loglog(n, [row[key] for row in rows], "o-", color=colour, mfc="white", label=key)
    ax.loglog(n, rows[0]["CPU [s]"] * (n / n[0]) ** 1.2, ":", color=GREY, label="n^1.2")
    ax.set(xlabel="displacement unknowns n [-]", ylabel="scene reduced and solved [s]")
    ax.legend(frameon=False)
    return figure


TEXT = """punch-3d, mu = .5, to a certificate of 1e-8: both bodies by conjugate gradients and multigrid, Q by its products,
`elements` across the half-width of the punch; Newton's method started from the solution on meshes half as fine (itself started from a coarser one; `coarse`).
CPU time is that of both threads; where it is far below twice the wall time other programs had a share of the two cores.

{sizes}

Growth of CPU time with the unknowns: exponent {slope}; of wall time: {slope_wall} (least squares over all sizes).
"""

if __name__ == "__main__":
    if sys.argv[1:2] == ["--once"]:
        print(json.dumps(once(int(sys.argv[2]))))
    else:
        rows = [isolated(int(elements)) for elements in sys.argv[1:] or SIZES]
        rows = sorted(merged("large_punch", "sizes", rows, ("elements",)), key=lambda row: row["unknowns"])
        n = np.log([row["unknowns"] for row in rows])
        slopes = {key: np.polyfit(n, np.log([row[key] for row in rows]), 1)[0] for key in ("CPU [s]", "wall [s]")}
        text = TEXT.replace("{slope}", f"{slopes['CPU [s]']:.2f}").replace("{slope_wall}", f"{slopes['wall [s]']:.2f}")
        write("large_punch", "A million unknowns", text, {"sizes": rows}, {"growth": draw(rows)})
