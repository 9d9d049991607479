"""One solve in a process of its own, with its CPU seconds, its Newton steps and its memory."""

from __future__ import annotations

import logging
import multiprocessing
import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from contactopt import Scene, solve
from contactopt.coupling.reduction import reduce_bodies
from contactopt.readings.half_space_readings import surface_contact

Row = dict[str, Any]


def cpu(act: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds of this process, and what was made."""
    start = time.process_time()
    made = act()
    return time.process_time() - start, made


def apart(act: Callable[..., Any], *arguments: Any) -> Any:
    """act(*arguments) in a new process, whose largest memory is its own."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        made = pool.submit(act, *arguments).result()
    print(made, flush=True)  # long runs show how far they are
    return made


class Steps(logging.Handler):
    """The iterations of every Newton step on the finest grid, which the nested method logs."""

    def __init__(self, grid: tuple[int, ...]):
        super().__init__()
        self.grid, self.iterations = grid, list[int]()

    def emit(self, record: logging.LogRecord) -> None:
        args = record.args
        if isinstance(args, tuple) and len(args) == 4 and args[0] == self.grid:
            self.iterations.append(int(args[2]))  # type: ignore[call-overload]


def solved(scene: Scene) -> Row:
    """What the solution of a scene of half-spaces took."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    making, reduction = cpu(lambda: reduce_bodies(scene))
    steps = Steps(reduction.problem.Q.kernel.grid)
    log = logging.getLogger("contactopt.methods.kernels.level_steps")
    log.addHandler(steps)
    log.setLevel(logging.INFO)
    solving, solution = cpu(lambda: solve(reduction.problem))
    log.removeHandler(steps)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "points": reduction.problem.contacts,
        "law": scene.law,
        "contact": surface_contact(reduction.problem, solution).fraction,
        "Newton steps": len(steps.iterations),
        "iterations a step": sum(steps.iterations) / max(1, len(steps.iterations)),
        "products": solution.products,
        "CPU s, problem": making,
        "CPU s, solve": solving,
        "certificate": solution.residual,
        "solved": solution.solved,
        "peak GB": after / 1e6,
        "kB a point": (after - before) / reduction.problem.contacts,
    }
