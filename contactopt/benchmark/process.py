"""A process in which code of the user may run, seen from outside: start it, ask it, kill it, tell
how it ended.

The process is the one worker of an executor of loky, which starts it, carries calls and answers,
and notices its death. What is added here: limits of time, the end of everything that the process
started, and what it printed last.
"""

from __future__ import annotations

import os
import re
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from contextlib import suppress
from typing import IO, TYPE_CHECKING, Any

from contactopt.errors import InputError

if TYPE_CHECKING:
    import psutil

LIBRARIES = ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMEXPR", "RAYON")
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in LIBRARIES} | {"VECLIB_MAXIMUM_THREADS": "1"}
# environment variable of all that a campaign starts: number and start time of its process
MARK = "CONTACTOPT_CAMPAIGN"
START = "start"  # the phase until the process answers at all
START_LIMIT = 120.0  # s for it
# of a process that is killed in it: once may be chance, each time is its limit of memory
STARTS = 3
BEAT = 0.1  # s between two looks at what a busy process printed
MOST_WORDS = 10e6  # bytes of print that are kept on disk; more is thrown away
KEPT_WORDS = 4000  # bytes of what a process printed last, which may tell why it ended
MEMORY_WORDS = re.compile(rb"MemoryError|bad_alloc|[Oo]ut of memory|Cannot allocate memory")
KILLED = "killed from outside, as the system does when memory runs out"


class Ended(Exception):
    """The process ended by itself or was killed at a limit: `phase`, `status`, `message`."""

    def __init__(self, phase: str, status: str, message: str):
        super().__init__(message)
        self.phase, self.status, self.message = phase, status, message


class Process:
    """One process at a time, started when it is first asked and again after it died.

    Use from one thread.
    """

    def __init__(self) -> None:
        self.executor: Any = None
        self.number: int | None = None  # of the process, once it has answered
        self.noise: IO[bytes]
        self.ready: Future[int]

    @property
    def running(self) -> bool:
        return self.executor is not None

    def start(self) -> None:
        """Let the process start, if there is none; nobody waits for it here."""
        if self.executor is not None:
            return
        from loky import ProcessPoolExecutor

        try:
            self.noise = tempfile.NamedTemporaryFile("a+b", delete=False)  # noqa: SIM115
            # a solver's last words tell more than the stack of a crashed process
            environment = ONE_THREAD | {"PYTHONFAULTHANDLER": "", MARK: _mark()}
            told = (self.noise.name, os.getpid())
            self.executor = ProcessPoolExecutor(
                1, env=environment, initializer=prepare, initargs=told
            )
            self.ready = self.executor.submit(os.getpid)
        except OSError as error:
            raise InputError(
                f"a worker process cannot start: {error.strerror or error}."
            ) from error

    def ask(self, limit: float, phase: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """What a function returns that the process calls.

        After `limit` seconds the process is killed. Raises Ended if it did not survive the call,
        which `phase` names. A process that is killed before the call, while it starts or while
        nobody asks it anything, is started anew, STARTS times.
        """
        from loky.process_executor import BrokenProcessPool

        for _ in range(STARTS):
            self.start()
            try:
                if self.number is None:
                    self.number = self._wait(self.ready, START_LIMIT, START)
                    os.unlink(self.noise.name)
                answer = self.executor.submit(function, *arguments)
            except Ended as end:
                last = end
            except BrokenProcessPool as error:
                last = Ended(START, *self._death(error))
            else:
                return self._wait(answer, limit, phase)
        raise last

    def _wait(self, future: Future[Any], limit: float, phase: str) -> Any:
        from loky.process_executor import BrokenProcessPool

        deadline = time.monotonic() + limit
        while True:
            try:
                return future.result(max(0.0, min(BEAT, deadline - time.monotonic())))
            except BrokenProcessPool as error:
                raise Ended(phase, *self._death(error)) from None
            except TimeoutError:
                if os.fstat(self.noise.fileno()).st_size > MOST_WORDS:
                    self.noise.truncate(0)
                if time.monotonic() >= deadline:
                    self.kill()
                    raise Ended(phase, "killed", f"still running after {limit:g} s") from None

    def _death(self, error: Exception) -> tuple[str, str]:
        """How the process ended by itself: (status, message)."""
        self.noise.seek(max(0, os.fstat(self.noise.fileno()).st_size - KEPT_WORDS))
        said = self.noise.read(KEPT_WORDS)
        self.kill()
        last = said.strip().splitlines()[-1].decode(errors="replace") if said.strip() else ""
        if MEMORY_WORDS.search(said):
            return "out_of_memory", one_line(last)
        told = f"{error.__cause__} {error}"
        found = re.search(r"exit codes of the workers are \{(\w+)\((-?\d+)\)", told)
        name, code = found.groups() if found else ("EXIT", "unknown")
        if name == "SIGKILL":
            return "out_of_memory", KILLED
        name = f"exit code {code}" if name == "EXIT" else name
        return "crashed", one_line(f"{name}: {last}".rstrip(": "))

    def interrupt(self) -> None:
        """Kill the process from another thread; the one that uses it sees it end."""
        import psutil

        if self.number is not None:
            with suppress(psutil.Error):
                process = psutil.Process(self.number)
                _kill([process, *process.children(recursive=True)])

    def kill(self) -> None:
        """End the process with all that it started."""
        if self.executor is None:
            return
        self.interrupt()
        self.executor.shutdown(wait=True, kill_workers=True)
        self.noise.close()
        with suppress(OSError):
            os.unlink(self.noise.name)
        self.executor = self.number = None
        end_orphans()


def prepare(noise: str, parent: int) -> None:
    """Make the new process ready: it ends with the process of the number `parent`, leaves Ctrl-C to
    it, and prints into the file `noise`.

    loky would end a process that has grown by 300 MB, as large problems let it grow. A call that
    comes at that moment gets no answer. Limits of memory are the campaign's own.
    """
    from loky import process_executor

    process_executor._MAX_MEMORY_LEAK_SIZE = float("inf")
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: however the parent ends
        if os.getppid() != parent:
            os._exit(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    file = os.open(noise, os.O_WRONLY | os.O_APPEND)
    for stream in (1, 2):
        os.dup2(file, stream)
    os.close(file)


def _mark() -> str:
    """Number and start of this process, which tell those of this campaign from all others."""
    import psutil

    return f"{os.getpid()} {psutil.Process().create_time()}"


def end_orphans() -> None:
    """Kill what solvers of this campaign, or of one that is dead, left behind in sessions of their
    own.
    """
    import psutil

    for process in psutil.process_iter():
        with suppress(psutil.Error, ValueError):
            if (found := process.environ().get(MARK)) is None:
                continue
            number, began = found.split()
            alive = psutil.pid_exists(int(number)) and psutil.Process(
                int(number)
            ).create_time() == float(began)
            family = (process.pid, *(parent.pid for parent in process.parents()))
            if not alive or (int(number) == os.getpid() and os.getpid() not in family):
                _kill([process])


def _kill(processes: Iterable[psutil.Process]) -> None:
    """Kill processes; what frees shared memory after them is left to end by itself."""
    import psutil

    killed = []
    for process in processes:
        with suppress(psutil.Error):
            if "resource_tracker" not in " ".join(process.cmdline()):
                process.kill()
                killed.append(process)
    psutil.wait_procs(killed, timeout=1)


def one_line(error: object) -> str:
    """A text, or an exception with its name unless it is an InputError, in one line of at most 200
    characters.
    """
    text = str(error) if isinstance(error, str | InputError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())[:200]
