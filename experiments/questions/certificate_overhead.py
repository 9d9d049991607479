"""What do the certificate and the checks of the input cost beside the solve? `python -m experiments.questions.certificate_overhead`."""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import time  # noqa: E402
from collections.abc import Callable  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402

from contactopt import InterfaceProblem, reduce, solve  # noqa: E402
from contactopt.scenes import make_scene  # noqa: E402
from experiments.report import write  # noqa: E402

SCENES = ("punch-2d", "sphere", "punch-3d")
REPEATS = 9


def clocked(act: Callable[[], Any]) -> tuple[Any, float]:
    """What it returns, and its seconds."""
    begin = time.perf_counter()
    return act(), time.perf_counter() - begin


def row(name: str) -> dict[str, object]:
    """Medians over REPEATS solves; every share is taken within one of them, so that another load of the machine cancels."""
    model = make_scene(name)
    (problem, reducing) = clocked(lambda: reduce(model).problem)
    runs = []
    for _ in range(REPEATS):
        made, checks = clocked(
            lambda: InterfaceProblem(problem.Q, problem.q, problem.law, problem.V, problem.s, problem.areas)
        )
        assert made.symmetric  # a check that is made when it is first asked for
        solution, whole = clocked(lambda: solve(problem))
        method, certificate = solution.seconds["solve"], solution.seconds["certificate"]
        rest = whole - method - certificate
        extra = checks + certificate + rest
        all_of_it = reducing + whole
        runs.append((method, certificate, rest, checks, extra / (checks + whole), extra / all_of_it))
    method, certificate, rest, checks, share, of_all = np.median(runs, axis=0)
    return {
        "scene": name,
        "contacts": problem.contacts,
        "iterations": solution.iterations,
        "method [ms]": 1e3 * method,
        "certificate [ms]": 1e3 * certificate,
        "rest of solve [ms]": 1e3 * rest,
        "checks of the problem [ms]": 1e3 * checks,
        "reduction [ms]": 1e3 * reducing,
        "share of the interface solve [%]": 100 * share,
        "share of reduction and solve [%]": 100 * of_all,
    }


TEXT = """The named scenes at their own resolution; medians of {repeats} solves, one BLAS thread. "Rest of solve" is what `solve` does
besides the method and the certificate of every iterate: dimensionless form, equilibrium of the load, history, stopping rule.
"Checks of the problem" is the making of the `InterfaceProblem` from its arrays. Both shares count certificate, rest and checks: of the
time of the interface problem alone, and of a run from the meshes to the reactions.

{rows}
"""

if __name__ == "__main__":
    rows = [row(name) for name in SCENES]
    text = TEXT.replace("{repeats}", str(REPEATS))
    write("certificate_overhead", "Overhead of certificate and checks", text, {"rows": rows}, {})
