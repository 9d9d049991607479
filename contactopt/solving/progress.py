"""One line per outer iteration of a long solve: what it reached, what it took, what is left."""

import math
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path

from contactopt.linear.operators import form
from contactopt.problem import InterfaceProblem
from contactopt.screen import PATIENCE


def progress_lines(
    say: Callable[[str], None], problem: InterfaceProblem, tol: float
) -> Callable[[int, float], None]:
    """A function that reports one line per outer iteration, from PATIENCE seconds on."""
    begin = time.perf_counter()
    before: list[tuple[float, float]] = []
    bodies = problem.Q.coupled if form(problem.Q) == "bodies" else None
    first = 0 if bodies is None else bodies.cycles

    def progress(iteration: int, residual: float) -> None:
        spent = time.perf_counter() - begin
        before.append((spent, residual))
        if spent < PATIENCE:
            return
        cycles = "" if bodies is None else f", {bodies.cycles - first} V-cycles of each body"
        say(
            f"step {iteration}: residual {residual:.1e}{cycles}, {spent:.0f} s,"
            f" {_peak_memory() / 2**30:.1f} GiB" + remaining(before, tol)
        )

    return progress


def remaining(steps: list[tuple[float, float]], tol: float) -> str:
    """ ", about T s left", from the last two residuals; nothing where they do not fall."""
    if len(steps) < 2:
        return ""
    (start, old), (end, new) = steps[-2:]
    if not 0 < tol < new < old:
        return ""
    return f", about {(end - start) * math.log(new / tol) / math.log(old / new):.0f} s left"


def _peak_memory() -> float:
    """Largest memory of this process so far in bytes."""
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(size if sys.platform == "darwin" else 1024 * size)


def resident_memory() -> float:
    """Read how much memory this process takes now, in bytes; 0 where the system does not tell."""
    try:
        return float(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
    except OSError:
        return 0.0
