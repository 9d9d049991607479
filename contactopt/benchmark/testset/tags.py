"""What a problem is like: sizes, structure of Q, thresholds of friction; and small numbers by which
one that was made on another machine is known again.
"""

from typing import Any

import numpy as np

from contactopt.benchmark.sequences import Sequence, states_of
from contactopt.linear.operators import form, has_entries
from contactopt.methods.diagnosis import diagnose
from contactopt.problem import InterfaceProblem, infeasibility

MOST = 1200  # components up to which Q's eigenvalues are computed
# tag -> what it is
TAGS = {
    "dim": "2 or 3",
    "contacts": "number of contacts",
    "states": "number of consecutive problems, 1 for a problem alone",
    "motions": "number of free motions, the columns of V",
    "law": "law of contact",
    "mu": "largest friction coefficient",
    "form": "of Q: dense, sparse, or products with vectors only",
    "symmetric": "whether Q is",
    "feasible": "false where a proof says that there is no solution",
    "rank": "of Q",
    "condition": "of Q on its range",
    "unique_below": "friction below which the solution is unique for every load",
    "several_from": "friction from which on some load has several solutions",
    "solutions": "their number, where all of them were listed",
}


def tags_of(given: InterfaceProblem | Sequence) -> dict[str, Any]:
    """The tags of a problem, or of the last state of a sequence, by the keys of TAGS. None stands
    for what was not computed because the problem is large, or because its law or its form does not
    allow it.
    """
    states = states_of(given)
    problem = states[-1]
    products = not has_entries(problem.Q)
    tags: dict[str, Any] = {
        "dim": problem.dim,
        "contacts": problem.contacts,
        "states": len(states),
        "motions": len(problem.s),
        "law": type(problem.law).__name__.lower(),
        "mu": float(problem.mu.max(initial=0.0)),
        "form": "products" if products else "sparse" if form(problem.Q) == "sparse" else "dense",
        "symmetric": bool(problem.symmetric),
        "feasible": products or infeasibility(problem) is None,
    }
    tags |= dict.fromkeys(TAGS.keys() - tags.keys())
    law = problem.law
    if not products and problem.q.size <= MOST and law.unilateral and law.proportional:
        found = diagnose(problem.explicit())
        tags |= {"rank": found.rank, "condition": _short(found.condition)}
        tags["unique_below"] = _short(found.guaranteed.unique)
        tags["several_from"] = _short(found.uniform_slip.unique)
    return {name: tags[name] for name in TAGS}


def _short(value: float) -> float | None:
    return float(f"{value:.4g}") if np.isfinite(value) else None


def invariants(given: InterfaceProblem | Sequence) -> dict[str, float]:
    """Norms that identify a problem: of q, Q x, V' x (x_i = cos i), s and mu, of all states, to ten
    digits.
    """
    states = states_of(given)
    x = np.cos(np.arange(states[0].q.size))
    parts = {
        "q": [p.q for p in states],
        "Qx": [states[0].Q @ x],
        "Vx": [states[0].V.T @ x],
        "s": [p.s for p in states],
        "mu": [p.mu for p in states],
    }
    return {
        name: float(f"{np.linalg.norm(np.concatenate([*map(np.ravel, part)])):.10g}")
        for name, part in parts.items()
    }
