"""Files of a campaign and of reports: written whole or not at all, and never outside the folder that the user gave."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from contactopt.checks import check_name
from contactopt.errors import InputError

RUN_FILES = ("deformed.png", "pressure.png", "path.png", "interface.npz", "history.csv", "path.npz")


def subfolder(parent: Path, name: str) -> Path:
    """The folder parent/name. It need not exist.

    Raises InputError if the name can lead out of `parent`, or if it is a symbolic link there: the folder behind a link
    was not given by the user, so nothing is written or removed in it.
    """
    check_name("the name", name)
    folder = parent / name
    if folder.is_symlink():
        raise InputError(
            f"'{folder}' is a symbolic link, which is not followed; remove it or choose another directory."
        )
    return folder


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file in the same folder, then give it the name `path`.

    A symbolic link at `path` is replaced, not followed. When writing fails, nothing is left behind.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=".contactopt-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    try:
        write(Path(name))
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(name)
        raise


def remove_files(folder: Path, names: Iterable[str]) -> None:
    """Remove the files of these names in the folder; links themselves and not what they lead to; other files stay."""
    for name in names:
        check_name("the file", name)
        with suppress(FileNotFoundError, NotADirectoryError):
            (folder / name).unlink()


def earlier_files(folder: Path) -> set[str]:
    """Names of the files that an earlier `contactopt run` wrote into the folder; empty where none has run.

    A folder in which one has run holds its summary.json. Its other files have fixed names, but for one VTU file per body:
    those are told from other people's by the field von_mises in them.
    """
    with suppress(OSError, ValueError, TypeError):
        if "contact_nodes" in json.loads(_plain_text(folder / "summary.json")):
            fields = {file.name for file in folder.glob("*.vtu") if '"von_mises"' in _plain_text(file)}
            return fields | {name for name in RUN_FILES if (folder / name).exists()}
    return set()


def _plain_text(file: Path) -> str:
    """What a regular file holds; nothing for links and devices."""
    return "" if file.is_symlink() or not file.is_file() else file.read_text(errors="replace")


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


@contextmanager
def told(place: Path, advice: str = "choose another directory") -> Iterator[None]:
    """Turn an OSError within the block, as of a full disk, into one sentence with what to do."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot write into '{place}': {error.strerror or error}; {advice}.") from error
