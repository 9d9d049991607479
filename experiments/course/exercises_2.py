"""The exercises of chapter 2: friction at one node."""

import cvxpy as cp
import numpy as np

from contactopt import InterfaceProblem, all_solutions
from experiments.course.feedback import Forces, Open
from experiments.course.quantities import by_hand

Q, q = np.array([[1.0, -1.0], [-1.0, 2.0]]), np.array([-3.0, 5.0])  # the node of the chapter
APART = np.diag([1.2, 2.5]), np.array([-1.5, 1.1])
STIFFER = np.array([[1.3, -0.8], [-0.8, 2.0]])
SPACE = np.diag([1.0, 1.0, 3.0]), np.array([-2.0, 1.5, 2.0])


def associated(Q: np.ndarray, q: np.ndarray, mu: float) -> np.ndarray:
    """The forces of the minimum over the cone."""
    r = cp.Variable(len(q))
    cost = cp.quad_form(r, cp.psd_wrap(Q)) / 2 + q @ r
    cp.Problem(cp.Minimize(cost), [cp.SOC(mu * r[0], r[1:])]).solve(solver=cp.CLARABEL)
    return r.value


def lift() -> float:
    return float((Q @ associated(Q, q, 0.7) + q)[0])


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
    "2.1": (
        lambda: Forces(InterfaceProblem(APART[0], [APART[1]], 0.3)),
        ((1.25, 0.375), "along"),
        ((1.25, -0.44), "bound"),
        ((1.25, 0.0), "frictionless"),
        ((1.0, -0.3), "penetration"),
        ((1.25, -0.2), "loose"),
    ),
    "2.2": (
        None,
        (5.3 / 3.1, "This is the ratio of displacements. The cone is one of forces: r = -K q."),
        (0.9 / 2.2, "You divided the normal force by the friction force."),
        (2.2, "This is the friction force [N]. Compare it with the normal force."),
        (-2.2 / 0.9, "sign"),
    ),
    "2.3": (
        lambda: Forces(InterfaceProblem(Q, [q], 1.5)),
        (lambda: associated(Q, q, 1.5), "associated"),
        ((1.0, -2.0), "bound"),
        ((1.2, 1.8), "along"),
        ((3.0, 0.0), "frictionless"),
    ),
    "2.4": (
        None,
        ((0.26, 0.29), "shape"),
        ((0.29, 0.26, 0.0), "order"),
        ((0.0, 0.13 / 2.5, 0.29), "Slip to the left needs friction to the right, r_t = +mu r_n."),
        ((0.0, 0.26, 0.42), "This is the friction force of the sticking node, not its r_n."),
    ),
    "2.5": (
        None,
        (0.0, "Coulomb's law would close the gap. The associated law lifts a node that slips."),
        (lambda: lift() / 0.7, "This is the slip. The gap is mu times the slip."),
        (0.3, "This is the gap for mu = 0.5."),
    ),
    "2.6": (
        None,
        (0.8 / 1.3, "This is the inverse: a weaker coupling Q_nt allows more friction, not less."),
        (2.0 / 0.8, "Here Q_nn counts, and not Q_tt: a larger r_n must not close the gap."),
        (np.sqrt(1.3 / 2.0), "The coupling Q_nt must appear: without it nothing wedges."),
    ),
    "2.7": (
        lambda: Open((0.13, -0.55), another_load),
        ((-3.0, 5.0), "presses the node"),
        ((1.0, -5.0), "This is the load of the text"),
        ((0.1, 0.5), "outside the cone"),
        ((0.0, 0.0), "Without any load"),
    ),
    "2.8": (
        None,
        (0.7 * 0.8 / 1.3, "sign"),
        (-0.7 * 0.8, "The new r_n is what closes the gap: divide by Q_nn."),
        (-0.8 / 1.3, "This is the factor from g to r_n. The new bound is mu r_n."),
    ),
    "2.9": (
        lambda: Forces(InterfaceProblem(SPACE[0], [SPACE[1]], 0.5)),
        ((2.0, -0.6, -0.8), "direction"),
        ((2.0, -1.0, -2.0 / 3), "bound"),
        ((2.0, 0.0, 0.0), "frictionless"),
        ((2.0, 0.6, 0.8), "along"),
    ),
    "2.10": (
        None,
        (-0.35 * 4.8 * 0.8, "Friction is negative: r_t = -mu r_n. Insert both signs."),
        (4.8 * 0.8, "The friction force is mu times the normal force."),
        (0.0, "Only the normal parts vanish, because u_n = 0 in both states."),
    ),
    "2.11": (
        None,
        (0.35 * 30 * 0.04 * 1.7, "This is the way out. On the way back a part is given back."),
        (0.35 * 30 * 0.05 * 1.7, "On the way back friction pushes along: subtract its work."),
        (30 * 0.03 * 1.7, "The friction force is mu times the normal force."),
    ),
}
