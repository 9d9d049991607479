"""What is each number of contactopt.solving.constants worth? Half and twice of it, one at a time, over problems of three kinds."""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import time  # noqa: E402
from collections.abc import Iterator  # noqa: E402
from contextlib import ExitStack, contextmanager  # noqa: E402
from importlib import import_module  # noqa: E402
from typing import Any  # noqa: E402

from contactopt import InterfaceProblem, reduce, scenes, solve  # noqa: E402
from contactopt.solving import constants  # noqa: E402
from experiments.questions.granular import packing  # noqa: E402
from experiments.questions.robustness import rigid_bodies  # noqa: E402
from experiments.report import write  # noqa: E402

HOME = "contactopt.solving"
USERS = {  # names of constants -> module that uses them, method that is run, kinds of problems that feel them
    (
        "NEWTON_STEPS PATIENCE PROGRESS CONE_PROGRAMS CLOSE LEAST_ALPHA POLISH ROUND SPARSE_ROUND PATHS TURNING GENTLE_ALPHA LARGER"
    ): (
        "methods.auto",
        "auto",
        ("elastic", "rigid", "packing"),
    ),
    "FALL RISE GENTLE_FALL GENTLE_RISE EASY": ("methods.proximal", "proximal", ("elastic", "rigid")),
    "SUBPROBLEM_STEPS SHORTEST MEMORY ENOUGH": ("kernels.sparse_newton", "proximal", ("elastic", "rigid")),
    "LOOSE": ("kernels.alart_curnier", "newton", ("elastic",)),
    "SMALL FULL": ("kernels.sparse_blocks", "auto", ("packing",)),
    "SHARPER SHARPEST": ("methods.apg", "apg", ("coarse",)),
}
LIMIT = 1000  # iterations per problem


def problems() -> dict[str, list[InterfaceProblem]]:
    """The problems of each kind."""
    punches = [reduce(scenes.flat_punch(2, mu=mu, elements=n)) for mu in (0.1, 0.5) for n in (32, 128)]
    spheres = [reduce(scenes.sphere(mu=mu, elements=n)) for mu in (0.1, 0.5) for n in (32, 128)]
    rigid = [rigid_bodies(seed, 10, 40, mu) for seed in range(3) for mu in (0.3, 1.0, 3.0)]
    grains = [packing(dim, 40, seed, mu, points) for seed in range(2) for dim, mu, points in ((2, 0.3, 1), (3, 0.8, 2))]
    return {"elastic": punches + spheres, "coarse": punches[::2] + spheres[::2], "rigid": rigid, "packing": grains}


@contextmanager
def setting(name: str, value: Any) -> Iterator[None]:
    """The solvers with another value of one constant."""
    with ExitStack() as stack:
        for names, (module, _, _) in USERS.items():
            if name in names.split():
                user = import_module(f"{HOME}.{module}")
                stack.callback(setattr, user, name, getattr(user, name))
                setattr(user, name, value)
        yield


def cost(method: str, asked: list[InterfaceProblem]) -> tuple[int, float]:
    """How many of the problems are certified, and the processor seconds of all."""
    start = time.process_time()
    solved = sum(solve(problem, method, max_iterations=LIMIT).solved for problem in asked)
    return solved, time.process_time() - start


def measure() -> list[dict[str, Any]]:
    """One row for each constant."""
    rows: list[dict[str, Any]] = []
    sets = problems()
    known: dict[tuple[str, tuple[str, ...]], tuple[int, float]] = {}
    for names, (_, method, kinds) in USERS.items():
        asked = [problem for kind in kinds for problem in sets[kind]]
        for name in names.split():
            value = getattr(constants, name)
            if (method, kinds) not in known:
                known[method, kinds] = cost(method, asked)
            solved, seconds = known[method, kinds]
            row = {"constant": name, "value": value, "method": method, "certified": f"{solved} of {len(asked)}"}
            row["seconds"] = seconds
            for label, factor in (("half", 0.5), ("twice", 2.0)):
                with setting(name, type(value)(factor * value)):
                    changed, taken = cost(method, asked)
                row |= {f"{label}: certified": changed, f"{label}: time": taken / seconds}
            rows.append(row)
            print(row, flush=True)
    return rows


TEXT = """Every number of `contactopt.solving.constants` at half and at twice its value, one at a time: how many problems are certified
(residual at most 1e-8, at most {limit} iterations), and the processor time over that with the value itself. The problems: {elastic} of elastic
bodies (`punch-2d` and `sphere`, of which the {coarse} coarse ones for `apg`), {rigid} of random rigid bodies, {packing} packings of rigid bodies with a sparse Q; one run each,
one thread; the same run twice differs by up to {noise:.0%}.

{{rows}}
"""

if __name__ == "__main__":
    sets = problems()
    counts = {kind: len(asked) for kind, asked in sets.items()}
    twice = [cost("auto", sets["elastic"] + sets["rigid"])[1] for _ in range(3)]
    text = TEXT.format(limit=LIMIT, noise=max(twice) / min(twice) - 1, **counts)
    write("solving_constants", "What the numbers of the methods are worth", text, {"rows": measure()}, {})
