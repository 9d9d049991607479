"""Tables of an experiment file or of a test set, whose lists and ranges are multiplied out."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from contactopt.checks import check_number, short
from contactopt.errors import InputError
from contactopt.files.toml_table import Table


class Entries:
    """Expands the tables below the keys of one file.

    absent  (key, name, values, why) of each optional entry that is left out
    """

    def __init__(self, table: Table):
        self.table = table
        self.absent: list[tuple[str, str, dict[str, Any], str]] = []

    def expanded(self, key: str, kinds: Sequence[str], make: Callable[..., list[Any]]) -> list[Any]:
        """What `make` makes of every combination of the entries below a key, of these kinds."""
        made: list[Any] = []
        for index, entry in enumerate(self.table.data[key]):
            own = [kind for kind in kinds if isinstance(entry, dict) and kind in entry]
            if len(own) != 1:
                what = f"one of {', '.join(kinds)}" if len(kinds) > 1 else f"the key '{kinds[0]}'"
                raise self.table.fail(f"a {key[:-1]} needs {what}.", key, index)
            for name, values in self.combinations(key, index, entry, own[0]):
                try:
                    made += make(own[0], name, values)
                except (ValueError, TypeError, ArithmeticError) as error:  # InputError, too
                    if not entry.get("optional"):
                        message = f"{str(error).rstrip('.')}."
                        culprit = _blamed(message, entry, own[0])
                        raise self.table.fail(message, key, index, culprit) from error
                    self.absent.append((key, name, values, str(error)))
        if twice := twice_in(getattr(one, "spec", one).label for one in made):
            raise self.table.fail(f"two {key} are called {twice!r}.", key)
        return made

    def combinations(
        self, table: str, index: int, entry: Mapping[str, Any], kind: str
    ) -> Iterator[tuple[str, dict[str, Any]]]:
        """(name, parameters) of every combination of the entry's lists and ranges."""
        names = entry[kind] if isinstance(entry[kind], list) else [entry[kind]]
        rest = {key: value for key, value in entry.items() if key not in (kind, "optional")}
        choices = []
        for key, value in rest.items():
            with self.table.about(table, index, key):
                choices.append(_values_of(key, value))
        for name, *values in product(names, *choices):
            if not isinstance(name, str):
                raise self.table.fail(f"'{kind}' must be a name.", table, index, kind)
            yield name, dict(zip(rest, values))


def twice_in(texts: Iterable[str]) -> str:
    """The first text that occurs twice, or none."""
    return next((text for text, n in Counter(texts).items() if n > 1), "")


def _blamed(message: str, entry: Mapping[str, Any], kind: str) -> str:
    """The key of an entry that is wrong: the message names it, or its value, first."""
    places = {}
    for key, value in entry.items():
        words = [key, *(v for v in np.atleast_1d(value) if isinstance(v, str))]
        found = [re.search(rf"\b{re.escape(word)}\b", message) for word in words]
        starts = [match.start() for match in found if match]
        if starts and key != kind:
            places[key] = min(starts)
    return min(places, key=places.__getitem__, default=kind)


def size_of(value: object) -> int:
    """How many values a list or a range stands for, without making them."""
    if isinstance(value, dict):
        steps = value.get("steps")
        return steps if isinstance(steps, int) and steps > 0 else 1
    return len(value) if isinstance(value, list) else 1


def _values_of(name: str, value: object) -> list[Any]:
    """One value, a list of them, or a range {from, to, steps, scale = "linear" or "log"}."""
    if isinstance(value, dict):
        return _range_of(name, value)
    if isinstance(value, list) and not value:
        raise InputError(f"the list '{name}' is empty.")
    values = value if isinstance(value, list) else [value]
    for one in values:
        large = isinstance(one, int) and abs(one) >= 2**63  # of whole numbers, as in TOML
        if not isinstance(one, str | int | float) or large:
            raise InputError(
                f"a value of '{name}' must be a text, a number, true or false; got {short(one)}."
            )
    return values


def _range_of(name: str, value: Mapping[str, Any]) -> list[Any]:
    if not {"from", "to", "steps"} <= set(value) <= {"from", "to", "steps", "scale"}:
        raise InputError(f"the range '{name}' needs from, to, steps, and may have scale = \"log\".")
    low, high, steps = value["from"], value["to"], value["steps"]
    scale = value.get("scale", "linear")
    if scale not in ("linear", "log") or not isinstance(steps, int) or steps < 1:
        raise InputError(
            f'the range \'{name}\' needs whole steps >= 1 and scale "linear" or "log".'
        )
    for key in ("from", "to"):
        check_number(f"'{key}' of the range '{name}'", value[key])
    if scale == "log" and not (low > 0 and high > 0):
        raise InputError(f"the logarithmic range '{name}' needs bounds above 0.")
    spaced = np.geomspace if scale == "log" else np.linspace
    numbers = [float(f"{x:.6g}") for x in spaced(low, high, steps)]
    if isinstance(low, int) and isinstance(high, int):
        return list(dict.fromkeys(round(x) for x in numbers))
    return numbers
