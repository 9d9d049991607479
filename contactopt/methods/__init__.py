"""Methods: one file each, one line here. Nothing is imported before it is used.

A method is a frozen dataclass whose fields are its settings. `iterate(problem)` takes a dimensionless
InterfaceProblem and yields (reactions (k, dim), multipliers (p,)) after each outer iteration; the driver
(contactopt.solve) owns the clock, the stopping rule, the history and the limits.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import Any, Protocol

import numpy as np

from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem


class Method(Protocol):
    def iterate(self, problem: InterfaceProblem) -> Iterator[tuple[np.ndarray, np.ndarray]]: ...

    def backends(self, dim: int) -> tuple[str, str]:
        """Names of the normal and tangential backend in `dim` dimensions; InputError if one cannot be used."""


# name -> (module, class, what it is)
METHODS = {
    "alternating": (
        "contactopt.methods.alternating",
        "Alternating",
        "normal QP and tangential QP or SOCP in turn (paper, 5.1)",
    ),
}


def find_method(name: str, **settings: Any) -> Method:
    """The method of that name with its settings; InputError if there is no such method or setting."""
    if name not in METHODS:
        raise InputError(f"unknown method {name!r}; choose from {', '.join(METHODS)}.")
    module, cls, _ = METHODS[name]
    try:
        method: Method = getattr(import_module(module), cls)(**settings)
    except TypeError as error:
        raise InputError(f"method '{name}': {error}.") from error
    return method
