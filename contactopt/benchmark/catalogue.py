"""What plug-ins declare: names, laws and arguments. Read in a process of its own, so that no plug-in runs in the campaign's.

The campaign's process certifies the answers. A plug-in that changes the library where it is loaded changes nothing there.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from contactopt.benchmark.plugins import LAWS, Registry
from contactopt.benchmark.process import START, Ended, Process
from contactopt.errors import InputError
from contactopt.solving.methods import METHODS

LIMIT = 120.0  # s to load all plug-ins
LONGEST = 10e6  # bytes of a catalogue
P = inspect.Parameter
KINDS = (P.POSITIONAL_ONLY, P.POSITIONAL_OR_KEYWORD, P.VAR_POSITIONAL, P.KEYWORD_ONLY, P.VAR_KEYWORD)
Arguments = tuple[tuple[str, int, bool], ...]  # (name, index in KINDS, whether it has a default)


@dataclass(frozen=True)
class Declared:
    """A plug-in method without its code: its law, whether it iterates, and its arguments."""

    law: str
    iterates: bool
    arguments: Arguments

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(name for name, _, _ in self.arguments)


@dataclass(frozen=True)
class Catalogue:
    """methods and problems that plug-ins declare, by name."""

    methods: Mapping[str, Declared] = field(default_factory=dict)
    problems: Mapping[str, Arguments] = field(default_factory=dict)


def read_catalogue(paths: Sequence[str], names: Sequence[str]) -> Catalogue:
    """Read what plug-in files declare, and the entry points among names of methods, in a process of its own.

    Parameters
    ----------
    paths
        The plug-in files.
    names
        The methods that the experiment names.

    Returns
    -------
    Catalogue
        Methods and problems with their laws and arguments.

    Raises
    ------
    InputError
        If a plug-in fails, hangs or ends the process. The message names the file.
    """
    asked = [name for name in dict.fromkeys(names) if name not in METHODS]
    if not paths and not asked:
        return Catalogue()
    process = Process("inspect")
    try:
        found = process.ask((tuple(paths), asked), {START: LIMIT}, LONGEST)
    except Ended as end:
        where = ", ".join(f"'{path}'" for path in paths) or "entry points"
        raise InputError(f"plug-ins ({where}) could not be loaded: {end.status}, {end.message}.") from end
    finally:
        process.close()
    if isinstance(found, dict) and "error" in found:
        raise InputError(str(found["error"]))
    try:
        methods = {
            str(name): Declared(LAWS[LAWS.index(law)], bool(iterates), _checked(arguments))
            for name, (law, iterates, arguments) in found["methods"].items()
        }
        return Catalogue(methods, {str(name): _checked(arguments) for name, arguments in found["problems"].items()})
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise InputError("plug-ins declared something that cannot be read.") from error


def _checked(arguments: Any) -> Arguments:
    return tuple((str(name), KINDS.index(KINDS[kind]), bool(default)) for name, kind, default in arguments)


def bind(arguments: Arguments, *values: Any, **given: Any) -> None:
    """Check that values fit the arguments of a plug-in.

    Parameters
    ----------
    arguments
        What the plug-in declared.
    values, given
        Arguments by their place and by their name.

    Raises
    ------
    TypeError
        If they do not, as from the call itself.
    """
    parameters = [P(name, KINDS[kind], default=None if default else P.empty) for name, kind, default in arguments]
    inspect.Signature(parameters).bind(*values, **given)


def arguments_of(function: Callable[..., Any]) -> Arguments:
    """List the arguments of a function as plain data.

    Parameters
    ----------
    function
        Any function or class.

    Returns
    -------
    tuple
        For each argument its name, the number of its kind in KINDS, and whether it has a default.
    """
    parameters = inspect.signature(function).parameters.values()
    return tuple((p.name, KINDS.index(p.kind), p.default is not P.empty) for p in parameters)


def declare(paths: Sequence[str], names: Sequence[str]) -> dict[str, Any]:
    """Load plug-ins and list what they declare. It runs in the process of its own.

    Parameters
    ----------
    paths
        The plug-in files.
    names
        The methods to look for among the entry points.

    Returns
    -------
    dict
        'methods' and 'problems' as plain data, or 'error' with a sentence if a plug-in fails.
    """
    try:
        plugins = Registry()
        plugins.load(paths)
        for name in names:
            plugins.find(name)
        return {
            "methods": {p.name: (p.law, p.iterates, arguments_of(p.make)) for p in plugins.methods.values()},
            "problems": {name: arguments_of(make) for name, make in plugins.problems.items()},
        }
    except InputError as error:
        return {"error": str(error)}
    except (Exception, SystemExit) as error:
        return {"error": f"a plug-in cannot be used: {type(error).__name__}: {error}"}
