"""One run judged: its row, the answer's certificate.

Runs in the campaign's process, where no plug-in is loaded.
"""

import json
import os
import platform
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np

from contactopt.benchmark.keys import COLUMNS
from contactopt.benchmark.peers import Answer
from contactopt.benchmark.process import one_line
from contactopt.benchmark.runs import Run
from contactopt.benchmark.sequences import Sequence, certificate
from contactopt.benchmark.store import ABSENT, SCHEMA, UNKNOWN, pack
from contactopt.cards import count
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem, Status


@dataclass(frozen=True)
class Task:
    """A run with the experiment's limits."""

    run: Run
    experiment: str
    plugins: tuple[str, ...]
    time_limit: float
    memory_limit: float
    max_iterations: int
    seed: int
    diagnose: bool = False


def blank(task: Task) -> dict[str, Any]:
    """A row with every column, of a run of which nothing is known yet but what it is."""
    run = task.run
    return _empty() | {
        "key": run.key,
        "experiment": task.experiment,
        "problem": run.problem.label,
        "family": run.problem.name,
        "parameters": json.dumps(run.problem.parameters),
        "method": run.method.label,
        "name": run.method.name,
        "settings": json.dumps(run.method.settings),
        "label": run.method.label,
        "backend": run.method.backends(2, 3),
        "setting": run.setting,
        "tolerance": run.tolerance,
        "time_limit": task.time_limit,
        "repeat": run.repeat,
        "status": "error",
        "residual": np.inf,
        "history": "[]",
    }


def absent_row(experiment: str, method: str, why: str) -> dict[str, Any]:
    """A row that says why a method is not there."""
    return _empty() | {
        "key": f"absent {method}",
        "experiment": experiment,
        "method": method,
        "name": method.partition("(")[0],
        "status": ABSENT,
        "message": one_line(why),
    }


def _empty() -> dict[str, Any]:
    """A row made here and now, with every column."""
    unknown = {name: UNKNOWN[kind] for name, (kind, _) in COLUMNS.items() if name != "error"}
    made = {"schema": SCHEMA, "versions": _versions(), "machine": _machine(), "time": _now()}
    return unknown | made | {"calibration": calibration()}


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


@cache
def _versions() -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in ("contactopt", "numpy", "scipy"))
    return f"Python {platform.python_version()}, {packages}"


@cache
def _machine() -> str:
    import psutil

    model = platform.processor() or platform.machine()
    if os.path.exists("/proc/cpuinfo"):
        with open("/proc/cpuinfo") as file:
            names = [line.split(":")[1].strip() for line in file if line.startswith("model name")]
        model = names[0] if names else model
    memory = psutil.virtual_memory().total / 1e9
    return f"{model}, {count(os.cpu_count() or 1, 'core')}, {memory:.0f} GB, {platform.system()}"


@cache
def calibration() -> float:
    """CPU time [s], the least of five, of a fixed mix of linear algebra and steps of Python."""
    A = np.random.default_rng(0).random((100, 100)) + 100 * np.eye(100)
    seconds = []
    for _ in range(5):
        begin = time.process_time()
        for _ in range(20):
            np.linalg.solve(A, A @ A)
        sum(n * n for n in range(100_000))
        seconds.append(time.process_time() - begin)
    return min(seconds)


def judge(task: Task, problem: InterfaceProblem | Sequence, answer: Answer) -> dict[str, Any]:
    """The columns that follow from an answer. What a method says of itself counts only if it
    reports a failure.
    """
    out: dict[str, Any] = {"message": answer.message, "time": _now(), **answer.measured}
    if answer.reactions is None:
        seconds = answer.measured.get("call_seconds", np.nan)
        return out | {"status": answer.status, "solve_seconds": seconds}
    r, lam = answer.reactions, answer.multipliers
    claimed = answer.status == Status.SOLVED.label
    out |= {
        "claimed": claimed,
        "iterations": answer.iterations,
        "solve_seconds": answer.seconds,
        "label": answer.label,
        "history": json.dumps(answer.history or []),
    }
    try:
        residual = certificate(problem, r, lam)
    except InputError as error:
        return out | {"status": "error", "message": one_line(error)}
    out["residual"] = residual
    if not np.all(np.isfinite(r)) or (lam is not None and not np.all(np.isfinite(lam))):
        return out | {"status": "not_finite"}
    out["answer"] = pack(r, lam)
    if residual > task.run.tolerance:
        return out | {"status": "false_claim" if claimed else answer.status}
    if answer.seconds > task.time_limit:
        return out | {"status": "time_limit", "message": "certified, but after the time limit"}
    return out | {"status": "solved", "success": True}
