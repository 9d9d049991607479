"""The exercises of chapter 7: duality."""

import numpy as np

from contactopt import InterfaceProblem, laws, solve
from experiments.course.feedback import Numbers, Open
from experiments.course.grader import Exercise

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


EXERCISES = (
    Exercise(
        "7.1",
        1,
        "value of the conjugate [N mm]",
        lambda: 2.9**2 / (2 * 4.3),
        (
            (4.3 * 2.9**2 / 2, "A conjugate exchanges stiffness and compliance."),
            (2.9**2 / 4.3, "half"),
            (0.0, "This is the conjugate for a rigid floor, kappa -> infinity."),
            (-(2.9**2) / (2 * 4.3), "sign"),
        ),
        (
            "f*(-r) is the largest value of -r u - f(u) over all u.",
            "The derivative is zero at u = -r / kappa.",
            "Insert this u: r^2 / kappa - r^2 / (2 kappa).",
        ),
        """
# The supremum on a fine grid.
ways = np.linspace(-5, 5, 1000001)
answer = np.max(-2.9 * ways - 4.3 / 2 * np.maximum(-ways, 0) ** 2)
""",
    ),
    Exercise(
        "7.2",
        2,
        "springs, contact, friction [N mm]",
        lambda: parts(U, R),
        (
            (lambda: np.multiply(parts(U, R), (2, 1, 1)), "The springs have a factor of one half."),
            (lambda: np.add(parts(U, R), (0, 0, 2 * 1.02)), "r_t u_t is negative here: add it."),
            (lambda: parts(U, R)[::-1], "order"),
            (lambda: (*parts(U, R)[:2], 1.7), "Friction has two terms: g |u_t| and r_t u_t."),
        ),
        (
            "Compute z = u - q and Q r first.",
            "z - Q r = (0.5, -0.1): half of its product with K is the part of the springs.",
            "The other parts are r_n u_n and g |u_t| + r_t u_t.",
        ),
        """
apart = np.array([0.1, 1.7]) - q - Q @ [2.0, -0.6]
answer = (apart @ K @ apart / 2, 2.0 * 0.1, 1.0 * 1.7 - 0.6 * 1.7)
whole = (U_gap := np.array([0.1, 1.7]) - q) @ K @ U_gap / 2 + 1.7
force = np.array([2.0, -0.6])
assert np.isclose(sum(answer), whole + force @ Q @ force / 2 + q @ force)  # P - D
""",
    ),
    Exercise(
        "7.3",
        1,
        "bound [N mm]",
        lambda: primal(TRIED) - dual(KNOWN),
        (
            (lambda: primal(TRIED), "This is P. A lower bound of the minimum is missing."),
            (lambda: dual(KNOWN), "This is D(r), a lower bound of the minimum itself."),
            (lambda: dual(KNOWN) - primal(TRIED), "sign"),
            (lambda: primal(TRIED, 0.0) - dual(KNOWN), "P also has the work of friction, g |u_t|."),
        ),
        (
            "The minimum is at least D(r), for every admissible r.",
            "So the energy can fall by P(u) - D(r) at most.",
            "P(u) = (u - q)' K (u - q) / 2 + g |u_t|, D(r) = -r' Q r / 2 - q' r.",
        ),
        """
# The sum of the three parts of the gap.
tried, known = np.array([0.0, 2.1]), np.array([2.1, -0.4])
apart = tried - q - Q @ known
answer = apart @ K @ apart / 2 + tried[0] * known[0] + g * abs(tried[1]) + tried[1] * known[1]
""",
    ),
    Exercise(
        "7.4",
        2,
        "r_n, r_t [N]",
        lambda: (-2.1, -1.1),
        (
            ((0.0, -1.1), "This floor also pulls: no constraint r_n >= 0 remains."),
            ((0.1, 1.1), "Friction acts along the slip here. It must act against it."),
            ((-1.0, 0.0), "This is the solution without friction."),
            ((2.1, 1.1), "sign"),
        ),
        (
            "The primal constraint is u_n = 0. For which r_n is the minimum of r_n u_n finite?",
            "For every r_n: the dual has no constraint on r_n.",
            "Minimise r' Q r / 2 + q' r subject to |r_t| <= 1.1 only.",
        ),
        """
x = cp.Variable(2)
cost = cp.quad_form(x, cp.psd_wrap(Q)) / 2 + np.array([1.0, 5.2]) @ x
cp.Problem(cp.Minimize(cost), [cp.abs(x[1]) <= 1.1]).solve(solver=cp.CLARABEL)
answer = x.value
""",
    ),
    Exercise(
        "7.5",
        2,
        "derivative [mm]",
        lambda: abs(slip(0.83)),
        (
            (
                lambda: 0.83 * slip(0.83),
                "This is the work of friction. Asked is the derivative by g.",
            ),
            (lambda: -slip(0.83), "sign"),
            (2.17, "This is the normal force."),
        ),
        (
            "In P only the last term contains g.",
            "At the minimum the change of u does not count: differentiate with u held fixed.",
            "The derivative is |u_t| at the solution.",
        ),
        """
# A central difference of the minimum.
def least(bound):
    v = cp.Variable(2)
    energy = cp.quad_form(v - q, K) / 2 + bound * cp.abs(v[1])
    return cp.Problem(cp.Minimize(energy), [v[0] >= 0]).solve(
        solver=cp.CLARABEL, tol_gap_abs=1e-12, tol_gap_rel=1e-12, tol_feas=1e-12
    )
answer = (least(0.84) - least(0.82)) / 0.02
""",
    ),
    Exercise(
        "7.6",
        2,
        "r_n, r_t [N]",
        lambda: Open((2.01, -0.995), nearly),
        (
            ((2.0, -1.0), "This is the solution"),
            ((2.0, -1.01), "not admissible"),
            ((1.5, -1.0), "The gap is"),
            ((2.0, 1.0), "The gap is"),
        ),
        (
            "The solution of the dual is r = (2, -1). The gap is zero there.",
            "Go a small way from it, but stay admissible: |r_t| <= 1.",
            "The gap of (2, -1 + e) is about e. So e must be smaller than 0.01, but for r_n.",
        ),
        """
# A change of r_n costs only its square, since u_n = 0.
answer = (2.05, -1.0)
print(models.tresca(node, form="dual"))
""",
    ),
    Exercise(
        "7.7",
        1,
        "smallest gap [mm]",
        lambda: 0.35 * 1.3,
        (
            (
                1.3 / 0.35,
                "The dual cone is flat where the cone of forces is steep: u_n >= mu |u_t|.",
            ),
            (0.0, "Coulomb's law allows this, the associated law does not."),
            (1.3, "The coefficient does not appear in your answer."),
        ),
        (
            "A displacement is in the dual cone if no force of the cone does negative work on it.",
            "r_n u_n + r_t u_t is smallest for r_t = -mu r_n.",
            "u_n >= mu |u_t|.",
        ),
        """
# The smallest u_n for which the work of no force of the cone is negative.
forces_7 = np.column_stack([np.ones(201), np.linspace(-0.35, 0.35, 201)])
answer = np.max(-forces_7[:, 1] * 1.3)
""",
    ),
    Exercise(
        "7.8",
        2,
        "energy [N mm]",
        lambda: (np.hypot(17.3, 1.4) - 17.3) ** 2 / 4,
        (
            ((np.hypot(17.3, 1.4) - 17.3) ** 2 / 2, "half"),
            (np.hypot(17.3, 1.4) - 17.3, "This is the penetration of the cone [mm], no energy."),
            ((np.hypot(17.3, 1.0) - 17.3) ** 2 / 4, "This is the answer for q = (0, 0, 1)."),
        ),
        (
            "Half of the squared distance of (17.3, -17.3, 1.4) from the cone u_n >= |u_t|.",
            "The distance from the cone is (|u_t| - u_n) / sqrt(2).",
            "|u_t| = sqrt(17.3^2 + 1.4^2).",
        ),
        """
# The program of the text. Its value is small, so that a factor brings it to the size of one.
z = cp.Variable(3)
at = z / 100 + np.array([17.3, -17.3, 1.4])
missing = cp.Problem(cp.Minimize(cp.sum_squares(z) / 2), [at[0] >= cp.norm(at[1:])])
answer = missing.solve(solver=cp.CLARABEL, tol_gap_abs=1e-10, tol_gap_rel=1e-10) / 1e4
""",
    ),
    Exercise(
        "7.9",
        3,
        "largest friction force [N]",
        lambda: Numbers(1 / np.sqrt(0.5 / 1.2**2 + 0.5 / 0.5**2)),
        (
            (
                np.sqrt(0.5 * 1.2**2 + 0.5 * 0.5**2),
                "This is the work of slip, f, and not the bound.",
            ),
            (0.85, "The mean of both bounds is no ellipse."),
            (0.5, "This is the bound in the second direction. Along the diagonal it is larger."),
            (np.hypot(1.2, 0.5), "The forces do not reach both bounds at once."),
        ),
        (
            "The conjugate is zero where p' v <= f(v) for all v, and infinite elsewhere.",
            "Substitute w = (1.2 v_1, 0.5 v_2): then f is |w|, whose conjugate you know.",
            "p is admissible if (p_1 / 1.2)^2 + (p_2 / 0.5)^2 <= 1.",
        ),
        """
# The largest p = a (1, 1) / sqrt(2) with p' v <= f(v) for 100,000 directions v.
turn = np.linspace(0, 2 * np.pi, 100001)
v_1, v_2 = np.cos(turn), np.sin(turn)
ahead = v_1 + v_2 > 0.01
answer = np.min((np.hypot(1.2 * v_1, 0.5 * v_2) * np.sqrt(2))[ahead] / (v_1 + v_2)[ahead])
""",
    ),
)
