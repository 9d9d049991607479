"""What plug-ins declare: names, laws and arguments.

Read in a process of its own, where they may fail or hang.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from contactopt.benchmark.plugins import Registry
from contactopt.benchmark.process import Ended, Process
from contactopt.errors import InputError
from contactopt.methods import METHODS

LIMIT = 120.0  # s to load all plug-ins


@dataclass(frozen=True)
class Declared:
    """A plug-in method without its code: its law, whether it iterates, and its arguments."""

    law: str
    iterates: bool
    arguments: inspect.Signature


@dataclass(frozen=True)
class Catalogue:
    """methods and problems that plug-ins declare, by name."""

    methods: Mapping[str, Declared] = field(default_factory=dict)
    problems: Mapping[str, inspect.Signature] = field(default_factory=dict)


def read_catalogue(paths: Sequence[str], names: Sequence[str]) -> Catalogue:
    """Read what plug-in files declare, and the entry points among names of methods, in a process of
    its own.

    Parameters
    ----------
    paths : The plug-in files.
    names : The methods that the experiment names.

    Returns
    -------
    Methods and problems with their laws and arguments.

    Raises
    ------
    InputError : If a plug-in fails, hangs or ends the process. The message names the file.
    """
    asked = [name for name in dict.fromkeys(names) if name not in METHODS]
    if not paths and not asked:
        return Catalogue()
    from contactopt.benchmark.worker import inspect as look

    process = Process()
    try:
        found: Catalogue | str = process.ask(LIMIT, "load", look, tuple(paths), asked)
    except Ended as end:
        where = ", ".join(f"'{path}'" for path in paths) or "entry points"
        raise InputError(
            f"plug-ins ({where}) could not be loaded: {end.status}, {end.message}."
        ) from end
    finally:
        process.kill()
    if isinstance(found, str):
        raise InputError(found)
    return found


def declared(plugins: Registry, names: Sequence[str]) -> Catalogue:
    """List what loaded plug-ins declare, and the entry points of these names."""
    for name in names:
        plugins.find(name)
    return Catalogue(
        {
            p.name: Declared(p.law, p.iterates, arguments_of(p.make))
            for p in plugins.methods.values()
        },
        {name: arguments_of(make) for name, make in plugins.problems.items()},
    )


def arguments_of(function: Callable[..., Any]) -> inspect.Signature:
    """The arguments of a function or class, each with None for its default value and without types."""
    empty = inspect.Parameter.empty
    parameters = [
        own.replace(annotation=empty, default=empty if own.default is empty else None)
        for own in inspect.signature(function).parameters.values()
    ]
    return inspect.Signature(parameters)
