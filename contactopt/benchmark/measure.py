"""One run measured: the method called, its answer certified, the row written."""

from __future__ import annotations

import inspect
import json
import os
import platform
import random
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np

from contactopt.benchmark.runs import PASSED, Run
from contactopt.benchmark.store import SCHEMA, pack
from contactopt.errors import BackendError, InputError
from contactopt.problem import (
    InterfaceProblem,
    Solution,
    Status,
    balance_residual,
    fit_multipliers,
    natural_map_residual,
)
from contactopt.problem.certificate import yardsticks
from contactopt.problem.cones import coulomb_cone
from contactopt.solving.driver import solve
from contactopt.solving.methods import find_method

POINTS = 100  # of a history
MB = 1e6


@dataclass(frozen=True)
class Task:
    """A run with the experiment's limits. warm_up: run the method on a tiny problem first, once per process."""

    run: Run
    experiment: str
    plugins: tuple[str, ...]
    time_limit: float
    memory_limit: float
    max_iterations: int
    seed: int
    diagnose: bool = False
    warm_up: bool = True


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a method returned, in one form for all; `status` is its own word."""

    reactions: np.ndarray
    multipliers: np.ndarray | None
    status: str
    message: str = ""
    label: str = ""
    iterations: float = np.nan
    seconds: float = np.nan
    history: tuple[dict[str, float], ...] = ()


def blank(task: Task) -> dict[str, Any]:
    """The row of a run of which nothing is known yet but what it is."""
    run = task.run
    return {
        "schema": SCHEMA,
        "key": run.key,
        "experiment": task.experiment,
        "problem": run.problem.label,
        "family": run.problem.name,
        "parameters": json.dumps(run.problem.parameters),
        "fingerprint": "",
        "contacts": 0,
        "dim": 0,
        "plates": 0,
        **dict.fromkeys(("rank", "condition", "guaranteed_mu", "alternating_mu", "tresca_mu"), np.nan),
        "method": run.method.label,
        "name": run.method.name,
        "settings": json.dumps(run.method.settings),
        "label": run.method.label,
        "backend": run.method.backends(2, 3),
        "law": run.method.law,
        "setting": run.setting,
        "tolerance": run.tolerance,
        "time_limit": task.time_limit,
        "start": run.start,
        "repeat": run.repeat,
        "status": "error",
        "message": "",
        "claimed": False,
        "success": False,
        "iterations": np.nan,
        "residual": np.inf,
        "law_residual": np.inf,
        "build_seconds": np.nan,
        "solve_seconds": np.nan,
        "call_seconds": np.nan,
        "cpu_seconds": np.nan,
        "peak_mb": np.nan,
        "base_mb": np.nan,
        "history": "[]",
        "versions": versions(),
        "machine": machine(),
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
    }


@cache
def versions() -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in ("contactopt", "numpy", "scipy"))
    return f"Python {platform.python_version()}, {packages}"


@cache
def machine() -> str:
    model = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo") as file:
            model = next((line.split(":")[1].strip() for line in file if line.startswith("model name")), model)
    except OSError:
        pass
    return f"{model}, {os.cpu_count()} cores, {platform.system()}"


def measure(task: Task, problem: InterfaceProblem, start: Solution | None) -> dict[str, Any]:
    """The part of the row that comes from running the method and certifying its answer."""
    random.seed(task.seed)
    np.random.seed(task.seed)  # noqa: NPY002 (a plug-in may use the global generator)
    out: dict[str, Any] = {"base_mb": reset_peak()}
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        outcome: Outcome | Exception = call(task, problem, start)
    except (Exception, SystemExit) as error:
        outcome = error if isinstance(error, Exception) else RuntimeError(f"it called exit({error})")
    out["call_seconds"], out["cpu_seconds"] = time.perf_counter() - wall, time.process_time() - cpu
    out["solve_seconds"], out["peak_mb"] = out["call_seconds"], peak()
    out["time"] = datetime.now(UTC).isoformat(timespec="seconds")
    if isinstance(outcome, Outcome):
        return out | judge(task, problem, outcome, out["call_seconds"])
    kinds = {MemoryError: "out_of_memory", InputError: "refused", BackendError: "backend_failed"}
    status = next((word for kind, word in kinds.items() if isinstance(outcome, kind)), "error")
    return out | {"status": status, "message": short(outcome)}


def call(task: Task, problem: InterfaceProblem, start: Solution | None) -> Outcome:
    """Run the method; its own errors pass through."""
    spec, tol = task.run.method, None if task.run.setting == "default" else task.run.tolerance
    plugin = spec.plugin
    if plugin is None or plugin.iterates:
        method = find_method(spec.name, **spec.settings) if plugin is None else plugin.make(**spec.settings)
        settings: dict[str, Any] = {} if tol is None else {"tol": tol}
        settings |= {"max_iterations": task.max_iterations, "time_limit": task.time_limit, "start": start}
        s = solve(problem, method, **settings)
        return Outcome(
            s.reactions, s.multipliers, s.status.label, s.message, s.method, s.iterations, s.seconds["solve"], s.history
        )
    given = {
        "tol": task.run.tolerance,
        "time_limit": task.time_limit,
        "max_iterations": task.max_iterations,
        "start": start,
    }
    wanted = inspect.signature(plugin.make).parameters
    passed = {name: given[name] for name in PASSED if name in wanted and name not in spec.settings}
    if tol is None and "tol" in passed and wanted["tol"].default is not inspect.Parameter.empty:
        del passed["tol"]
    answer = plugin.make(problem, **passed, **spec.settings)
    if isinstance(answer, Solution):
        return Outcome(
            answer.reactions, answer.multipliers, answer.status.label, answer.message, spec.label, answer.iterations,
            history=answer.history,
        )  # fmt: skip
    reactions, multipliers = answer if isinstance(answer, tuple) else (answer, None)
    return Outcome(np.asarray(reactions, dtype=float), multipliers, Status.SOLVED.label, label=spec.label)


def judge(task: Task, problem: InterfaceProblem, outcome: Outcome, seconds: float) -> dict[str, Any]:
    """Certificate and status; the method's own word counts only where it admits failure."""
    r, lam = np.asarray(outcome.reactions, dtype=float), outcome.multipliers
    if r.shape != problem.q.shape and r.size == problem.q.size:
        r = r.reshape(problem.q.shape)
    seconds = seconds if np.isnan(outcome.seconds) else outcome.seconds
    claimed = outcome.status == Status.SOLVED.label
    out: dict[str, Any] = {"claimed": claimed, "iterations": outcome.iterations, "solve_seconds": seconds}
    out |= {"label": outcome.label, "history": thinned(outcome.history), "message": short(outcome.message)}
    try:
        residual = natural_map_residual(problem, r, lam)
    except InputError as error:
        return out | {"status": "error", "message": short(error)}
    own = residual if task.run.method.law == "coulomb" else associated_residual(problem, r, lam)
    out |= {"residual": residual, "law_residual": own}
    if not np.all(np.isfinite(r)) or (lam is not None and not np.all(np.isfinite(lam))):
        return out | {"status": "not_finite"}
    out["answer"] = pack(r)
    if own <= task.run.tolerance:
        if seconds <= task.time_limit:
            return out | {"status": "solved", "success": True}
        return out | {"status": "time_limit", "message": "certified, but after the time limit"}
    return out | {"status": "false_claim" if claimed else outcome.status}


def associated_residual(problem: InterfaceProblem, r: np.ndarray, lam: np.ndarray | None) -> float:
    """As natural_map_residual for the associated law: the largest |r_i - proj_K(r_i - rho_i u_i)| / F, and the balance."""
    if not np.all(np.isfinite(r)):
        return np.inf
    lam = fit_multipliers(problem, r) if lam is None else lam
    w = problem.q + (problem.V @ lam).reshape(r.shape)
    moved = (problem.Q @ r.ravel()).reshape(r.shape)
    measure = yardsticks(problem, r, moved, w)
    errors = np.linalg.norm(r - coulomb_cone(r - measure.rho[:, None] * (moved + w), problem.mu), axis=1)
    gap = float(errors.max(initial=0.0)) / measure.force if measure.force > 0 else 0.0
    return max(gap, balance_residual(problem, r, measure.force))


def thinned(history: tuple[dict[str, float], ...]) -> str:
    """JSON [[residuals], [seconds]] with at most POINTS entries, the last included; [iterations] third."""
    if not history:
        return "[]"
    index = np.unique(np.geomspace(1, len(history), POINTS).astype(int)) - 1
    columns = [[float(f"{history[i].get(key, np.nan):.3g}") for i in index] for key in ("residual", "seconds")]
    return json.dumps([*columns, [int(i) + 1 for i in index]])


def short(error: object) -> str:
    text = str(error) if isinstance(error, str | InputError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())[:200]


def reset_peak() -> float:
    """Forget the largest resident memory so far; the present one [MB], nan where the system does not tell."""
    try:
        with open("/proc/self/clear_refs", "w") as file:
            file.write("5")
        return _status("VmRSS")
    except OSError:
        return np.nan


def peak() -> float:
    try:
        return _status("VmHWM")
    except OSError:
        return np.nan


def _status(field: str) -> float:
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) * 1024 / MB for line in file if line.startswith(field))
