"""What does friction cost over one direct linear solve of the same two bodies, bonded together?"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from statistics import median
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt import Scene, scenes, solve
from contactopt.bodies.assembly import Assembly
from contactopt.bodies.body import build_body
from contactopt.bodies.solvers import make_solver
from contactopt.bodies.solvers.system import System
from contactopt.coupling.reduction import reduce_bodies
from experiments.report import merged, write

REPEATS = 3
SOLVERS = ("superlu", "pardiso")  # the latter where it is installed
SCENES = {
    "punch-2d": (lambda: scenes.flat_punch(2, elements=1024), 2),
    "punch-3d": (lambda: scenes.flat_punch(3, elements=28), 4),
}


def timed(act: Callable[[], Any]) -> tuple[Any, float, float]:
    """What it returns, wall seconds, CPU seconds of all threads."""
    wall, cpu = time.perf_counter(), time.process_time()
    out = act()
    return out, time.perf_counter() - wall, time.process_time() - cpu


def bonded(upper: Assembly, lower: Assembly, solver: str) -> Callable[[], np.ndarray]:
    """The direct solve of the bonded bodies under the plate's unit motion, with its factors."""
    count = [b.basis.mesh.p.shape[1] for b in (upper, lower)]
    partner = {tuple(np.round(x, 9)): n for x, n in zip(lower.points.T, lower.nodes)}
    node = [np.arange(count[0]), count[0] + np.arange(count[1])]
    for x, n in zip(upper.points.T, upper.nodes):
        node[0][n] = count[0] + partner[tuple(np.round(x, 9))]  # one node for both
    dim = len(upper.basis.mesh.p)
    size = dim * sum(count)
    A, load, held = sp.csr_matrix((size, size)), np.zeros(size), np.zeros(size, dtype=bool)
    for body, own in zip((upper, lower), node):
        place = np.empty(body.basis.N, dtype=int)
        for component, dofs in enumerate(body.basis.nodal_dofs):
            place[dofs] = dim * own + component
        move = sp.csr_matrix(
            (np.ones(len(place)), (place, np.arange(len(place)))), (size, len(place))
        )
        A = A + move @ body.A @ move.T
        load += move @ -(body.A @ body.motion.sum(axis=1))
        held |= np.asarray(move @ ~np.isin(np.arange(len(place)), body.free), dtype=bool)
    used = np.unique(np.concatenate(node))
    free = (dim * used[:, None] + np.arange(dim)).ravel()
    free = free[~held[free]]
    points = np.concatenate([upper.basis.mesh.p, lower.basis.mesh.p], axis=1)
    A = A[free][:, free].tocsr()

    def act() -> np.ndarray:
        return make_solver(solver, System(A, free // dim, free % dim, points)).solve(load[free])

    return act


def assembled(scene: Scene) -> list[Assembly]:
    """Both bodies."""
    parts = (scene.upper, scene.lower)
    return [build_body(scene, part, scene.elements, scene.zone) for part in parts]


def frictional(scene: Scene, solver: str) -> tuple[float, float, Any, Any]:
    """Wall and CPU seconds from assembled bodies to the certified reactions, without assembly."""
    _, _, cpu_assembly = timed(lambda: assembled(scene))
    reduction, _, cpu_reduction = timed(lambda: reduce_bodies(scene, solver=solver))
    solution, wall, cpu = timed(lambda: solve(reduction.problem, tol=1e-8))
    reduced = sum(reduction.seconds.values()) - reduction.seconds["assemble"]
    return reduced + wall, cpu_reduction - cpu_assembly + cpu, reduction, solution


def measure(name: str, solver: str) -> dict[str, Any]:
    scene = SCENES[name][0]()
    act = bonded(*assembled(scene), solver)
    rows = []
    for _ in range(REPEATS):
        reduction = None  # frees its factors
        _, wall, cpu = timed(act)
        total, total_cpu, reduction, solution = frictional(scene, solver)
        rows.append((wall, cpu, total, total_cpu, total / wall, total_cpu / cpu))
    linear, _, total, _, ratio, ratio_cpu = (median(column) for column in zip(*rows))
    form = "implicit" if solution.products else "explicit"
    return {
        "scene": name,
        "solver": solver,
        "unknowns": reduction.dofs,
        "contacts": reduction.problem.contacts,
        "Q": form,
        "status": solution.status.label,
        "residual": float(solution.residual),
        "steps": solution.iterations,
        "products": solution.products,
        "one linear solve [s]": linear,
        "friction [s]": total,
        "ratio": ratio,
        "ratio of CPU times": ratio_cpu,
        "asked": SCENES[name][1],
    }


TEXT = f"""What does friction cost? The time from assembled bodies to certified contact forces
(residual at most 1e-8) is compared with that of one linear solve. For the frictional problem two
cores factorise both bodies at the same time, and Newton's method follows. The linear solve is one
direct solve of the same two bodies, glued together at the contact nodes, with a given motion of the
plate. It has the same solver and ordering, and one forward and backward substitution. Times are
medians of {REPEATS} runs in turn, with `OMP_NUM_THREADS=1`. The second ratio counts the seconds of
both threads.

{{ratios}}

Friction can cost less than a linear solve. The factors of two separate bodies are smaller than
those of both bodies together, and each body has a core of its own.
"""


if __name__ == "__main__":
    # scenes and solvers may be named: those alone are measured again
    names = [n for n in SCENES if n in sys.argv] or list(SCENES)
    solvers = [s for s in SOLVERS if s in sys.argv] or list(SOLVERS)
    pairs = [(n, s) for n in names for s in solvers if s != "pardiso" or find_spec("pypardiso")]
    rows = merged("cost_ratio", "ratios", [measure(*pair) for pair in pairs], ("scene", "solver"))
    write("cost_ratio", "The price of friction", TEXT, {"ratios": rows}, {})
