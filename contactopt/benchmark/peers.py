"""External solvers that live in another Python: one process of it answers many problems.

A peer is a plug-in file with three functions that the other Python runs. They import what they
need, and use no name from outside themselves. `version()` returns the version of the solver.
`prepare(problem, tol, settings)` makes what the solver takes of the problem, a mapping of arrays:
Q in rows of blocks (dim, dim), namely `indptr`, `indices` and `data`, `q` (k, dim), `mu` (k,), and
`start` (k, dim), forces to begin with, zero from cold. The normal component comes first.
`solve(prepared)` returns the forces, whether the solver claims success, and its iterations. Only
`solve` is timed.
"""

import inspect
import json
import pickle
import subprocess
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from contactopt.errors import InputError
from contactopt.linear.operators import form, has_entries
from contactopt.problem import InterfaceProblem, Scales, Status, dimensionless

Plain = tuple[str, tuple[int, ...], bytes]
MOST_HELD = 256  # problems, which many solvers get after one another; a sequence has up to 100

# What the other Python runs after the source of the three functions. Solvers print: what they say
# goes to the standard error. The system ends the process when the solver exceeds its time.
SERVER = """
import json, os, pickle, signal, sys, time
import numpy as np

out = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

def memory(name):
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) * 1.024e-3 for line in file if line.startswith(name))

def array(kind, shape, data):
    return np.frombuffer(data, kind).reshape(shape).copy()

version()
held = {}
while True:
    try:
        key, parts, start, tol, limit, settings = pickle.load(sys.stdin.buffer)
    except EOFError:
        break
    if parts is not None:
        if len(held) == MOST_HELD:
            held.clear()
        held[key] = parts
    try:
        problem = {name: array(*part) for name, part in held[key].items()}
        prepared = prepare(problem | {"start": array(*start)}, tol, settings)
        with open("/proc/self/clear_refs", "w") as file:
            file.write("5")  # forget the largest memory so far
        base = memory("VmRSS")
        signal.setitimer(signal.ITIMER_REAL, limit)
        wall, cpu = time.perf_counter(), time.process_time()
        r, claimed, iterations = solve(prepared)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        signal.setitimer(signal.ITIMER_REAL, 0)
        measured = dict(call_seconds=wall, cpu_seconds=cpu, base_mb=base, peak_mb=memory("VmHWM"))
        reply = dict(reactions=np.ravel(r).tolist(), claimed=bool(claimed),
                     iterations=float(iterations), measured=measured)
    except Exception as error:
        signal.setitimer(signal.ITIMER_REAL, 0)
        reply = dict(error=f"{type(error).__name__}: {error}")
    print(json.dumps(reply), file=out, flush=True)
"""


@dataclass(frozen=True, eq=False)
class Answer:
    """What a method answers, as a worker says it of a run.

    `status` is the method's own word; `reactions` None where there is no answer.

    measured  the columns call_seconds, cpu_seconds, peak_mb and base_mb, as far as they are known
    history   residuals, seconds and iterations
    """

    status: str
    message: str = ""
    reactions: np.ndarray | None = None
    multipliers: np.ndarray | None = None
    label: str = ""
    iterations: float = np.nan
    seconds: float = np.nan
    history: Any = None
    measured: dict[str, float] = field(default_factory=dict)


class PeerAnswer(Answer):
    """An answer from a separate process. Measurements are taken over from such answers only."""


@dataclass
class Peer:
    """An external solver, run by the first of several Python interpreters that can import it.

    name     as it is called in messages
    install  the line that installs it
    pythons  interpreters to try
    """

    name: str
    install: str
    pythons: Sequence[str]
    version: Callable[[], str]
    prepare: Callable[..., Any]
    solve: Callable[[Any], Any]
    process: subprocess.Popen[bytes] | None = field(default=None, init=False)
    # problems that the process holds, by fingerprint and dimension -> shape of q there, scales
    held: dict[tuple[str, int], tuple[tuple[int, int], Scales]] = field(
        default_factory=dict, init=False
    )

    def found(self) -> tuple[str, str]:
        """A Python that imports the solver, and its version; InputError tells how to install it."""
        program = f"{inspect.getsource(self.version)}\nprint('VERSION', version())"
        for python in self.pythons:
            if version := _said(python, program):
                return python, version
        raise InputError(f"{self.name} is not installed; {self.install}")

    def answer(
        self,
        problem: InterfaceProblem,
        tol: float,
        time_limit: float,
        dims: Collection[int] = (3,),
        start: np.ndarray | None = None,
        **settings: Any,
    ) -> Answer:
        """Let the solver answer a problem without plates, which it gets without units.

        The tolerance is the solver's own [-], `time_limit` is in seconds, and `prepare` gets the
        settings. `start` are forces (k, dim) to begin with. `dims` are the dimensions that the
        solver takes, of 2 and 3: without 2, a problem of the plane gets a second tangent along
        which nothing moves.
        """
        if len(problem.s):
            raise InputError(f"{self.name} knows no plates, whose forces balance a given load.")
        law = problem.law
        plain = law.unilateral and law.proportional and not law.dilatant
        if not plain or law.stretch(problem.dim) is not None:
            raise InputError(f"{self.name} takes Coulomb's law only, not {type(law).__name__}.")
        if problem.dim not in dims and 3 not in dims:
            raise InputError(f"this solver of {self.name} takes problems in the plane only.")
        key = problem.fingerprint, problem.dim if problem.dim in dims else 3
        parts = None
        if self.process is None or key not in self.held:
            parts = self._hold(key, problem)
        shape, scales = self.held[key]
        begin = np.zeros(shape)
        if start is not None:
            begin[:, : problem.dim] = scales.to_dimensionless(start, problem.s)[0]
        reply = self._ask((key, parts, _plain(begin), tol, time_limit, settings))
        if reply is None:
            return Answer("time_limit", f"{self.name} was ended after {time_limit:g} s")
        if "error" in reply:
            return Answer("error", reply["error"])
        status = Status.SOLVED if reply["claimed"] else Status.SETTLED
        r = np.array(reply["reactions"]).reshape(shape)[:, : problem.dim]
        return PeerAnswer(
            status.label,
            reactions=scales.to_physical(r, problem.s)[0],
            iterations=reply["iterations"],
            seconds=reply["measured"]["call_seconds"],
            measured=reply["measured"],
        )

    def _hold(self, key: tuple[str, int], problem: InterfaceProblem) -> dict[str, Plain]:
        """What the process gets of a problem without units, to be held there until it ends."""
        p, scales = dimensionless(problem if has_entries(problem.Q) else problem.explicit())
        if problem.dim != key[1]:
            p = _in_space(p)
        Q = sp.bsr_array(sp.csr_array(p.Q), blocksize=(p.dim, p.dim))
        Q.sort_indices()
        if self.process is None or len(self.held) == MOST_HELD:
            self.held.clear()
        self.held[key] = p.q.shape, scales
        arrays = {"indptr": Q.indptr, "indices": Q.indices, "data": Q.data, "q": p.q, "mu": p.mu}
        return {name: _plain(array) for name, array in arrays.items()}

    def _ask(self, request: tuple[Any, ...]) -> Any:
        """The reply to a request; None if the process was ended at the limit of time."""
        if self.process is None:
            parts = [inspect.getsource(part) for part in (self.version, self.prepare, self.solve)]
            program = "\n".join([*parts, f"MOST_HELD = {MOST_HELD}", SERVER])
            pipe = subprocess.PIPE
            self.process = subprocess.Popen(
                [self.found()[0], "-c", program], stdin=pipe, stdout=pipe
            )
        assert self.process.stdin and self.process.stdout
        pickle.dump(request, self.process.stdin, 4)
        self.process.stdin.flush()
        if line := self.process.stdout.readline():
            reply = json.loads(line)
            if reply.get("measured", {}).get("peak_mb", 0.0) > 500.0:  # then a new process follows
                self.process.kill()
                self.process.wait()
                self.process = None
            return reply
        code, self.process = self.process.wait(), None
        if code == -14:  # SIGALRM
            return None
        raise RuntimeError(f"{self.name} ended its process with code {code}")


def _plain(array: np.ndarray) -> Plain:
    """An array in a form that does not depend on the version of NumPy."""
    return array.dtype.str, array.shape, array.tobytes()


@cache
def _said(python: str, program: str) -> str:
    """The version that a program prints; '' if this Python cannot run it."""
    try:
        done = subprocess.run(
            [python, "-c", program],
            capture_output=True,
            text=True,
            timeout=60.0,  # s to import the solver
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    found = [line for line in done.stdout.splitlines() if line.startswith("VERSION ")]
    return found[-1].removeprefix("VERSION ") if found else ""


def _in_space(problem: InterfaceProblem) -> InterfaceProblem:
    """A problem of the plane with a second tangent along which nothing moves."""
    k = len(problem.q)
    Q, new = problem.Q, float(problem.Q.diagonal().mean()) * sp.eye_array(k)
    order = np.concatenate([np.arange(2 * k).reshape(k, 2), 2 * k + np.arange(k)[:, None]], axis=1)
    order = order.ravel()
    wide = (
        sp.csr_array(sp.block_diag([Q, new]))[order][:, order]
        if form(Q) == "sparse"
        else la.block_diag(Q, new.toarray())[np.ix_(order, order)]
    )
    q = np.column_stack([problem.q, np.zeros(k)])
    return InterfaceProblem(wide, q, problem.law, s=problem.s[:0])
