"""Files that appear complete or not at all, and one sentence for the user where they cannot be
written.

Also pipes to other processes, which may be dead when one writes to them.
"""

import math
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from contactopt.checks import check_name
from contactopt.errors import InputError

OLD = 86400.0  # s after which a hidden folder was left behind by a program that was killed


def finite(value: Any) -> Any:
    """The same tables and lists with None for every number that is not finite, as JSON has it."""
    if isinstance(value, dict):
        return {key: finite(own) for key, own in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(own) for own in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def check_folder(out: Path) -> None:
    """Raise InputError unless files can be put into a folder, which may not exist yet."""
    existing = out
    try:
        while not existing.exists() and existing != existing.parent:
            existing = existing.parent
        if not existing.is_dir():
            raise NotADirectoryError(f"{existing} is not a directory")
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        raise _unwritable(out, error) from error


@contextmanager
def whole_folder(out: str | Path, stale: Iterable[str] = ()) -> Iterator[Path]:
    """Give an empty folder to write files into, which move to the folder `out` together when the
    block ends without an error.

    After an error `out` holds what it held before, and a folder that was made for it is gone. Files
    named in `stale` are removed from `out` unless the block wrote them again. InputError where the
    operating system refuses to write.
    """
    out = Path(out)
    missing = [path for path in (out, *out.parents) if not path.exists()]  # innermost first
    try:
        out.mkdir(parents=True, exist_ok=True)
        with _staging(out) as staging:
            yield staging
            with _ctrl_c_waits():
                written = sorted(staging.iterdir())
                for file in written:
                    os.replace(file, out / file.name)
                remove_files(out, set(stale) - {file.name for file in written})
    except OSError as error:
        raise _unwritable(out, error) from error
    finally:
        for folder in missing:
            with suppress(OSError):  # it holds something
                folder.rmdir()


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a path to write one file to, which replaces `path` when the block ends without an error.
    It has the same name, from whose ending many writers take their format.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"cannot write '{path}': it is a folder; choose the name of a file.")
    with whole_folder(path.parent) as staging:
        yield staging / path.name


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Replace a file by one that the function `write` writes to the path it is given, of the same
    name.

    The folder is made if it does not exist. An error of writing goes on, and nothing is left
    behind. A symbolic link is replaced, not followed.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with _staging(path.parent) as staging:
        write(staging / path.name)
        os.replace(staging / path.name, path)


@contextmanager
def _staging(folder: Path) -> Iterator[Path]:
    """A hidden folder for files to come. Those of killed programs are removed once they are OLD."""
    for old in folder.glob(".contactopt-*"):
        with suppress(OSError):
            if time.time() - old.stat().st_mtime > OLD:
                shutil.rmtree(old)
    staging = None
    try:
        with _ctrl_c_waits():
            staging = tempfile.mkdtemp(prefix=".contactopt-", dir=folder)
        yield Path(staging)
    finally:
        if staging is not None:
            with _ctrl_c_waits():
                shutil.rmtree(staging, ignore_errors=True)


@contextmanager
def _ctrl_c_waits() -> Iterator[None]:
    """An interrupt within this block is heeded when it ends, in Python's main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    pressed: list[int] = []
    heed = signal.signal(signal.SIGINT, lambda number, frame: pressed.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, heed or signal.SIG_DFL)
        if pressed:
            signal.raise_signal(signal.SIGINT)


def _unwritable(out: Path, error: OSError) -> InputError:
    return InputError(
        f"cannot write into '{out}': {error.strerror or error}; choose another output directory."
    )


def remove_files(folder: Path, names: Iterable[str]) -> None:
    """Remove the files of these names from a folder. InputError on a name that could lead to
    another one.

    A symbolic link is removed itself, and what it leads to stays. Files that do not exist are
    passed over.
    """
    for name in names:
        check_name("the file", name)
        with suppress(FileNotFoundError, NotADirectoryError):
            (folder / name).unlink()


@contextmanager
def quiet() -> Iterator[None]:
    """Within this block nothing is printed, not even by libraries that bypass Python."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(place) for place in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for place in (1, 2):
            os.dup2(nowhere, place)
        yield
    finally:
        for place, own in zip((1, 2), kept):
            os.dup2(own, place)
        for own in (*kept, nowhere):
            os.close(own)


@contextmanager
def broken_pipe_is_an_error() -> Iterator[None]:
    """Within this block writing to a dead process raises BrokenPipeError, as Python has it, also
    where a library changed that. Gmsh, for one, lets the signal of a broken pipe end the whole
    process without a word.
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
