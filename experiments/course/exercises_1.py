"""The exercises of chapter 1: a spring, a node and a floor."""

import numpy as np

from contactopt import InterfaceProblem
from experiments.course.feedback import Forces, State
from experiments.course.quantities import by_hand

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


GRADED = {
    "1.1": (
        lambda: State(1 / 4.4, 0.6 - 6.5 / 4.4),
        ((0.6 - 6.5 / 4.4, 0.0), "penetration"),
        ((0.0, 4.4 * 0.6 - 6.5), "tension"),
        ((0.0, 6.5), "balance"),
        ((0.6, 3.86), "distance"),
    ),
    "1.2": (
        None,
        (4.4 / 0.6, "A stiffness over a length is no force: look at the units."),
        (0.6 / 4.4, "A length over a stiffness is no force: look at the units."),
        (4.4 * 0.6**2 / 2, "This is the energy of the spring [N mm], not its force [N]."),
    ),
    "1.3": (
        None,
        (1 / 2.3, "This is the compliance in mm/N. A millimetre is a thousandth of a metre."),
        (1e3 / 2.3, "You converted the wrong way: as a number of metres a length is smaller."),
        (2300.0, "This is the stiffness in N/m. The compliance is its inverse."),
    ),
    "1.4": (
        None,
        (5.3, "The ceiling does not carry the whole pull: the stretched spring holds a part."),
        (1 + 5.3 / 2, "This is where the node would be without a ceiling, a length [mm]."),
        (0.0, "This is the multiplier of the floor. The node is at the ceiling."),
        (-3.3, "sign"),
    ),
    "1.5": (
        None,
        ((F - k * g0) / 0.007 - k, "This is kappa in N/mm. Give it as a multiple of k."),
        ((F - k * g0) / 0.007 / k, "This is (k + kappa) / k: the spring k helps, too."),
        ((F / 0.007 - k) / k, "The penalty spring carries F - k g_0, and not all of F."),
    ),
    "1.6": (
        None,
        (lambda: multipliers(1, 5.0), "This is the first step, which is the penalty method."),
        (F - k * g0, "This is the limit of many steps. Two steps come near it."),
        (
            3 * (1 - (5 / 7) ** 2),
            "An error shrinks by k / (k + kappa), not by kappa / (k + kappa).",
        ),
    ),
    "1.7": (
        None,
        ((2.7 - k, k - k**2 / 2.7), "order"),
        ((k, 2.7 - k), "Without contact the term -r^2 / (2 gamma) remains, and r' is k."),
        ((k - k**2 / 2.7, k - k**2 / 2.7), "With contact the bracket has the slope k - gamma."),
    ),
    "1.8": (
        None,
        (np.exp(-0.4 * F), "The contact force is F - k g_0, and not F."),
        (np.exp(-3.0), "The step size alpha = 0.4 is missing in the exponent."),
        (0.4 * 3, "This is how much psi falls in a step; the gap is its exponential."),
    ),
    "1.9": (
        lambda: Forces(chain()),
        ((-1.95, 4.45), "tension"),
        ((0.0, 0.0), "penetration"),
        ((0.0, 5.0), "distance"),
        (((0.0, 3.8, 0.0),), "shape"),
    ),
}
