"""One run made: the method called, its answer in one form for all, its time and memory.

Runs in a worker process.
"""

from __future__ import annotations

import errno
import inspect
import random
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt.benchmark.measure import Answer, Task
from contactopt.benchmark.plugins import Registry
from contactopt.benchmark.process import one_line
from contactopt.benchmark.runs import PASSED
from contactopt.benchmark.store import STATUSES
from contactopt.errors import BackendError, InputError
from contactopt.methods import METHODS, find_method
from contactopt.methods.driver import solve
from contactopt.problem import InterfaceProblem, Solution, Status

POINTS = 100  # of a history
MB = 1e6


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


def no_answer(status: str, error: object, measured: dict[str, float] | None = None) -> Answer:
    """What is said of a run that ended without an answer: a word of the column `status`, and a text
    or an exception.
    """
    return Answer(status, one_line(error), measured or {})


def measure(
    task: Task, problem: InterfaceProblem, start: Solution | None, plugins: Registry
) -> Answer:
    """Run a method on a problem, and measure time and memory.

    Parameters
    ----------
    task : The run and its limits.
    problem : The interface problem.
    start : The solution to start from, if there is one.
    plugins : The methods of the user.

    Returns
    -------
    Its answer, or how it failed.
    """
    random.seed(task.seed)
    np.random.seed(task.seed)  # noqa: NPY002 (a plug-in may use the global generator)
    measured = {"base_mb": _reset_peak()}
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        outcome: Outcome | Exception = call(task, problem, start, plugins)
    except (Exception, SystemExit, KeyboardInterrupt) as error:
        outcome = (
            error
            if isinstance(error, Exception)
            else RuntimeError(f"it raised {type(error).__name__}({error})")
        )
    measured |= {
        "call_seconds": time.perf_counter() - wall,
        "cpu_seconds": time.process_time() - cpu,
    }
    measured["peak_mb"] = _peak()
    if not isinstance(outcome, Outcome):
        kinds = {
            MemoryError: "out_of_memory",
            InputError: "refused",
            BackendError: "backend_failed",
        }
        word = next((word for kind, word in kinds.items() if isinstance(outcome, kind)), "error")
        full = isinstance(outcome, OSError) and outcome.errno == errno.ENOMEM
        return no_answer("out_of_memory" if full else word, outcome, measured)
    try:
        return _read_outcome(outcome, problem, measured)
    except (TypeError, ValueError, AttributeError, OverflowError) as error:
        return no_answer("error", f"its answer has the wrong form: {error}", measured)


def _read_outcome(
    outcome: Outcome, problem: InterfaceProblem, measured: dict[str, float]
) -> Answer:
    """The answer in its one form; TypeError or ValueError if it has another."""
    r, lam = (
        _real(outcome.reactions),
        None if outcome.multipliers is None else _real(outcome.multipliers),
    )
    if r.size != problem.q.size:
        raise ValueError(
            f"reactions must have shape {problem.q.shape}, normal first; got {r.shape}"
        )
    if lam is not None and lam.shape != problem.s.shape:
        raise ValueError(f"multipliers must have shape {problem.s.shape}; got {lam.shape}")
    if outcome.status not in STATUSES:
        raise ValueError(f"{outcome.status!r} is no status")
    seconds = measured["call_seconds"] if np.isnan(outcome.seconds) else float(outcome.seconds)
    return Answer(
        outcome.status,
        one_line(outcome.message),
        measured,
        r.reshape(problem.q.shape),
        lam,
        str(outcome.label),
        float(outcome.iterations),
        seconds,
        _thinned(outcome.history),
    )


def _real(values: Any) -> np.ndarray:
    """The values as an array of floats of its own; TypeError or ValueError if they are not real
    numbers.
    """
    array = np.asarray(values)
    if np.iscomplexobj(array):
        raise TypeError("complex numbers")
    return np.array(array, dtype=float, order="C", subok=False)


def call(
    task: Task, problem: InterfaceProblem, start: Solution | None, plugins: Registry
) -> Outcome:
    """Run a method on a problem. Its own errors pass through.

    Parameters
    ----------
    task, problem, start, plugins : As for `measure`.

    Returns
    -------
    The answer of the method, with what it says of itself.
    """
    spec, tol = task.run.method, None if task.run.setting == "default" else task.run.tolerance
    plugin = None if spec.name in METHODS else plugins.find(spec.name)
    if plugin is None or plugin.iterates:
        method = (
            find_method(spec.name, **spec.settings)
            if plugin is None
            else plugin.make(**spec.settings)
        )
        settings: dict[str, Any] = {} if tol is None else {"tol": tol}
        settings |= {
            "max_iterations": task.max_iterations,
            "time_limit": task.time_limit,
            "start": start,
        }
        s = solve(problem, method, **settings)
        return Outcome(
            s.reactions,
            s.multipliers,
            s.status.label,
            s.message,
            s.method,
            s.iterations,
            s.seconds["solve"],
            s.history,
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
    return Outcome(reactions, multipliers, Status.SOLVED.label, label=spec.label)


def _thinned(
    history: tuple[dict[str, float], ...],
) -> tuple[list[float], list[float], list[int]] | None:
    """Residuals, seconds and iterations, at most POINTS of them, the last included; None without a
    history.
    """
    if not len(history):
        return None
    index = np.unique(np.geomspace(1, len(history), POINTS).astype(int)) - 1
    residuals, seconds = (
        [float(f"{history[i].get(key, np.nan):.3g}") for i in index]
        for key in ("residual", "seconds")
    )
    return residuals, seconds, [int(i) + 1 for i in index]


def _reset_peak() -> float:
    """Forget the largest resident memory so far; the present one [MB], nan where the system does
    not tell.
    """
    try:
        with open("/proc/self/clear_refs", "w") as file:
            file.write("5")
        return _status("VmRSS")
    except OSError:
        return np.nan


def _peak() -> float:
    try:
        return _status("VmHWM")
    except OSError:
        return np.nan


def _status(field: str) -> float:
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) * 1024 / MB for line in file if line.startswith(field))
