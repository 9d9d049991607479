"""A process in which code of the user may run, seen from outside: start it, ask it, kill it, tell how it ended."""

from __future__ import annotations

import os
import secrets
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from contactopt.benchmark import wire
from contactopt.benchmark.wire import Channel, ForeignMessage
from contactopt.errors import InputError

LIBRARIES = ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "BLIS_NUM", "NUMEXPR_NUM", "VECLIB_MAXIMUM", "RAYON_NUM")
ONE_THREAD = {f"{name}_THREADS": "1" for name in LIBRARIES}
START = "start"  # the phase from the request until the process says what it does
MEMORY_WORDS = (b"MemoryError", b"bad_alloc", b"out of memory", b"Out of memory", b"Cannot allocate memory")
KEPT_WORDS = 4000  # bytes of what a process printed last


class Ended(Exception):
    """The process ended, was killed at a limit, or sent what it was not asked for: `phase`, `status`, `message`."""

    def __init__(self, phase: str, status: str, message: str):
        super().__init__(message)
        self.phase, self.status, self.message = phase, status, message


class Process:
    """One process at a time, started when it is first asked and again after it died. Use from one thread.

    role  what it does: a key of contactopt.benchmark.worker.ROLES
    """

    def __init__(self, role: str):
        self.role = role
        self.process: subprocess.Popen | None = None
        self.channel: Channel
        try:
            self.noise = tempfile.TemporaryFile(mode="a+b")  # noqa: SIM115 (what solvers print)
        except OSError as error:
            raise InputError(f"a worker process needs a temporary file: {error.strerror or error}.") from error

    @property
    def running(self) -> bool:
        return self.process is not None

    def start(self) -> None:
        if self.process is not None:
            return
        ours, theirs = socket.socketpair()
        code = "from contactopt.benchmark.worker import main; main()"
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-c", code, str(theirs.fileno()), str(os.getpid()), self.role],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=self.noise,
                stderr=self.noise,
                env=os.environ | ONE_THREAD,
                process_group=0,  # so that what a solver starts dies with it
            )
        except OSError as error:
            ours.close()
            raise InputError(f"a worker process cannot start: {error.strerror or error}.") from error
        finally:
            theirs.close()
        self.channel = Channel(ours)

    def ask(self, request: tuple[Any, ...], limits: Mapping[str, float], most: float) -> Any:
        """What the process answers to a request.

        limits  seconds of every phase that the process may enter, START included
        most    bytes of the longest message
        Raises Ended without an answer; the process is dead then. Each request carries a word of its own, made at
        random. A message without it, as from a copy of the process that an earlier request left behind, is not taken for
        an answer.
        """
        self.start()
        with suppress(OSError):
            self.noise.truncate(0)
        token, phase = secrets.token_hex(8), START
        deadline = time.monotonic() + limits[phase]
        try:
            self.channel.send((token, *request), limits[phase])
            while True:
                kind, content = self._next(token, deadline, most)
                if kind == "answer":
                    return content
                if kind != "phase" or content not in limits:
                    raise ForeignMessage("an unknown message")
                phase = content
                deadline = time.monotonic() + limits[phase]
        except TimeoutError:
            self.kill()
            raise Ended(phase, "killed", f"still running after {limits[phase]:g} s") from None
        except ForeignMessage as error:
            self.kill()
            raise Ended(START, "error", f"its process sent what it was not asked for: {error}") from error
        except (EOFError, OSError):
            raise Ended(phase, *self._death()) from None

    def _next(self, token: str, deadline: float, most: float) -> tuple[str, Any]:
        process = self.process
        assert process is not None
        message = wire.read(self.channel.receive(deadline, most, lambda: process.poll() is None))
        if not isinstance(message, tuple) or len(message) != 3 or not isinstance(message[0], str):
            raise ForeignMessage("a message of another form")
        if not secrets.compare_digest(message[0].encode(), token.encode()):
            raise ForeignMessage("an answer to another request")
        return message[1], message[2]

    def _death(self) -> tuple[str, str]:
        """How the process ended by itself: (status, message)."""
        assert self.process is not None
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(5)
        code = self.process.poll()
        self.noise.seek(0, os.SEEK_END)
        self.noise.seek(max(0, self.noise.tell() - KEPT_WORDS))
        said = self.noise.read()
        self.kill()
        last = said.strip().splitlines()[-1].decode(errors="replace") if said.strip() else ""
        if any(word in said for word in MEMORY_WORDS):
            return "out_of_memory", one_line(last)
        if code == -signal.SIGKILL:
            return "out_of_memory", "killed from outside, as the system does when memory runs out"
        how = signal.Signals(-code).name if code is not None and code < 0 else f"exit code {code}"
        return "crashed", one_line(f"{how}: {last}".rstrip(": "))

    def interrupt(self) -> None:
        """Kill the process from another thread; the one that uses it sees it end."""
        process = self.process
        if process is not None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)

    def kill(self) -> None:
        if self.process is None:
            return
        self.interrupt()
        self.process.wait()
        self.channel.close()
        self.process = None

    def close(self) -> None:
        self.kill()
        self.noise.close()


def one_line(error: object) -> str:
    """Write a text, or an exception with its name unless it is an InputError, in one line of at most 200 characters.

    Parameters
    ----------
    error
        The text or exception.

    Returns
    -------
    str
        The line.
    """
    text = str(error) if isinstance(error, str | InputError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())[:200]
