"""What is each stage of the default method worth?

`python -m experiments.questions.stages [FOLDER ...]` also takes FCLib files of folders.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from contactopt import InputError, InterfaceProblem, fclib, solve
from contactopt.benchmark.families.packings import packing
from contactopt.benchmark.testset.problem_set import problems
from contactopt.methods import auto, constants
from contactopt.methods.kernels.alart_curnier import cold_start
from contactopt.methods.nested import Nested
from experiments.report import template, write

# packings: dimension, bodies, contacts of a pair of bodies
FAMILIES = ((2, 25, 1), (2, 64, 2), (3, 18, 3), (3, 27, 2))
FRICTION, SEEDS = (0.5, 0.8, 1.5), 4
LOW_RANK = 20  # problems
LIMIT, SECONDS = 500, 60.0  # iterations, and seconds of the clock
TIERS = ("small",)

Problems = dict[str, tuple[str, Callable[[], InterfaceProblem]]]
Solved = tuple[str, float, set[str]]


def packings() -> Iterator[tuple[str, Callable[[], InterfaceProblem]]]:
    for family in FAMILIES:
        for mu in FRICTION:
            for seed in range(SEEDS):
                dim, bodies, points = family
                name = f"{dim}D, {bodies} bodies, {points} points, mu {mu}, {seed}"
                yield name, lambda one=(dim, bodies, seed, mu, points): packing(*one)


def low_rank(seed: int) -> InterfaceProblem:
    """A random Q of a third of the full rank, as of redundant contacts."""
    rng, dim = np.random.default_rng(seed), 2 + seed % 2
    k = int(rng.integers(4, 25))
    B, q = rng.normal(size=(k * dim, max(1, k * dim // 3))), rng.normal(size=(k, dim))
    q[:, 0] -= 2.0
    return InterfaceProblem(B @ B.T, q, rng.uniform(0, 1, k))


def all_problems(folders: list[str]) -> Problems:
    found = {name: ("packings", make) for name, make in packings()}
    for seed in range(LOW_RANK):
        found[f"low rank {seed}"] = "low rank", lambda seed=seed: low_rank(seed)
    for folder in folders:
        for path in sorted(Path(folder).glob("*.hdf5")):
            found[path.name] = "FCLib", lambda path=path: fclib.read(path)
    for one in problems(testset="1"):
        if one.tier in TIERS:
            found[one.name] = f"test set, {one.tier}", one.load
    return found


def nothing(*given: Any, **more: Any) -> Iterator[Any]:
    return iter(())


def returned(which: int) -> Callable[..., Any]:
    """A stage without points, which returns one of its arguments."""

    def stage(*given: Any, **more: Any) -> Any:
        yield from ()
        return given[which]

    return stage


def bonded(problem: InterfaceProblem, *given: Any) -> Any:
    yield from ()
    return cold_start(problem)


def every(*given: Any, **more: Any) -> bool:
    return True


def path_is(drawn: bool) -> Callable[..., bool]:
    return lambda problem, matrix, path=None: (path is not None) == drawn


def sweeps(most: int) -> Callable[..., bool]:
    return lambda swept, number, *more: number == most


ROBUST, SWEPT = auto._Robust, auto._Swept
INTERIOR = (auto, "interior_iterates", nothing)
# stage -> object and attribute, what stands for it where it is left out, which calls are its own
STAGES: dict[str, tuple[Any, str, Callable[..., Any], Callable[..., bool]]] = {
    "first sweeps": (SWEPT, "points", nothing, sweeps(constants.FIRST_SWEEPS)),
    "nested grids": (Nested, "with_residuals", nothing, every),
    "Newton's method": (auto, "_newton", bonded, every),
    "proximal steps near Newton's best": (
        ROBUST,
        "proximal",
        returned(1),
        lambda *given, **more: "aim" in more,
    ),
    "more sweeps": (SWEPT, "points", nothing, sweeps(constants.MORE_SWEEPS)),
    "interior path": (*INTERIOR, path_is(drawn=False)),
    "proof that there is no solution": (auto, "infeasibility", lambda problem: None, every),
    "tree over the states": (ROBUST, "searched", nothing, every),
    "random interior paths": (*INTERIOR, path_is(drawn=True)),
    "restarts from random forces": (ROBUST, "restarted", returned(1), every),
}


@contextmanager
def watched(left_out: str | None = None) -> Iterator[set[str]]:
    """The stages that a solve enters; one of them may be left out."""
    entered: set[str] = set()
    with ExitStack() as stack:
        for name, (owner, attribute, instead, own) in STAGES.items():
            usual = getattr(owner, attribute)

            def call(*given: Any, usual=usual, name=name, instead=instead, own=own, **more: Any):
                if not own(*given, **more):
                    return usual(*given, **more)
                entered.add(name)
                return (instead if name == left_out else usual)(*given, **more)

            stack.enter_context(patch.object(owner, attribute, call))
        yield entered


def solved(problem: InterfaceProblem, left_out: str | None = None) -> Solved:
    """Status, processor seconds and stages of the default method."""
    with watched(left_out) as entered, np.errstate(all="ignore"):
        start = time.process_time()
        try:
            status = str(solve(problem, max_iterations=LIMIT, time_limit=SECONDS).status)
        except InputError as error:
            status = f"refused: {error}"
        return status, time.process_time() - start, entered


def measure(folders: list[str]) -> list[dict[str, Any]]:
    """For each set and stage: the problems that enter it, and what is lost without it."""
    found, rows = all_problems(folders), []
    for group in dict.fromkeys(group for group, _ in found.values()):
        own = {name: make for name, (its, make) in found.items() if its == group}
        usual = {name: solved(make()) for name, make in own.items()}
        rows.append(row(group, "-", len(own), usual))
        for stage in STAGES:
            entering = [name for name, (*_, entered) in usual.items() if stage in entered]
            if entering:
                without = usual | {name: solved(own[name](), stage) for name in entering}
                rows.append(row(group, stage, len(entering), without))
                lost = {name for name in entering if usual[name][0] != without[name][0]}
                print({name: (usual[name][:2], without[name][:2]) for name in lost}, flush=True)
    return rows


def row(group: str, stage: str, number: int, found: dict[str, Solved]) -> dict[str, Any]:
    """A row of the table: without the stage, which so many problems enter."""
    statuses = [status for status, *_ in found.values()]
    made = {
        "set": group,
        "left out": stage,
        "enter it": number,
        "solved": statuses.count("solved"),
        "proved unsolvable": statuses.count("infeasible"),
        "CPU [s]": sum(seconds for _, seconds, _ in found.values()),
    }
    print(made, flush=True)
    return made


if __name__ == "__main__":
    text = template(__file__)
    write("stages", "The stages of the default method", text, {"rows": measure(sys.argv[1:])}, {})
