"""Checks of numbers, each with one sentence that says what is wrong, and warnings said once."""

from __future__ import annotations

import logging
import os
import weakref
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from difflib import get_close_matches
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from skfem import Mesh

RESERVED = {
    "con",
    "prn",
    "aux",
    "nul",
    *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10)),
}
LONGEST_NAME = 100  # characters
# of forces, stresses and lengths: fourth powers of others are lost to floating point
SMALLEST, LARGEST = 1e-70, 1e70
# modules whose warnings are of bodies
OF_BODIES = ("coupling.mortar", "bodies.rigid", "meshes.mesh_repair", "meshes.mesh_refinement")


def check_number(
    name: str, value: float, low: float = -np.inf, high: float = np.inf, closed: bool = False
) -> None:
    """Raise InputError, which says `name`, unless a number is in (low, high) or [low, high)."""
    try:
        good = isfinite(value) and (low <= value if closed else low < value) and value < high
    except (TypeError, ValueError, OverflowError):
        good = False
    if not good:
        bounds = []
        if low > -np.inf:
            bounds.append(f"{'at least' if closed else 'greater than'} {low:g}")
        if high < np.inf:
            bounds.append(f"less than {high:g}")
        raise InputError(
            f"{name} must be a finite number {' and '.join(bounds)}".rstrip() + f"; got {value!r}."
        )


def check_size(name: str, value: float, low: float = -LARGEST) -> None:
    """Raise InputError unless a value with a unit is in (low, LARGEST) and 0 or not tiny."""
    check_number(name, value, low, LARGEST)
    if 0 < abs(value) < SMALLEST:
        zero = "write 0, or " if low < 0 else ""
        raise InputError(
            f"{name} is {value:g}, which is too small: {zero}take units in which it is larger than"
            f" {SMALLEST:g}."
        )


def check_memory(what: str, needed: float) -> None:
    """Raise InputError if `what` needs more memory [bytes] than is free."""
    free = _free_memory()
    if needed > free:
        raise InputError(
            f"{what} needs about {needed / 1e9:.2g} GB of memory, more than the {free / 1e9:.2g} GB"
            " that are free; take fewer elements."
        )


def _free_memory() -> float:
    """What the system and the limits of this process leave [bytes]; infinite if unknown."""
    found = np.inf
    with suppress(OSError, ValueError, StopIteration):
        with open("/proc/meminfo") as file:
            found = 1024.0 * int(
                next(line for line in file if line.startswith("MemAvailable")).split()[1]
            )
        with open("/proc/self/statm") as file:
            mapped = os.sysconf("SC_PAGE_SIZE") * int(file.read().split()[0])
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        found = found if limit == resource.RLIM_INFINITY else min(found, limit - mapped)
    return found


def given(value: ArrayLike) -> bool:
    """Whether an optional array has an entry; what no array can be made of counts as given."""
    try:
        return np.size(value) > 0
    except ValueError:
        return True


def check_positive(**sizes: float) -> None:
    """Raise InputError unless every size is positive and finite. The message shows _ as a space."""
    for name, value in sizes.items():
        check_number(name.replace("_", " "), value, low=0.0)


def check_count(name: str, value: int) -> None:
    """Raise InputError unless a value is a whole number of at least 1. True and False are none."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{name} must be a whole number of at least 1; got {value!r}.")


def real_array(name: str, value: object) -> np.ndarray:
    """Copy a number, a list of any depth or an array into an array of finite floats. InputError,
    which calls the value `name`, on text, rows of different lengths, complex numbers, and numbers
    that are not finite.
    """
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(
            f"{name} must be an array of numbers; its rows have different lengths."
        ) from error
    if array.dtype.kind == "c":
        raise InputError(f"{name} must be real; got complex numbers.")
    if array.dtype.kind not in "biuf" and array.size:
        raise InputError(
            f"{name} must be an array of numbers; got {type(value).__name__} of {array.dtype}."
        )
    numbers = np.array(array, dtype=float)
    if not np.isfinite(numbers).all():
        raise InputError(f"{name} holds a number that is not finite.")
    return numbers


def check_name(what: str, name: object) -> None:
    """Raise InputError unless a name can become a file's name in a folder, and can lead to no other
    folder. The message begins with `what`, the thing that has this name.

    Refused are names that are no text, empty, longer than 100 characters, or made of dots only;
    names with a slash, a backslash, a colon or a character that cannot be printed; names that begin
    or end with a space; and the device names of Windows.
    """
    wrong = ""
    if not isinstance(name, str):
        wrong = "it must be a text"
    elif not name.strip(". "):
        wrong = "it needs at least one character besides dots and spaces"
    elif len(name) > LONGEST_NAME:
        wrong = f"it has more than {LONGEST_NAME} characters"
    elif set(name) & set("/\\:") or not name.isprintable():
        wrong = "it holds a slash, a backslash, a colon or a character that cannot be printed"
    elif name != name.strip():
        wrong = "it begins or ends with a space"
    elif name.partition(".")[0].strip().lower() in RESERVED:
        wrong = "it is reserved by an operating system"
    if wrong:
        raise InputError(f"{what} {short(name)} cannot name a file: {wrong}.")


def place_words(x: Iterable[float]) -> str:
    """Coordinates for a message, without brackets. What rounding leaves of zero is 0."""
    place = np.asarray(list(x), dtype=float)
    rounded = np.where(np.abs(place) <= 1e-9 * np.abs(place).max(), 0.0, place)
    return ", ".join(f"{c:.6g}" for c in rounded)


def short(value: object, most: int = 60) -> str:
    """Write a value as Python does, a text cut to about `most` characters."""
    text = repr(value)
    return text if len(text) <= most else f"{text[: most // 2]}...{text[-most // 4 :]}"


def meant(name: str, known: Iterable[str]) -> str:
    """The end of a sentence on an unknown name: '; did you mean ...?' or a full stop."""
    near = get_close_matches(name, known, 1)
    return f"; did you mean {near[0]!r}?" if near else "."


@contextmanager
def said_once() -> Iterator[None]:
    """Within this block a remark on a body or a pair is made once, not for each of its meshes."""
    said: set[Any] = set()

    def new(record: logging.LogRecord) -> bool:
        what = record.msg, *(record.args if isinstance(record.args, tuple) else ())[:2]
        if what in said:
            return False
        said.add(what)
        return True

    with ExitStack() as after:
        for name in OF_BODIES:
            logger = logging.getLogger(f"contactopt.{name}")
            logger.addFilter(new)
            after.callback(logger.removeFilter, new)
        yield


@contextmanager
def overheard() -> Iterator[list[str]]:
    """Collect what the package warns of within the block, each sentence once, in a list."""
    told: list[str] = []

    def hear(record: logging.LogRecord) -> None:
        if (text := record.getMessage()) not in told:
            told.append(text)
        if not others and not logging.getLogger().handlers and logging.lastResort is not None:
            logging.lastResort.handle(record)

    logger, handler = logging.getLogger("contactopt"), logging.Handler(logging.WARNING)
    others = list(logger.handlers)
    handler.emit = hear  # type: ignore[method-assign]
    logger.addHandler(handler)
    try:
        yield told
    finally:
        logger.removeHandler(handler)


_TOLD: dict[int, dict[str, str]] = {}  # by the array of its nodes: copies of a mesh share it


def remember(mesh: Mesh, told: dict[str, str]) -> Any:
    """The mesh, with remarks for every run with it, but for scenes of the kind that each names."""
    if told:
        if id(mesh.doflocs) not in _TOLD:
            weakref.finalize(mesh.doflocs, _TOLD.pop, id(mesh.doflocs), None)
        _TOLD[id(mesh.doflocs)] = told
    return mesh


def remembered(mesh: Mesh) -> dict[str, str]:
    """What was said of a mesh when it was read, with the kind of scenes that it is not for."""
    return _TOLD.get(id(getattr(mesh, "doflocs", None)), {})
