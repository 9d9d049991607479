"""What does the time of a run buy? Every ratio of small problems, first answers and whole runs.

`python -m experiments.questions.price` measures all tables; a table's name after it measures this
one. Set FCLIB to a folder of problems in FCLib's format to have those where sweeps fail.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import contactopt
from contactopt import InterfaceProblem, Scene, fclib, scenes, solve, solve_batch
from contactopt.benchmark.families.packings import packing
from contactopt.coupling.reduction import reduce_bodies
from experiments.questions.half_spaces.measured import apart, cpu
from experiments.questions.half_spaces.rough import one, pressed
from experiments.report import measure, template

REPEATS = 7
BATCH, SIZE = 256, 8
PACKINGS = range(10)  # their seeds: times of single packings differ by a factor of a hundred
GRIDS = (256, 512, 1024)
IMPORTS = "import numpy, scipy, skfem, matplotlib"
Rows = list[dict[str, Any]]


def timed(act: Callable[[], Any], times: int = 1) -> float:
    """The median CPU seconds of one call."""

    def several() -> None:
        for _ in range(times):
            act()

    several()
    return median(cpu(several)[0] for _ in range(REPEATS)) / times


def commands(*given: tuple[str, ...]) -> list[float]:
    """The median CPU seconds of commands as whole processes, of modules that are compiled. They
    take turns, so that a machine that slows down slows all of them.
    """
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}

    def once(arguments: tuple[str, ...]) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        call = [sys.executable, *arguments]
        subprocess.run(call, capture_output=True, check=True, env=environment)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    rounds = [[once(arguments) for arguments in given] for _ in range(REPEATS + 1)]
    return [median(times) for times in zip(*rounds[1:])]


def row(
    work: str, amount: float, wanted: float, beside: str = "", other: float = 1.0
) -> dict[str, Any]:
    """An amount beside another one, or alone; wanted is the largest ratio, or amount."""
    ratio = amount / other
    told = {"beside": beside or "-", "its amount": other if beside else "-"}
    return {"work": work, "amount": amount, **told, "ratio": ratio if beside else "-",
            "wanted": wanted, "reached": "yes" if ratio <= wanted else "no"}  # fmt: skip


def made_anew(problem: InterfaceProblem) -> InterfaceProblem:
    return InterfaceProblem(problem.Q, problem.q, problem.law, problem.V, problem.s)


def _solved_anew(problem: InterfaceProblem) -> None:
    solve(made_anew(problem))


def settled(points: int) -> float:
    """The median CPU seconds of a packing in space of 27 bodies."""
    made = (packing(3, 27, seed, 0.5, points) for seed in PACKINGS)
    return median(timed(partial(_solved_anew, each)) for each in made)


def small() -> Rows:
    """Problems of a few contacts."""
    made = reduce_bodies(scenes.flat_punch(2, elements=8)).problem
    push = np.array([-1e-3 * abs(made.Q).max(), 0.0])  # every contact, with a force of 1e-3
    nine = InterfaceProblem(made.Q, made.q + push, 0.3)
    rng = np.random.default_rng(0)
    B = rng.normal(size=(BATCH, 2 * SIZE, 2 * SIZE))
    Q, q = B @ B.transpose(0, 2, 1), rng.normal(size=(BATCH, SIZE, 2))
    batch = timed(lambda: solve_batch(Q, q, 0.5)) / BATCH
    loop = timed(lambda: [solve(InterfaceProblem(*each, 0.5)) for each in zip(Q, q)]) / BATCH
    single, double = (settled(points) for points in (1, 2))
    return [
        row("9 contacts in the plane, made already", timed(lambda: solve(nine), 200), 60e-6),
        row("the same with its making", timed(partial(_solved_anew, nine), 200), 250e-6),
        row(f"one of {BATCH} problems of {SIZE} contacts in a batch", batch, 500e-6),
        row("the same", batch, 1.0, "one of them in a loop", loop),
        row("packing in space of 27 bodies, the median of ten", single, 0.04),
        row("the same with two contacts of each pair of bodies", double, 0.04),
    ]


def words() -> Rows:
    """Commands that answer in words, and the first run."""
    cli = ("-m", "contactopt")
    with tempfile.TemporaryDirectory() as folder:
        imports, numpy, alone, helped, listed, first = commands(
            ("-c", IMPORTS),
            ("-c", "import numpy"),
            ("-c", "import contactopt"),
            (*cli, "--help"),
            (*cli, "list"),
            (*cli, "run", "punch-2d", "--out", folder),
        )
    return [
        row("contactopt --help", helped, 2.0, "import numpy", numpy),
        row("contactopt list", listed, 4.0, "import numpy", numpy),
        row("import contactopt", alone, 0.05),
        row("contactopt run punch-2d with figures", first, 3.0, IMPORTS, imports),
    ]


def whole(scene: Scene, **options: Any) -> tuple[float, float, float]:
    """CPU seconds of a whole run, of its reduction with one product, and of its solve."""
    reducing, reduction = cpu(lambda: reduce_bodies(scene, **options))
    problem = reduction.problem
    product, _ = cpu(lambda: problem.Q @ np.ones(problem.q.size))
    solving, _ = cpu(lambda: solve(problem))
    running, result = cpu(lambda: contactopt.run(scene, **options))
    assert result.solution.solved
    return running, reducing + product, solving


def runs() -> Rows:
    """Whole runs, beside what they cannot do without."""
    punch, half = scenes.flat_punch(3, elements=32), pressed("wavy", 1024, "frictionless")
    multigrid, setup, _ = apart(partial(whole, solver="multigrid"), punch)
    running, _, solving = apart(whole, half)
    return [
        row("run of a punch in space by multigrid", multigrid, 1.6, "set-up, one product", setup),
        row("run of a half-space of 1,024 x 1,024 points", running, 1.4, "its solve", solving),
    ]


def searched(name: str, quantity: str) -> tuple[float, float]:
    """CPU seconds of a search for 1 %, and of one solve on its last mesh."""
    scene = scenes.make_scene(name)
    contactopt.run(scene, accuracy=0.5, quantity=quantity)  # imports are no part of either
    searching, result = cpu(lambda: contactopt.run(scene, accuracy=1e-2, quantity=quantity))
    last, _ = cpu(lambda: contactopt.run(result.scene))
    return searching, last


def searches() -> Rows:
    """Searches for an accuracy of 1 %."""
    cylinders, _ = apart(searched, "cattaneo-2d", "shift")
    found = [row("search for 1 % of the shift of cattaneo-2d", cylinders, 6.0)]
    for name, quantity in (("punch-2d", "approach"), ("sphere", "pressure")):
        search, last = apart(searched, name, quantity)
        work = f"search for 1 % of the {quantity} of {name}"
        found.append(row(work, search, 2.5, "one solve on its last mesh", last))
    return found


def rough() -> Rows:
    """Products with Q on rough half-spaces with friction, as the grid grows."""
    coarse, *finer = [apart(one, "rough", n, "coulomb") for n in GRIDS]
    few = coarse["products"]
    return [
        row(f"products, {n} x {n} points", each["products"], 1.1, f"{GRIDS[0]} x {GRIDS[0]}", few)
        for n, each in zip(GRIDS[1:], finer)
    ]


def solved_anew(path: Path, method: str) -> None:
    solve(fclib.read(path), method, time_limit=60)


def others() -> Rows:
    """Problems of other codes on which sweeps fail, in all and by Newton's method alone."""
    folder = Path(os.environ.get("FCLIB", "no folder"))
    found = []
    for path in sorted(folder.glob("*.hdf5")):
        auto, newton = (timed(partial(solved_anew, path, method)) for method in ("auto", "newton"))
        found.append(row(path.stem, auto, 1.8, "newton alone", newton))
    return found


TABLES = {table.__name__: table for table in (small, words, runs, searches, rough)}
if "FCLIB" in os.environ:
    TABLES["others"] = others

if __name__ == "__main__":
    measure("price", "The full price of an answer", template(__file__), TABLES)
