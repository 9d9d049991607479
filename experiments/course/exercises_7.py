"""The exercises of chapter 7: duality."""

import numpy as np

from experiments.course.feedback import Open

Q, q = np.array([[1.0, -1.0], [-1.0, 2.0]]), np.array([-3.0, 5.0])  # the node of the chapter
K = np.linalg.inv(Q)


def primal(u: np.ndarray) -> float:
    return float((u - q) @ K @ (u - q) / 2 + abs(u[1]))


def dual(r: np.ndarray) -> float:
    return float(-r @ Q @ r / 2 - q @ r)


def nearly(r: np.ndarray) -> str | None:
    """Whether r is admissible, no solution, and has a gap below 0.01 N mm with u = (0, 1)."""
    if r[0] < 0 or abs(r[1]) > 1:
        return "These forces are not admissible: D is -infinity, and the gap is infinite."
    if np.allclose(r, (2, -1), atol=1e-6):
        return "This is the solution. Give other forces."
    gap = primal(np.array([0.0, 1.0])) - dual(r)
    return None if gap < 0.01 else f"The gap is {gap:.3g} N mm, too large."


GRADED = {"7.6": (lambda: Open((2.01, -0.995), nearly),)}
