"""The exercises of chapter 5: Coulomb friction on an interface."""

from functools import cache

import numpy as np

from contactopt import InterfaceProblem, diagnose, laws, reduce, scenes, solve
from experiments.course.feedback import Forces, Open
from experiments.course.quantities import Numbers, by_hand


@cache
def punch(law: float | str = 0.2) -> InterfaceProblem:
    """The block of the chapter, with a friction coefficient or with associated friction, 0.35."""
    one = reduce(scenes.flat_punch(2, mu=0.2, elements=24))
    other = laws.Associated(0.35) if law == "associated" else law
    return InterfaceProblem(
        *(one.Q, one.q, other, one.V, one.s),
        areas=one.areas,
        coordinates=one.coordinates,
        motions=("the plate",),
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


def slides(motion: np.ndarray) -> str | None:
    """Whether a motion proves that no forces hold the sledge."""
    up, along = motion
    least = 1e-6 * max(abs(up), abs(along))
    if up < 0.26 * abs(along) - least:
        return "Forces on the edge of a cone can do negative work: up must be >= mu |along|."
    if -110 * up + 31 * along <= least:
        return f"The load does the work {-110 * up + 31 * along:.3g}, which is not positive."
    return None


GRADED = {
    "5.1": (
        None,
        (130 / 23, "You divided the normal force by the friction force."),
        (23 / 65, "One runner carries half of the weight, but both runners hold."),
        (23 / 260, "Two runners carry the weight once, not twice."),
    ),
    "5.2": (
        None,
        ((0.06 + 0.45) / 2 * 103, "The mean coefficient does not count: most weight is on ice."),
        (0.45 * 21, "The runner on ice holds something as well."),
        (0.06 * 103, "The runner on stone holds more than that."),
        (0.06 * 21 + 0.45 * 82, "The front runner, with 82 N, stands on ice."),
    ),
    "5.3": (
        lambda: (slipping(0.2), slipping(0.1)),
        (lambda: (slipping(0.1), slipping(0.2)), "order"),
        (lambda: (25 - slipping(0.2), 25 - slipping(0.1)), "These are the nodes that stick."),
        (lambda: (slipping(0.2),) * 2, "`newton` reads mu and the problem: change both for 0.1."),
    ),
    "5.4": (
        lambda: Numbers(
            rate(),
            close=0.04,
            least=(0.0, "Certificates are positive, and so is their ratio."),
            most=(1.0, "The certificate falls: the factor is below one."),
        ),
        (lambda: rate() ** 4, "This is the factor of four steps. Take the fourth root."),
        (lambda: 1 / rate(), "The certificate falls: divide the later by the earlier one."),
        (lambda: rate() / 4, "Factors multiply. Take a root, and do not divide."),
    ),
    "5.5": (
        None,
        ((2.1, -0.4 * 2.3), "The bound comes from the trial force y_n, and not from r_n."),
        (lambda: on_the_cone(0.0), "This is the projection on the cone: associated friction."),
        ((2.1, -2.1), "The tangential part exceeds the bound mu y_n: cut it off."),
        ((2.1, 0.84), "Cutting off keeps the direction of y_t."),
    ),
    "5.6": (
        None,
        (lambda: on_the_cone(0.0), "The shift mu |u_t| n is missing: this is associated friction."),
        (lambda: on_the_cone(-0.4 * 0.3), "The shift makes u_n larger, so that y_n is smaller."),
        ((1.86, -0.4 * 1.86), "This cuts off y_t. The nearest point of the cone is another one."),
    ),
    "5.7": (
        lambda: Forces(punch(0.35)),
        (lambda: forces_of(0.0), "frictionless"),
        (lambda: forces_of("associated"), "associated"),
        (lambda: forces_of(0.35) * [1, -1], "along"),
        (lambda: 0.98 * forces_of(0.35), "balance"),
        (lambda: forces_of(0.5), "bound"),
        (lambda: forces_of(0.35) / punch().areas[:, None], "pressure"),
    ),
    "5.8": (
        lambda: Open((0.27, 1.0), slides),
        ((0.0, 1.0), "can do negative work"),
        ((0.5, 1.0), "The load does the work"),
        ((0.27, -1.0), "The load does the work"),
        ((0.0, 0.0), "The load does the work"),
    ),
    "5.9": (
        None,
        ((1.875, 1.125, 0.0, 0.875), "r_plus pushes to the right, along the slip."),
        ((1.875, 0.0, -1.125, 0.875), "The unknowns of an LCP are never negative."),
        ((1.875, 0.0, 1.125, 0.0), "The node slips, and sigma is its slip."),
    ),
    "5.10": (
        None,
        (-0.6, "This is a single step from the beginning. The node has slipped before."),
        (0.6, "On the way back the node sticks: it does not reach the bound."),
        (-1.3 / 0.8, "Without the bound, and without what has slipped before."),
        ((2.0 - 1.3) / 0.8, "The node has not slipped 2 mm: friction held it back by Q_tt mu r_n."),
        ((2.0 - 1.3) / 0.8 - 1.2, "Count the change of the force from -0.6 N, in units of Q_tt."),
    ),
    "5.11": (
        None,
        (4 * 0.6 * 2.0, "Not the whole way is slip: near the turning points the node sticks."),
        (2 * 0.6 * (2.0 - 0.48), "This is half a cycle: there and back are two ways."),
        (
            4 * 0.6 * (2.0 - 0.96),
            "At each turn the force changes from +mu r_n to -mu r_n only once.",
        ),
        (0.6 * (2.0 - 0.48), "This is the first pull."),
    ),
}
