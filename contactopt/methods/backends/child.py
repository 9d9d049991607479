"""Quadratic programs in a process of their own, for backends that no time limit ends. It is killed
at the deadline of the solve that runs, and started for programs of more than SMALL unknowns in
solves with a time limit only, since the start takes up to a second.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import weakref
from contextlib import suppress
from math import isfinite
from threading import Timer
from typing import TYPE_CHECKING, Any

from contactopt.errors import BackendError
from contactopt.files.writing import broken_pipe_is_an_error
from contactopt.linear.deadline import TimeUp, check_time, time_left
from contactopt.methods.backends import Backend

if TYPE_CHECKING:
    import numpy as np

SMALL = 200  # unknowns of a program that is solved at once by every backend

# The process answers on a copy of its standard output, and whatever a solver prints goes nowhere.
SERVE = """
import os, pickle, sys, warnings
out = os.fdopen(os.dup(1), "wb")
os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
import qpsolvers
warnings.simplefilter("ignore")
while True:
    try:
        arguments, name, start, settings = pickle.load(sys.stdin.buffer)
    except EOFError:
        break
    try:
        problem = qpsolvers.Problem(**arguments)
        found = qpsolvers.solve_problem(problem, name, initvals=start, **settings)
        answer = found.x, found.y
    except Exception as error:
        answer = str(error) or type(error).__name__
    pickle.dump(answer, out)
    out.flush()
"""


class Child:
    """The process of one sequence of quadratic programs, which ends with this object."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None

    @staticmethod
    def needed(backend: Backend, n: int) -> bool:
        """Whether a program of n unknowns might outlast the time limit of the solve that runs."""
        return n > SMALL and not backend.clock and not backend.steps and isfinite(time_left())

    def solve(
        self,
        arguments: dict[str, Any],
        name: str,
        start: np.ndarray | None,
        settings: dict[str, Any],
    ) -> tuple[Any, Any]:
        """x and y of qpsolvers.Problem(**arguments), or None; TimeUp or BackendError."""
        check_time()
        if self.process is None:
            self.process = _started()
            weakref.finalize(self, _stop, self.process)
        process = self.process
        assert process.stdin is not None and process.stdout is not None
        end = Timer(time_left(), process.kill)
        end.start()
        try:
            with broken_pipe_is_an_error():
                pickle.dump((arguments, name, start, settings), process.stdin)
                process.stdin.flush()
            answer = pickle.load(process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError) as error:
            self.process = None
            _stop(process)
            if time_left() <= 0:
                raise TimeUp from error
            raise BackendError(f"its process ended with exit code {process.returncode}") from error
        finally:
            end.cancel()
        if isinstance(answer, str):
            raise BackendError(answer)
        return answer


def _started() -> subprocess.Popen[bytes]:
    """A new process that waits for programs."""
    return subprocess.Popen(
        [sys.executable, "-c", SERVE],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
    )


def _stop(process: subprocess.Popen[bytes]) -> None:
    """Kill the process and wait for its end."""
    process.kill()
    for pipe in (process.stdin, process.stdout):  # to close one writes what it still holds
        with suppress(OSError), broken_pipe_is_an_error():
            if pipe is not None:
                pipe.close()
    process.wait()
