"""The exercises of chapter 5: Coulomb friction on an interface."""

from functools import cache

import numpy as np

from contactopt import InterfaceProblem, diagnose, laws, reduce, scenes, solve
from experiments.course.feedback import Forces, Open
from experiments.course.quantities import Numbers


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
    "5.3": (
        lambda: Numbers((slipping(0.2), slipping(0.1)), given={"nodes": 25.0}),
        (lambda: (slipping(0.1), slipping(0.2)), "order"),
        (lambda: (25 - slipping(0.2), 25 - slipping(0.1)), "These are the nodes that stick."),
        (lambda: (slipping(0.2),) * 2, "`newton` reads mu and the problem: change both for 0.1."),
    ),
    "5.4": (
        lambda: Numbers(
            rate(),
            close=0.04,
            given={"mu": 0.2},
            least=(0.0, "Certificates are positive, and so is their ratio."),
            most=(1.0, "The certificate falls: the factor is below one."),
        ),
        (lambda: rate() ** 4, "This is the factor of four steps. Take the fourth root."),
        (lambda: 1 / rate(), "The certificate falls: divide the later by the earlier one."),
        (lambda: rate() / 4, "Factors multiply. Take a root, and do not divide."),
    ),
    "5.7": (
        lambda: Forces(punch(0.35)),
        (lambda: forces_of(0.0), "frictionless"),
        (lambda: forces_of("associated"), "associated"),
        (lambda: forces_of(0.35) * [1, -1], "along"),
        (lambda: 0.98 * forces_of(0.35), "balance"),
        (lambda: forces_of(0.5), "coefficient"),
        (lambda: forces_of(0.35) / punch().areas[:, None], "pressure"),
    ),
    "5.8": (lambda: Open((0.27, 1.0), slides),),
}
