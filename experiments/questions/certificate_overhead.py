"""What do the certificate and the checks of the input cost beside the solve? `python -m
experiments.questions.certificate_overhead`.
"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import time  # noqa: E402
from collections.abc import Callable  # noqa: E402
from functools import partial  # noqa: E402
from itertools import islice  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402

from contactopt import InterfaceProblem, natural_map_residual, reduce, solve  # noqa: E402
from contactopt.methods.auto import Auto  # noqa: E402
from contactopt.problem import dimensionless  # noqa: E402
from contactopt.scenes import make_scene  # noqa: E402
from experiments.report import write  # noqa: E402

SCENES = ("punch-2d", "sphere", "punch-3d")
REPEATS = 9


def clocked(act: Callable[[], Any]) -> tuple[Any, float]:
    """What it returns, and its seconds of the processor, which another load of the machine changes
    least.
    """
    begin = time.process_time()
    return act(), time.process_time() - begin


def alone(problem: InterfaceProblem, iterations: int) -> float:
    """Seconds of the default method without driver and certificate."""
    scaled, _ = dimensionless(problem)
    _, seconds = clocked(lambda: list(islice(Auto().iterate(scaled), iterations)))
    return seconds


def row(name: str) -> dict[str, object]:
    """Medians over REPEATS solves."""
    model = make_scene(name)
    problem, reducing = clocked(lambda: reduce(model))
    runs = []
    for _ in range(REPEATS):
        made, checks = clocked(
            lambda: InterfaceProblem(
                problem.Q, problem.q, problem.law, problem.V, problem.s, problem.areas
            )
        )
        solution, whole = clocked(partial(solve, made))
        certificate = sum(
            clocked(
                partial(natural_map_residual, problem, solution.reactions, solution.multipliers)
            )[1]
            for _ in range(solution.iterations)
        )
        runs.append((checks, whole, alone(problem, solution.iterations), certificate))
    checks, whole, method, certificate = np.median(runs, axis=0)
    extra = max(checks + whole - method, 0.0)
    return {
        "scene": name,
        "contacts": problem.contacts,
        "iterations": solution.iterations,
        "checks of the problem [ms]": 1e3 * checks,
        "solve [ms]": 1e3 * whole,
        "method alone [ms]": 1e3 * method,
        "certificates alone [ms]": 1e3 * certificate,
        "reduction [ms]": 1e3 * reducing,
        "share of the interface solve [%]": 100 * extra / (checks + whole),
        "share of reduction and solve [%]": 100 * extra / (reducing + checks + whole),
    }


TEXT = """How much time do the certificate and the checks cost? The named scenes are solved at their own resolution. Times are processor seconds,
medians of {repeats} solves with one BLAS thread. "Checks of the problem" is the making of the
`InterfaceProblem` from its arrays. "Method alone" makes the same iterates without the driver and
the certificate.

Both shares count all that is not the method: checks, the dimensionless form, equilibrium of the
load, certificates, and history. The first share is that of the time that the interface problem
takes. The second is that of the solve of the scene, from the meshes to the contact forces.

{rows}
"""

if __name__ == "__main__":
    rows = [row(name) for name in SCENES]
    text = TEXT.replace("{repeats}", str(REPEATS))
    write("certificate_overhead", "Overhead of certificate and checks", text, {"rows": rows}, {})
