"""One run made in a worker: the method called, its answer, its time and memory."""

from __future__ import annotations

import errno
import inspect
import random
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.benchmark.measure import Task
from contactopt.benchmark.peers import Answer
from contactopt.benchmark.plugins import PASSED, Registry
from contactopt.benchmark.process import one_line
from contactopt.benchmark.store import STATUSES
from contactopt.errors import BackendError, InputError
from contactopt.methods import find_method
from contactopt.methods.driver import solve
from contactopt.problem import InterfaceProblem, Solution, Status

POINTS = 100  # of a history
MB = 1e6
FAILURES = {MemoryError: "out_of_memory", InputError: "refused", BackendError: "backend_failed"}


def measure(
    task: Task, problem: InterfaceProblem, start: Solution | None, plugins: Registry
) -> Answer:
    """Run a method, from `start` if there is one: its answer, or how it failed."""
    random.seed(task.seed)
    np.random.seed(task.seed)  # noqa: NPY002 (a plug-in may use the global generator)
    measured = {"base_mb": _reset_peak()}
    wall, cpu = time.perf_counter(), time.process_time()
    error: BaseException | None = None
    try:
        answer = call(task, problem, start, plugins)
    except (Exception, SystemExit, KeyboardInterrupt) as raised:
        error = raised
    measured["call_seconds"] = time.perf_counter() - wall
    measured["cpu_seconds"] = time.process_time() - cpu
    measured["peak_mb"] = _memory("VmHWM")
    if error is not None:
        word = next((word for kind, word in FAILURES.items() if isinstance(error, kind)), "error")
        if isinstance(error, OSError) and error.errno == errno.ENOMEM:
            word = "out_of_memory"
        return Answer(word, one_line(error), measured=measured)
    try:
        # a peer measures itself, in its own process
        measured |= answer.measured
        if answer.reactions is None:
            return replace(answer, message=one_line(answer.message), measured=measured)
        return replace(_in_form(answer, problem, measured["call_seconds"]), measured=measured)
    except (TypeError, ValueError, AttributeError, OverflowError) as wrong:
        message = one_line(f"its answer has the wrong form: {wrong}")
        return Answer("error", message, measured=measured)


def _in_form(answer: Answer, problem: InterfaceProblem, seconds: float) -> Answer:
    """The answer in its one form; TypeError or ValueError if it has another."""
    r = _real(answer.reactions)
    lam = None if answer.multipliers is None else _real(answer.multipliers)
    if r.size != problem.q.size:
        raise ValueError(
            f"reactions must have shape {problem.q.shape}, normal first; got {r.shape}"
        )
    if lam is not None and lam.shape != problem.s.shape:
        raise ValueError(f"multipliers must have shape {problem.s.shape}; got {lam.shape}")
    if answer.status not in STATUSES:
        raise ValueError(f"{answer.status!r} is no status")
    return Answer(
        answer.status,
        one_line(answer.message),
        r.reshape(problem.q.shape),
        lam,
        str(answer.label),
        float(answer.iterations),
        seconds if np.isnan(answer.seconds) else float(answer.seconds),
        _thinned(answer.history),
    )


def _real(values: Any) -> np.ndarray:
    """An array of floats of its own; TypeError or ValueError if the values are not real numbers."""
    array = np.asarray(values)
    if np.iscomplexobj(array):
        raise TypeError("complex numbers")
    return np.array(array, dtype=float, order="C", subok=False)


def call(
    task: Task, problem: InterfaceProblem, start: Solution | None, plugins: Registry
) -> Answer:
    """The answer of a method, in whatever form it gave it. Its own errors pass through."""
    spec, usual = task.run.method, task.run.setting == "default"
    plugin = plugins.find(spec.name) if spec.foreign else None
    given: dict[str, Any] = {
        "tol": task.run.tolerance,
        "time_limit": task.time_limit,
        "max_iterations": task.max_iterations,
        "start": start,
    }
    if plugin is None or plugin.iterates:
        if plugin is None:
            method = find_method(spec.name, **spec.settings)
        else:
            method = plugin.make(**spec.settings)
        if usual:
            del given["tol"]
        s = solve(problem, method, **given)
        return _of_solution(s, s.method, s.seconds["solve"])
    wanted = inspect.signature(plugin.make).parameters
    passed = {name: given[name] for name in PASSED if name in wanted and name not in spec.settings}
    if usual and "tol" in passed and wanted["tol"].default is not inspect.Parameter.empty:
        del passed["tol"]
    answer = plugin.make(problem, **passed, **spec.settings)
    if isinstance(answer, Answer):
        return replace(answer, label=spec.label)
    if isinstance(answer, Solution):
        return _of_solution(answer, spec.label)
    reactions, multipliers = answer if isinstance(answer, tuple) else (answer, None)
    return Answer(Status.SOLVED.label, "", reactions, multipliers, spec.label)


def _of_solution(s: Solution, label: str, seconds: float = np.nan) -> Answer:
    forces = (s.reactions, s.multipliers)
    return Answer(s.status.label, s.message, *forces, label, s.iterations, seconds, s.history)


def _thinned(history: Sequence[Mapping[str, float]] | None) -> Any:
    """Residuals, seconds, iterations, at most POINTS with the last; None without any."""
    if not history:
        return None
    index = np.unique(np.geomspace(1, len(history), POINTS).astype(int)) - 1
    residuals, seconds = (
        [float(f"{history[i].get(key, np.nan):.3g}") for i in index]
        for key in ("residual", "seconds")
    )
    return residuals, seconds, [int(i) + 1 for i in index]


def _reset_peak() -> float:
    """Forget the largest resident memory so far; the present one [MB]."""
    with suppress(OSError), open("/proc/self/clear_refs", "w") as file:
        file.write("5")
    return _memory("VmRSS")


def _memory(field: str) -> float:
    """What the system tells of this process [MB]; nan where it tells nothing."""
    with suppress(OSError), open("/proc/self/status") as file:
        return next(int(line.split()[1]) * 1024 / MB for line in file if line.startswith(field))
    return np.nan
