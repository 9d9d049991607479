"""Ranks started by the command line itself, and watched until they end."""

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
from contactopt.linear.concurrency import cores
from contactopt.scenes.scene import Scene

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
    The exit code of rank 0. Where it left none, a rank ended before the work was done, and mpiexec
    ended the others.

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
    command = [*mpiexec(ranks), sys.executable, "-m", "contactopt", *arguments]
    with tempfile.TemporaryDirectory() as folder:
        outcome = Path(folder) / "exit code"
        own = {OUTCOME: str(outcome)}
        code = _watched(command, dict.fromkeys(ONE_THREAD, "1") | dict(os.environ) | own)
        if outcome.exists():
            return int(outcome.read_text())
    why = f" by signal {code - 128}, which may mean that there was too little memory"
    _tell(
        f"a rank was ended{why if code > 128 else ''}; all others were stopped and nothing was"
        " written."
    )
    return code or 1


def _tell(sentence: str) -> None:
    print(f"contactopt: {sentence}", file=sys.stderr)


def _watched(command: list[str], environment: dict[str, str]) -> int:
    """The exit code of mpiexec; a rank that was stopped is waited for, and ended after PATIENCE."""
    import psutil

    since: dict[int, float] = {}  # number of a stopped process -> when that was first seen
    with subprocess.Popen(command, env=environment) as process:
        try:
            while True:
                with suppress(subprocess.TimeoutExpired):
                    return process.wait(BEAT)
                with suppress(psutil.NoSuchProcess):
                    for rank in psutil.Process(process.pid).children(recursive=True):
                        if rank.status() != psutil.STATUS_STOPPED:
                            since.pop(rank.pid, None)
                        elif rank.pid not in since:
                            since[rank.pid] = time.monotonic()
                            _tell(
                                f"a rank (process {rank.pid}) was stopped and all others wait for"
                                f" it; go on with 'kill -CONT {rank.pid}', or it is ended in"
                                f" {PATIENCE:g} s."
                            )
                        elif time.monotonic() - since[rank.pid] > PATIENCE:
                            rank.kill()
        except BaseException:
            process.kill()
            raise


def mpiexec(ranks: int) -> list[str]:
    """The beginning of a command on several ranks; InputError without MPI, or beyond PER_CORE."""
    check_count("the number of ranks", ranks)
    here = cores()
    if ranks > PER_CORE * here:
        raise InputError(
            f"{ranks} ranks are too many for {count(here, 'core')}; take {PER_CORE * here} at most,"
            f" better {here}."
        )
    beside = shutil.which("mpiexec", path=str(Path(sys.executable).parent))
    program = beside or shutil.which("mpiexec")
    if program is None or find_spec("mpi4py") is None or find_spec("psutil") is None:
        raise InputError("ranks need mpi4py, psutil and mpiexec: pip install 'contactopt[mpi]'.")
    shared = ["--oversubscribe", "--bind-to", "none"]
    placed = ["--bind-to", "core", "--map-by", "core"] if ranks <= here else shared
    # whoever is root runs this as root
    root = ["--allow-run-as-root"] if getattr(os, "geteuid", lambda: 1)() == 0 else []
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
    bodies = len(scene.meshed)
    if ranks > max(bodies, 1):
        have = f"only {count(bodies, 'elastic body', 'elastic bodies')}"
        raise InputError(
            f"scene '{scene.name}' has {have}, and each rank needs one; take {max(bodies, 1)} of"
            f" the {ranks} ranks."
        )


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
