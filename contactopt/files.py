"""Files that appear complete or not at all, and one sentence for the user where they cannot be written."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from contactopt.errors import InputError


def check_folder(out: Path) -> None:
    """Raise InputError unless files can be put into the folder `out`, which may not exist yet. It leaves nothing behind."""
    existing = out
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    try:
        if not existing.is_dir():
            raise NotADirectoryError(f"{existing} is not a directory")
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        raise _unwritable(out, error) from error


@contextmanager
def whole_folder(out: str | Path) -> Iterator[Path]:
    """An empty folder to write files into, which move to the folder `out` together when the block ends without an error.

    After an error `out` holds what it held before. Raises InputError where the operating system refuses to write.
    """
    out = Path(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".contactopt-", dir=out) as staging:
            yield Path(staging)
            for file in Path(staging).iterdir():
                os.replace(file, out / file.name)
    except OSError as error:
        raise _unwritable(out, error) from error


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A path beside `path` to write one file to, which replaces `path` when the block ends without an error.

    It has the ending of `path`, from which many writers take their format. Raises InputError where the operating system
    refuses to write.
    """
    path = Path(path)
    with whole_folder(path.parent) as staging:
        yield staging / path.name


def _unwritable(out: Path, error: OSError) -> InputError:
    return InputError(f"cannot write into '{out}': {error.strerror or error}; choose another output directory.")
