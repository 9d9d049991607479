"""Problems that have no solution.

Each of them has a ray that proves it, which `contactopt.problem.infeasibility` finds and checks.
"""

from dataclasses import replace

import numpy as np

from contactopt.benchmark.families.of_scenes import reduced
from contactopt.benchmark.families.rigid_blocks import rigid_blocks
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem

BEYOND = 1.2  # the load over the largest one that friction holds


def dragged(of: str, mu: float = 0.5, **parameters: object) -> InterfaceProblem:
    """The scene, its body free along the first tangent and dragged by more than mu r_n."""
    made = reduced(of, mu=mu, **parameters)
    along = np.zeros(made.q.shape)
    along[:, 1] = 1.0
    return _with_motion(made, along, BEYOND * mu * _press(made))


def toppled(of: str, **parameters: object) -> InterfaceProblem:
    """The scene, its body free to turn and pressed beside the place where it stands."""
    made = reduced(of, **parameters)
    x = made.coordinates[0] - made.coordinates[0].mean()
    turn = np.zeros(made.q.shape)
    turn[:, 0] = x
    return _with_motion(made, turn, -BEYOND * float(np.abs(x).max()) * _press(made))


def squeezed(size: int = 3, mu: float = 0.5, overlap: float = 0.1) -> InterfaceProblem:
    """A row of rigid blocks between two walls that are nearer than the blocks are long."""
    return rigid_blocks("row", size, mu=mu, narrow=overlap)


def _press(problem: InterfaceProblem) -> float:
    """The force that presses the body of a scene with one free motion, along its normal."""
    if problem.s.size != 1:
        raise InputError("this family needs a scene in which one motion is free, as punch-2d.")
    return abs(float(problem.s[0])) / float(np.abs(problem.V).max())


def _with_motion(problem: InterfaceProblem, motion: np.ndarray, s: float) -> InterfaceProblem:
    V = np.hstack([problem.V, motion.reshape(-1, 1)])
    return replace(problem, V=V, s=np.append(problem.s, s), motions=())
