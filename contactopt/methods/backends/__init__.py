"""Bridges to QP and conic solvers.

The tables say what exists; nothing is imported before it is used.

A backend is one line here. `settings` are the tight settings it is run at, for a dimensionless
problem; what each of them gets wrong is caught afterwards by the crossover and the certificate,
never believed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from math import isfinite
from time import perf_counter
from typing import Any

import numpy as np

from contactopt.errors import InputError
from contactopt.linear.deadline import TimeUp, check_time, time_left

Answer = tuple[np.ndarray, np.ndarray]  # what a bridge returns: forces, multipliers
FIRST = 10  # iterations of the first try of a backend whose iterations are its only limit
TIGHT = 1e-9  # accuracy asked of every backend, in dimensionless units


@dataclass(frozen=True)
class Backend:
    """A solver behind qpsolvers (kind 'qp') or cvxpy (kind 'conic'), by its name there.

    module    what must be importable;   package  what pip installs;   sparse  the matrix form it
              wants
    clock     its setting for a time limit [s], "" if it has none
    steps     its setting for a limit of iterations, if these can be many and there is no clock
    """

    name: str
    kind: str
    module: str
    package: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    sparse: bool = False
    clock: str = ""
    steps: str = ""

    def tightened(self) -> Backend:
        """The same backend, asked for a thousand times the accuracy."""
        tighter = {
            key: value / 1e3 if value == TIGHT else value for key, value in self.settings.items()
        }
        return replace(self, settings=tighter)

    def timed(self) -> dict[str, Any]:
        """Its settings, with the time that is left to the solve that runs where it takes a limit."""
        check_time()
        left = time_left()
        return dict(self.settings) | ({self.clock: left} if self.clock and isfinite(left) else {})

    def rounds(self) -> Iterator[dict[str, Any]]:
        """Settings for one try after another, each of more iterations, as many as fit into the time
        that is left.

        A backend with a clock, with few iterations, or in a solve without a time limit is tried
        once.
        """
        if not self.steps or not isfinite(time_left()):
            yield self.timed()
            return
        most, count = self.settings[self.steps], FIRST
        while True:
            check_time()
            begin = perf_counter()
            yield dict(self.settings) | {self.steps: count}
            each = max(perf_counter() - begin, 1e-9) / count
            if count >= most:
                return
            # later iterations may cost more
            count = min(3 * count, most, int(time_left() / (3 * each)))
            if count < 1:
                raise TimeUp

    @property
    def installed(self) -> bool:
        return find_spec(self.module) is not None

    @property
    def version(self) -> str:
        try:
            return version(self.package)
        except PackageNotFoundError:
            return "-"


_CLARABEL = {"tol_gap_abs": TIGHT, "tol_gap_rel": TIGHT, "tol_feas": TIGHT}
_ECOS = {"abstol": TIGHT, "reltol": TIGHT, "feastol": TIGHT}
_CVXOPT = {"abstol": TIGHT, "reltol": TIGHT, "feastol": TIGHT}
_SCS = {"eps_abs": TIGHT, "eps_rel": TIGHT}

QP: dict[str, Backend] = {
    b.name: b
    for b in (
        Backend(
            "proxqp",
            "qp",
            "proxsuite",
            "proxsuite",
            {"eps_abs": TIGHT, "eps_rel": 0.0, "max_iter": 1_000},
            steps="max_iter",
        ),
        Backend(
            "clarabel", "qp", "clarabel", "clarabel", _CLARABEL, sparse=True, clock="time_limit"
        ),
        Backend(
            "osqp",
            "qp",
            "osqp",
            "osqp",
            {"eps_abs": TIGHT, "eps_rel": TIGHT, "max_iter": 200_000, "polishing": True},
            sparse=True,
            clock="time_limit",
        ),
        Backend(
            "daqp",
            "qp",
            "daqp",
            "daqp",
            {"primal_tol": TIGHT, "dual_tol": TIGHT},
            clock="time_limit",
        ),
        Backend("ecos", "qp", "ecos", "ecos", _ECOS, sparse=True),
        Backend(
            "highs",
            "qp",
            "highspy",
            "highspy",
            {"primal_feasibility_tolerance": TIGHT, "dual_feasibility_tolerance": TIGHT},
            sparse=True,
            clock="time_limit",
        ),
        Backend("piqp", "qp", "piqp", "piqp", {"eps_abs": TIGHT, "eps_rel": TIGHT}),
        Backend("quadprog", "qp", "quadprog", "quadprog"),
        Backend(
            "scs",
            "qp",
            "scs",
            "scs",
            _SCS | {"max_iters": 200_000},
            sparse=True,
            clock="time_limit_secs",
        ),
        Backend("cvxopt", "qp", "cvxopt", "cvxopt", _CVXOPT),
        Backend(
            "qpalm",
            "qp",
            "qpalm",
            "qpalm",
            {"eps_abs": TIGHT, "eps_rel": TIGHT},
            sparse=True,
            clock="time_limit",
        ),
    )
}

CONIC: dict[str, Backend] = {
    b.name: b
    for b in (
        Backend("clarabel", "conic", "clarabel", "clarabel", _CLARABEL, clock="time_limit"),
        Backend(
            "scs", "conic", "scs", "scs", _SCS | {"max_iters": 200_000}, clock="time_limit_secs"
        ),
        Backend("ecos", "conic", "ecos", "ecos", _ECOS | {"max_iters": 100}, steps="max_iters"),
        Backend(
            "cvxopt", "conic", "cvxopt", "cvxopt", _CVXOPT | {"max_iters": 100}, steps="max_iters"
        ),
    )
}


def attempts(
    solver: Any, solve: Callable[[Any], Answer]
) -> Iterator[tuple[str, Callable[[], Answer]]]:
    """List the attempts of a bridge for `semismooth.certified`: with its backend as it is, then at
    tighter settings.

    Parameters
    ----------
    solver : A bridge, such as BoxQP or DiscSOCP.
    solve : A function of a bridge that returns its answer.

    Yields
    ------
    The name of the backend, and a function without arguments that makes the attempt.
    """
    for backend in (solver.backend, solver.backend.tightened()):
        bridge = replace(solver, backend=backend)
        yield backend.name, partial(solve, bridge)


def find(name: str, table: Mapping[str, Backend]) -> Backend:
    """Find a backend by its name.

    Parameters
    ----------
    name : A name in the table.
    table : QP or CONIC.

    Returns
    -------
    The backend.

    Raises
    ------
    InputError : If it is unknown or not installed, with what to do.
    """
    if name not in table:
        kind = next(iter(table.values())).kind
        raise InputError(
            f"unknown {kind} backend {name!r}; choose from {', '.join(sorted(table))}."
        )
    backend = table[name]
    if not backend.installed:
        raise InputError(
            f"backend '{name}' is not installed; install it with: pip install {backend.package}"
        )
    return backend
