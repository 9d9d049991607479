"""The exercises of chapter 2: friction at one node."""

import cvxpy as cp
import numpy as np

from contactopt import InterfaceProblem, all_solutions
from experiments.course.feedback import Forces, Open
from experiments.course.grader import Exercise

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


def three_solutions() -> list[float]:
    found = all_solutions(InterfaceProblem(Q, [[0.13, -0.55]], 1.5))
    return sorted(float(each.reactions[0, 0]) for each in found)


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


EXERCISES = (
    Exercise(
        "2.1",
        1,
        "r_n, r_t [N]",
        lambda: Forces(InterfaceProblem(APART[0], [APART[1]], 0.3)),
        (
            ((1.25, 0.375), "along"),
            ((1.25, -0.44), "bound"),
            ((1.25, 0.0), "frictionless"),
            ((1.0, -0.3), "penetration"),
            ((-0.375, 1.25), "order"),
            ((1.25, -0.2), "loose"),
        ),
        (
            "Q is diagonal, so that nothing couples the directions. Find r_n first.",
            "Suppose that the node sticks, u_t = 0. Is the friction force that it needs allowed?",
            "It is not. So the node slips, with |r_t| = mu r_n against the slip.",
        ),
        """
# r_n = 1.5 / 1.2 N. To stick, the node would need r_t = -1.1 / 2.5 = -0.44 N, more than the bound
# 0.3 * 1.25 = 0.375 N. So it slips to the right, by 1.1 - 2.5 * 0.375 mm, and r_t = -0.375 N.
answer = (1.5 / 1.2, -0.3 * 1.5 / 1.2)
""",
    ),
    Exercise(
        "2.2",
        1,
        "friction coefficient [-]",
        lambda: 2.2 / 0.9,
        (
            (5.3 / 3.1, "This is the ratio of displacements. The cone is one of forces: r = -K q."),
            (0.9 / 2.2, "You divided the normal force by the friction force."),
            (2.2, "This is the friction force [N]. Compare it with the normal force."),
            (-2.2 / 0.9, "sign"),
        ),
        (
            "If the node sticks, u = 0. Which force does this need?",
            "It needs r = -K q. Compute both components.",
            "The cone |r_t| <= mu r_n has to contain this force.",
        ),
        """
# The smallest coefficient whose cone contains the sticking force.
f_n, f_t = -np.linalg.solve(Q, [-3.1, 5.3])
answer = abs(f_t) / f_n
""",
    ),
    Exercise(
        "2.3",
        2,
        "r_n, r_t [N]",
        lambda: Forces(InterfaceProblem(Q, [q], 1.5)),
        (
            (lambda: associated(Q, q, 1.5), "associated"),
            ((1.0, -2.0), "bound"),
            ((1.2, 1.8), "along"),
            ((3.0, 0.0), "frictionless"),
        ),
        (
            "Start from the program of associated friction, and add mu sigma r_n to its cost.",
            "Make sigma a cp.Parameter, zero at first. After each solve it becomes |u_t|.",
            "An error shrinks to 0.7 of its size in each step, so about 30 steps are needed.",
        ),
        """
x, shift = cp.Variable(2), cp.Parameter(nonneg=True, value=0.0)
cost = cp.quad_form(x, cp.psd_wrap(Q)) / 2 + q @ x + 1.5 * shift * x[0]
program = cp.Problem(cp.Minimize(cost), [cp.SOC(1.5 * x[0], x[1:])])
for _ in range(60):
    program.solve(solver=cp.CLARABEL)
    shift.value = abs(float((Q @ x.value + q)[1]))
answer = x.value
""",
    ),
    Exercise(
        "2.4",
        1,
        "three normal forces, the smallest first [N]",
        three_solutions,
        (
            ((0.26, 0.29), "shape"),
            ((0.29, 0.26, 0.0), "order"),
            (
                (0.0, 0.13 / 2.5, 0.29),
                "Slip to the left needs friction to the right, r_t = +mu r_n.",
            ),
            ((0.0, 0.26, 0.42), "This is the friction force of the sticking node, not its r_n."),
        ),
        (
            "Try the three states open (r = 0), stick (u = 0), and slip to the left.",
            "Stick: r = -K q. Slip to the left: u_n = 0 with r_t = +1.5 r_n.",
            "While it slips to the left, u_n = (1 - 1.5) r_n + 0.13.",
        ),
        """
# Open: u = q, whose gap 0.13 mm is allowed. Stick: r = -K q, in the cone because 0.42 <= 1.5 * 0.29.
# Slip to the left: (1 - 1.5) r_n + 0.13 = 0; the slip -0.26 + 2 * 0.39 - 0.55 = -0.03 mm is negative.
stick = -np.linalg.solve(Q, [0.13, -0.55])
answer = (0.0, 0.13 / 0.5, stick[0])
""",
    ),
    Exercise(
        "2.5",
        2,
        "gap [mm]",
        lift,
        (
            (0.0, "Coulomb's law would close the gap. The associated law lifts a node that slips."),
            (lambda: lift() / 0.7, "This is the slip. The gap is mu times the slip."),
            (0.3, "This is the gap for mu = 0.5."),
        ),
        (
            "Solve the cone program of the text with mu = 0.7, and compute u = Q r + q.",
            "By hand: on the edge of the cone r_t = -mu r_n, and one unknown is left.",
            "The minimum is at r_n = (-q_n + mu q_t) / (Q_nn - 2 mu Q_nt + mu^2 Q_tt).",
        ),
        """
# On the edge r = r_n (1, -mu). The derivative of the energy along the edge is zero.
edge = np.array([1.0, -0.7])
force = -(edge @ q) / (edge @ Q @ edge) * edge
answer = (Q @ force + q)[0]
""",
    ),
    Exercise(
        "2.6",
        1,
        "friction coefficient [-]",
        lambda: STIFFER[0, 0] / abs(STIFFER[0, 1]),
        (
            (
                0.8 / 1.3,
                "This is the inverse: a weaker coupling Q_nt allows more friction, not less.",
            ),
            (2.0 / 0.8, "Here Q_nn counts, and not Q_tt: a larger r_n must not close the gap."),
            (np.sqrt(1.3 / 2.0), "The coupling Q_nt must appear: without it nothing wedges."),
        ),
        (
            "Let the node slip to the left. Then r_t = +mu r_n. How does u_n depend on r_n?",
            "u_n = (Q_nn + mu Q_nt) r_n + q_n, and Q_nt is negative.",
            "A larger force must open the gap: the factor of r_n has to be positive.",
        ),
        """
# Is there a load (0.01, -b) with more than one solution?
def several(mu, Q_2=np.array([[1.3, -0.8], [-0.8, 2.0]])):
    loads = np.linspace(0.0, 1.0, 21)
    return any(len(all_solutions(InterfaceProblem(Q_2, [[0.01, -b]], mu))) > 1 for b in loads)
assert not several(1.60) and several(1.66)
answer = 1.3 / 0.8  # Q_nn + mu Q_nt = 0
""",
    ),
    Exercise(
        "2.7",
        3,
        "q_n, q_t [mm]",
        lambda: Open((0.13, -0.55), another_load),
        (
            ((-3.0, 5.0), "presses the node"),
            ((1.0, -5.0), "This is the load of the text"),
            ((0.1, 0.5), "outside the cone"),
            ((0.0, 0.0), "Without any load"),
        ),
        (
            "The node must be able to hang freely: what does this say about q_n?",
            "It must be able to stick as well: -K q lies in the cone.",
            "With q_n = 0.1 the sticking force is (-0.2 - q_t, -0.1 - q_t). Choose q_t < -0.2.",
        ),
        """
# The open state needs q_n >= 0, and the sticking force -K q has to lie in the cone. Between the two
# the node slips to the left.
answer = (0.1, -0.42)
assert len(all_solutions(InterfaceProblem(Q, [answer], 1.5))) == 3
""",
    ),
    Exercise(
        "2.8",
        3,
        "factor of the error in one step, with its sign [-]",
        lambda: 0.7 * STIFFER[0, 1] / STIFFER[0, 0],
        (
            (0.7 * 0.8 / 1.3, "sign"),
            (-0.7 * 0.8, "The new r_n is what closes the gap: divide by Q_nn."),
            (-0.8 / 1.3, "This is the factor from g to r_n. The new bound is mu r_n."),
        ),
        (
            "The node slips to the right, so that r_t = -g. Write down u_n = 0.",
            "Q_nn r_n - Q_nt g + q_n = 0. How does r_n change if g changes by a little?",
            "r_n changes by Q_nt / Q_nn, and the new bound is mu r_n.",
        ),
        """
# Two steps from bounds that differ by 0.01 N, with a load under which the node slips.
def next_bound(bound, Q_2=np.array([[1.3, -0.8], [-0.8, 2.0]])):
    return 0.7 * dual(bound, Q_2, np.array([-3.0, 5.0]))[0]
answer = (next_bound(0.5) - next_bound(0.4)) / 0.1
""",
    ),
    Exercise(
        "2.9",
        3,
        "r_n, r_1, r_2 [N]",
        lambda: Forces(InterfaceProblem(SPACE[0], [SPACE[1]], 0.5)),
        (
            ((2.0, -0.6, -0.8), "direction"),
            ((2.0, -1.0, -2.0 / 3), "bound"),
            ((2.0, 0.0, 0.0), "frictionless"),
            ((2.0, 0.6, 0.8), "along"),
        ),
        (
            "Nothing couples r_n with the rest, so r_n = 2 N and the bound is 1 N.",
            "The compliance differs in the two directions. So the slip is not parallel to q_t.",
            "Minimise over a disc of radius 1 N: cp.norm(t) <= 1 in the dual program.",
        ),
        """
# With r_n = 2 N the bound is known, 1 N, and the rest is one convex program over a disc.
t = cp.Variable(2)
C, c = np.diag([1.0, 3.0]), np.array([1.5, 2.0])
cp.Problem(cp.Minimize(cp.quad_form(t, C) / 2 + c @ t), [cp.norm(t) <= 1]).solve(solver=cp.CLARABEL)
answer = (2.0, *t.value)
""",
    ),
)
