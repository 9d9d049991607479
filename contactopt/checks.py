"""Checks of numbers that a user gives, each with one sentence that says what is wrong."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np

from contactopt.errors import InputError

RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))}
LONGEST_NAME = 100  # characters


def check_number(name: str, value: float, low: float = -np.inf, high: float = np.inf, closed: bool = False) -> None:
    """Raise InputError unless value is a finite number in (low, high), or in [low, high) when `closed`."""
    try:
        good = isfinite(value) and (low <= value if closed else low < value) and value < high
    except TypeError:
        good = False
    if not good:
        bounds = []
        if low > -np.inf:
            bounds.append(f"{'at least' if closed else 'greater than'} {low:g}")
        if high < np.inf:
            bounds.append(f"less than {high:g}")
        raise InputError(f"{name} must be a finite number {' and '.join(bounds)}".rstrip() + f"; got {value!r}.")


def check_positive(**sizes: float) -> None:
    """Raise InputError unless every size is a positive finite number."""
    for name, value in sizes.items():
        check_number(name.replace("_", " "), value, low=0.0)


def check_count(name: str, value: int) -> None:
    """Raise InputError unless the value is a whole number of at least 1."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{name} must be a whole number of at least 1; got {value!r}.")


def real_array(name: str, value: Any) -> np.ndarray:
    """A copy of the value as an array of finite floats; InputError on text, ragged lists, complex or missing numbers."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"{name} must be an array of numbers; its rows have different lengths.") from error
    if array.dtype.kind == "c":
        raise InputError(f"{name} must be real; got complex numbers.")
    if array.dtype.kind not in "biuf" and array.size:
        raise InputError(f"{name} must be an array of numbers; got {type(value).__name__} of {array.dtype}.")
    numbers = np.array(array, dtype=float)
    if not np.all(np.isfinite(numbers)):
        raise InputError(f"{name} holds a number that is not finite.")
    return numbers


def check_name(what: str, name: object) -> None:
    """Raise InputError unless the name can become a file's name in a folder, and can lead to no other folder.

    Refused are names that are no text, empty, longer than 100 characters, or made of dots only; names with a slash, a
    backslash, a colon or a character that cannot be printed; names that begin or end with a space; and the device
    names of Windows.
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


def short(value: object, most: int = 60) -> str:
    """The value as Python writes it, with its middle left out if that is longer than `most` characters."""
    text = repr(value)
    return text if len(text) <= most else f"{text[: most // 2]}...{text[-most // 4 :]}"
