"""QP and conic backends on one convex subproblem, as they come or made exact: plug-in methods of
the campaigns here.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from contactopt import InterfaceProblem
from contactopt.benchmark import method
from contactopt.methods.backends import CONIC, QP, TIGHT, find
from contactopt.methods.backends.conic import Conic
from contactopt.methods.backends.qp import BoxQP
from contactopt.methods.kernels.semismooth import crossover
from contactopt.models import tangential
from contactopt.problem import dimensionless
from contactopt.problem.cones import disc_derivative, half_line_derivative

# kept at the backend's default settings too: iterations are no matter of accuracy
LOOPS = {"max_iter", "max_iters"}


def asked(backend, tol: float | None):  # type: ignore[no-untyped-def]
    """The backend with its accuracy settings at tol; None: with its own defaults."""
    if tol is None:
        return replace(
            backend, settings={key: v for key, v in backend.settings.items() if key in LOOPS}
        )
    return replace(
        backend, settings={key: tol if v == TIGHT else v for key, v in backend.settings.items()}
    )


@method
def normal_qp(
    problem: InterfaceProblem, backend: str, exact: bool = False, tol: float | None = None
):  # type: ignore[no-untyped-def]
    """The normal problem alone (friction forces zero), by one call of a QP backend; exact: with a
    crossover.
    """
    p, scales = dimensionless(problem)
    k, dim = p.q.shape
    Q, V = p.Q[::dim, ::dim].copy(), p.V[::dim].copy()
    qp = BoxQP(asked(find(backend, QP), tol), Q, V.T)
    c = p.q[:, 0].copy()  # some backends write into it
    x, lam = qp.solve(c, -p.s, np.zeros(k), np.full(k, np.inf))
    if exact:
        r_n, lam = crossover(Q, c, V, p.s, half_line_derivative, x[:, None], lam)
        x = r_n[:, 0]
    r = np.zeros((k, dim))
    r[:, 0] = x
    return scales.to_physical(r, lam)


@method
def friction_socp(
    problem: InterfaceProblem, backend: str, exact: bool = False, tol: float | None = None
):  # type: ignore[no-untyped-def]
    """Friction under given normal forces (family `tangential`), by one call of a conic backend;
    exact: with a crossover.
    """
    p, scales = dimensionless(problem)
    k, dim = p.q.shape
    normal = np.maximum(-p.q[:, 0] / np.diag(p.Q)[::dim], 0.0)
    tangents = np.arange(k * dim).reshape(k, dim)[:, 1:].ravel()
    Q, radius = p.Q[np.ix_(tangents, tangents)], p.mu * normal
    bridge = Conic.using(backend, tangential(p), Q)
    bridge = replace(bridge, backend=asked(find(backend, CONIC), tol))
    t = bridge.solve(r_n=normal, g=radius)["r_t"].reshape(k, dim - 1)
    if exact:
        c, V = p.q[:, 1:].ravel(), np.zeros((len(Q), 0))
        t, _ = crossover(Q, c, V, np.zeros(0), lambda y: disc_derivative(y, radius), t, np.zeros(0))
    return scales.to_physical(np.concatenate([normal[:, None], t], axis=1), np.zeros(0))
