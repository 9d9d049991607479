"""What the processes do in which code of the user runs: build problems, run methods.

They may crash, hang or run out of memory at any moment: contactopt.benchmark.process watches them
from outside. Each keeps its plug-ins, its problem and what is imported from call to call. What runs
methods gets its problems from outside and judges nothing.
"""

from __future__ import annotations

import os
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from contactopt.benchmark.calls import call, measure
from contactopt.benchmark.measure import Task
from contactopt.benchmark.peers import Answer
from contactopt.benchmark.plugins import Registry
from contactopt.benchmark.problems import ProblemSpec
from contactopt.benchmark.process import one_line
from contactopt.errors import InputError
from contactopt.linear.convolution import Convolution
from contactopt.linear.operators import InterfaceOperator
from contactopt.methods.driver import solve
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.laws.coulomb import Coulomb

NEIGHBOUR = 0.9  # load and friction of the problem whose solution is the warm start
MOST_ROWS = 3000  # components up to which a Q of products is made a matrix
UNBUILT = (InputError, MemoryError, ArithmeticError, ValueError, np.linalg.LinAlgError)


@dataclass
class Kept:
    """What a process keeps: plug-ins, and the problem of that label with its warm start, or why it
    has none.
    """

    plugins: Registry = field(default_factory=Registry)
    label: str = ""
    problem: InterfaceProblem | None = None
    start: Solution | None = None
    missing: Exception | None = None


_kept = Kept()


def build(
    spec: ProblemSpec, paths: tuple[str, ...], diagnosed: bool, memory_limit: float
) -> tuple[InterfaceProblem, dict[str, Any]] | str:
    """A problem with the columns that it fills, or a sentence that says why there is none."""
    _limit_memory(memory_limit)
    try:
        _kept.plugins.load(paths)
        begin = time.perf_counter()
        problem = spec.build(_kept.plugins.problems)
        seconds = time.perf_counter() - begin
        if isinstance(problem.Q, InterfaceOperator) and problem.q.size <= MOST_ROWS:
            problem = problem.explicit()
        if isinstance(problem.Q, InterfaceOperator) and not isinstance(problem.Q, Convolution):
            raise InputError(
                f"problem '{spec.label}' must have Q as a matrix or as a convolution above"
                f" {MOST_ROWS} components; a benchmark hands it to other processes."
            )
        facts = {
            "fingerprint": problem.fingerprint,
            "contacts": problem.contacts,
            "dim": problem.dim,
            "plates": len(problem.s),
            "build_seconds": seconds,
        }
        return problem, facts | (_diagnosis(problem) if diagnosed else {})
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


def hold(label: str, problem: InterfaceProblem, paths: tuple[str, ...]) -> None:
    """Keep a problem and plug-ins for the runs that follow."""
    _kept.plugins.load(paths)
    _kept.label, _kept.problem, _kept.start, _kept.missing = label, problem, None, None


def warm_up(task: Task, dim: int) -> None:
    """Run the method untimed on a problem of two contacts, so that imports and compilation are not
    timed later.
    """
    Q = np.eye(2 * dim) + 0.1
    q = np.zeros((2, dim))
    q[:, 0], q[:, 1] = -1.0, 0.5
    own = os.getpid()
    with suppress(Exception, SystemExit, KeyboardInterrupt):  # the run itself will tell
        _limit_memory(task.memory_limit)
        call(task, InterfaceProblem(Q, q, Coulomb(np.full(2, 0.5))), None, _kept.plugins)
    _only(own)


def find_start(label: str) -> None:
    """Solve the problem kept at NEIGHBOUR times its load and friction, for warm starts."""
    problem = _kept.problem
    if problem is None or _kept.label != label or _kept.start is not None:
        return
    q, s = problem.q, NEIGHBOUR * problem.s
    if not len(s):
        q = NEIGHBOUR * q
    try:
        found = solve(replace(problem, law=problem.law.times(NEIGHBOUR), q=q, s=s))
        if not found.solved:
            raise InputError(f"no warm start: {found.message}")
        _kept.start = found
    except UNBUILT as error:
        _kept.missing = error


def execute(task: Task) -> Answer | None:
    """The answer to one task; None if its problem is not kept here."""
    problem, start, own = _kept.problem, None, os.getpid()
    if problem is None or _kept.label != task.run.problem.label:
        return None
    if task.run.start == "warm":
        start = _kept.start
        if start is None:
            return Answer("not_built", one_line(_kept.missing or "no warm start"))
    _limit_memory(task.memory_limit)
    answer = measure(task, problem, start, _kept.plugins)
    _only(own)
    return answer


def _only(own: int) -> None:
    """End this process if it is a copy of the true one, which a method forked and forgot."""
    if os.getpid() != own:
        os._exit(1)


def _limit_memory(gigabytes: float) -> None:
    """Bound the data of this process; beyond what it holds now also all that is mapped, as shared
    memory is.
    """
    import resource

    import psutil

    size = int(gigabytes * 1e9)
    limits = {resource.RLIMIT_DATA: size, resource.RLIMIT_CORE: 0}
    limits[resource.RLIMIT_AS] = psutil.Process().memory_info().vms + size
    for kind, limit in limits.items():
        with suppress(OSError, ValueError):
            resource.setrlimit(kind, (limit, resource.getrlimit(kind)[1]))
