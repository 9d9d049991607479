"""The processes in which code of the user runs: they receive requests over a socket and send answers back.

They may crash, hang or run out of memory at any moment: contactopt.benchmark.process watches them from outside. There
are three roles, each in a process of its own: one lists what plug-ins declare, one builds problems, one runs methods.
What runs methods gets its problems from outside and judges nothing.
"""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.benchmark.calls import call, measure, no_answer
from contactopt.benchmark.measure import Task
from contactopt.benchmark.plugins import Registry
from contactopt.benchmark.problems import ProblemSpec
from contactopt.benchmark.process import one_line
from contactopt.benchmark.wire import Channel
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.problem.operators import InterfaceOperator
from contactopt.solving.driver import solve

NEIGHBOUR = 0.9  # load and friction of the problem whose solution is the warm start
UNBUILT = (InputError, MemoryError, ArithmeticError, ValueError, np.linalg.LinAlgError)
Note = Callable[[str], None]


class Runner:
    """Runs methods, one request after another. It keeps the last problem, its warm start, and what is imported.

    A method's first run in a process is preceded by an untimed one on a problem of two contacts, so that imports and
    compilation are not timed.
    """

    def __init__(self, note: Note):
        self.note = note
        self.plugins = Registry()
        self.problem: InterfaceProblem
        self.start: Solution | None = None
        self.warm: set[tuple[str, int]] = set()

    def execute(self, task: Task, problem: InterfaceProblem | None) -> dict[str, Any]:
        """The answer to one task, on a new problem or the one kept."""
        _limit_memory(task.memory_limit)
        self.note("solve")
        if problem is not None:
            self.problem, self.start = problem, None
        self.plugins.load(task.plugins)
        start = None
        if task.run.start == "warm":
            try:
                start = self.warm_start()
            except UNBUILT as error:
                return no_answer("not_built", error)
        if task.warm_up:
            self.warm_up(task, self.problem.dim)
        return measure(task, self.problem, start, self.plugins)

    def warm_start(self) -> Solution:
        """The certified solution of the same problem at NEIGHBOUR times its load and friction."""
        if self.start is None:
            self.note("neighbour")
            problem = self.problem
            q, s = (problem.q, NEIGHBOUR * problem.s) if len(problem.s) else (NEIGHBOUR * problem.q, problem.s)
            self.start = solve(replace(problem, law=problem.law.times(NEIGHBOUR), q=q, s=s))
            self.note("solve")
        if not self.start.solved:
            raise InputError(f"no warm start: {self.start.message}")
        return self.start

    def warm_up(self, task: Task, dim: int) -> None:
        mark = (task.run.method.label, dim)
        if mark in self.warm:
            return
        self.note("warm up")
        Q = np.eye(2 * dim) + 0.1
        q = np.zeros((2, dim))
        q[:, 0], q[:, 1] = -1.0, 0.5
        with suppress(Exception):  # the run itself will tell
            call(task, InterfaceProblem(Q, q, Coulomb(np.full(2, 0.5))), None, self.plugins)
        self.warm.add(mark)
        self.note("solve")


class Builder:
    """Builds problems, one request after another. It keeps what plug-ins declared."""

    def __init__(self) -> None:
        self.plugins = Registry()

    def build(self, spec: ProblemSpec, paths: tuple[str, ...], diagnosed: bool, memory_limit: float) -> dict[str, Any]:
        """The problem with the seconds that it took and its diagnosis, or {"error": sentence}."""
        _limit_memory(memory_limit)
        try:
            self.plugins.load(paths)
            begin = time.perf_counter()
            problem = spec.build(self.plugins.problems)
            seconds = time.perf_counter() - begin
            if isinstance(problem.Q, InterfaceOperator):
                raise InputError(
                    f"problem '{spec.label}' must have Q as a matrix; a benchmark hands it to other processes."
                )
            return {
                "problem": problem,
                "build_seconds": seconds,
                "diagnosis": _diagnosis(problem) if diagnosed else {},
            }
        except (Exception, SystemExit) as error:
            return {"error": one_line(error)}


def _diagnosis(problem: InterfaceProblem) -> dict[str, float]:
    from contactopt.analysis.diagnosis import diagnose

    found = diagnose(problem)
    return {
        "rank": found.rank,
        "condition": found.condition,
        "guaranteed_mu": found.guaranteed.alternating,
        "alternating_mu": found.uniform_slip.alternating,
        "tresca_mu": found.uniform_slip.tresca,
    }


def _die_with_parent(parent: int) -> None:
    """Linux: the kernel kills this process when the thread that started it ends, however that happens."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, 9)  # PR_SET_PDEATHSIG, SIGKILL
        if os.getppid() != parent:
            os._exit(1)


def _limit_memory(gigabytes: float) -> None:
    import resource

    for kind in (resource.RLIMIT_DATA, resource.RLIMIT_CORE):
        size = int(gigabytes * 1e9) if kind == resource.RLIMIT_DATA else 0
        with suppress(OSError, ValueError):
            resource.setrlimit(kind, (size, resource.getrlimit(kind)[1]))


def _serve_inspect(note: Note) -> Callable[..., Any]:
    from contactopt.benchmark.catalogue import declare

    return declare


ROLES: dict[str, Callable[[Note], Callable[..., Any]]] = {
    "inspect": _serve_inspect,
    "build": lambda note: Builder().build,
    "solve": lambda note: Runner(note).execute,
}


def main() -> None:
    """Serve requests (word, *arguments) with messages (word, "phase" or "answer", content) until the socket closes."""
    _die_with_parent(int(sys.argv[2]))
    channel, own = Channel(socket.socket(fileno=int(sys.argv[1]))), os.getpid()
    word = ""
    serve = ROLES[sys.argv[3]](lambda phase: channel.send((word, "phase", phase)))
    while True:
        try:
            word, *arguments = channel.wait()
        except (EOFError, OSError):
            return
        answer = serve(*arguments)
        if os.getpid() != own:  # a copy that the method made of this process by forking, and forgot
            os._exit(1)
        channel.send((word, "answer", answer))
