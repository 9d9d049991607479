"""The command line.

Exit codes: 0 done (run: solved, and to the accuracy asked for), 1 not solved, 2 input that cannot
be used, 130 interrupted.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from contactopt.bodies.launch import check_bodies, launch, leave
from contactopt.bodies.ranks import Team, serve, world
from contactopt.cli.commands import run, scene_asked
from contactopt.cli.parser import make_parser
from contactopt.errors import InputError

__all__ = ["main", "make_parser"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line with these arguments, by default those of the process; the exit code."""
    told = sys.argv[1:] if arguments is None else list(arguments)
    options = make_parser().parse_args(told, argparse.Namespace(team=None, ranks=None))
    with _logging(options.verbose, options.quiet):
        return _answered(lambda: _execute(options, told))


def _answered(command: Callable[[], int]) -> int:
    """The exit code of a command; what ends it is said in one sentence."""
    try:
        return int(command())
    except InputError as error:
        return _refused(str(error))
    except MemoryError as error:
        why = f" ({error})" if str(error) else ""
        return _refused(f"this needs more memory than there is{why}; take fewer elements.")
    except BrokenPipeError:
        raise
    except OSError as error:  # a name that no file can have, a disk that is gone
        return _refused(f"cannot use '{error.filename}': {error.strerror or error}.")
    except KeyboardInterrupt:
        return _refused("interrupted", 130)


def _refused(why: str, code: int = 2) -> int:
    print(f"contactopt: {why}", file=sys.stderr)
    return code


def _execute(options: argparse.Namespace, told: list[str]) -> int:
    """One command; where mpiexec started several ranks, rank 0 executes it and the others serve."""
    if (comm := world()) is None:
        if options.ranks is not None:
            check_bodies(scene_asked(options), options.ranks)  # before any of them is started
        if options.ranks not in (None, 1):
            return launch(options.ranks, told)
        return int(options.command(options))
    if comm.rank:
        serve(comm)
        return 0
    options.team = Team(comm)
    try:
        return leave(_answered(lambda: _on_ranks(options)))
    finally:
        options.team.dismiss()


def _on_ranks(options: argparse.Namespace) -> int:
    if options.command is not run:
        raise InputError(
            "only the command 'run' uses several ranks; start the others without mpiexec."
        )
    if options.ranks not in (None, options.team.size):
        raise InputError(
            f"--ranks {options.ranks} was asked for, but mpiexec started {options.team.size} ranks."
        )
    check_bodies(scene_asked(options), options.team.size)
    return run(options)


@contextmanager
def _logging(verbose: int, quiet: bool) -> Iterator[None]:
    """-v sends what the package logs to the standard error: once its steps, twice also their
    details. -q leaves errors only.
    """
    logger = logging.getLogger("contactopt")
    before, handler = logger.level, logging.StreamHandler()
    handler.setFormatter(logging.Formatter("  %(name)s: %(message)s"))
    if verbose or quiet:
        logger.setLevel(logging.ERROR if quiet else logging.INFO if verbose == 1 else logging.DEBUG)
    if verbose:
        logger.addHandler(handler)
    try:
        yield
    finally:
        logger.setLevel(before)
        logger.removeHandler(handler)
