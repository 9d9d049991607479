"""Ranks started by the command line itself, on the cores of this machine, and watched until they
end.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from contactopt.cards import count
from contactopt.checks import check_count
from contactopt.errors import InputError
from contactopt.scenes.scene import Part, Scene

OUTCOME = "CONTACTOPT_OUTCOME"  # environment variable: the file that takes the exit code of rank 0
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
PER_CORE = 4  # most ranks on a core, above which they only take time and memory from each other
BEAT = 1.0  # between two looks whether a rank was stopped [s]
PATIENCE = 60.0  # for which a stopped rank is waited for [s]


def launch(ranks: int, arguments: Sequence[str]) -> int:
    """Start the command line on several ranks of this machine, each bound to a core while there are
    enough of them.

    Every rank uses one BLAS thread unless the environment says otherwise.

    Parameters
    ----------
    ranks : How many processes.
    arguments : Of the command line, without the name of the program.

    Returns
    -------
    The exit code of rank 0.

    Raises
    ------
    InputError : If the packages of the extra `mpi` are missing, if there are too many ranks for the
        cores of this machine, and in a process that was itself started as a rank.
    """
    if OUTCOME in os.environ:  # without this sentence each rank would start ranks of its own
        raise InputError(
            "mpiexec started ranks that do not see each other; it must belong to the MPI that"
            " mpi4py was built with."
        )
    start = mpiexec(ranks)
    with tempfile.TemporaryDirectory() as folder:
        outcome = Path(folder) / "exit code"
        environment = (
            {name: "1" for name in ONE_THREAD} | dict(os.environ) | {OUTCOME: str(outcome)}
        )
        command = [*start, sys.executable, "-m", "contactopt", *arguments]
        code = _watched(command, environment)
        return int(outcome.read_text()) if outcome.exists() else ended_early(code)


def _watched(command: list[str], environment: dict[str, str]) -> int:
    """The exit code of mpiexec.

    A rank that somebody stopped is waited for with a word, and ended after PATIENCE.
    """
    import psutil

    stopped: dict[int, float] = {}  # number of a process -> when it was first seen stopped
    with subprocess.Popen(command, env=environment) as process:
        try:
            while True:
                with suppress(subprocess.TimeoutExpired):
                    return process.wait(BEAT)
                with suppress(psutil.NoSuchProcess):
                    ranks = psutil.Process(process.pid).children(recursive=True)
                    found = [own for own in ranks if own.status() == psutil.STATUS_STOPPED]
                    stopped = {
                        own.pid: stopped.get(own.pid) or _told_stopped(own.pid) for own in found
                    }
                    for own in found:
                        if time.monotonic() - stopped[own.pid] > PATIENCE:
                            own.kill()
        except BaseException:
            process.kill()
            raise


def _told_stopped(number: int) -> float:
    """Say that a rank was stopped; the time at which that was said."""
    print(
        f"contactopt: a rank (process {number}) was stopped and all others wait for it; go on with"
        f" 'kill -CONT {number}', or it is ended in {PATIENCE:g} s.",
        file=sys.stderr,
    )
    return time.monotonic()


def mpiexec(ranks: int) -> list[str]:
    """The beginning of a command that runs on several ranks of this machine.

    Raises
    ------
    InputError : Where MPI is missing, and for more ranks than PER_CORE on each core.
    """
    check_count("the number of ranks", ranks)
    cores = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    if ranks > PER_CORE * cores:
        raise InputError(
            f"{ranks} ranks are too many for {count(cores, 'core')}; take {PER_CORE * cores} at"
            f" most, better {cores}."
        )
    program = shutil.which("mpiexec", path=str(Path(sys.executable).parent)) or shutil.which(
        "mpiexec"
    )
    if program is None or find_spec("mpi4py") is None or find_spec("psutil") is None:
        raise InputError("ranks need mpi4py, psutil and mpiexec: pip install 'contactopt[mpi]'.")
    placed = (
        ["--bind-to", "core", "--map-by", "core"]
        if ranks <= cores
        else ["--oversubscribe", "--bind-to", "none"]
    )
    root = (
        ["--allow-run-as-root"] if getattr(os, "geteuid", lambda: 1)() == 0 else []
    )  # whoever is root runs this as root
    return [program, *root, *placed, "-n", str(ranks)]


def check_bodies(scene: Scene, ranks: int) -> None:
    """Check that every rank gets an elastic body of a scene.

    Parameters
    ----------
    scene : The scene.
    ranks : How many processes shall share its bodies.

    Raises
    ------
    InputError : If there are more ranks than elastic bodies.
    """
    check_count("the number of ranks", ranks)
    bodies = sum(isinstance(part, Part) for part in scene.parts)
    if ranks > max(bodies, 1):
        have = f"only {count(bodies, 'elastic body', 'elastic bodies')}"
        raise InputError(
            f"scene '{scene.name}' has {have}, and each rank needs one; take {max(bodies, 1)} of"
            f" the {ranks} ranks."
        )


def ended_early(code: int) -> int:
    """The exit code where rank 0 left none: a rank ended before the work was done, and mpiexec
    ended the others.
    """
    why = (
        f" by signal {code - 128}, which may mean that there was too little memory"
        if code > 128
        else ""
    )
    print(
        f"contactopt: a rank was ended{why}; all others were stopped and nothing was written.",
        file=sys.stderr,
    )
    return code or 1


def leave(code: int) -> int:
    """Choose the exit code for mpiexec, which explains every code but 0 at length.

    Parameters
    ----------
    code : The true exit code of this rank.

    Returns
    -------
    0 where `launch` waits for the true code in a file, else the code itself.
    """
    if OUTCOME not in os.environ:
        return code
    Path(os.environ[OUTCOME]).write_text(str(code))
    return 0
