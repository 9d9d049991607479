"""The choice between the ways to a solution by their cost, with every number that it rests on.

`python -m experiments.questions.ways` measures the ways on punches of growing size, in the plane
and in space, fits COSTS to the measured times and draws both as maps (reports/ways/report.md).
MOST_EXPLICIT is not fitted but chosen: an array of half a gigabyte. STEPS_BY_PRODUCTS was measured
on rigid and elastic bodies of 130 to 870 interface unknowns that friction alone holds.
"""

from __future__ import annotations

import numpy as np

WAYS = ("dense", "products", "coupled")
MOST_EXPLICIT = 8000  # interface unknowns of an explicit Q that is chosen without being asked for
# seconds that Newton's steps by products take beyond the products, in the smallest problem
STEPS_BY_PRODUCTS = 0.2

# (dimension, body solver) -> seconds per unit of each of `terms`, on one core
COSTS: dict[tuple[int, str], tuple[float, ...]] = {
    (2, "superlu"): (3.35e-05, 0.0, 4.8e-10, 1.21e-06),
    (2, "pardiso"): (2.87e-05, 0.0, 2.47e-10, 3.43e-06),
    (2, "multigrid"): (8.1e-05, 0.0, 0.0, 0.0),
    (3, "superlu"): (6.77e-05, 5.44e-09, 1.34e-09, 2.38e-06),
    (3, "pardiso"): (6.26e-05, 1.12e-09, 4.86e-10, 5.08e-06),
    (3, "multigrid"): (0.00012, 0.0, 0.0, 0.0),
}


def terms(way: str, m: int, n: int, dim: int) -> np.ndarray:
    """What the cost of a way grows with, (4,) terms, to which COSTS gives the seconds.

    The largest body has n unknowns, m of them on the contact surface. Assembly grows with n, and so
    does the coupled way with its V-cycles. Factors take n^1.5 operations in the plane and n^2 in
    space, a dense Q m^3, and products with Q n log2 n or n^(4/3) (nested dissection).
    """
    factors = n ** (1.5 if dim == 2 else 2.0)
    substitution = n * np.log2(max(n, 2)) if dim == 2 else n ** (4 / 3)
    of_way = {
        "dense": (n, factors, m**3, 0),
        "products": (n, factors, 0, substitution),
        "coupled": (n, 0, 0, 0),
    }
    return np.array(of_way[way], dtype=float)


def seconds(way: str, m: int, n: int, dim: int, solver: str) -> float:
    """Estimated time [s] of set-up and solution on one core, with a solver of bodies by factors."""
    return float(np.dot(COSTS[dim, solver], terms(way, m, n, dim)))


def form_of(m: int, n: int, dim: int, iterative: bool, solver: str = "superlu") -> str:
    """The cheaper form of Q, 'explicit' or 'implicit', as for `terms`. Where a body is `iterative`,
    without factors, an explicit Q would need m solves, which never pays.
    """
    if iterative or m > MOST_EXPLICIT:
        return "implicit"
    dense, products = (seconds(way, m, n, dim, solver) for way in WAYS[:2])
    return "explicit" if dense <= products + STEPS_BY_PRODUCTS else "implicit"
