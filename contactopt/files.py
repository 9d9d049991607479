"""Files that appear complete or not at all, and one sentence for the user where they cannot be written."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from contactopt.checks import check_name
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
def whole_folder(out: str | Path, stale: Iterable[str] = ()) -> Iterator[Path]:
    """An empty folder to write files into, which move to the folder `out` together when the block ends without an error.

    The files in `out` whose names are in `stale` and that the block did not write are removed then. After an error `out`
    holds what it held before, and a folder that was made for it is gone. Raises InputError where the operating system
    refuses to write.
    """
    out = Path(out)
    made: list[Path] = []
    try:
        made = make_folder(out)
        with tempfile.TemporaryDirectory(prefix=".contactopt-", dir=out) as staging:
            yield Path(staging)
            written = sorted(Path(staging).iterdir())
            for file in written:
                os.replace(file, out / file.name)
            remove_files(out, set(stale) - {file.name for file in written})
    except OSError as error:
        raise _unwritable(out, error) from error
    finally:
        remove_empty(made)


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A path to write one file to, which replaces `path` when the block ends without an error.

    It has the ending of `path`, from which many writers take their format. Raises InputError where the operating system
    refuses to write.
    """
    path = Path(path)
    with whole_folder(path.parent) as staging:
        yield staging / path.name


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file in a hidden folder beside `path`, then give it the name `path`.

    The file has the ending of `path`, from which many writers take their format. A symbolic link at `path` is replaced, not
    followed. When writing fails, the error goes on and nothing is left behind.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".contactopt-", dir=path.parent) as staging:
        file = Path(staging) / path.name
        write(file)
        os.replace(file, path)


def _unwritable(out: Path, error: OSError) -> InputError:
    return InputError(f"cannot write into '{out}': {error.strerror or error}; choose another output directory.")


def make_folder(folder: Path) -> list[Path]:
    """Make the folder and those above it; the ones that were missing, innermost first, for remove_empty."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def remove_empty(folders: Iterable[Path]) -> None:
    """Remove those of the folders that hold nothing."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def remove_files(folder: Path, names: Iterable[str]) -> None:
    """Remove the files of these names in the folder; links themselves and not what they lead to; other files stay."""
    for name in names:
        check_name("the file", name)
        with suppress(FileNotFoundError, NotADirectoryError):
            (folder / name).unlink()
