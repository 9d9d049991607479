"""The exercises of chapter 3: a string on a floor."""

from functools import cache

import numpy as np

from contactopt import InterfaceProblem
from experiments.course.feedback import Forces
from experiments.course.quantities import Numbers

f = 8.0  # N/mm: the weight per length of the chapter's string, 1 mm long, under 1 N


def string(N: int, d: float = 0.25) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stiffness A, compliance Q and gaps without contact q of a string of N elements."""
    A = N * (2 * np.eye(N - 1) - np.eye(N - 1, k=1) - np.eye(N - 1, k=-1))
    Q = np.linalg.inv(A)
    return A, Q, d - Q @ np.full(N - 1, f / N)


def active_set(Q: np.ndarray, q: np.ndarray, touches: np.ndarray) -> tuple[np.ndarray, int]:
    """The forces, and the number of steps from a first guess of the set."""
    steps = 0
    while True:
        r, steps = np.zeros(len(q)), steps + 1
        r[touches] = np.linalg.solve(Q[np.ix_(touches, touches)], -q[touches])
        new = r - (Q @ r + q) > 0
        if np.array_equal(new, touches):
            return r, steps
        touches = new


def on_the_hill() -> tuple[np.ndarray, np.ndarray]:
    _, Q, q = string(40)
    x = np.arange(1, 40) / 40
    return Q, q - np.maximum(0.2 * (1 - ((x - 0.5) / 0.2) ** 2), 0)


def hill_problem() -> InterfaceProblem:
    Q, q = on_the_hill()
    both = np.column_stack([q, np.zeros(39)])
    x, areas = np.arange(1, 40) / 40, np.full(39, 1 / 40)
    return InterfaceProblem(np.kron(Q, np.eye(2)), both, 0.0, areas=areas, coordinates=[x])


def touching(Q: np.ndarray, q: np.ndarray) -> np.ndarray:
    return active_set(Q, q, np.ones(len(q), bool))[0]


@cache
def two_starts() -> tuple[int, int]:
    """Steps on 320 elements from all nodes, and from the set of 160 elements."""
    (_, Q_c, q_c), (_, Q_f, q_f) = string(160), string(320)
    coarse = touching(Q_c, q_c) > 0
    start = np.interp(np.arange(1, 320) / 320, np.arange(1, 160) / 160, coarse) >= 0.5
    return active_set(Q_f, q_f, np.ones(319, bool))[1], active_set(Q_f, q_f, start)[1]


@cache
def coarse_steps() -> int:
    """Steps on 160 elements from all nodes."""
    return active_set(*string(160)[1:], np.ones(159, bool))[1]


def sweep(together: bool = False, sweeps: int = 1) -> np.ndarray:
    """Projected Gauss-Seidel, or Jacobi if all nodes change together, on four elements."""
    _, Q, q = string(4, 0.07)
    r = np.zeros(3)
    for _ in range(sweeps):
        old = r.copy()
        for i in range(3):
            u = Q[i] @ (old if together else r) + q[i]
            r[i] = max(r[i] - u / Q[i, i], 0.0)
    return r


def middle_spring(stiffness: float = 700.0) -> np.ndarray:
    """The stiffness form of exercise 3.10."""
    return string(4)[0] + stiffness * np.diag([0.0, 1.0, 0.0])


def carried() -> np.ndarray:
    return touching(*string(40, 0.19)[1:])


GRADED = {
    "3.3": (
        lambda: Forces(hill_problem()),
        (lambda: touching(*string(40)[1:]), "penetration"),
        (lambda: np.linalg.solve(on_the_hill()[0], -on_the_hill()[1]), "tension"),
        (lambda: 40 * touching(*on_the_hill()), "pressure"),
        (lambda: -touching(*on_the_hill()), "sign"),
    ),
    "3.4": (
        two_starts,
        (lambda: two_starts()[::-1], "order"),
        (lambda: (two_starts()[0], coarse_steps()), "The second number is for 160 elements."),
        (
            lambda: (coarse_steps(), two_starts()[1]),
            "The first number is for 160 elements. Count on 320.",
        ),
        (
            lambda: (two_starts()[0], coarse_steps() + two_starts()[1]),
            "Do not count the steps on the coarse mesh.",
        ),
        (lambda: two_starts()[:1] * 2, "The start was not used: change the first `touches`."),
        (
            lambda: (two_starts()[0], 1),
            "One step only solves; another one sees that the set stays.",
        ),
    ),
    "3.5": (
        lambda: Numbers(
            sweep(),
            given={"weight": f / 4},
            least=(0.0, "The floor only pushes: no force is negative."),
        ),
        (lambda: sweep(True), "This is Jacobi: each node must see the new force of the last one."),
        (lambda: sweep(sweeps=200), "This is the solution. One sweep does not reach it."),
        (lambda: sweep(sweeps=2), "This is the result of two sweeps."),
        (lambda: sweep()[::-1], "order"),
    ),
    "3.7": (
        lambda: Numbers(
            float(carried().sum()),
            formulas=("f * (1 - 2 * sqrt(2 * T * d / f))",),
            given={"f": f, "T": 1.0, "d": 0.19, "N": 40.0},
            least=(0.0, "If the floor rises, the string is lifted: the energy grows."),
            most=(f, "The floor cannot carry more than the whole weight."),
        ),
        (f, "This is the whole weight. The ends carry a part of it."),
        (lambda: carried().mean(), "The floor rises below all nodes: add their forces."),
        (lambda: carried().max(), "This is the force on one node. Add all of them."),
    ),
    "3.10": (
        lambda: Numbers(
            float(np.linalg.cond(middle_spring())),
            given={
                "k_p": 700.0,
                "largest eigenvalue": float(np.linalg.eigvalsh(middle_spring())[-1]),
                "smallest eigenvalue": float(np.linalg.eigvalsh(middle_spring())[0]),
            },
            least=(1.0, "A condition number is at least one."),
        ),
        (lambda: np.linalg.cond(middle_spring(0.0)), "This is A alone: the spring is missing."),
        (
            lambda: np.linalg.cond(string(4)[0] + 700 * np.eye(3)),
            "This has a spring at every node, and only the middle one touches.",
        ),
        (
            lambda: np.linalg.cond(string(4)[1] + np.eye(3) / 700),
            "This is the compliance form. The exercise asks for the stiffness form.",
        ),
        (
            lambda: np.linalg.cond(string(4)[0] / 4 + 700 * np.diag([0, 1, 0])),
            "The stiffness of an element is T / h, and h is a quarter of 1 mm.",
        ),
        (
            lambda: np.linalg.cond(middle_spring(700 / 4)),
            "The 700 N/mm are those of the spring of the node: no length belongs to them.",
        ),
        (
            lambda: 700 / np.linalg.eigvalsh(middle_spring())[0],
            "The largest eigenvalue is more than the spring: the string adds to it.",
        ),
    ),
}
