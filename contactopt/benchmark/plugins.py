"""Methods and problems of the user: decorated in a file, or entry points of a package.

The campaign's process runs the file, to know what it declares; the functions are called in workers
only.
"""

import hashlib
import inspect
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from contactopt.benchmark.peers import Peer
from contactopt.errors import InputError
from contactopt.methods import METHODS

GROUP = "contactopt.methods"  # of entry points
MARK = "_contactopt"  # attribute of what a file declares: table of the registry, name, entry
# to a plug-in, if it has such an argument
PASSED = ("tol", "time_limit", "max_iterations")


@dataclass(frozen=True)
class Plugin:
    """make: a function problem -> answer, or a class whose objects have `iterate`
    (contactopt.methods.method.Method). `peer` is the external solver that it calls, if any.
    """

    name: str
    make: Callable[..., Any]
    peer: Peer | None = None

    @property
    def version(self) -> str:
        """The version of its peer, '' without one; InputError if the peer is not installed."""
        return "" if self.peer is None else f"{self.peer.name} {self.peer.found()[1]}"

    @property
    def iterates(self) -> bool:
        return hasattr(self.make, "iterate")

    def check(self, settings: Mapping[str, Any]) -> None:
        """InputError if it does not take these settings."""
        arguments = inspect.signature(self.make)
        passed = {name: None for name in PASSED if name in arguments.parameters}
        problem = [] if self.iterates else [None]
        try:
            arguments.bind(*problem, **passed | dict(settings))
        except TypeError as error:
            raise InputError(f"method '{self.name}': {error}.") from error


@dataclass(frozen=True)
class Registry:
    """What plug-in files have declared to one process.

    methods   by name
    problems  functions that return problems, by name
    loaded    the files that were run
    """

    methods: dict[str, Plugin] = field(default_factory=dict)
    problems: dict[str, Callable[..., Any]] = field(default_factory=dict)
    loaded: set[Path] = field(default_factory=set)

    def load(self, paths: Iterable[str | Path]) -> None:
        """Run plug-in files, each of them once; InputError, naming the file, if one fails."""
        for path in map(Path, paths):
            if path not in self.loaded:
                for one in vars(run_file(path, "plug-in")).values():
                    for table, name, declared in getattr(one, "__dict__", {}).get(MARK, ()):
                        getattr(self, table)[name] = declared
                self.loaded.add(path)

    def find(self, name: str) -> Plugin | None:
        """The method of that name, from a loaded file or an entry point; None if there is none."""
        if name not in self.methods:
            for point in entry_points(group=GROUP, name=name):
                try:
                    self.methods[name] = Plugin(name, point.load())
                except Exception as error:
                    text = f"plug-in '{point.value}' failed: {type(error).__name__}: {error}"
                    raise InputError(text) from error
        return self.methods.get(name)


def source_of(declared: Callable[..., Any]) -> str:
    """Digest of the file that declares a function or class, "" where there is no such file."""
    try:
        path = inspect.getsourcefile(declared)
    except TypeError:
        return ""
    found = path is not None and Path(path).is_file()
    return hashlib.sha256(Path(str(path)).read_bytes()).hexdigest()[:16] if found else ""


def method(
    make: Callable[..., Any] | None = None, *, name: str | None = None, peer: Peer | None = None
) -> Any:
    """Declare a function or class as a method of the benchmark.

    The declaration counts where a campaign runs the file. Everywhere else the function or class is
    returned as it is.

    A function takes an InterfaceProblem and, by name, its settings; `tol`, `time_limit` [s] and
    `max_iterations` are passed if it has such arguments. If `tol` has a default, the setting
    "default" leaves it out. It returns reactions (k, dim), or (reactions, multipliers), or a
    Solution, or an Answer. Returning forces claims success; raising does not,
    and InputError means that the problem is not one for this method.

    Parameters
    ----------
    make : The function or class, where the decorator is written without arguments.
    name : The name of the method; by default that of the function.
    peer : The external solver that it calls, without which it is left out.

    Returns
    -------
    The function or class itself, or a decorator that returns it.

    Raises
    ------
    InputError : For the name of a method of contactopt.
    """

    def register(make: Callable[..., Any]) -> Callable[..., Any]:
        plugin = Plugin(_name("method", make, name), make, peer)
        if plugin.name in METHODS:
            raise InputError(
                f"plug-in method {plugin.name!r} has the name of a method of contactopt; rename it."
            )
        return _marked(make, "methods", plugin.name, plugin)

    return register if make is None else register(make)


def problem(make: Callable[..., Any] | None = None, *, name: str | None = None) -> Any:
    """Declare a function of named parameters that returns an InterfaceProblem, for `family = NAME`
    in an experiment file.

    Parameters
    ----------
    make : The function, where the decorator is written without arguments.
    name : The name of the family; by default that of the function.

    Returns
    -------
    The function itself, or a decorator that returns it.

    Raises
    ------
    InputError : For a name that cannot be used.
    """

    def register(make: Callable[..., Any]) -> Callable[..., Any]:
        return _marked(make, "problems", _name("problem", make, name), make)

    return register if make is None else register(make)


def _marked(make: Callable[..., Any], *declared: object) -> Callable[..., Any]:
    """The function or class with a note for the registry that runs its file."""
    setattr(make, MARK, (*getattr(make, "__dict__", {}).get(MARK, ()), declared))
    return make


def _name(kind: str, make: object, name: object) -> str:
    """The name under which `make` is registered, if both are of the right kind."""
    if not callable(make):
        raise InputError(
            f"a plug-in {kind} must be a function or a class; got {type(make).__name__}."
        )
    found = getattr(make, "__name__", None) if name is None else name
    if not isinstance(found, str) or not found.strip() or not found.isprintable():
        raise InputError(f"a plug-in {kind} needs a name of printable characters; got {found!r}.")
    return found


def run_file(path: Path, what: str) -> ModuleType:
    """Run a Python file as a module of its own; InputError, which calls it `what`, if it fails."""
    digest = hashlib.sha256(str(path).encode()).hexdigest()[:8]
    spec = spec_from_file_location(f"contactopt_plugin_{path.stem}_{digest}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise InputError(f"{what} '{path}' is not a Python file.")
    module = module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise InputError(f"{what} '{path}' failed: {type(error).__name__}: {error}") from error
    return module
