"""Benchmarks: an experiment file -> runs in processes of their own -> a table -> figures and
reports.

    >>> from contactopt import benchmark
    >>> folder = benchmark.run_campaign("friction.toml", jobs=2)
    >>> table = benchmark.load(folder)  # pandas.DataFrame, one row per run: benchmark.COLUMNS

An experiment file names problems, methods and settings; lists and ranges are multiplied out:

    name = "friction"
    plugins = ["mine.py"]                       # files beside this one
    settings = ["low", "mid", "high", 1e-7]     # bounds on the certificate: 1e-3, 1e-6, 1e-9;
                                                # "default": the method's own
    repeats = 3
    time_limit = 10.0                           # s per run, enforced
    [[problems]]
    scene = "punch-2d"
    mu = {from = 0.1, to = 10.0, steps = 5, scale = "log"}
    elements = [8, 16]
    [[problems]]
    fclib = "${FCLIB}/*.hdf5"                   # a folder that the environment names
    optional = true                             # left out where it is missing
    [[methods]]
    method = ["auto", "nsgs", "mine"]

A method of your own is a function `mine(problem, tol, ...)` in `mine.py` that returns reactions,
with the decorator `method`; nothing in this package changes. Instead of a function it may be a
dataclass with `iterate`, as in contactopt.methods: it then gets the driver's stopping rule and
history. `problem` registers a function that makes an InterfaceProblem in the same way, for `family
= NAME`. An installed package offers methods as entry points of the group "contactopt.methods".

What a method claims is never believed: each answer gets the certificate of
contactopt.natural_map_residual, in the process of the campaign and from the problem that it holds.
Methods run in worker processes only: a crash, a hang or a full memory of one costs one row.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from contactopt.benchmark.campaign import run_campaign, run_reports  # noqa: F401
    from contactopt.benchmark.experiment import Experiment, read_experiment  # noqa: F401
    from contactopt.benchmark.keys import COLUMNS  # noqa: F401
    from contactopt.benchmark.peers import Answer, Peer  # noqa: F401
    from contactopt.benchmark.plugins import method, problem  # noqa: F401
    from contactopt.benchmark.store import STATUSES, load, save  # noqa: F401

_HOMES = {
    "campaign": ("run_campaign", "run_reports"),
    "experiment": ("Experiment", "read_experiment"),
    "keys": ("COLUMNS",),
    "peers": ("Answer", "Peer"),
    "plugins": ("method", "problem"),
    "store": ("STATUSES", "load", "save"),
}
_MODULES = {"figures": "report_figures", "report": "reports", "tables": "tables"}  # name -> module
__all__ = sorted([*(name for names in _HOMES.values() for name in names), *_MODULES])


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"contactopt.benchmark.{_MODULES[name]}")
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"contactopt.benchmark.{module}"), name)
    raise AttributeError(f"module 'contactopt.benchmark' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
