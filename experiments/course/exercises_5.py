"""The exercises of chapter 5: Coulomb friction on an interface."""

from functools import cache

import numpy as np

from contactopt import InterfaceProblem, diagnose, laws, reduce, scenes, solve
from experiments.course.feedback import Forces, Numbers, Open
from experiments.course.grader import Exercise


@cache
def punch(law: float | str = 0.2) -> InterfaceProblem:
    """The block of the chapter, with a friction coefficient or with associated friction, 0.35."""
    one = reduce(scenes.flat_punch(2, mu=0.2, elements=24))
    other = laws.Associated(0.35) if law == "associated" else law
    return InterfaceProblem(
        one.Q, one.q, other, one.V, one.s, coordinates=one.coordinates, motions=("the plate",)
    )


@cache
def forces_of(law: float | str) -> np.ndarray:
    return solve(punch(law)).reactions


def slipping(mu: float) -> int:
    r = forces_of(mu)
    return int(np.sum((abs(r[:, 1]) > (1 - 1e-6) * mu * r[:, 0]) & (r[:, 0] > 0)))


@cache
def rate() -> float:
    """The factor per step of Tresca's iteration, an eigenvalue of its derivative."""
    return diagnose(punch(), solve(punch())).local.tresca_rate


def on_the_cone(shift: float) -> np.ndarray:
    """The point of the cone |r_t| <= 0.4 r_n nearest to r - 2 (u + shift n), outside of it."""
    y, edge = np.array([2.3 - 2 * (0.1 + shift), -1.5 - 2 * 0.3]), np.array([1.0, -0.4])
    return (y @ edge) / (edge @ edge) * edge


def unknowns() -> tuple[float, ...]:
    """r_n, r_plus, r_minus and sigma of the node of chapter 2 with mu = 0.6."""
    node = InterfaceProblem([[1.0, -1.0], [-1.0, 2.0]], [[-3.0, 5.0]], 0.6)
    r = solve(node).reactions
    return r[0, 0], max(r[0, 1], 0.0), max(-r[0, 1], 0.0), abs(node.displacements(r, [])[0, 1])


def slides(motion: np.ndarray) -> str | None:
    """Whether a motion proves that no forces hold the sledge."""
    up, along = motion
    least = 1e-6 * max(abs(up), abs(along))
    if up < 0.26 * abs(along) - least:
        return "Forces on the edge of a cone can do negative work: up must be >= mu |along|."
    if -110 * up + 31 * along <= least:
        return f"The load does the work {-110 * up + 31 * along:.3g}, which is not positive."
    return None


EXERCISES = (
    Exercise(
        "5.1",
        1,
        "friction coefficient [-]",
        lambda: 23 / 130,
        (
            (130 / 23, "You divided the normal force by the friction force."),
            (23 / 65, "One runner carries half of the weight, but both runners hold."),
            (23 / 260, "Two runners carry the weight once, not twice."),
        ),
        (
            "What do both runners carry together, and what must they hold together?",
            "They carry 130 N, so that friction can hold up to mu * 130 N.",
            "It has to hold 23 N.",
        ),
        """
# A linear program: each runner carries 65 N, and the friction forces hold the pull.
least, friction = cp.Variable(), cp.Variable(2)
law = [cp.abs(friction) <= 65 * least, cp.sum(friction) == -23]
answer = cp.Problem(cp.Minimize(least), law).solve(solver=cp.CLARABEL)
""",
    ),
    Exercise(
        "5.2",
        1,
        "largest pull [N]",
        lambda: 0.06 * 82 + 0.45 * 21,
        (
            (
                (0.06 + 0.45) / 2 * 103,
                "The mean coefficient does not count: most weight is on ice.",
            ),
            (0.45 * 21, "The runner on ice holds something as well."),
            (0.06 * 103, "The runner on stone holds more than that."),
            (0.06 * 21 + 0.45 * 82, "The front runner, with 82 N, stands on ice."),
        ),
        (
            "Each runner holds up to its own coefficient times its own normal force.",
            "The friction forces are the unknowns, and their sum is the pull.",
            "Maximise the sum subject to |f_1| <= 0.06 * 82 and |f_2| <= 0.45 * 21.",
        ),
        """
friction = cp.Variable(2)
limits = np.array([0.06 * 82, 0.45 * 21])
answer = cp.Problem(cp.Maximize(cp.sum(friction)), [cp.abs(friction) <= limits]).solve(
    solver=cp.CLARABEL
)
""",
    ),
    Exercise(
        "5.3",
        2,
        "slipping nodes with mu = 0.2, with mu = 0.1",
        lambda: (slipping(0.2), slipping(0.1)),
        (
            (lambda: (slipping(0.1), slipping(0.2)), "order"),
            (lambda: (25 - slipping(0.2), 25 - slipping(0.1)), "These are the nodes that stick."),
            (
                lambda: (slipping(0.2),) * 2,
                "`newton` reads mu and the problem: change both for 0.1.",
            ),
        ),
        (
            "A node slips if its friction force has reached the bound mu r_n.",
            "Compare with a small tolerance, and count only nodes with r_n > 0.",
            "InterfaceProblem(Q, problem.q, 0.1, V, s) is the block with mu = 0.1.",
        ),
        """
# The second way: nodes that slip move, and nodes that stick do not.
counts = []
for coefficient in (0.2, 0.1):
    other = InterfaceProblem(Q, problem.q, coefficient, V, s)
    found = solve(other, tol=1e-12)
    slip = other.displacements(found.reactions, found.multipliers)[:, 1]
    counts.append(int(np.sum(np.abs(slip) > 1e-9 * np.abs(slip).max())))
answer = tuple(counts)
""",
    ),
    Exercise(
        "5.4",
        2,
        "factor in one step [-]",
        lambda: Numbers(rate(), close=0.04),
        (
            (lambda: rate() ** 4, "This is the factor of four steps. Take the fourth root."),
            (lambda: 1 / rate(), "The certificate falls: divide the later by the earlier one."),
            (lambda: rate() / 4, "Factors multiply. Take a root, and do not divide."),
        ),
        (
            "Plot the certificates over the steps, with a logarithmic axis.",
            "In the middle of the road the ratio of two neighbours is nearly constant.",
            "(history[8] / history[4]) ** (1 / 4) is the mean factor of four steps.",
        ),
        """
history = [entry["residual"] for entry in solve(problem, "tresca", tol=1e-13).history]
answer = (history[8] / history[4]) ** (1 / 4)
""",
    ),
    Exercise(
        "5.5",
        1,
        "normal component, tangential component [N]",
        lambda: (2.1, -0.4 * 2.1),
        (
            ((2.1, -0.4 * 2.3), "The bound comes from the trial force y_n, and not from r_n."),
            (lambda: on_the_cone(0.0), "This is the projection on the cone: associated friction."),
            ((2.1, -2.1), "The tangential part exceeds the bound mu y_n: cut it off."),
            ((2.1, 0.84), "Cutting off keeps the direction of y_t."),
        ),
        (
            "First compute y = r - rho u.",
            "The normal part of P is max(y_n, 0). It makes the bound of the tangential part.",
            "y = (2.1, -2.1), and the bound is 0.4 * 2.1.",
        ),
        """
# contactopt's law has the same map.
from contactopt import laws
y = np.array([[2.3 - 2 * 0.1, -1.5 - 2 * 0.3]])
answer = laws.Coulomb(np.array([0.4])).mapped(y)[0]
""",
    ),
    Exercise(
        "5.6",
        3,
        "normal component, tangential component [N]",
        lambda: tuple(on_the_cone(0.4 * 0.3)),
        (
            (
                lambda: on_the_cone(0.0),
                "The shift mu |u_t| n is missing: this is associated friction.",
            ),
            (
                lambda: on_the_cone(-0.4 * 0.3),
                "The shift makes u_n larger, so that y_n is smaller.",
            ),
            (
                (1.86, -0.4 * 1.86),
                "This cuts off y_t. The nearest point of the cone is another one.",
            ),
        ),
        (
            "First compute y = r - rho (u + mu |u_t| n).",
            "y = (1.86, -2.1) lies beside the cone: the nearest point lies on its edge.",
            "Project y on the direction (1, -0.4).",
        ),
        """
# The nearest point of the cone, by a program.
y, point = np.array([2.3 - 2 * (0.1 + 0.4 * 0.3), -1.5 - 2 * 0.3]), cp.Variable(2)
cp.Problem(cp.Minimize(cp.sum_squares(point - y)), [cp.abs(point[1]) <= 0.4 * point[0]]).solve(
    solver=cp.CLARABEL
)
answer = point.value
""",
    ),
    Exercise(
        "5.7",
        2,
        "25 rows r_n, r_t [N]",
        lambda: Forces(punch(0.35)),
        (
            (lambda: forces_of(0.0), "frictionless"),
            (lambda: forces_of("associated"), "associated"),
            (lambda: forces_of(0.35) * [1, -1], "along"),
            (lambda: 0.98 * forces_of(0.35), "balance"),
            (lambda: forces_of(0.5), "bound"),
        ),
        (
            "Tresca's iteration of the text needs one change: the bound is 0.35 max(r_n, 0).",
            "Start with g.value = np.zeros(k), and take about ten steps.",
            "r.value.reshape(-1, 2) has one row for each node.",
        ),
        """
g.value = np.zeros(k)
for _ in range(12):
    dual.solve(solver=cp.CLARABEL)
    g.value = 0.35 * np.maximum(r.value[n], 0)
answer = r.value.reshape(-1, 2)
""",
    ),
    Exercise(
        "5.8",
        3,
        "up, along [-]",
        lambda: Open((0.27, 1.0), slides),
        (
            ((0.0, 1.0), "can do negative work"),
            ((0.5, 1.0), "The load does the work"),
            ((0.27, -1.0), "The load does the work"),
            ((0.0, 0.0), "The load does the work"),
        ),
        (
            "If forces r in the cones balanced the load, their work r_n up + r_t along would be"
            " minus the work of the load.",
            "Choose the motion so that no force of a cone does negative work: up >= 0.26 |along|.",
            "With along = 1, the load does the work 31 - 110 up. It must be positive.",
        ),
        """
# All forces of the cones do work that is not negative if up >= mu |along|. The load then does positive
# work if up < 31 / 110 along. In balance both would add up to zero. So there is no balance.
answer = ((0.26 + 31 / 110) / 2, 1.0)
""",
    ),
    Exercise(
        "5.9",
        3,
        "r_n [N], r_plus [N], r_minus [N], sigma [mm]",
        unknowns,
        (
            ((1.875, 1.125, 0.0, 0.875), "r_plus pushes to the right, along the slip."),
            ((1.875, 0.0, -1.125, 0.875), "The unknowns of an LCP are never negative."),
            ((1.875, 0.0, 1.125, 0.0), "The node slips, and sigma is its slip."),
        ),
        (
            "r_t = r_plus - r_minus. Which of the two is zero if the node slips to the right?",
            "r_plus = 0 and r_minus = mu r_n. Then u_n = 0 gives r_n.",
            "r_minus is not zero, so that its partner sigma - u_t is.",
        ),
        """
# All ways to choose which of the four unknowns are zero.
M = np.array([[1, -1, 1, 0], [-1, 2, -2, 1], [1, -2, 2, 1], [0.6, -1, -1, 0]])
m = np.array([-3.0, 5.0, -5.0, 0.0])
for choice in range(16):
    on = [i for i in range(4) if choice >> i & 1]
    if np.linalg.matrix_rank(M[np.ix_(on, on)]) == len(on):
        z = np.zeros(4)
        z[on] = np.linalg.solve(M[np.ix_(on, on)], -m[on])
        if z.min() >= -1e-9 and (M @ z + m).min() >= -1e-9:
            answer = z
""",
    ),
)
