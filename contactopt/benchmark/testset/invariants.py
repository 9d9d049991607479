"""Small numbers by which a problem made on another machine is known again."""

from __future__ import annotations

import numpy as np

from contactopt.problem import InterfaceProblem


def invariants(problem: InterfaceProblem) -> dict[str, float]:
    """Norms of q, Q x, V' x (x_i = cos i), s and mu, to ten digits, which rounding keeps."""
    x = np.cos(np.arange(problem.q.size))
    parts = {"q": problem.q, "Qx": problem.Q @ x, "Vx": problem.V.T @ x, "s": problem.s}
    return {
        name: float(f"{np.linalg.norm(part):.10g}")
        for name, part in (parts | {"mu": problem.mu}).items()
    }
