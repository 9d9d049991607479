"""Which elimination order, sparse product, precision and constants of multigrid are best for the
bodies?
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from contactopt import Scene, scenes
from contactopt.bodies.body import build_body
from contactopt.bodies.solvers import multigrid
from contactopt.bodies.solvers import sparse_products as products
from contactopt.bodies.solvers.ordering import elimination_order
from contactopt.bodies.solvers.sparse_products import SparseProduct
from contactopt.bodies.solvers.superlu import factorise
from contactopt.bodies.solvers.system import System
from experiments.report import write

REPEATS = 5
RTOL = 1e-8
ORDERED = {  # scene, body, elements across the contact half-width
    "plane foundation": (scenes.flat_punch(2), "lower", 128),
    "large plane foundation": (scenes.flat_punch(2), "lower", 512),
    "sphere": (scenes.sphere(), "upper", 128),
    "solid punch": (scenes.flat_punch(3), "upper", 16),
    "solid foundation": (scenes.flat_punch(3), "lower", 11),
}
SOLID = 24  # elements of the foundation of punch-3d for products, precision and constants
VARIED = {"NEAR": (1.1, 1.5, 2.0, 4.0), "DEGREE": (2, 3, 4, 5), "COARSEST": (20, 60, 200)}


def system(scene: Scene, part: str, elements: int) -> System:
    """What the solvers of one body are made from, its contact unknowns last."""
    body = build_body(scene, getattr(scene, part), elements, scene.zone)
    unknowns, free = body.unknowns, body.free
    node, component = np.empty(len(body.load), int), np.empty(len(body.load), int)
    node[unknowns], component[unknowns] = (
        np.arange(unknowns.shape[1]),
        np.arange(len(unknowns))[:, None],
    )
    last = np.flatnonzero(np.isin(free, body.contact_dofs))
    return System(body.A[free][:, free], node[free], component[free], body.locations, last)


def fastest(act: Callable[[], Any]) -> float:
    """Least processor time of several runs [s]."""
    seconds = []
    for _ in range(REPEATS):
        start = time.process_time()
        act()
        seconds.append(time.process_time() - start)
    return min(seconds)


@contextmanager
def setting(module: Any, name: str, value: Any) -> Iterator[None]:
    """The module with another constant."""
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)


def orders() -> list[dict[str, Any]]:
    """Both orders for both forms of Q: nothing last, or the contact unknowns last."""
    rows = []
    for name, (scene, part, elements) in ORDERED.items():
        asked = system(scene, part, elements)
        for form, last in (("implicit", np.zeros(0, int)), ("explicit", asked.trailing)):
            for order in ("minimum degree", "nested dissection"):
                act = partial(elimination_order, *asked[:4], last, order == "minimum degree")
                chosen = act()
                ordered = asked.A[chosen][:, chosen].tocsc()
                rows.append(
                    {
                        "body": name,
                        "unknowns": asked.A.shape[0],
                        "Q": form,
                        "order": order,
                        "entries of L [million]": factorise(ordered).L.nnz / 1e6,
                        "to order [s]": fastest(act),
                        "to factorise [s]": fastest(partial(factorise, ordered)),
                    }
                )
    return rows


def kinds(asked: System) -> list[dict[str, Any]]:
    """One product with the stiffness by either library, in either form and precision."""
    rows = []
    for form, A in (
        ("CSR", asked.A),
        ("BSR", multigrid.nodal_blocks(*asked[:3], len(asked.points))[0]),
    ):
        for precision in (np.float64, np.float32):
            row: dict[str, Any] = {"form": form, "precision": precision.__name__}
            x = np.ones(A.shape[1], dtype=precision)
            for library, found in (("oneMKL", products.library), ("SciPy", lambda: None)):
                with setting(products, "library", found):
                    product = SparseProduct(A.astype(precision))
                    row[f"{library} [ms]"] = (
                        1e3 * fastest(lambda p=product, x=x: [p @ x for _ in range(10)]) / 10
                    )
            rows.append(row)
    return rows


def precisions(asked: System) -> list[dict[str, Any]]:
    """Multigrid with V-cycles of either precision by either library."""
    rows = []
    for precision in (np.float64, np.float32):
        for library, found in (("oneMKL", products.library), ("SciPy", lambda: None)):
            with setting(products, "library", found), setting(multigrid, "SINGLE", precision):
                rows.append({"precision": precision.__name__, "library": library, **cost(asked)})
    return rows


def cost(asked: System) -> dict[str, Any]:
    """Set-up, one V-cycle, and one solve for a random load on the contact."""
    load = np.zeros(asked.A.shape[0])
    load[asked.trailing] = np.random.default_rng(0).standard_normal(len(asked.trailing))
    start = time.process_time()
    solver = multigrid.MultigridSolver(asked)
    setup = time.process_time() - start
    cycles = multigrid.conjugate_gradients(solver.A, solver.cycle, load, RTOL).cycles
    return {
        "setup [s]": setup,
        "V-cycle [ms]": 1e3 * fastest(lambda: solver.cycle.apply(load)),
        "V-cycles": cycles,
        "solve [s]": fastest(lambda: solver.solve(load, RTOL)),
        "complexity": solver.cycle.complexity,
    }


def constants(asked: System) -> list[dict[str, Any]]:
    """One constant varied at a time; the others as they are."""
    rows = []
    for name, values in VARIED.items():
        for value in values:
            with setting(multigrid, name, value):
                rows.append({"constant": name, "value": value, **cost(asked)})
    return rows


TEXT = f"""Processor seconds of one thread, the least of {REPEATS} runs. Products, precisions and constants: the foundation of punch-3d with
{SOLID} elements across the contact half-width, a random load on the contact, to an accuracy of
{RTOL:g}.

Elimination orders with SuperLU. Implicit Q: nothing is kept to the end. Explicit Q: the contact
unknowns are eliminated last.

{{orders}}

One product with the stiffness:

{{products}}

Multigrid with V-cycles of either precision, conjugate gradients in double precision:

{{precision}}

Constants of multigrid, one varied at a time (contactopt.bodies.solvers.constants has those in use):

{{constants}}
"""

if __name__ == "__main__":
    foundation = system(scenes.flat_punch(3), "lower", SOLID)
    tables = {
        "orders": orders(),
        "products": kinds(foundation),
        "precision": precisions(foundation),
        "constants": constants(foundation),
    }
    write(
        "solver_constants",
        "Orders, products and constants of the solvers of bodies",
        TEXT,
        tables,
        {},
    )
