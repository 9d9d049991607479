"""Files of a campaign and of reports: written whole or not at all, and never outside the folder
that the user gave.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from contactopt.checks import check_name
from contactopt.errors import InputError


def subfolder(parent: Path, name: str) -> Path:
    """Name a folder inside another. It need not exist.

    Parameters
    ----------
    parent : The folder that the user gave.
    name : The name of the folder in it.

    Returns
    -------
    parent/name.

    Raises
    ------
    InputError : If the name can lead out of `parent`.
    """
    check_name("the name", name)
    return parent / name


@contextmanager
def told(place: Path, advice: str = "choose another directory") -> Iterator[None]:
    """Turn an OSError within the block, as of a full disk, into one sentence with what to do.

    Parameters
    ----------
    place : Where something is written.
    advice : What to do.

    Yields
    ------
    Nothing.

    Raises
    ------
    InputError : Where the block raises an OSError.
    """
    try:
        yield
    except OSError as error:
        raise InputError(
            f"cannot write into '{place}': {error.strerror or error}; {advice}."
        ) from error
