"""The exercises of chapter 6: large problems in three dimensions."""

from functools import cache

import cvxpy as cp
import numpy as np

from contactopt import InterfaceProblem, Material, laws, models, solve
from contactopt.analytic import contact_modulus, hertz_point
from experiments.course.feedback import Displacements, Numbers

RUBBER = Material(E=5.5, nu=0.42)
NODE = np.array([[1.0, 0.2, -0.1], [0.2, 1.5, 0.3], [-0.1, 0.3, 2.0]])


def gigabytes(contacts: int, components: int = 3) -> float:
    return 8 * (components * contacts) ** 2 / 1e9


def angle(facets: int) -> float:
    """The angle at which a polygon pulls the node of the chapter back, if it slips at 50 degrees."""
    way = np.deg2rad(50)
    node = InterfaceProblem(np.eye(3), [[-1.0, 3 * np.cos(way), 3 * np.sin(way)]], 0.5)
    program = models.tresca(node, facets=facets)
    program.parameters["g"].value = np.array([0.5])
    program.problem.solve(solver=cp.CLARABEL)
    return float(np.degrees(np.arctan2(*-program.variables["r"].value[:0:-1])))


def peak(P: float) -> float:
    return hertz_point(P, 400.0, contact_modulus(RUBBER)).peak


@cache
def node(law: laws.Law | float = 0.45) -> InterfaceProblem:
    return InterfaceProblem(NODE, [[-1.4, 1.2, -1.9]], law)


def moved(law: laws.Law | float = 0.45, factor: float = 1.0) -> np.ndarray:
    """The displacements under the forces of a law, the friction times a factor."""
    r = solve(node(law)).reactions * [1, factor, factor]
    return node().displacements(r, [])[0]


GRADED = {
    "6.1": (
        lambda: gigabytes(120 * 80),
        (gigabytes(120 * 80, 1), "Each node has three components of force."),
        (gigabytes(120 * 80) / 8, "A number takes 8 bytes."),
        (gigabytes(120 * 80) / 1.024**3, "These are GiB, 1024^3 bytes. Asked are 10^9 bytes."),
    ),
    "6.2": (
        lambda: int(np.ceil(np.pi / np.arccos(0.993))),
        (26, "With 26 facets a little more than 0.7 % is lost."),
        (54, "From the middle of a facet to its corner it is pi / m, and not 2 pi / m."),
        (14, "From the middle of a facet to its corner it is pi / m, and not pi / (2 m)."),
    ),
    "6.3": (
        lambda: Numbers(peak(260.0) / peak(100.0), close=0.01),
        (2.6, "The area grows, too, so that the peak grows more slowly than the load."),
        (2.6**0.5, "This is Hertz's law for a cylinder. Under a sphere the area grows faster."),
        (2.6 ** (2 / 3), "This is the factor of the area."),
    ),
    "6.4": (
        lambda: angle(8),
        (50.0, "This is the direction of the circle. A polygon has its own directions."),
        (22.5, "This is the next corner on the other side; 50 degrees is farther from it."),
        (45.0, "This is the middle of a facet. Friction goes into a corner."),
    ),
    "6.5": (
        lambda: contact_modulus(RUBBER),
        (5.5 / (1 - 0.42**2) / 2, "This holds for two equal bodies. A rigid one gives no way."),
        (5.5 / (2 * (1 + 0.42)), "This is the shear modulus."),
        (5.5 / (1 - 0.42), "It is 1 - nu^2, and not 1 - nu."),
    ),
    "6.6": (
        lambda: 2 * 0.2 / (6.0 * 2 * np.pi / 3.0),
        (0.2 / (6.0 * 2 * np.pi / 3.0), "half"),
        (2 * 0.2 / (6.0 * 3.0), "The wave number is 2 pi over the wavelength."),
        (2 * 0.2 / 6.0 / (2 * np.pi / 3) ** 2, "This divides by the square: that is the string."),
        (2 * 0.2 / 6.0 * (2 * np.pi / 3), "A surface gives way *less* to short waves."),
    ),
    "6.7": (
        lambda: int(np.ceil(np.sqrt(900) / 2 * np.log(2e6))),
        (6529, "Conjugate gradients feel the square root of the condition number."),
        (436, "half"),
        (208, "The bound is 2 q^j, and the 2 counts."),
    ),
    "6.8": (
        lambda: Displacements(node()),
        (lambda: moved(0.0), "frictionless"),
        (lambda: moved(laws.Associated(0.45)), "associated"),
        (lambda: moved(factor=-1.0), "along"),
        ((0.0, 0.0, 0.0), "bound"),
        (lambda: node().q[0], "penetration"),
    ),
}
