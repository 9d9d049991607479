"""The exercises of chapter 7: duality."""

import numpy as np

from contactopt import InterfaceProblem, laws, solve
from experiments.course.feedback import Open
from experiments.course.quantities import Numbers, by_hand

Q, q = np.array([[1.0, -1.0], [-1.0, 2.0]]), np.array([-3.0, 5.0])  # the node of the chapter
K = np.linalg.inv(Q)


def primal(u: np.ndarray, g: float = 1.0) -> float:
    return float((u - q) @ K @ (u - q) / 2 + g * abs(u[1]))


def dual(r: np.ndarray) -> float:
    return float(-r @ Q @ r / 2 - q @ r)


def parts(u: np.ndarray, r: np.ndarray, g: float = 1.0) -> tuple[float, float, float]:
    """The parts of the gap: springs, contact, friction."""
    apart = u - q - Q @ r
    return float(apart @ K @ apart / 2), u[0] * r[0], g * abs(u[1]) + u[1] * r[1]


U, R = np.array([0.1, 1.7]), np.array([2.0, -0.6])  # of exercise 7.2
TRIED, KNOWN = np.array([0.0, 2.1]), np.array([2.1, -0.4])  # of exercise 7.3


def node(g: float) -> InterfaceProblem:
    return InterfaceProblem(Q, [q], laws.Tresca(np.array([g])))


def slip(g: float) -> float:
    return float(node(g).displacements(solve(node(g)).reactions, [])[0, 1])


def nearly(r: np.ndarray) -> str | None:
    """Whether r is admissible, no solution, and has a gap below 0.01 N mm with u = (0, 1)."""
    if r[0] < 0 or abs(r[1]) > 1:
        return "These forces are not admissible: D is -infinity, and the gap is infinite."
    if np.allclose(r, (2, -1), atol=1e-6):
        return "This is the solution. Give other forces."
    gap = primal(np.array([0.0, 1.0])) - dual(r)
    return None if gap < 0.01 else f"The gap is {gap:.3g} N mm, too large."


GRADED = {
    "7.1": (
        None,
        (4.3 * 2.9**2 / 2, "A conjugate exchanges stiffness and compliance."),
        (2.9**2 / 4.3, "half"),
        (0.0, "This is the conjugate for a rigid floor, kappa -> infinity."),
        (-(2.9**2) / (2 * 4.3), "sign"),
    ),
    "7.2": (
        lambda: Numbers(
            parts(U, R),
            formulas=(
                "(2 * z_n**2 + 2 * z_n * z_t + z_t**2) / 2",
                "r_n * u_n",
                "g * u_t + r_t * u_t",
            ),
            given={"z_n": 0.5, "z_t": -0.1, "r_n": 2.0, "u_n": 0.1}
            | {"g": 1.0, "u_t": 1.7, "r_t": -0.6},
            least=(0.0, "No part of the gap is negative."),
        ),
        (lambda: np.multiply(parts(U, R), (2, 1, 1)), "The springs have a factor of one half."),
        (lambda: np.add(parts(U, R), (0, 0, 2 * 1.02)), "r_t u_t is negative here: add it."),
        (lambda: parts(U, R)[::-1], "order"),
        (lambda: (*parts(U, R)[:2], 1.7), "Friction has two terms: g |u_t| and r_t u_t."),
    ),
    "7.3": (
        None,
        (lambda: primal(TRIED), "This is P. A lower bound of the minimum is missing."),
        (lambda: dual(KNOWN), "This is D(r), a lower bound of the minimum itself."),
        (lambda: dual(KNOWN) - primal(TRIED), "sign"),
        (lambda: primal(TRIED, 0.0) - dual(KNOWN), "P also has the work of friction, g |u_t|."),
    ),
    "7.4": (
        None,
        ((0.0, -1.1), "This floor also pulls: no constraint r_n >= 0 remains."),
        ((0.1, 1.1), "Friction acts along the slip here. It must act against it."),
        ((-1.0, 0.0), "This is the solution without friction."),
        ((2.1, 1.1), "sign"),
    ),
    "7.5": (
        None,
        (lambda: 0.83 * slip(0.83), "This is the work of friction. Asked is the derivative by g."),
        (lambda: -slip(0.83), "sign"),
        (2.17, "This is the normal force."),
    ),
    "7.6": (
        lambda: Open((2.01, -0.995), nearly),
        ((2.0, -1.0), "This is the solution"),
        ((2.0, -1.01), "not admissible"),
        ((1.5, -1.0), "The gap is"),
        ((2.0, 1.0), "The gap is"),
    ),
    "7.7": (
        None,
        (1.3 / 0.35, "The dual cone is flat where the cone of forces is steep: u_n >= mu |u_t|."),
        (0.0, "Coulomb's law allows this, the associated law does not."),
        (1.3, "The coefficient does not appear in your answer."),
    ),
    "7.8": (
        None,
        ((np.hypot(17.3, 1.4) - 17.3) ** 2 / 2, "half"),
        (np.hypot(17.3, 1.4) - 17.3, "This is the penetration of the cone [mm], no energy."),
        ((np.hypot(17.3, 1.0) - 17.3) ** 2 / 4, "This is the answer for q = (0, 0, 1)."),
    ),
    "7.9": (
        None,
        (np.sqrt(0.5 * 1.2**2 + 0.5 * 0.5**2), "This is the work of slip, f, and not the bound."),
        (0.85, "The mean of both bounds is no ellipse."),
        (0.5, "This is the bound in the second direction. Along the diagonal it is larger."),
        (np.hypot(1.2, 0.5), "The forces do not reach both bounds at once."),
    ),
}
