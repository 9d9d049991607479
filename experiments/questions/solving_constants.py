"""What is each number of contactopt.methods.constants worth? Half and twice of it, one at a time,
over problems of several kinds.

Names of constants after the command choose some of them. Their rows are then printed, and no report
is written.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

from contactopt import InterfaceProblem, reduce, scenes, solve
from contactopt.benchmark.families.packings import packing, rigid_bodies
from contactopt.methods import constants, find_method
from contactopt.methods.nested import Nested
from experiments.report import template, write

# method that is run, kinds of problems that feel them, names of constants
FELT = (
    ("auto", "rigid packing",
     "FIRST_SWEEPS MORE_SWEEPS SWEEPING LOCAL FEWEST_SWEEPS SWEEPS_KEPT NEARLY_SWEPT SWEPT LOOK "
     "FRICTIONLESS ROUGHEST INTERIOR_STEPS STALLED INTERIOR_PROGRESS START "
     "LEAST_SMOOTHING MOST_SMOOTHING PREDICTED BOUNDARY SHORT STUCK CORRECTED "
     "LEAST_CENTERING MOST_CENTERING STUCK_CENTERING CENTRAL CENTRAL_KEPT BACKTRACK"),
    ("auto", "elastic rigid packing",
     "NEWTON_STEPS PATIENCE FEW_ENTRIES PROGRESS NEARBY CONE_PROGRAMS CLOSE LEAST_ALPHA "
     "POLISH ROUND SPARSE_ROUND PATHS TURNING EAGER_ALPHA GENTLE_ALPHA LARGER"),
    ("proximal", "elastic rigid",
     "FALL RISE GENTLE_FALL GENTLE_RISE EASY EAGER_STEPS SUBPROBLEM_STEPS SHORTEST MEMORY "
     "ENOUGH"),
    ("newton", "elastic",
     "LOOSE"),
    ("auto", "packing",
     "SMALL FULL"),
    ("apg", "coarse",
     "SHARPER SHARPEST"),
    ("newton", "products",
     "KRYLOV_FIRST KRYLOV_LOOSEST KRYLOV_TIGHTEST PRODUCT_SHARE MODEL_STEP MODEL_PRODUCTS "
     "SLIPPING"),
    ("pcg", "products",
     "ACTIVE_SETS SUCCESS WEIGHT_FALL WEIGHT_RISE"),
    ("newton", "bodies",
     "COUPLED_FIRST COUPLED_LOOSEST COUPLED_TIGHTEST SCHUR_STEP SCHUR_MARGIN GIVEN_BALANCE"),
    ("nested", "half-spaces",
     "COARSEST LEAST_SYMBOL LEAST_DETERMINANT FIRST_SHIFT SHIFT_RATIO NESTED_LOOSEST "
     "NESTED_TIGHTEST COARSE_ENOUGH COARSEST_ENOUGH COARSE_STEPS COARSE_TRIES CLOSER SLOW "
     "MOST_LOCAL FEW_OF_ALL LOCAL_SHARE AROUND LOCAL_TRIES LOCAL_ENOUGH"),
    ("lagrangian", "coarse",
     "EIGENVALUE_MARGIN ROWS_FALL ROWS_SHARE FINEST_SHARE STIFFER ROUGH_NORMAL"),
    ("admm", "coarse",
     "FIRST_BALANCING MOST_CHANGE LEAST_CHANGE"),
)  # fmt: skip
# methods with settings, or without a name of their own
BUILT = {"pcg": find_method("alternating", normal="pcg", tangential="pcg"), "nested": Nested()}
LIMIT = 1000  # iterations per problem
NEAR_ONE = 0.8  # shares from here to one are changed by their distance from one


def problems() -> dict[str, list[InterfaceProblem]]:
    """The problems of each kind."""
    punches = [
        reduce(scenes.flat_punch(2, mu=mu, elements=n)) for mu in (0.1, 0.5) for n in (32, 128)
    ]
    spheres = [reduce(scenes.sphere(mu=mu, elements=n)) for mu in (0.1, 0.5) for n in (32, 128)]
    rigid = [rigid_bodies(10, 40, mu, seed) for seed in range(3) for mu in (0.3, 1.0, 3.0)]
    grains = [
        packing(dim, 40, seed, mu, points)
        for seed in range(2)
        for dim, mu, points in ((2, 0.3, 1), (3, 0.8, 2))
    ]
    scenes_of_products = (scenes.flat_punch(2, mu=0.5), scenes.sphere(mu=0.5))
    products = [
        reduce(scene, elements=n, Q="implicit") for scene in scenes_of_products for n in (32, 128)
    ]
    bodies = [
        reduce(scenes.flat_punch(3, mu=mu), elements=6, solver="multigrid") for mu in (0.1, 0.5)
    ]
    made = (scenes.hertz_half_space(), scenes.cattaneo_half_space(), scenes.rough())
    return {
        "elastic": punches + spheres,
        "coarse": punches[::2] + spheres[::2],
        "rigid": rigid,
        "packing": grains,
        "products": products,
        "bodies": bodies,
        "half-spaces": [reduce(scene) for scene in made],
    }


@contextmanager
def setting(name: str, value: Any) -> Iterator[None]:
    """All methods, which are imported by now, with another value of one constant."""
    usual = getattr(constants, name)
    with ExitStack() as stack:
        for room, module in list(sys.modules.items()):
            if room.startswith("contactopt.methods") and vars(module).get(name) == usual:
                stack.enter_context(patch.object(module, name, value))
        yield


def cost(method: str, asked: list[InterfaceProblem]) -> tuple[int, float]:
    """How many of the problems are certified, and the processor seconds of all."""
    start = time.process_time()
    solved = sum(
        solve(problem, BUILT.get(method, method), max_iterations=LIMIT).solved for problem in asked
    )
    return solved, time.process_time() - start


def changed(value: Any, factor: float) -> Any:
    """That many times the value; of a share near one that many times its distance from one."""
    return 1 - factor * (1 - value) if NEAR_ONE <= value < 1 else type(value)(factor * value)


def measure(chosen: list[str]) -> list[dict[str, Any]]:
    """One row for each of the chosen constants; for every one if none is chosen."""
    rows: list[dict[str, Any]] = []
    sets = problems()
    known: dict[tuple[str, str], tuple[int, float]] = {}
    for method, kinds, names in FELT:
        asked = [problem for kind in kinds.split() for problem in sets[kind]]
        for name in (name for name in names.split() if name in chosen or not chosen):
            value = getattr(constants, name)
            if (method, kinds) not in known:
                known[method, kinds] = cost(method, asked)
            solved, seconds = known[method, kinds]
            row = {
                "constant": name,
                "value": value,
                "method": method,
                "certified": f"{solved} of {len(asked)}",
            }
            row["seconds"] = seconds
            for label, factor in (("half", 0.5), ("twice", 2.0)):
                with setting(name, changed(value, factor)):
                    count, taken = cost(method, asked)
                row |= {f"{label}: certified": count, f"{label}: time": taken / seconds}
            rows.append(row)
            print(row, flush=True)
    return rows


TEXT = template(__file__)

if __name__ == "__main__":
    if sys.argv[1:]:
        measure(sys.argv[1:])
        sys.exit()
    sets = problems()
    counts = {kind: len(asked) for kind, asked in sets.items()}
    twice = [cost("auto", sets["elastic"] + sets["rigid"])[1] for _ in range(3)]
    halves = counts.pop("half-spaces")
    text = TEXT.format(limit=LIMIT, noise=max(twice) / min(twice) - 1, halves=halves, **counts)
    write(
        "solving_constants",
        "What the numbers of the methods are worth",
        text,
        {"rows": measure([])},
        {},
    )
