"""Files that appear complete or not at all, and one sentence for the user where they cannot be written.

Also pipes to other processes, which may be dead when one writes to them.
"""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from contactopt.checks import check_name
from contactopt.errors import InputError


def check_folder(out: Path) -> None:
    """Check that files can be put into a folder, which may not exist yet. Nothing is left behind.

    Parameters
    ----------
    out
        The folder.

    Raises
    ------
    InputError
        If the folder cannot be made or written to.
    """
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
    """Give an empty folder to write files into, which move to the folder `out` together when the block ends without an
    error.

    After an error `out` holds what it held before, and a folder that was made for it is gone.

    Parameters
    ----------
    out
        The folder where the files shall be in the end. It is made if it does not exist.
    stale
        Names of files that are removed from `out` unless the block wrote them anew.

    Yields
    ------
    Path
        The empty folder, inside `out`.

    Raises
    ------
    InputError
        Where the operating system refuses to write.
    """
    out = Path(out)
    made: list[Path] = []
    try:
        made = _make_folder(out)
        with tempfile.TemporaryDirectory(prefix=".contactopt-", dir=out) as staging:
            yield Path(staging)
            written = sorted(Path(staging).iterdir())
            for file in written:
                os.replace(file, out / file.name)
            remove_files(out, set(stale) - {file.name for file in written})
    except OSError as error:
        raise _unwritable(out, error) from error
    finally:
        _remove_empty(made)


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a path to write one file to, which replaces `path` when the block ends without an error.

    Parameters
    ----------
    path
        Where the file shall be in the end.

    Yields
    ------
    Path
        The path to write to. It has the name of `path`, from whose ending many writers take their format.

    Raises
    ------
    InputError
        Where the operating system refuses to write.
    """
    path = Path(path)
    with whole_folder(path.parent) as staging:
        yield staging / path.name


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file in a hidden folder beside `path`, then give it the name `path`.

    A symbolic link at `path` is replaced, not followed. When writing fails, the error goes on and nothing is left
    behind.

    Parameters
    ----------
    path
        Where the file shall be in the end. Its folder is made if it does not exist.
    write
        A function of a path that writes the file there. The path has the ending of `path`, from which many writers take
        their format.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".contactopt-", dir=path.parent) as staging:
        file = Path(staging) / path.name
        write(file)
        os.replace(file, path)


def _unwritable(out: Path, error: OSError) -> InputError:
    return InputError(f"cannot write into '{out}': {error.strerror or error}; choose another output directory.")


def _make_folder(folder: Path) -> list[Path]:
    """Make the folder and those above it; the ones that were missing, innermost first, for remove_empty."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def _remove_empty(folders: Iterable[Path]) -> None:
    """Remove those of the folders that hold nothing."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def remove_files(folder: Path, names: Iterable[str]) -> None:
    """Remove the files of these names from a folder. All other files stay.

    A symbolic link is removed itself, and what it leads to stays. Names of files that do not exist are passed over.

    Parameters
    ----------
    folder
        The folder.
    names
        The names of the files, without any folder.

    Raises
    ------
    InputError
        On a name that could lead to another folder.
    """
    for name in names:
        check_name("the file", name)
        with suppress(FileNotFoundError, NotADirectoryError):
            (folder / name).unlink()


@contextmanager
def broken_pipe_is_an_error() -> Iterator[None]:
    """Let writing to a dead process raise an exception, as Python has it, also where a library changed that.

    Gmsh, for one, sets the signal of a broken pipe back to its default, which ends the whole process without a word.

    Returns
    -------
    context manager
        Within it, a broken pipe raises BrokenPipeError.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGPIPE})
    try:
        yield
    finally:
        signal.sigtimedwait({signal.SIGPIPE}, 0)
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
