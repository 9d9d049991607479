"""The exercises of chapter 2: friction at one node."""

import numpy as np

from contactopt import InterfaceProblem, all_solutions, laws, solve
from experiments.course.feedback import Forces, Open

Q, q = np.array([[1.0, -1.0], [-1.0, 2.0]]), np.array([-3.0, 5.0])  # the node of the chapter
APART = np.diag([1.2, 2.5]), np.array([-1.5, 1.1])
SPACE = np.diag([1.0, 1.0, 3.0]), np.array([-2.0, 1.5, 2.0])


def another_load(load: np.ndarray) -> str | None:
    """Whether a load has three solutions, and is no multiple of the one in the text."""
    if np.linalg.norm(load) == 0:
        return "Without any load the only force is zero."
    if abs(load[0] * -0.5 - load[1] * 0.1) < 1e-3 * np.linalg.norm(load):
        return "This is the load of the text or a multiple of it. Find another direction."
    if load[0] <= 0:
        return "This load presses the node on the floor, q_n <= 0, so that it cannot hang freely."
    f_n, f_t = stick = -np.linalg.solve(Q, load)
    if abs(f_t) > 1.5 * f_n:
        return f"To stick, the node would need r = {np.round(stick, 3)} N, outside the cone."
    count = len(all_solutions(InterfaceProblem(Q, [load / np.linalg.norm(load)], 1.5)))
    return None if count == 3 else f"Here all_solutions finds {count}."


GRADED = {
    "2.1": (lambda: Forces(InterfaceProblem(APART[0], [APART[1]], 0.3)),),
    "2.3": (
        lambda: Forces(InterfaceProblem(Q, [q], 1.5)),
        (
            lambda: solve(InterfaceProblem(Q, [q], laws.Associated(1.5)), tol=1e-10).reactions,
            "associated",
        ),
    ),
    "2.7": (lambda: Open((0.13, -0.55), another_load),),
    "2.9": (lambda: Forces(InterfaceProblem(SPACE[0], [SPACE[1]], 0.5)),),
}
