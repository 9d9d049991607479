"""The process in which runs happen: receives tasks over a pipe, sends rows back.

It may crash, hang or run out of memory at any moment: contactopt.benchmark.pool watches it from outside. Between tasks it
keeps the last problems it built and the modules its methods imported; a method's first run in a process is preceded by
an untimed one on a problem of two contacts, so that imports and compilation are not timed.
"""

from __future__ import annotations

import os
import sys
import time
from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from contactopt.benchmark.measure import Task, blank, call, measure, short
from contactopt.benchmark.plugins import load_plugins
from contactopt.benchmark.problems import ProblemSpec
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.solving.driver import solve

KEPT = 3  # problems in memory
NEIGHBOUR = 0.9  # load and friction of the problem whose solution is the warm start


@dataclass(frozen=True, eq=False)
class Built:
    problem: InterfaceProblem
    facts: dict[str, Any]  # the columns that it fills


class Runner:
    """Executes tasks one after another; `note` is told what takes time, "build", "warm up", "solve", and a problem's facts."""

    def __init__(self, note: Callable[[Any], None]):
        self.note = note
        self.built: OrderedDict[str, Built | InputError] = OrderedDict()
        self.starts: dict[str, Solution] = {}
        self.warm: set[tuple[str, int]] = set()

    def execute(self, task: Task) -> dict[str, Any]:
        self.note("solve")
        load_plugins(task.plugins)
        row = blank(task)
        try:
            built = self.build(task.run.problem, task.diagnose)
            start = self.start(task.run.problem, built.problem) if task.run.start == "warm" else None
        except (InputError, MemoryError, ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            return row | {"status": "not_built", "message": short(error)}
        problem = built.problem
        row |= built.facts
        try:
            row["backend"] = task.run.method.backends(problem.dim)
        except InputError as error:
            return row | {"status": "refused", "message": short(error)}
        if task.warm_up:
            self.warm_up(task, problem.dim)
        return row | measure(task, problem, start)

    def build(self, spec: ProblemSpec, diagnosed: bool) -> Built:
        if spec.label not in self.built:
            self.note("build")
            while len(self.built) >= KEPT:
                self.starts.pop(self.built.popitem(last=False)[0], None)
            begin = time.perf_counter()
            try:
                problem = spec.build()
            except InputError as error:
                self.built[spec.label] = error
            else:
                facts = sizes(problem) | {"build_seconds": time.perf_counter() - begin}
                facts |= diagnosis(problem) if diagnosed else {}
                self.built[spec.label] = Built(problem, facts)
                self.note(facts)  # known outside even if the run never returns
            self.note("solve")
        known = self.built[spec.label]
        if isinstance(known, InputError):
            raise known
        return known

    def start(self, spec: ProblemSpec, problem: InterfaceProblem) -> Solution:
        """The certified solution of the same problem at NEIGHBOUR times its load and friction."""
        if spec.label not in self.starts:
            self.note("build")
            q, s = (problem.q, NEIGHBOUR * problem.s) if len(problem.s) else (NEIGHBOUR * problem.q, problem.s)
            solution = solve(replace(problem, law=problem.law.times(NEIGHBOUR), q=q, s=s))
            if not solution.solved:
                raise InputError(f"no warm start: {solution.message}")
            self.starts[spec.label] = solution
            self.note("solve")
        return self.starts[spec.label]

    def warm_up(self, task: Task, dim: int) -> None:
        mark = (task.run.method.label, dim)
        if mark in self.warm:
            return
        self.note("warm up")
        Q = np.eye(2 * dim) + 0.1
        q = np.zeros((2, dim))
        q[:, 0], q[:, 1] = -1.0, 0.5
        with suppress(Exception):  # the run itself will tell
            call(task, InterfaceProblem(Q, q, Coulomb(np.full(2, 0.5))), None)
        self.warm.add(mark)
        self.note("solve")


def sizes(problem: InterfaceProblem) -> dict[str, Any]:
    size = {"contacts": problem.contacts, "dim": problem.dim, "plates": len(problem.s)}
    return {"fingerprint": problem.fingerprint, **size}


def diagnosis(problem: InterfaceProblem) -> dict[str, float]:
    from contactopt.analysis.diagnosis import diagnose

    found = diagnose(problem)
    return {
        "rank": found.rank,
        "condition": found.condition,
        "guaranteed_mu": found.guaranteed.alternating,
        "alternating_mu": found.uniform_slip.alternating,
        "tresca_mu": found.uniform_slip.tresca,
    }


def die_with_parent(parent: int) -> None:
    """Linux: the kernel kills this process when the thread that started it ends, however that happens."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, 9)  # PR_SET_PDEATHSIG, SIGKILL
        if os.getppid() != parent:
            os._exit(1)


def limit_memory(gigabytes: float) -> None:
    import resource

    for kind in (resource.RLIMIT_DATA, resource.RLIMIT_CORE):
        size = int(gigabytes * 1e9) if kind == resource.RLIMIT_DATA else 0
        with suppress(OSError, ValueError):
            resource.setrlimit(kind, (size, resource.getrlimit(kind)[1]))


def main() -> None:
    die_with_parent(int(sys.argv[2]))
    pipe = Connection(int(sys.argv[1]))
    runner = Runner(pipe.send)
    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError):
            return
        limit_memory(task.memory_limit)
        pipe.send(runner.execute(task))
