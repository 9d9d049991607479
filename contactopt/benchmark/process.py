"""A process in which code of the user may run: limits of time, its end, and what it printed."""

import fcntl
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from contactopt.errors import InputError
from contactopt.files.writing import broken_pipe_is_an_error

LIBRARIES = ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMEXPR", "RAYON")
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in LIBRARIES} | {"VECLIB_MAXIMUM_THREADS": "1"}
LOAD_LIMIT = 120.0  # s to load plug-ins
START = "start"  # the phase until the process answers at all
# of a process that is killed in it: once may be chance, each time is its limit of memory
STARTS = 3
BEAT = 0.1  # s between two looks at what a busy process printed
MOST_WORDS = 10e6  # bytes of print that are kept on disk; more is thrown away
MOST_TEXT = 10_000  # characters of a message that are looked at
KEPT_WORDS = 4000  # bytes of what a process printed last, which may tell why it ended
PIECE = 2**20  # bytes that are read from it at once
HEAD = 8  # bytes before an answer, which say its length
END = 3.0  # s for a process to end after it closed its pipe
ROUNDS = 100  # in which what it started is killed, while that starts more
LOOKS = 4  # that find nothing one after the other: one may miss a process that starts another
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
        fcntl.fcntl(self.noise, fcntl.F_SETFL, os.O_APPEND)  # what is thrown away leaves no hole
        self.folder = tempfile.mkdtemp(prefix="contactopt-")  # its temporary files end with it
        self.pipe, theirs = Pipe()
        program = PROGRAM.format(sys.path, theirs.fileno(), os.getpid())
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-c", program],
                # a solver's last words tell more than the stack of a crashed process
                env=os.environ | ONE_THREAD | {"PYTHONFAULTHANDLER": "", "TMPDIR": self.folder},
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
        """What the process says next. A plug-in may have spoken for it, or closed the pipe."""
        assert self.process is not None
        deadline, heard = time.monotonic() + limit, bytearray()
        while len(heard) < HEAD or len(heard) < HEAD + int.from_bytes(heard[:HEAD]):
            if self.pipe.poll(max(0.0, min(BEAT, deadline - time.monotonic()))):
                part = b""
                with suppress(OSError):
                    part = os.read(self.pipe.fileno(), PIECE)
                if not part:
                    raise Ended(phase, *self._death())
                heard += part
            elif self.process.poll() is not None:  # a copy of it may hold the pipe open
                raise Ended(phase, *self._death())
            if os.fstat(self.noise.fileno()).st_size > MOST_WORDS:
                self.noise.truncate(0)
            if time.monotonic() >= deadline:
                held = self._memory()
                self.kill()
                words = f"still running after {limit:g} s, holding {held:.2g} GB of memory"
                raise Ended(phase, "killed", words, held)
        try:
            if len(heard) > HEAD + int.from_bytes(heard[:HEAD]):
                raise ValueError("something else was written into its pipe")
            return pickle.loads(memoryview(heard)[HEAD:])
        except Exception as error:  # whatever these bytes lead to
            self.kill()
            words = one_line(f"its answer cannot be read: {error}")
            raise Ended(phase, "crashed", words) from None

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
        code = 0
        with suppress(subprocess.TimeoutExpired):
            code = self.process.wait(END)
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
        process = self.process
        if process is None:
            return
        with suppress(OSError):  # what loses its parent becomes its child, and it starts no more
            os.kill(process.pid, signal.SIGSTOP)
        rounds, missed, dead = 0, 0, process.poll() is not None
        while missed < LOOKS and rounds < ROUNDS:
            found = _kill_descendants(process.pid, self.folder, dead)
            rounds, missed = rounds + 1, 0 if found else missed + 1
            time.sleep(0.01 * missed * (dead or rounds > LOOKS))
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
        shutil.rmtree(self.folder, ignore_errors=True)
        self.process, self.known = None, {}


def _kill_descendants(number: int, folder: str, dead: bool) -> bool:
    """Kill what a process started, also in sessions of their own; whether there was any. After its
    own death these are all processes whose temporary files belong into its `folder`.
    """
    import psutil

    pids, found = psutil.pids() if dead else _children(number), False
    for pid in sorted(pids, reverse=True):  # the newest may be gone soon
        with suppress(psutil.Error):
            one = psutil.Process(pid)
            own = not dead or one.environ().get("TMPDIR") == folder
            if own and one.status() != psutil.STATUS_ZOMBIE:
                one.kill()
                found = True
    return found


def _children(number: int) -> list[int]:
    """The processes that one started, dead ones among them. Those that they started become its
    children when they are dead.
    """
    import psutil

    lists = list(Path(f"/proc/{number}/task").glob("*/children"))  # not in every system
    with suppress(OSError):
        if lists:
            return [int(pid) for file in lists for pid in file.read_text().split()]
    with suppress(psutil.Error):
        return [one.pid for one in psutil.Process(number).children(recursive=True)]
    return []


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
    _say(pipe_number, True)
    while True:
        function, arguments = pipe.recv()
        try:
            _say(pipe_number, function(*arguments))
        except Exception as error:  # also of an answer that cannot be sent
            _say(pipe_number, RuntimeError(one_line(error)))


def _say(pipe_number: int, answer: object) -> None:
    """Write an answer into a pipe, its length in HEAD bytes first."""
    data = pickle.dumps(answer)
    left = memoryview(len(data).to_bytes(HEAD) + data)
    while left:
        left = left[os.write(pipe_number, left) :]


def one_line(error: object) -> str:
    """A text, or an exception with its name unless an InputError, in 200 characters."""
    text = str(error) if isinstance(error, str | InputError) else f"{type(error).__name__}: {error}"
    text = text[:MOST_TEXT].encode(errors="replace").decode()  # tables hold no half characters
    return " ".join(text.split())[:200]
