"""The exercises of chapter 6: large problems in three dimensions."""

from functools import cache

import cvxpy as cp
import numpy as np

from contactopt import InterfaceProblem, Material, laws, models, solve
from contactopt.analytic import contact_modulus, hertz_point
from experiments.course.feedback import Displacements, Numbers
from experiments.course.grader import Exercise

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


EXERCISES = (
    Exercise(
        "6.1",
        1,
        "memory [GB]",
        lambda: gigabytes(120 * 80),
        (
            (gigabytes(120 * 80, 1), "Each node has three components of force."),
            (gigabytes(120 * 80) / 8, "A number takes 8 bytes."),
            (gigabytes(120 * 80) / 1.024**3, "These are GiB, 1024^3 bytes. Asked are 10^9 bytes."),
        ),
        (
            "How many components of force are there, and how many entries does Q have?",
            "3 * 9600 unknowns, and their square as entries.",
            "Each entry takes 8 bytes; divide by 10^9.",
        ),
        """
# The size of one row is known to numpy.
row = np.zeros(3 * 120 * 80).nbytes
answer = row * 3 * 120 * 80 / 1e9
""",
    ),
    Exercise(
        "6.2",
        1,
        "number of facets",
        lambda: int(np.ceil(np.pi / np.arccos(0.993))),
        (
            (26, "With 26 facets a little more than 0.7 % is lost."),
            (54, "From the middle of a facet to its corner it is pi / m, and not 2 pi / m."),
            (14, "From the middle of a facet to its corner it is pi / m, and not pi / (2 m)."),
        ),
        (
            "Where does the polygon lose most? Draw one facet and the circle.",
            "In the middle of a facet the polygon reaches cos(pi / m) of the radius.",
            "Find the smallest m with cos(pi / m) >= 0.993.",
        ),
        """
answer = next(m for m in range(3, 1000) if np.cos(np.pi / m) >= 0.993)
""",
    ),
    Exercise(
        "6.3",
        2,
        "peak at 260 N / peak at 100 N",
        lambda: Numbers(peak(260.0) / peak(100.0), close=0.01),
        (
            (2.6, "The area grows, too, so that the peak grows more slowly than the load."),
            (2.6**0.5, "This is Hertz's law for a cylinder. Under a sphere the area grows faster."),
            (2.6 ** (2 / 3), "This is the factor of the area."),
        ),
        (
            "Change the force of the sphere to -260 N, and solve again.",
            "The contact grows by 2.6^(1/3): the grid has to be wider, too.",
            "Take the largest reactions[:, 0] / areas of both answers.",
        ),
        """
# In Hertz's solution the peak is proportional to P^(1/3).
wide = grid * 2.6 ** (1 / 3)
heavy = Rigid("sphere", gap=lambda p: (p[0] ** 2 + p[1] ** 2) / (2 * R), force={"z": -2.6 * P})
below = HalfSpace("block", rubber, (wide, wide))
heavier = reduce(Scene("sphere", heavy, below, 0.0, kind="solid", law="frictionless"))
answer = (solve(heavier).reactions[:, 0] / heavier.areas).max() / p.max()
""",
    ),
    Exercise(
        "6.4",
        2,
        "angle [degrees]",
        lambda: angle(8),
        (
            (50.0, "This is the direction of the circle. A polygon has its own directions."),
            (22.5, "This is the next corner on the other side; 50 degrees is farther from it."),
            (45.0, "This is the middle of a facet. Friction goes into a corner."),
        ),
        (
            "models.tresca(pulled(50.0), facets=8) is the program. Set its parameter g.",
            "Read the force from program.variables['r'].value after the solve.",
            "The corners of the polygon lie at 22.5, 67.5, ... degrees.",
        ),
        """
# Friction resists most where the work of the slip is largest, in the corner nearest to the slip. (Two
# neighbouring corners are equally near at 45 degrees.)
corners_8 = 22.5 + 45.0 * np.arange(8)
answer = corners_8[np.argmax(np.cos(np.deg2rad(corners_8 - 50.0)))]
""",
    ),
    Exercise(
        "6.5",
        1,
        "contact modulus [MPa]",
        lambda: contact_modulus(RUBBER),
        (
            (5.5 / (1 - 0.42**2) / 2, "This holds for two equal bodies. A rigid one gives no way."),
            (5.5 / (2 * (1 + 0.42)), "This is the shear modulus."),
            (5.5 / (1 - 0.42), "It is 1 - nu^2, and not 1 - nu."),
        ),
        (
            "The compliances of two bodies add: 1 / E* = (1 - nu_1^2) / E_1 + (1 - nu_2^2) / E_2.",
            "The rigid body has no compliance.",
            "E* = E / (1 - nu^2).",
        ),
        """
# Two bodies, of which the second one is so stiff that it does not count.
answer = 1 / ((1 - 0.42**2) / 5.5 + (1 - 0.3**2) / 1e12)
""",
    ),
    Exercise(
        "6.6",
        3,
        "amplitude of the displacement [mm]",
        lambda: 2 * 0.2 / (6.0 * 2 * np.pi / 3.0),
        (
            (0.2 / (6.0 * 2 * np.pi / 3.0), "half"),
            (2 * 0.2 / (6.0 * 3.0), "The wave number is 2 pi over the wavelength."),
            (
                2 * 0.2 / 6.0 / (2 * np.pi / 3) ** 2,
                "This divides by the square: that is the string.",
            ),
            (2 * 0.2 / 6.0 * (2 * np.pi / 3), "A surface gives way *less* to short waves."),
        ),
        (
            "A point load P moves the surface by P / (pi E* r). Add this up over the wave.",
            "Along the crests: the integral of cos(k x) / sqrt(x^2 + y^2) over x is 2 K_0(k |y|).",
            "The integral of K_0 over all of y is pi / k. So the factor is 2 / (E* k).",
        ),
        """
# The surface below a crest, by numerical integration over the lines of equal y.
from scipy.integrate import quad
from scipy.special import k0
wave = 2 * np.pi / 3.0
inner = 2 * quad(lambda y: 2 * k0(wave * y), 0, np.inf)[0]
answer = 0.2 * inner / (np.pi * 6.0)
""",
    ),
    Exercise(
        "6.7",
        1,
        "number of iterations",
        lambda: int(np.ceil(np.sqrt(900) / 2 * np.log(2e6))),
        (
            (6529, "Conjugate gradients feel the square root of the condition number."),
            (436, "half"),
            (208, "The bound is 2 q^j, and the 2 counts."),
        ),
        (
            "The bound falls from 2 to 1e-6.",
            "j >= sqrt(kappa) / 2 * ln(2 / 1e-6).",
            "sqrt(900) / 2 = 15, and ln(2e6) = 14.5.",
        ),
        """
answer = next(j for j in range(10000) if 2 * np.exp(-2 * j / np.sqrt(900)) <= 1e-6)
""",
    ),
    Exercise(
        "6.8",
        2,
        "u_n, u_1, u_2 [mm]",
        lambda: Displacements(node()),
        (
            (lambda: moved(0.0), "frictionless"),
            (lambda: moved(laws.Associated(0.45)), "associated"),
            (lambda: moved(factor=-1.0), "along"),
            ((0.0, 0.0, 0.0), "bound"),
            (lambda: node().q[0], "penetration"),
        ),
        (
            "Find the forces first: solve(InterfaceProblem(Q, [q], 0.45)), or Tresca's iteration.",
            "Then u = Q r + q.",
            "Look at your answer: u_n = 0, and the slip is opposite to r_t.",
        ),
        """
# Tresca's iteration with discs.
C, c = np.array([[1.0, 0.2, -0.1], [0.2, 1.5, 0.3], [-0.1, 0.3, 2.0]]), np.array([-1.4, 1.2, -1.9])
f, limit = cp.Variable(3), cp.Parameter(nonneg=True, value=0.0)
program = cp.Problem(
    cp.Minimize(cp.quad_form(f, C) / 2 + c @ f), [f[0] >= 0, cp.norm(f[1:]) <= limit]
)
for _ in range(20):
    program.solve(solver=cp.CLARABEL)
    limit.value = 0.45 * max(f.value[0], 0.0)
answer = C @ f.value + c
""",
    ),
)
