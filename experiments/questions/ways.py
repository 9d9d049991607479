"""Which way to the solution is cheapest: a dense Q, products with Q by factors, or bodies and
contact at once by multigrid?

`python -m experiments.questions.ways` measures all ways on punches of growing size, fits the
estimates of contactopt.coupling.costs to them and draws both as maps. `--fit` fits and draws what
was measured before.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from itertools import product

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import nnls

from contactopt import reduce_bodies, scenes, solve
from contactopt.coupling.costs import MOST_EXPLICIT, WAYS, seconds, terms
from contactopt.figures.plots import BLUE, GREEN, ORANGE
from experiments.report import stored, write

SIZES = {2: (64, 128, 256, 512, 1024), 3: (6, 8, 12, 16, 20, 26)}  # elements across the half-width
FORMS = {"dense": "explicit", "products": "implicit", "coupled": "implicit"}
SOLVERS = {
    "dense": ("superlu", "pardiso"),
    "products": ("superlu", "pardiso"),
    "coupled": ("multigrid",),
}
LONG = 40.0  # seconds after which a way is not tried on larger meshes
MU = 0.3
NAMES = {"dense": "dense Q", "products": "products with Q", "coupled": "coupled, multigrid"}
Places = dict[int, list[tuple[int, int]]]  # dimension -> n, m of the punches
COLOURS = {"dense": BLUE, "products": GREEN, "coupled": ORANGE}


def once(dim: int, elements: int, way: str, solver: str) -> dict[str, object]:
    """CPU time of one run with one BLAS thread; late imports are made before."""
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
    done = subprocess.run(
        command, check=True, capture_output=True, text=True, env=os.environ | limits
    )
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


def fitted(rows: list[dict]) -> list[dict[str, object]]:
    """COSTS by least squares of relative errors, not negative, and how far they are off."""
    found: list[dict[str, object]] = []
    for dim, solver in dict.fromkeys((row["dim"], row["solver"]) for row in rows):
        mine = [row for row in rows if (row["dim"], row["solver"]) == (dim, solver)]
        t = np.array([row["whole [s]"] for row in mine])
        A = np.array([terms(row["way"], row["m"], row["n"], dim) for row in mine])
        prices, _ = nnls(A / t[:, None], np.ones(len(t)))
        own: dict[str, object] = {
            "dim": dim,
            "solver": solver,
            "prices": " ".join(f"{price:.2e}" for price in prices),
        }
        for way in WAYS:
            ratio = (A @ prices / t)[[row["way"] == way for row in mine]]
            own[f"{way}: estimate over measured"] = (
                f"{ratio.min():.2f} to {ratio.max():.2f}" if len(ratio) else ""
            )
        found.append(own)
    return found


def draw(places: Places) -> Figure:
    """The cheapest way by COSTS; rings: the punches that were measured."""
    figure = Figure(figsize=(9, 7), layout="constrained")
    axes = figure.subplots(2, 2)
    for (dim, solver), ax in zip(product((2, 3), ("superlu", "pardiso")), axes.ravel()):
        n = np.geomspace(2e3, 1e6, 160)
        m = np.geomspace(30, 2e4, 120)
        best = np.array([[WAYS.index(cheapest(int(b), int(a), dim, solver)) for a in n] for b in m])
        ax.contourf(
            n,
            m,
            best,
            levels=[-0.5, 0.5, 1.5, 2.5],
            colors=[COLOURS[way] for way in WAYS],
            alpha=0.45,
        )
        ax.set(
            xscale="log",
            yscale="log",
            xlabel="unknowns of the largest body [-]",
            ylabel="of them on the contact [-]",
        )
        ax.set_title(f"{dim}D, factors by {solver}", fontsize=10)
        ax.plot(*np.array(places[dim]).T, "o", mfc="white", mec="black", ms=5)
    for way in WAYS:
        axes[0, 0].fill([], [], color=COLOURS[way], alpha=0.45, label=NAMES[way])
    figure.legend(loc="outside lower center", frameon=False, ncol=3)
    return figure


def cheapest(m: int, n: int, dim: int, solver: str) -> str:
    ways = [way for way in WAYS if m <= MOST_EXPLICIT or way != "dense"]
    return min(
        ways, key=lambda way: seconds(way, m, n, dim, "multigrid" if way == "coupled" else solver)
    )


TEXT = """Which way to the solution is the cheapest? The scenes are punch-2d and punch-3d with mu =
{mu}. Newton's method solves them from a cold start to a certificate of 1e-8. There are three ways:
an array Q (`dense`), `products` with Q by the factors of both bodies, or bodies and contact at once
by multigrid (`coupled`). Times are CPU seconds of one run each, with the set-up and with one thread
of BLAS. Other programs had a share of the machine. n is the number of unknowns of the larger body,
and m is the number of those on its contact surface.

{{rows}}

`contactopt/coupling/costs.py` estimates the costs. Each estimate is a sum of the terms there
(`terms`), with the prices of this table. The prices were fitted to the measured times.

{{fits}}

The maps show the cheapest way by these estimates. The rings are measured punches. In three
dimensions, along the measured punches, `coupled` takes less time than both other ways from about
{superlu:,} unknowns of the larger body on, if the factors are those of SuperLU. With the factors of
PARDISO this begins at about {pardiso:,}. It takes less than half of their time from
{half_superlu:,} and {half_pardiso:,}. contactopt takes factors up to there (`FACTORS_UP_TO` in
`contactopt/bodies/solvers/constants.py`), because factors also serve further states of a load path,
and methods other than Newton's. In the plane `coupled` takes less than both others {plane}.
"""


def crossing(places: Places, dim: int, solver: str, share: float) -> float:
    """Unknowns from which on `coupled` takes less than that share of the time of the others."""
    n, m = np.log(np.array(places[dim]).T)
    slope, start = np.polyfit(n, m, 1)
    for size in np.geomspace(3e3, 1e7, 400):
        contact = int(np.exp(start + slope * np.log(size)))
        others = [way for way in WAYS[:2] if contact <= MOST_EXPLICIT or way != "dense"]
        least = min(seconds(way, contact, int(size), dim, solver) for way in others)
        if seconds("coupled", contact, int(size), dim, "multigrid") < share * least:
            return float(size)
    return np.inf


def said(size: float) -> str:
    return (
        "never with the factors"
        if np.isinf(size)
        else f"from about {rounded(size):,} unknowns on with those"
    )


def rounded(size: float) -> int:
    return int(float(f"{size:.2g}")) if np.isfinite(size) else 0


def main(rows: list[dict]) -> None:
    places = {
        dim: sorted({(row["n"], row["m"]) for row in rows if row["dim"] == dim}) for dim in SIZES
    }
    text = TEXT.format(
        mu=MU,
        superlu=rounded(crossing(places, 3, "superlu", 1.0)),
        pardiso=rounded(crossing(places, 3, "pardiso", 1.0)),
        half_superlu=rounded(crossing(places, 3, "superlu", 0.5)),
        half_pardiso=rounded(crossing(places, 3, "pardiso", 0.5)),
        plane=" and ".join(
            f"{said(crossing(places, 2, name, 1.0))} of {name}" for name in ("superlu", "pardiso")
        ),
    )
    write(
        "ways",
        "Which way to the solution",
        text,
        {"rows": rows, "fits": fitted(rows)},
        {"maps": draw(places)},
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--once"]:
        print(json.dumps(once(int(sys.argv[2]), int(sys.argv[3]), sys.argv[4], sys.argv[5])))
    else:
        main(stored("ways", "rows") if sys.argv[1:2] == ["--fit"] else measured())
