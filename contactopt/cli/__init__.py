"""The command line.

Exit codes: 0 done (run: solved, and to the accuracy asked for), 1 not solved, 2 input that cannot
be used, 130 interrupted.
"""

import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module

from contactopt.cli.parser import make_parser
from contactopt.errors import InputError

__all__ = ["main", "make_parser"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line with these arguments, by default those of the process; the exit code."""
    told = sys.argv[1:] if arguments is None else list(arguments)
    options = make_parser().parse_args(told)
    with _logging(options.verbose, options.quiet):
        return _answered(lambda: _command(options.command)(options))


def _command(name: str) -> Callable[..., int]:
    """The function of a command: the rooms that it needs are imported only now."""
    home = "test_set" if name == "problems" else "commands"
    function: Callable[..., int] = getattr(import_module(f"contactopt.cli.{home}"), name)
    return function


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


@contextmanager
def _logging(verbose: int, quiet: bool) -> Iterator[None]:
    """-v sends the package's steps to the standard error, twice details; -q leaves errors only."""
    logger = logging.getLogger("contactopt")
    before, handler = logger.level, logging.StreamHandler()
    handler.setFormatter(logging.Formatter("  %(name)s: %(message)s"))
    if quiet:  # what is not printed is still a remark of the summary
        handler.setLevel(logging.ERROR)
    elif verbose:
        logger.setLevel(logging.INFO if verbose == 1 else logging.DEBUG)
    if verbose or quiet:
        logger.addHandler(handler)
    try:
        yield
    finally:
        logger.setLevel(before)
        logger.removeHandler(handler)
