"""The convex programs of friction in cvxpy, written as on a blackboard."""

from __future__ import annotations

from typing import Any

import cvxpy as cp
import numpy as np


def tangential_disc_program(Q: np.ndarray, A: np.ndarray) -> tuple[Any, Any, dict[str, Any]]:
    """min t'Qt/2 + c't  subject to  |t_i| <= g_i for each contact i,  A t = b   (paper, eq (22)).

    Q (2k, 2k) symmetric positive semidefinite (checked by the caller: cvxpy's own check is unreliable), A (p, 2k);
    parameters c (2k,), radii g (k,), b (p,). Returns the problem, the variable t (2k,), the parameters by name; the
    multipliers of A t = b are the dual value of the last constraint. Build once, set parameters, solve many times.
    """
    k, p = len(Q) // 2, len(A)
    t = cp.Variable(2 * k, name="t")
    parameters = {"c": cp.Parameter(2 * k), "g": cp.Parameter(k, nonneg=True)}
    constraints = [cp.SOC(parameters["g"], cp.reshape(t, (2, k), order="F"), axis=0)]
    if p:
        parameters["b"] = cp.Parameter(p)
        constraints.append(A @ t == parameters["b"])
    objective = cp.Minimize(cp.quad_form(t, cp.psd_wrap(Q)) / 2 + parameters["c"] @ t)
    return cp.Problem(objective, constraints), t, parameters
