"""The exercises of chapter 1: a spring, a node and a floor."""

import numpy as np

from contactopt import InterfaceProblem
from experiments.course.feedback import Forces, State

CHAIN = np.array([[4.5, -1.5], [-1.5, 1.5]])  # N/mm: springs of 3 and 1.5 N/mm


def chain() -> InterfaceProblem:
    Q, q = np.linalg.inv(CHAIN), np.array([0.5, 0.2]) - np.linalg.solve(CHAIN, [0.0, 4.0])
    return InterfaceProblem(np.kron(Q, np.eye(2)), np.column_stack([q, 0 * q]), 0.0)


GRADED = {
    "1.1": (lambda: State(1 / 4.4, 0.6 - 6.5 / 4.4),),
    "1.9": (
        lambda: Forces(chain()),
        (((0.0, 3.8, 0.0),), "shape"),
    ),
}
