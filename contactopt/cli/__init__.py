"""The command line.

Exit codes: 0 done (run: solved, and to the accuracy asked for), 1 not solved, 2 input that cannot be used, 130 interrupted.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from contactopt.cli.parser import make_parser
from contactopt.errors import InputError

__all__ = ["main", "make_parser"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code: 0 solved, 1 not solved, 2 bad input."""
    options = make_parser().parse_args(arguments)
    with _logging(options.verbose, options.quiet):
        try:
            return int(options.command(options))
        except InputError as error:
            print(f"contactopt: {error}", file=sys.stderr)
            return 2
        except MemoryError:
            print("contactopt: this needs more memory than there is; take fewer elements.", file=sys.stderr)
            return 2
        except KeyboardInterrupt:
            print("contactopt: interrupted", file=sys.stderr)
            return 130


@contextmanager
def _logging(verbose: int, quiet: bool) -> Iterator[None]:
    """-v sends what the package logs to the standard error: once its steps, twice also their details. -q leaves errors only."""
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
