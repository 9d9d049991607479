"""The exercises of chapter 3: a string on a floor."""

from functools import cache

import numpy as np

from contactopt import InterfaceProblem
from experiments.course.feedback import Forces
from experiments.course.grader import Exercise

f = 8.0  # N/mm: the weight per length of the chapter's string, 1 mm long, under 1 N


def string(N: int, d: float = 0.25) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stiffness A, compliance Q and gaps without contact q of a string of N elements."""
    A = N * (2 * np.eye(N - 1) - np.eye(N - 1, k=1) - np.eye(N - 1, k=-1))
    Q = np.linalg.inv(A)
    return A, Q, d - Q @ np.full(N - 1, f / N)


def active_set(Q: np.ndarray, q: np.ndarray, touches: np.ndarray) -> tuple[np.ndarray, int]:
    """The forces, and the number of steps from a first guess of the set."""
    steps = 0
    while True:
        r, steps = np.zeros(len(q)), steps + 1
        r[touches] = np.linalg.solve(Q[np.ix_(touches, touches)], -q[touches])
        new = r - (Q @ r + q) > 0
        if np.array_equal(new, touches):
            return r, steps
        touches = new


def on_the_hill() -> tuple[np.ndarray, np.ndarray]:
    _, Q, q = string(40)
    x = np.arange(1, 40) / 40
    return Q, q - np.maximum(0.2 * (1 - ((x - 0.5) / 0.2) ** 2), 0)


def hill_problem() -> InterfaceProblem:
    Q, q = on_the_hill()
    both = np.column_stack([q, np.zeros(39)])
    x, areas = np.arange(1, 40) / 40, np.full(39, 1 / 40)
    return InterfaceProblem(np.kron(Q, np.eye(2)), both, 0.0, areas=areas, coordinates=[x])


def touching(Q: np.ndarray, q: np.ndarray) -> np.ndarray:
    return active_set(Q, q, np.ones(len(q), bool))[0]


@cache
def two_starts() -> tuple[int, int]:
    """Steps on 320 elements from all nodes, and from the set of 160 elements."""
    (_, Q_c, q_c), (_, Q_f, q_f) = string(160), string(320)
    coarse = touching(Q_c, q_c) > 0
    start = np.interp(np.arange(1, 320) / 320, np.arange(1, 160) / 160, coarse) >= 0.5
    return active_set(Q_f, q_f, np.ones(319, bool))[1], active_set(Q_f, q_f, start)[1]


def sweep(together: bool = False, sweeps: int = 1) -> np.ndarray:
    """Projected Gauss-Seidel, or Jacobi if all nodes change together, on four elements."""
    _, Q, q = string(4, 0.07)
    r = np.zeros(3)
    for _ in range(sweeps):
        old = r.copy()
        for i in range(3):
            u = Q[i] @ (old if together else r) + q[i]
            r[i] = max(r[i] - u / Q[i, i], 0.0)
    return r


def carried() -> np.ndarray:
    return touching(*string(40, 0.19)[1:])


a = np.sqrt(2 * 0.07 / f)

EXERCISES = (
    Exercise(
        "3.1",
        1,
        "distance from the end [mm]",
        lambda: a,
        (
            (a / np.sqrt(2), "The parabola is f x^2 / (2 T): a factor of two is missing."),
            (0.5 - a, "This is the distance from the middle. Give that from the end."),
            (2 * a, "This is the length that hangs at both ends together."),
            (0.07 / f, "A height over a weight per length is no length: look at the units."),
        ),
        (
            "The text gives the distance a for any height d.",
            "At the end the parabola has the height d = f a^2 / (2 T).",
            "a = sqrt(2 T d / f) with d = 0.07 mm.",
        ),
        """
# The free part is a parabola that leaves the floor without a kink: u = f (a - x)^2 / (2 T), and u = d
# at x = 0.
from scipy.optimize import brentq
answer = brentq(lambda way: f * way**2 / (2 * T) - 0.07, 0.0, 0.5)
""",
    ),
    Exercise(
        "3.2",
        1,
        "part of the weight [-]",
        lambda: 1 - 2 * a,
        (
            (1 - a, "The string hangs at both ends."),
            (2 * a, "This is the part that the ends carry."),
            (f * (1 - 2 * a), "This is a force [N]. Divide it by the whole weight f L."),
        ),
        (
            "On the floor the string is straight, so that the tension carries nothing there.",
            "So the floor carries exactly the weight of the part that lies on it.",
            "The part that lies on it has the length L - 2 a.",
        ),
        """
# The ends carry the slope of the string there, T f a / T = f a each; the floor carries the rest.
answer = 1 - 2 * f * np.sqrt(2 * T * 0.07 / f) / (f * L)
""",
    ),
    Exercise(
        "3.3",
        2,
        "39 forces [N]",
        lambda: Forces(hill_problem()),
        (
            (lambda: touching(*string(40)[1:]), "penetration"),
            (lambda: np.linalg.solve(on_the_hill()[0], -on_the_hill()[1]), "tension"),
            (lambda: 40 * touching(*on_the_hill()), "pressure"),
            (lambda: -touching(*on_the_hill()), "sign"),
        ),
        (
            "Q does not change. Only the gap is measured from the hill now.",
            "Subtract the height of the hill from q.",
            "active_set(Q, q - hill) returns the forces and the number of steps.",
        ),
        """
# The gap is measured from the hill. The dual program is the second way.
hill = np.maximum(0.2 * (1 - ((x - 0.5) / 0.2) ** 2), 0)
v = cp.Variable(39)
cp.Problem(cp.Minimize(cp.quad_form(v, cp.psd_wrap(Q)) / 2 + (q - hill) @ v), [v >= 0]).solve(solver=cp.CLARABEL)
answer = v.value
""",
    ),
    Exercise(
        "3.4",
        2,
        "steps from all nodes, steps from the coarse set",
        two_starts,
        (
            (lambda: two_starts()[::-1], "order"),
            (lambda: two_starts()[:1] * 2, "The start was not used: change the first `touches`."),
            (
                lambda: (two_starts()[0], 1),
                "One step only solves; another one sees that the set stays.",
            ),
        ),
        (
            "Copy active_set, and give it the first guess as an argument.",
            "On 160 elements, the set is active_set(...)[0] > 0.",
            "np.interp(x_fine, x_coarse, touches) >= 0.5 carries the set to the finer mesh.",
        ),
        """
def from_a_guess(N, touches):
    A_N, w_N, x_N = string(N)
    Q_N, steps = np.linalg.inv(A_N), 0
    while True:
        forces, steps = np.zeros(N - 1), steps + 1
        forces[touches] = np.linalg.solve(Q_N[np.ix_(touches, touches)], (Q_N @ w_N - d)[touches])
        last, touches = touches, forces - (Q_N @ forces + d - Q_N @ w_N) > 0
        if np.array_equal(last, touches):
            return touches, steps, x_N
coarse, _, x_c = from_a_guess(160, np.ones(159, bool))
_, plain, x_f = from_a_guess(320, np.ones(319, bool))
answer = (plain, from_a_guess(320, np.interp(x_f, x_c, coarse) >= 0.5)[1])
""",
    ),
    Exercise(
        "3.5",
        2,
        "three forces after one sweep [N]",
        sweep,
        (
            (
                lambda: sweep(True),
                "This is Jacobi: each node must see the new force of the last one.",
            ),
            (lambda: sweep(sweeps=200), "This is the solution. One sweep does not reach it."),
            (lambda: sweep(sweeps=2), "This is the result of two sweeps."),
            (lambda: sweep()[::-1], "order"),
        ),
        (
            "Node after node: change r_i alone, so that its gap or its force becomes zero.",
            "If r_i changes by x, its own gap changes by Q_ii x.",
            "r_i = max(0, r_i - (Q r + q)_i / Q_ii), with all forces as they are now.",
        ),
        """
# The sweep solves a lower triangular system, as long as no force becomes negative.
A_4, w_4, _ = string(4)
Q_4 = np.linalg.inv(A_4)
answer = np.linalg.solve(np.tril(Q_4), Q_4 @ w_4 - 0.07)
assert answer.min() >= 0
""",
    ),
    Exercise(
        "3.6",
        1,
        "stiffness per length [N/mm^2]",
        lambda: f / 0.0003,
        (
            (f / 0.0003 / 40, "This is the spring of one node [N/mm]. Asked is that per length."),
            (0.0003 / f, "You divided the wrong way: a stiffness is a load over a depth."),
            (0.25 / 0.0003, "The height d does not push; the weight f does."),
        ),
        (
            "The springs carry the weight, and their force per length is kappa times the depth.",
            "kappa * depth = f.",
            "kappa = 8 N/mm / 0.0003 mm.",
        ),
        """
# Where the string is straight, the springs carry its weight: check it with the penalty of the text.
from scipy.optimize import brentq
answer = brentq(lambda kappa: -penalty(kappa)[19] - 0.0003, 1e4, 1e5)
""",
    ),
    Exercise(
        "3.7",
        3,
        "derivative of the energy [N]",
        lambda: float(carried().sum()),
        (
            (f, "This is the whole weight. The ends carry a part of it."),
            (lambda: carried().mean(), "The floor rises below all nodes: add their forces."),
            (lambda: carried().max(), "This is the force on one node. Add all of them."),
        ),
        (
            "A multiplier says how much the minimum changes if its constraint is shifted.",
            "The constraint of node i becomes u_i >= b. Its multiplier is r_i.",
            "All constraints are shifted together: the derivative is the sum of the forces.",
        ),
        """
# A central difference of the minimum, with the floor at the height b.
def lowest(b):
    v = cp.Variable(39)
    cost = cp.quad_form(v - 0.19, cp.psd_wrap(A)) / 2 + weight @ v
    return cp.Problem(cp.Minimize(cost), [v >= b]).solve(
        solver=cp.CLARABEL, tol_gap_abs=1e-12, tol_gap_rel=1e-12
    )
answer = (lowest(1e-4) - lowest(-1e-4)) / 2e-4
""",
    ),
    Exercise(
        "3.8",
        3,
        "condition number [-]",
        lambda: 1 / np.tan(np.pi / 2000) ** 2,
        (
            (1e6, "It grows like N^2; the factor is missing."),
            (4e6, "The largest eigenvalue is about 4, the smallest is not 1 / N^2."),
            (1 / np.tan(np.pi / 2000), "This is its square root."),
        ),
        (
            "Compute it for two small N. The text says how it grows.",
            "The eigenvectors of A are waves, sin(j pi i / N).",
            "The eigenvalues are proportional to 1 - cos(j pi / N), j = 1 ... N - 1.",
        ),
        """
# np.linalg.cond(string(1000)[0]) would do, but takes long. The eigenvalues are known.
waves = 1 - np.cos(np.pi * np.arange(1, 1000) / 1000)
answer = waves.max() / waves.min()
assert np.isclose(conditions[80], (1 + np.cos(np.pi / 80)) / (1 - np.cos(np.pi / 80)))
""",
    ),
)
