"""What is run: a problem, a method, a setting, a repeat."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache
from importlib.metadata import version
from typing import Any

from contactopt.benchmark.plugins import Registry
from contactopt.benchmark.problems import ProblemSpec, short_number
from contactopt.defaults import TOL
from contactopt.errors import InputError
from contactopt.methods import METHODS, find_method
from contactopt.methods.backends import CONIC, QP
from contactopt.methods.method import NATIVE

SETTINGS = {"default": TOL, "low": 1e-3, "mid": 1e-6, "high": 1e-9}


@dataclass(frozen=True)
class MethodSpec:
    """A method or plug-in with settings, and the external solver that it calls."""

    name: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    peer: str = ""

    @property
    def label(self) -> str:
        given = ", ".join(
            f"{key}={short_number(value) if isinstance(value, float) else repr(value)}"
            for key, value in self.settings.items()
        )
        return f"{self.name}({given})" if given else self.name

    @property
    def foreign(self) -> bool:
        """Whether it is a plug-in."""
        return self.name not in METHODS

    def backends(self, *dims: int) -> str:
        """Names and versions of the backends, "native" without; InputError if none works."""
        return self.peer or _backends(self.name, json.dumps(dict(self.settings)), dims)


def method_spec(name: str, settings: Mapping[str, Any], registry: Registry) -> MethodSpec:
    """The method with these settings; InputError if unknown, or a backend is not installed."""
    peer = ""
    if name in METHODS:
        find_method(name, **settings)
    elif (plugin := registry.find(name)) is not None:
        plugin.check(settings)
        peer = plugin.version
    else:
        raise InputError(
            f"unknown method {name!r}; choose from {', '.join(METHODS)}, or name its plug-in file."
        )
    spec = MethodSpec(name, settings, peer)
    spec.backends(2, 3)
    return spec


@lru_cache(maxsize=1000)
def _backends(name: str, settings: str, dims: tuple[int, ...]) -> str:
    given = json.loads(settings)
    names = [value for value in given.values() if isinstance(value, str) and value in QP | CONIC]
    if name in METHODS:
        found: list[str] = []
        errors: list[InputError] = []
        for dim in dims:
            try:
                found += find_method(name, **given).backends(dim)
            except InputError as error:
                errors.append(error)
        if not found:
            raise errors[0]
        names = [backend for backend in found if backend != NATIVE]
    versions = {backend: (QP | CONIC)[backend].version for backend in sorted(set(names))}
    return ", ".join(f"{backend} {version}" for backend, version in versions.items()) or NATIVE


@cache
def _own_version() -> str:
    return version("contactopt")  # reads a file


@dataclass(frozen=True)
class Run:
    """One run; `key` tells it apart from all others, also from those of another version of this
    package, of a backend, or of a plug-in.

    source  digest of the plug-ins that declare its method and its problem, "" without
    """

    problem: ProblemSpec
    method: MethodSpec
    setting: str
    tolerance: float
    repeat: int
    source: str = ""

    @cached_property
    def key(self) -> str:
        method, backends = self.method.label, self.method.backends(2, 3)
        made = _own_version(), backends, self.source
        parts = (self.problem.label, method, made, self.setting, self.repeat)
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:20]
