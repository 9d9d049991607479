"""The exercises of chapter 1: a spring, a node and a floor."""

import numpy as np

from contactopt import InterfaceProblem
from experiments.course.feedback import Forces, State
from experiments.course.grader import Exercise

k, g0, F = 2.0, 1.0, 5.0  # N/mm, mm, N: the node of the chapter
CHAIN = np.array([[4.5, -1.5], [-1.5, 1.5]])  # N/mm: springs of 3 and 1.5 N/mm


def chain() -> InterfaceProblem:
    Q, q = np.linalg.inv(CHAIN), np.array([0.5, 0.2]) - np.linalg.solve(CHAIN, [0.0, 4.0])
    return InterfaceProblem(np.kron(Q, np.eye(2)), np.column_stack([q, 0 * q]), 0.0)


def multipliers(steps: int, kappa: float) -> float:
    """The force after some steps of the method of multipliers, each a minimum of one parabola."""
    r = 0.0
    for _ in range(steps):
        u = (r + k * g0 - F) / (k + kappa)  # k (u - g0) + F = r - kappa u
        r = max(r - kappa * u, 0.0)
    return r


def last_ratio(alpha: float) -> float:
    """The ratio of two gaps of the proximal Galerkin method, one after the other, late."""
    psi = last = 0.0
    for _ in range(12):
        last = psi
        for _ in range(60):
            psi -= (alpha * (k * (np.exp(psi) - g0) + F) + psi - last) / (
                alpha * k * np.exp(psi) + 1
            )
    return float(np.exp(psi - last))


EXERCISES = (
    Exercise(
        "1.1",
        1,
        "gap [mm], force [N]",
        lambda: State(1 / 4.4, 0.6 - 6.5 / 4.4),
        (
            ((0.6 - 6.5 / 4.4, 0.0), "penetration"),
            ((0.0, 4.4 * 0.6 - 6.5), "tension"),
            ((0.0, 6.5), "balance"),
            ((0.6, 3.86), "distance"),
        ),
        (
            "How far would the node sink if there were no floor? Compare this with the gap.",
            "The node touches. So you know u, and the forces on the node balance.",
            "Three forces act on the node: F down, k g_0 of the stretched spring up, and r up.",
        ),
        """
# The spring would let the node sink by 6.5 / 4.4 = 1.48 mm, which is more than 0.6 mm. So the node
# touches, u = 0. The spring then carries 4.4 * 0.6 N, and the floor carries the rest.
answer = (0.0, 6.5 - 4.4 * 0.6)
""",
    ),
    Exercise(
        "1.2",
        1,
        "load [N]",
        lambda: 4.4 * 0.6,
        (
            (4.4 / 0.6, "A stiffness over a length is no force: look at the units."),
            (0.6 / 4.4, "A length over a stiffness is no force: look at the units."),
            (4.4 * 0.6**2 / 2, "This is the energy of the spring [N mm], not its force [N]."),
        ),
        (
            "What are the gap and the contact force when the node just touches?",
            "Both are zero. So the spring alone carries the load.",
            "Without contact the gap is g_0 - F / k. Set it to zero.",
        ),
        """
# The gap g_0 - F / k is zero at F = k g_0. The contact force is zero there, too. A contact whose gap
# and force are both zero is called weakly active.
from scipy.optimize import brentq
answer = brentq(lambda load: 0.6 - load / 4.4, 0.0, 10.0)
""",
    ),
    Exercise(
        "1.3",
        1,
        "compliance [m/N]",
        lambda: 1e-3 / 2.3,
        (
            (1 / 2.3, "This is the compliance in mm/N. A millimetre is a thousandth of a metre."),
            (1e3 / 2.3, "You converted the wrong way: as a number of metres a length is smaller."),
            (2300.0, "This is the stiffness in N/m. The compliance is its inverse."),
        ),
        (
            "The compliance says how far the node moves under one newton.",
            "Under one newton the spring gives way by 1 / 2.3 mm.",
            "Write this length in metres.",
        ),
        """
# 2.3 N/mm are 2300 N/m, and Q = 1 / k.
answer = 1 / 2300
""",
    ),
    Exercise(
        "1.4",
        2,
        "force of the ceiling [N]",
        lambda: 5.3 - k * (2 - g0),
        (
            (5.3, "The ceiling does not carry the whole pull: the stretched spring holds a part."),
            (1 + 5.3 / 2, "This is where the node would be without a ceiling, a length [mm]."),
            (0.0, "This is the multiplier of the floor. The node is at the ceiling."),
            (-3.3, "sign"),
        ),
        (
            "The program has two constraints, and each of them has a multiplier.",
            "Keep the constraint in a variable, ceiling = w <= 2, and read ceiling.dual_value.",
            "The pull of 5.3 N is the load F = -5.3 N in the energy.",
        ),
        """
# The multiplier of u <= 2 is the force of the ceiling. By hand it is -E'(2).
w = cp.Variable()
ceiling = w <= 2
cp.Problem(cp.Minimize(k * (w - g0) ** 2 / 2 - 5.3 * w), [w >= 0, ceiling]).solve(solver=cp.CLARABEL)
answer = float(ceiling.dual_value)
""",
    ),
    Exercise(
        "1.5",
        2,
        "kappa / k [-]",
        lambda: ((F - k * g0) / 0.007 - k) / k,
        (
            ((F - k * g0) / 0.007 - k, "This is kappa in N/mm. Give it as a multiple of k."),
            ((F - k * g0) / 0.007 / k, "This is (k + kappa) / k: the spring k helps, too."),
            ((F / 0.007 - k) / k, "The penalty spring carries F - k g_0, and not all of F."),
        ),
        (
            "The text gives the depth to which the node sinks for a penalty spring kappa.",
            "Set (F - k g_0) / (k + kappa) = 0.007 mm.",
            "Solve this for kappa, and divide by k.",
        ),
        """
# The depth is the minimum of the energy with a penalty: search for the stiffness that gives 0.007 mm.
from scipy.optimize import brentq, minimize_scalar
def depth(times):
    cost = lambda u: k * (u - g0) ** 2 / 2 + F * u + times * k * min(u, 0) ** 2 / 2
    return -minimize_scalar(cost, bounds=(-1, 0), method="bounded", options={"xatol": 1e-12}).x
answer = brentq(lambda times: depth(times) - 0.007, 10, 1000, xtol=1e-6)
""",
    ),
    Exercise(
        "1.6",
        2,
        "force after two steps [N]",
        lambda: multipliers(2, 5.0),
        (
            (lambda: multipliers(1, 5.0), "This is the first step, which is the penalty method."),
            (F - k * g0, "This is the limit of many steps. Two steps come near it."),
            (
                3 * (1 - (5 / 7) ** 2),
                "An error shrinks by k / (k + kappa), not by kappa / (k + kappa).",
            ),
        ),
        (
            "In the first step r = 0: it is the penalty method, and its force is [-kappa u]_+.",
            "The minimum of a step solves k (u - g_0) + F = r - kappa u, if the node touches.",
            "Subtract the solution: the error of r is multiplied by k / (k + kappa) in each step.",
        ),
        """
# The error 3 N of the first guess r = 0 is multiplied by k / (k + kappa) = 2 / 7 twice.
answer = 3 * (1 - (2 / 7) ** 2)
""",
    ),
    Exercise(
        "1.7",
        2,
        "second derivative without contact, with contact [N/mm]",
        lambda: (k - k**2 / 2.7, 2.7 - k),
        (
            ((2.7 - k, k - k**2 / 2.7), "order"),
            ((k, 2.7 - k), "Without contact the term -r^2 / (2 gamma) remains, and r' is k."),
            ((k - k**2 / 2.7, k - k**2 / 2.7), "With contact the bracket has the slope k - gamma."),
        ),
        (
            "Differentiate each of the three terms twice. The derivative of r(u) is k.",
            "The second derivatives are k, -k^2 / gamma, and (k - gamma)^2 / gamma if r > gamma u.",
            "Add the first two without contact, and all three with contact.",
        ),
        """
# Second differences of Nitsche's function, which consists of two parabolas.
def nitsche_energy(u, gamma=2.7):
    r = k * (u - g0) + F
    return k * (u - g0) ** 2 / 2 + F * u + (max(r - gamma * u, 0) ** 2 - r**2) / (2 * gamma)
def curvature(u):
    return nitsche_energy(u + 1) - 2 * nitsche_energy(u) + nitsche_energy(u - 1)
answer = (curvature(10.0), curvature(-10.0))  # r - gamma u = 3 - 0.7 u is negative at 10
""",
    ),
    Exercise(
        "1.8",
        2,
        "ratio of two gaps [-]",
        lambda: last_ratio(0.4),
        (
            (np.exp(-0.4 * F), "The contact force is F - k g_0, and not F."),
            (np.exp(-3.0), "The step size alpha = 0.4 is missing in the exponent."),
            (0.4 * 3, "This is how much psi falls in a step; the gap is its exponential."),
        ),
        (
            "Run proximal_galerkin(12, alpha=0.4) and divide the last gap by the last but one.",
            "In each step psi falls by alpha E'(u), and E' tends to the contact force.",
            "The gap is exp(psi), so that it is multiplied by exp(-alpha r).",
        ),
        """
# The gap shrinks by exp(-alpha r) with r = 3 N, once the gap is small.
gaps, _ = proximal_galerkin(12, alpha=0.4)
answer = gaps[-1] / gaps[-2]
""",
    ),
    Exercise(
        "1.9",
        3,
        "forces on the upper and on the lower node [N]",
        lambda: Forces(chain()),
        (
            ((-1.95, 4.45), "tension"),
            ((0.0, 0.0), "penetration"),
            ((0.0, 5.0), "distance"),
            (((0.0, 3.8, 0.0),), "shape"),
        ),
        (
            "Write K for the two displacements: the spring between the nodes feels their difference.",
            "Each node is open or touches: four cases. Solve each of them, and look at the signs.",
            "If both touch, the floor has to pull at one of them. So this one is open.",
        ),
        """
# Both nodes touch: the upper one is pulled. So it is open, and only the lower one touches.
K_2, g_2, load_2 = np.array([[4.5, -1.5], [-1.5, 1.5]]), np.array([0.5, 0.2]), np.array([0.0, 4.0])
v = cp.Variable(2)
floors = v >= 0
cp.Problem(cp.Minimize(cp.quad_form(v - g_2, K_2) / 2 + load_2 @ v), [floors]).solve(solver=cp.CLARABEL)
answer = floors.dual_value
""",
    ),
)
