"""Bridges to QP and conic solvers. The tables say what exists; nothing is imported before it is used.

A backend is one line here. `settings` are the tight settings it is run at, for a dimensionless problem; what each of
them gets wrong is caught afterwards by the crossover and the certificate, never believed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Any

import numpy as np

from contactopt.errors import InputError

Answer = tuple[np.ndarray, np.ndarray]  # what a bridge returns: forces, multipliers
TIGHT = 1e-9  # accuracy asked of every backend, in dimensionless units


@dataclass(frozen=True)
class Backend:
    """A solver behind qpsolvers (kind 'qp') or cvxpy (kind 'conic'), by its name there.

    module    what must be importable;   package  what pip installs;   sparse  the matrix form it wants
    """

    name: str
    kind: str
    module: str
    package: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    sparse: bool = False

    def tightened(self) -> Backend:
        """The same backend, asked for a thousand times the accuracy."""
        tighter = {key: value / 1e3 if value == TIGHT else value for key, value in self.settings.items()}
        return replace(self, settings=tighter)

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
_SCS = {"eps_abs": TIGHT, "eps_rel": TIGHT}

QP: dict[str, Backend] = {
    b.name: b
    for b in (
        Backend("proxqp", "qp", "proxsuite", "proxsuite", {"eps_abs": TIGHT, "eps_rel": 0.0, "max_iter": 10_000}),
        Backend("clarabel", "qp", "clarabel", "clarabel", _CLARABEL, sparse=True),
        Backend(
            "osqp",
            "qp",
            "osqp",
            "osqp",
            {"eps_abs": TIGHT, "eps_rel": TIGHT, "max_iter": 200_000, "polishing": True},
            sparse=True,
        ),
        Backend("daqp", "qp", "daqp", "daqp", {"primal_tol": TIGHT, "dual_tol": TIGHT}),
        Backend("ecos", "qp", "ecos", "ecos", _ECOS, sparse=True),
        Backend(
            "highs",
            "qp",
            "highspy",
            "highspy",
            {"primal_feasibility_tolerance": TIGHT, "dual_feasibility_tolerance": TIGHT},
            sparse=True,
        ),
        Backend("piqp", "qp", "piqp", "piqp", {"eps_abs": TIGHT, "eps_rel": TIGHT}),
        Backend("quadprog", "qp", "quadprog", "quadprog"),
        Backend("scs", "qp", "scs", "scs", _SCS | {"max_iters": 200_000}, sparse=True),
        Backend("cvxopt", "qp", "cvxopt", "cvxopt", {"abstol": TIGHT, "reltol": TIGHT, "feastol": TIGHT}),
        Backend("qpalm", "qp", "qpalm", "qpalm", {"eps_abs": TIGHT, "eps_rel": TIGHT}, sparse=True),
    )
}

CONIC: dict[str, Backend] = {
    b.name: b
    for b in (
        Backend("clarabel", "conic", "clarabel", "clarabel", _CLARABEL),
        Backend("scs", "conic", "scs", "scs", _SCS | {"max_iters": 200_000}),
        Backend("ecos", "conic", "ecos", "ecos", _ECOS),
        Backend("cvxopt", "conic", "cvxopt", "cvxopt", {"abstol": TIGHT, "reltol": TIGHT, "feastol": TIGHT}),
    )
}


def attempts(solver: Any, solve: Callable[[Any], Answer]) -> Iterator[tuple[str, Callable[[], Answer]]]:
    """For semismooth.certified: a bridge (BoxQP, DiscSOCP) with its backend as it is, then at tighter settings."""
    for backend in (solver.backend, solver.backend.tightened()):
        bridge = replace(solver, backend=backend)
        yield backend.name, partial(solve, bridge)


def find(name: str, table: Mapping[str, Backend]) -> Backend:
    """The backend of that name; InputError with what to do if it is unknown or not installed."""
    if name not in table:
        kind = next(iter(table.values())).kind
        raise InputError(f"unknown {kind} backend {name!r}; choose from {', '.join(sorted(table))}.")
    backend = table[name]
    if not backend.installed:
        raise InputError(f"backend '{name}' is not installed; install it with: pip install {backend.package}")
    return backend
