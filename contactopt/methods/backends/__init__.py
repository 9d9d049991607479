"""Bridges to QP and conic solvers: a backend is one line of a table, imported when it is used.

`settings` are the tight settings it is run at, for a dimensionless problem; what each of them gets
wrong is caught afterwards by the crossover and the certificate, never believed.
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
TIGHT = 1e-9  # accuracy asked of every backend, in dimensionless units


@dataclass(frozen=True)
class Backend:
    """A solver behind qpsolvers (kind 'qp') or cvxpy (kind 'conic'), by its name there.

    module    what must be importable
    package   what pip installs
    sparse    the matrix form it wants
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
        return replace(self, settings=_tightened(self.settings))

    def timed(self) -> dict[str, Any]:
        """Its settings, with the time that is left to the solve where it takes a limit."""
        check_time()
        left = time_left()
        return dict(self.settings) | ({self.clock: left} if self.clock and isfinite(left) else {})

    def rounds(self) -> Iterator[dict[str, Any]]:
        """Settings for one try after another, of more iterations, within the time that is left."""
        if not self.steps or not isfinite(time_left()):
            yield self.timed()
            return
        most, count = self.settings[self.steps], 10
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
_CONE = {"abstol": TIGHT, "reltol": TIGHT, "feastol": TIGHT}
_DAQP = {"primal_tol": TIGHT, "dual_tol": TIGHT}
_EPS = {"eps_abs": TIGHT, "eps_rel": TIGHT}
_HIGHS = {"primal_feasibility_tolerance": TIGHT, "dual_feasibility_tolerance": TIGHT}
_MOREAU = {"ipm_settings": _CLARABEL}
# by its clock OSQP would choose when it changes rho
_OSQP = _EPS | {"max_iter": 200_000, "polishing": True, "adaptive_rho_interval": 50}
_PROXQP = {"eps_abs": TIGHT, "eps_rel": 0.0, "max_iter": 1_000}
_QOCO = {"abstol": TIGHT, "reltol": TIGHT, "max_iters": 200}
_SCS = _EPS | {"max_iters": 200_000}
_SHORT = _CONE | {"max_iters": 100}

QP: dict[str, Backend] = {
    b.name: b
    for b in (
        Backend("proxqp", "qp", "proxsuite", "proxsuite", _PROXQP, steps="max_iter"),
        Backend("clarabel", "qp", "clarabel", "clarabel", _CLARABEL, True, "time_limit"),
        Backend("osqp", "qp", "osqp", "osqp", _OSQP, True, "time_limit"),
        Backend("daqp", "qp", "daqp", "daqp", _DAQP, clock="time_limit"),
        Backend("ecos", "qp", "ecos", "ecos", _CONE, True),
        Backend("highs", "qp", "highspy", "highspy", _HIGHS, True, "time_limit"),
        Backend("piqp", "qp", "piqp", "piqp", _EPS),
        Backend("quadprog", "qp", "quadprog", "quadprog"),
        Backend("scs", "qp", "scs", "scs", _SCS, True, "time_limit_secs"),
        Backend("cvxopt", "qp", "cvxopt", "cvxopt", _CONE),
        Backend("qpalm", "qp", "qpalm", "qpalm", _EPS, True, "time_limit"),
    )
}

CONIC: dict[str, Backend] = {
    b.name: b
    for b in (
        Backend("clarabel", "conic", "clarabel", "clarabel", _CLARABEL, clock="time_limit"),
        Backend("scs", "conic", "scs", "scs", _SCS, clock="time_limit_secs"),
        Backend("ecos", "conic", "ecos", "ecos", _SHORT, steps="max_iters"),
        Backend("cvxopt", "conic", "cvxopt", "cvxopt", _SHORT, steps="max_iters"),
        Backend("qoco", "conic", "qoco", "qoco", _QOCO, steps="max_iters"),
        Backend("moreau", "conic", "moreau", "moreau", _MOREAU, clock="time_limit"),
    )
}


def _tightened(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The settings, those in tables of them included, with a thousandth of the usual tolerance."""
    made = dict(settings)
    for key, value in settings.items():
        if isinstance(value, Mapping):
            made[key] = _tightened(value)
        elif value == TIGHT:
            made[key] = value / 1e3
    return made


def attempts(
    solver: Any, solve: Callable[[Any], Answer]
) -> Iterator[tuple[str, Callable[[], Answer]]]:
    """Attempts for `semismooth.certified`: a backend as it is, then at tighter settings."""
    for backend in (solver.backend, solver.backend.tightened()):
        bridge = replace(solver, backend=backend)
        yield backend.name, partial(solve, bridge)


def find(name: str, table: Mapping[str, Backend]) -> Backend:
    """The backend of a name; InputError that says what to do if it is unknown or not installed."""
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
