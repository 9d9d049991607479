"""A process in which code of the user may run: limits of time, its end, and what it printed."""

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from contactopt.errors import InputError
from contactopt.files.writing import broken_pipe_is_an_error

LIBRARIES = ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMEXPR", "RAYON")
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in LIBRARIES} | {"VECLIB_MAXIMUM_THREADS": "1"}
START = "start"  # the phase until the process answers at all
# of a process that is killed in it: once may be chance, each time is its limit of memory
STARTS = 3
BEAT = 0.1  # s between two looks at what a busy process printed
MOST_WORDS = 10e6  # bytes of print that are kept on disk; more is thrown away
KEPT_WORDS = 4000  # bytes of what a process printed last, which may tell why it ended
MEMORY_WORDS = re.compile(rb"MemoryError|bad_alloc|[Oo]ut of memory|Cannot allocate memory")
KILLED = "killed from outside, as the system does when memory runs out"
PROGRAM = """
import sys
sys.path[:] = {}
from contactopt.benchmark.process import serve
serve({}, {})
"""


class Ended(Exception):
    """The process ended by itself or was killed at a limit: `phase`, `status`, `message`, and the
    memory [GB] that it held when it was killed.
    """

    def __init__(self, phase: str, status: str, message: str, held: float = 0.0):
        super().__init__(message)
        self.phase, self.status, self.message, self.held = phase, status, message, held


class Process:
    """One process at a time, started when it is first asked and again after it died.

    Use from one thread. `known` is for notes about the present process, and empty in a new one.
    """

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None
        self.known: dict[str, str] = {}

    @property
    def running(self) -> bool:
        return self.process is not None

    def start(self) -> None:
        """Let the process start, if there is none; nobody waits for it here."""
        if self.process is not None:
            return
        self.ready, self.known = False, {}  # until it has said so
        self.noise = tempfile.TemporaryFile()  # noqa: SIM115
        self.pipe, theirs = Pipe()
        program = PROGRAM.format(sys.path, theirs.fileno(), os.getpid())
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-c", program],
                # a solver's last words tell more than the stack of a crashed process
                env=os.environ | ONE_THREAD | {"PYTHONFAULTHANDLER": ""},
                pass_fds=[theirs.fileno()],
                start_new_session=True,  # Ctrl-C is for the campaign
                stdin=subprocess.DEVNULL,
                stdout=self.noise,
                stderr=subprocess.STDOUT,
            )
        except OSError as error:
            raise InputError(
                f"a worker process cannot start: {error.strerror or error}."
            ) from error
        finally:
            theirs.close()

    def ask(self, limit: float, phase: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """What a called function returns; Ended, with `phase`, if it died or took too long."""
        for _ in range(STARTS):
            self.start()
            try:
                if not self.ready:
                    self.ready = self._wait(120.0, START)  # s to start
                with broken_pipe_is_an_error():
                    self.pipe.send((function, arguments))
                break
            except Ended as end:
                last = end
            except OSError:  # it died while nobody asked it
                last = Ended(START, *self._death())
        else:
            raise last
        answer = self._wait(limit, phase)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _wait(self, limit: float, phase: str) -> Any:
        """What the process says next."""
        assert self.process is not None
        deadline = time.monotonic() + limit
        while not self.pipe.poll(max(0.0, min(BEAT, deadline - time.monotonic()))):
            if self.process.poll() is not None:  # a copy of it may hold the pipe open
                raise Ended(phase, *self._death())
            if os.fstat(self.noise.fileno()).st_size > MOST_WORDS:
                self.noise.truncate(0)
            if time.monotonic() >= deadline:
                held = self._memory()
                self.kill()
                words = f"still running after {limit:g} s, holding {held:.2g} GB of memory"
                raise Ended(phase, "killed", words, held)
        try:
            return self.pipe.recv()
        except (EOFError, OSError):
            raise Ended(phase, *self._death()) from None

    def _memory(self) -> float:
        """Resident memory of the process and of all that it started [GB]."""
        import psutil

        size = 0
        with suppress(psutil.Error):
            me = psutil.Process(self.process.pid if self.process else None)
            for one in (me, *me.children(recursive=True)):
                with suppress(psutil.Error):
                    size += one.memory_info().rss
        return size / 1e9

    def _death(self) -> tuple[str, str]:
        """How the process ended by itself: (status, message)."""
        assert self.process is not None
        code = self.process.wait()
        self.noise.seek(max(0, os.fstat(self.noise.fileno()).st_size - KEPT_WORDS))
        said = self.noise.read(KEPT_WORDS)
        self.kill()
        last = said.strip().splitlines()[-1].decode(errors="replace") if said.strip() else ""
        if MEMORY_WORDS.search(said):
            return "out_of_memory", one_line(last)
        if code == -signal.SIGKILL:
            return "out_of_memory", KILLED
        name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return "crashed", one_line(f"{name}: {last}".rstrip(": "))

    def interrupt(self) -> None:
        """Kill the process and all that it started, also from another thread."""
        import psutil

        process = self.process
        if process is None:
            return
        with suppress(psutil.Error):  # what it started in sessions of their own
            for child in psutil.Process(process.pid).children(recursive=True):
                child.kill()
        with suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)

    def kill(self) -> None:
        """End the process with all that it started."""
        if self.process is None:
            return
        self.interrupt()
        self.process.wait()
        self.pipe.close()
        self.noise.close()
        self.process, self.known = None, {}


def serve(pipe_number: int, parent: int) -> None:
    """What the process does: it calls the functions that come, and ends with `parent`."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: however the parent ends
        ctypes.CDLL(None).prctl(36, 1)  # PR_SET_CHILD_SUBREAPER
        if os.getppid() != parent:
            return
    os.set_inheritable(pipe_number, False)
    pipe: Connection[Any, Any] = Connection(pipe_number)
    pipe.send(True)
    while True:
        function, arguments = pipe.recv()
        try:
            pipe.send(function(*arguments))
        except Exception as error:  # also of an answer that cannot be sent
            pipe.send(RuntimeError(one_line(error)))


def one_line(error: object) -> str:
    """A text, or an exception with its name unless an InputError, in 200 characters."""
    text = str(error) if isinstance(error, str | InputError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())[:200]
