"""The exercises of chapter 6: large problems in three dimensions."""

from functools import cache

import cvxpy as cp
import numpy as np

from contactopt import InterfaceProblem, laws, models, solve
from contactopt.methods.preconditioners.circulant import seminorm
from experiments.course.feedback import Displacements
from experiments.course.quantities import Numbers

NODE = np.array([[1.0, 0.2, -0.1], [0.2, 1.5, 0.3], [-0.1, 0.3, 2.0]])


def angle(facets: int) -> float:
    """The angle at which a polygon pulls the node of the chapter back, if it slips at 50 degrees."""
    way = np.deg2rad(50)
    node = InterfaceProblem(np.eye(3), [[-1.0, 3 * np.cos(way), 3 * np.sin(way)]], 0.5)
    program = models.tresca(node, facets=facets)
    program.parameters["g"].value = np.array([0.5])
    program.problem.solve(solver=cp.CLARABEL)
    return float(np.degrees(np.arctan2(*-program.variables["r"].value[:0:-1])))


def symbol(m: int) -> np.ndarray:
    """The symbol of the sparse circulant, for the waves 0 ... 2 m - 1."""
    return np.fft.fft(seminorm(m)).real


def stiffer(m: int, j: int) -> float:
    return float(symbol(m)[j] / symbol(m)[1])


@cache
def node(law: laws.Law | float = 0.45) -> InterfaceProblem:
    return InterfaceProblem(NODE, [[-1.4, 1.2, -1.9]], law)


def moved(law: laws.Law | float = 0.45, factor: float = 1.0) -> np.ndarray:
    """The displacements under the forces of a law, the friction times a factor."""
    r = solve(node(law)).reactions * [1, factor, factor]
    return node().displacements(r, [])[0]


GRADED = {
    "6.4": (
        lambda: Numbers(
            angle(8),
            given={"pull": 50.0, "facets": 8.0, "right_angle": 90.0},
            least=(0.0, "The exercise asks for an angle between 0 and 90 degrees."),
            most=(90.0, "The exercise asks for an angle between 0 and 90 degrees."),
        ),
    ),
    "6.8": (
        lambda: Displacements(node()),
        (lambda: moved(0.0), "frictionless"),
        (lambda: moved(laws.Associated(0.45)), "associated"),
        (lambda: moved(factor=-1.0), "along"),
        (lambda: node().q[0], "penetration"),
    ),
    "6.10": (
        lambda: Numbers(
            stiffer(64, 21),
            given={"j": 21.0, "m": 64.0},
            least=(1.0, "Short waves are stiffer than long ones."),
        ),
        (lambda: stiffer(128, 21), "This is m = 128: the circle has 2 m = 128 nodes."),
        (lambda: stiffer(32, 21), "This is m = 32: the circle has 2 m = 128 nodes."),
        (lambda: symbol(64)[21], "This is the symbol itself. Divide by that of one wave."),
        (lambda: stiffer(64, 20), "Waves are counted from 0, the constant: take the entry 21."),
        (lambda: stiffer(64, 22), "Waves are counted from 0, the constant: take the entry 21."),
    ),
}
