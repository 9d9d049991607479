"""What a problem is like: sizes, structure of Q, thresholds of friction."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.linear.operators import InterfaceOperator
from contactopt.methods.diagnosis import diagnose
from contactopt.problem import InterfaceProblem, infeasibility

MOST = 1200  # components up to which Q's eigenvalues are computed


def tags_of(problem: InterfaceProblem) -> dict[str, Any]:
    """Compute the tags of a problem.

    Parameters
    ----------
    problem : of any form

    Returns
    -------
    dim, contacts, and motions, the number of columns of V; law; mu, the largest friction
    coefficient; form of Q: dense, sparse or products; symmetric; feasible: false where a proof
    says that there is no solution; and, where Q is small enough, its rank and condition, and the
    thresholds of friction below which the solution is known to be unique, and above which some load
    has several. None stands for what was not computed.
    """
    products = isinstance(problem.Q, InterfaceOperator)
    tags: dict[str, Any] = {
        "dim": problem.dim,
        "contacts": problem.contacts,
        "motions": len(problem.s),
        "law": type(problem.law).__name__.lower(),
        "mu": float(problem.mu.max(initial=0.0)),
        "form": "products" if products else "sparse" if sp.issparse(problem.Q) else "dense",
        "symmetric": bool(problem.symmetric),
        "feasible": products or infeasibility(problem) is None,
        **dict.fromkeys(("rank", "condition", "unique_below", "several_from")),
    }
    if not products and problem.q.size <= MOST:
        found = diagnose(problem.explicit())
        tags |= {"rank": found.rank, "condition": _short(found.condition)}
        tags["unique_below"] = _short(found.guaranteed.unique)
        tags["several_from"] = _short(found.uniform_slip.unique)
    return tags


def _short(value: float) -> float | None:
    return float(f"{value:.4g}") if np.isfinite(value) else None
