"""The choice between the ways to a solution by their cost, estimated from the matrices at hand.

A way is a form of Q and a solver of the bodies: a dense Q, products with Q by factors, or bodies
and contact at once by multigrid. COSTS were fitted to times on meshes that nobody prepared, and
`python -m experiments.questions.scene_check` compares them with runs of other scenes.
MOST_EXPLICIT and AGAIN are not fitted but chosen: an array of half a gigabyte, and a coupled way
that takes less than half the time of factors.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from contactopt.bodies.assembled import Work
from contactopt.linear.budget import NextBest

MOST_EXPLICIT = 8000  # interface unknowns of an explicit Q that is chosen without being asked for
AGAIN = 2.0  # factor on the cost of the coupled way where factors would serve more than one solve

# (way, solver of the bodies) -> seconds per unit of each of `terms`, on one core
COSTS: dict[tuple[str, str], tuple[float, ...]] = {
    ("dense", "superlu"): (5.78e-02, 8.03e-07, 2.82e-10, 1.61e-10),
    ("dense", "pardiso"): (5.52e-02, 7.51e-07, 6.70e-12, 1.02e-10),
    ("products", "superlu"): (1.10e-01, 1.47e-07, 1.77e-10, 4.44e-07, 6.19e-04, 1.46e-06),
    ("products", "pardiso"): (1.15e-01, 5.45e-07, 0.0, 8.84e-08, 8.31e-04, 1.06e-06),
    ("coupled", "multigrid"): (1.58e-01, 1.72e-06, 9.96e-04, 3.40e-07),
}
# steps of a way, in the mean of the scenes of the fit: V-cycles of all bodies, or products with Q
USUAL = {"coupled": 125, "products": 58}
MOST_DEARER = 10.0  # times the cost of a way, up to which another way may replace it
FORM_OF = {"dense": "explicit", "products": "implicit", "coupled": "implicit"}


def terms(way: str, works: Sequence[Work], unknowns: int, dim: int) -> np.ndarray:
    """What the cost of a way, a key of FORM_OF, grows with, to which COSTS gives the seconds; from
    the works of the bodies and the number of all interface unknowns, in 2 or 3 dimensions.

    Every way has a fixed cost, and assembly grows with the entries of the stiffness. Factors take
    the operations of their elimination; those of a dense Q keep the contact unknowns to the end. A
    dense Q takes the cubes of the contact unknowns of each body, to invert a Schur complement, and
    of all, for Newton's steps. Products with Q take the entries of the factors, and a model of Q on
    the contact surface, which takes more for each unknown of a surface than for one of a line. The
    coupled way takes V-cycles, whose matrices have a share of the entries of the stiffness, and the
    same model.
    """
    total = np.sum([[w.stiffness, *w.factors, *w.factors_contact_last] for w in works], axis=0)
    stiffness, entries, operations, _, ordered = total
    cubes = sum(float(w.contact) ** 3 for w in works) + float(unknowns) ** 3
    model = unknowns, unknowns**2 if dim == 3 else 0
    of_way = {
        "dense": (1, stiffness, ordered, cubes),
        "products": (1, stiffness, operations, entries, *model),
        "coupled": (1, stiffness, *model),
    }
    return np.array(of_way[way], dtype=float)


def estimates(
    works: Sequence[Work], unknowns: int, dim: int, solvers: Sequence[str], Q: str, once: bool
) -> dict[tuple[str, str], float]:
    """(way, solver) -> seconds of set-up and solution on one core, for each way that is open to the
    solvers and the form of Q (or 'auto') that are asked for; the first arguments are those of
    `terms`.

    `once` says that one problem is solved by Newton's steps, and factors serve nothing else.
    """
    found = {}
    for (way, solver), prices in COSTS.items():
        asked = Q in ("auto", FORM_OF[way])
        large = way == "dense" and Q == "auto" and unknowns > MOST_EXPLICIT
        if solver in solvers and asked and not large:
            cost = float(np.dot(prices, terms(way, works, unknowns, dim)))
            found[way, solver] = cost * (AGAIN if way == "coupled" and not once else 1.0)
    return found


def next_best(costs: Mapping[tuple[str, str], float], unknowns: int, once: bool) -> NextBest | None:
    """The best of the ways that can take the place of the cheapest of `costs`, from `estimates`:
    any way by factors that of the coupled one, and a dense Q that of products. `unknowns` counts
    the displacements of all bodies, which each step goes over.

    None where a dense Q is the cheapest, or where all others cost too much to fall back on.
    """
    taken = min(costs, key=lambda way: costs[way])
    surer = {"coupled": ("dense", "products"), "products": ("dense",), "dense": ()}[taken[0]]
    others = {way: cost for way, cost in costs.items() if way[0] in surer}
    if not others:
        return None
    best = min(others, key=lambda way: others[way])
    again = AGAIN if taken[0] == "coupled" and not once else 1.0
    ratio = costs[best] / costs[taken] * again
    if ratio > MOST_DEARER:
        return None
    work = float(USUAL[taken[0]] * unknowns)
    then = next_best(others, unknowns, once)
    return NextBest(taken[0], FORM_OF[best[0]], best[1], work, work * (1.0 + ratio), then)
