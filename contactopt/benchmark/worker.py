"""What the processes do in which code of the user runs: build problems, run methods. They may end
at any moment (contactopt.benchmark.process), keep what was loaded, and judge nothing.
"""

import errno
import inspect
import os
import pickle
import random
import resource
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from contactopt.benchmark.measure import Task
from contactopt.benchmark.peers import Answer, PeerAnswer
from contactopt.benchmark.plugins import PASSED, Registry
from contactopt.benchmark.problems import ProblemSpec
from contactopt.benchmark.process import one_line
from contactopt.benchmark.runs import MethodSpec
from contactopt.benchmark.sequences import Sequence as States
from contactopt.benchmark.sequences import states_of
from contactopt.cards import count
from contactopt.errors import BackendError, InputError
from contactopt.linear.operators import form, has_entries
from contactopt.methods import find_method
from contactopt.methods.driver import solve
from contactopt.problem import InterfaceProblem, Solution, Status
from contactopt.problem.laws.coulomb import Coulomb

MOST_ROWS = 3000  # components up to which a Q of products is made a matrix
POINTS = 100  # of a history
MB = 1e6
Call = Callable[[InterfaceProblem, bool, float], Answer]
# how what was measured of the states of a sequence is joined
JOIN: dict[str, Callable[..., float]] = {
    "call_seconds": sum, "cpu_seconds": sum, "peak_mb": max, "base_mb": max,
}  # fmt: skip
# what a method may say of itself
SAID = {word: word for word in (*(s.label for s in Status), "refused", "error", "out_of_memory")}
FAILURES = {MemoryError: "out_of_memory", InputError: "refused", BackendError: "backend_failed"}


def _ended_cpu() -> float:
    """CPU time of the children that ended [s], with that of theirs."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


# wall time, CPU time here, and that of ended children; as they were before any plug-in ran
CLOCKS = time.perf_counter, time.process_time, _ended_cpu


@dataclass
class Kept:
    """Plug-ins, and the problem of a label, pickled: each run gets an object of its own."""

    plugins: Registry = field(default_factory=Registry)
    label: str = ""
    problem: bytes = b""


_kept = Kept()


def build(
    spec: ProblemSpec, paths: tuple[str, ...], diagnosed: bool, memory_limit: float
) -> tuple[InterfaceProblem | States, dict[str, Any]] | str:
    """A problem with the columns that it fills, or a sentence that says why there is none."""
    _limit_memory(memory_limit)
    try:
        _kept.plugins.load(paths)
        begin = time.perf_counter()
        problem = spec.build(_kept.plugins.problems)
        seconds = time.perf_counter() - begin
        if isinstance(problem, InterfaceProblem):
            if not has_entries(problem.Q) and problem.q.size <= MOST_ROWS:
                problem = problem.explicit()
            if form(problem.Q) in ("products", "bodies"):
                raise InputError(
                    f"problem '{spec.label}' must have Q as a matrix or as a convolution above"
                    f" {MOST_ROWS} components; a benchmark hands it to other processes."
                )
        states = states_of(problem)
        facts = {
            "fingerprint": problem.fingerprint,
            "contacts": problem.contacts,
            "dim": problem.dim,
            "plates": len(states[0].s),
            "states": len(states),
            "build_seconds": seconds,
        }
        return problem, facts | (_diagnosis(states[0]) if diagnosed else {})
    except (Exception, SystemExit) as error:
        return one_line(error)


def _diagnosis(problem: InterfaceProblem) -> dict[str, float]:
    from contactopt.methods.diagnosis import diagnose

    found = diagnose(problem)
    return {
        "rank": found.rank,
        "condition": found.condition,
        "guaranteed_mu": found.guaranteed.alternating,
        "alternating_mu": found.uniform_slip.alternating,
        "tresca_mu": found.uniform_slip.tresca,
    }


def load(paths: tuple[str, ...]) -> None:
    """Load the files of plug-ins."""
    _kept.plugins.load(paths)


def hold(label: str, problem: InterfaceProblem | States) -> None:
    """Keep a problem for the runs that follow."""
    parts = [part for state in states_of(problem) for part in (state, state.law, state.Q)]
    for part in parts:  # no run profits of what another one computed
        known = getattr(part, "__dict__", {})
        for name in [n for n in known if isinstance(getattr(type(part), n, 0), cached_property)]:
            del known[name]
    _kept.label, _kept.problem = label, pickle.dumps(problem)


def warm_up(task: Task, dim: int) -> None:
    """Run the method untimed on two contacts, so that imports and compilation are not timed."""
    q = np.zeros((2, dim))
    q[:, 0], q[:, 1] = -1.0, 0.5
    _measured(task, InterfaceProblem(np.eye(2 * dim) + 0.1, q, Coulomb(np.full(2, 0.5))))


def execute(task: Task) -> Answer | None:
    """The answer to one task; None if its problem is not kept here."""
    if not _kept.problem or _kept.label != task.run.problem.label:
        return None
    return _measured(task, pickle.loads(_kept.problem))


def _measured(task: Task, problem: InterfaceProblem | States) -> Answer:
    """Run a method: its answer, or how it failed, with what was measured."""
    _limit_memory(task.memory_limit)
    random.seed(task.seed)
    np.random.seed(task.seed)  # noqa: NPY002 (a plug-in may use the global generator)
    own, measured = os.getpid(), {"base_mb": _reset_peak()}
    others, begin = _running_cpu(), [clock() for clock in CLOCKS]
    try:
        call = _call(task)
        begin = [clock() for clock in CLOCKS]
        answer = _along(call, problem, task.time_limit)
    except BaseException as error:
        answer = Answer(_word(error), _said(error))
    wall, cpu, ended = (clock() - start for clock, start in zip(CLOCKS, begin))
    measured["call_seconds"] = wall
    measured["cpu_seconds"] = cpu + max(0.0, ended + _running_cpu() - others)
    measured["peak_mb"] = _memory("VmHWM")
    if os.getpid() != own:  # a copy of the true process, which a method forked and forgot
        os._exit(1)
    try:
        if answer.measured:  # a peer measures itself, in its own process
            own_part = {key: float(answer.measured[key]) for key in JOIN}
            bridge = measured["call_seconds"] - own_part["call_seconds"]
            measured |= own_part | {"bridge_seconds": bridge}
        return _in_form(answer, problem, measured)
    except Exception as wrong:  # whatever its parts do when they are read
        words = one_line(f"its answer has the wrong form: {_said(wrong)}")
        return Answer("error", words, measured=measured)


def _said(error: BaseException) -> str:
    """One line about an error, also about one that cannot be printed."""
    try:
        return one_line(error)
    except Exception:
        return type(error).__name__


def _word(error: BaseException) -> str:
    """The status of a run that ended with an error."""
    if isinstance(error, OSError) and error.errno == errno.ENOMEM:
        return "out_of_memory"
    return next((word for kind, word in FAILURES.items() if isinstance(error, kind)), "error")


def _along(call: Call, problem: InterfaceProblem | States, limit: float) -> Answer:
    """The answer to a problem or to all states of a sequence, or the first state without one."""
    if isinstance(problem, InterfaceProblem):
        return call(problem, False, limit)
    answers: list[Answer] = []
    left = limit
    for number, state in enumerate(problem.states, 1):
        if left <= 0:
            return Answer(
                "time_limit", f"{number - 1} of {count(len(problem.states), 'state')} in time"
            )
        begin = CLOCKS[0]()
        answer = call(state, problem.warm and number > 1, left)
        # the bridge to an external solver is not counted
        left -= answer.measured.get("call_seconds", CLOCKS[0]() - begin)
        answers.append(answer)
        if answer.reactions is None:
            return replace(answer, message=f"state {number}: {answer.message}", measured={})
    worst = next((a for a in answers if a.status != Status.SOLVED.label), answers[-1])
    parts = [(_real(a.reactions).ravel(), a.multipliers) for a in answers]
    lam = [part for _, part in parts if part is not None]
    return replace(
        worst,
        reactions=np.concatenate([r for r, _ in parts]),
        multipliers=np.concatenate(lam) if len(lam) == len(parts) else None,
        iterations=sum(a.iterations for a in answers),
        seconds=sum(a.seconds for a in answers),
        history=None,
        measured={key: JOIN[key](a.measured[key] for a in answers) for key in worst.measured},
    )


def _call(task: Task) -> Call:
    """A method to be called, whether it starts from its last answer, and a limit of time."""
    spec, usual = task.run.method, task.run.setting == "default"
    plugin = _kept.plugins.find(spec.name) if spec.foreign else None
    given: dict[str, Any] = {
        "tol": task.run.tolerance,
        "time_limit": task.time_limit,
        "max_iterations": task.max_iterations,
    }
    if plugin is None or plugin.iterates:
        if plugin is None:
            method = find_method(spec.name, **spec.settings)
        else:
            method = plugin.make(**spec.settings)
        if usual:
            del given["tol"]

        last: list[Solution] = []

        def solved(problem: InterfaceProblem, warm: bool, limit: float) -> Answer:
            start = last.pop() if warm else None
            s = solve(problem, method, start=start, **given | {"time_limit": limit})
            last[:] = [s]
            return _of_solution(s, s.method, s.seconds["solve"])

        return solved
    make, wanted = plugin.make, inspect.signature(plugin.make).parameters
    passed = {name: given[name] for name in PASSED if name in wanted and name not in spec.settings}
    if usual and "tol" in passed and wanted["tol"].default is not inspect.Parameter.empty:
        del passed["tol"]
    before: list[Any] = []

    def read(problem: InterfaceProblem, warm: bool, limit: float) -> Answer:
        if warm and "start" not in wanted:
            raise InputError(f"method '{spec.name}' takes no 'start', the forces to begin with.")
        more = {"start": before.pop()} if warm else {}
        more |= {"time_limit": limit} if "time_limit" in passed else {}
        answer = _read(make(problem, **{**passed, **spec.settings, **more}), spec)
        before[:] = [answer.reactions]
        return answer

    return read


def _read(answer: object, spec: MethodSpec) -> Answer:
    """What a plug-in's function returned, in whatever form."""
    label = spec.label
    if isinstance(answer, Answer):
        own = isinstance(answer, PeerAnswer) and spec.peer  # a peer that it declared
        return replace(answer, label=label, measured=answer.measured if own else {})
    if isinstance(answer, Solution):
        return _of_solution(answer, label)
    reactions, multipliers = answer if isinstance(answer, tuple) else (answer, None)
    return Answer(Status.SOLVED.label, "", reactions, multipliers, label)


def _of_solution(s: Solution, label: str, seconds: float = np.nan) -> Answer:
    forces = (s.reactions, s.multipliers)
    return Answer(s.status.label, s.message, *forces, label, s.iterations, seconds, s.history)


def _in_form(
    answer: Answer, problem: InterfaceProblem | States, measured: dict[str, float]
) -> Answer:
    """The answer in its one form, of plain numbers and words; an error if it has another."""
    r, lam = (None if x is None else _real(x) for x in (answer.reactions, answer.multipliers))
    if r is not None and r.size != problem.q.size:
        raise ValueError(
            f"reactions must have shape {problem.q.shape}, normal first; got {r.shape}"
        )
    if lam is not None and lam.shape != problem.s.shape:
        raise ValueError(f"multipliers must have shape {problem.s.shape}; got {lam.shape}")
    status = SAID.get(answer.status)
    if status is None or (r is None and status == Status.SOLVED.label):
        raise ValueError(f"{answer.status!r} is no status that a method may give here")
    return Answer(
        status,
        one_line(answer.message),
        None if r is None else r.reshape(problem.q.shape),
        lam,
        str(answer.label),
        float(answer.iterations),
        measured["call_seconds"] if np.isnan(answer.seconds) else float(answer.seconds),
        _thinned(answer.history),
        measured,
    )


def _real(values: object) -> np.ndarray:
    """An array of floats of its own; TypeError or ValueError if the values are not real numbers."""
    array = np.asarray(values)
    if np.iscomplexobj(array):
        raise TypeError("complex numbers")
    return np.array(array, dtype=float, order="C", subok=False)


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


def _running_cpu() -> float:
    """CPU time of the processes that were started here and run [s], or ended without notice."""
    import psutil

    seconds = 0.0
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            used = child.cpu_times()
            seconds += used.user + used.system
    return seconds


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


def _limit_memory(gigabytes: float) -> None:
    """Bound the data of this process, all that is mapped beyond what it holds now, and each file
    that it writes.
    """
    import psutil

    size = int(gigabytes * 1e9)
    limits = dict.fromkeys((resource.RLIMIT_DATA, resource.RLIMIT_FSIZE), size)
    limits[resource.RLIMIT_CORE] = 0
    limits[resource.RLIMIT_AS] = psutil.Process().memory_info().vms + size
    for kind, limit in limits.items():
        with suppress(OSError, ValueError):
            resource.setrlimit(kind, (limit, resource.getrlimit(kind)[1]))
