"""What friction on meshes that do not match costs over one direct linear solve of the same bodies,
tied together.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from contactopt import Scene, reduce_bodies, solve
from contactopt.bodies import assemble
from contactopt.bodies.solvers import make_solver
from contactopt.bodies.solvers.system import System
from contactopt.coupling.coupling import couple
from contactopt.coupling.reduction import Reduction
from experiments.questions.cost_ratio import timed
from experiments.questions.nonmatching.bodies import apart, punch

REPEATS = 3
SIZES = (830, 1245)  # about 150,000 unknowns


def tied(reduction: Reduction) -> Callable[[], np.ndarray]:
    """The direct solve of the bodies of a mortar coupling without opening or slip, under the
    plate's unit motion.

    u = 0 gives the contact nodes of the side that carries them, which are condensed out, so that
    the other side's nodes take their place.
    """
    own = 0 if reduction.coupling.carrier == "upper" else 1
    bodies, maps = [b.body for b in reduction.bodies], reduction.maps
    starts = np.cumsum([0, *(body.A.shape[0] for body in bodies)])
    B = sp.csr_matrix(sp.hstack(maps, format="csr"))
    free = np.concatenate([start + body.free for start, body in zip(starts, bodies)])
    mine = starts[own] + np.intersect1d(np.unique(maps[own].indices), bodies[own].free)
    rows = np.flatnonzero(np.diff(B[:, mine].tocsr().indptr) > 0)
    kept = np.setdiff1d(free, mine)
    inner = spl.splu(sp.csc_matrix(B[rows][:, mine].T @ B[rows][:, mine]))
    used = kept[np.unique(B[rows][:, kept].indices)]
    follow = -inner.solve((B[rows][:, mine].T @ B[rows][:, used]).toarray())
    follow[np.abs(follow) < 1e-13] = 0.0
    n = int(starts[-1])
    number = np.full(n, -1)
    number[kept] = np.arange(len(kept))
    entries = sp.coo_matrix(follow)
    E = sp.csr_matrix(
        (
            np.concatenate([np.ones(len(kept)), entries.data]),
            (
                np.concatenate([kept, mine[entries.row]]),
                np.concatenate([np.arange(len(kept)), number[used][entries.col]]),
            ),
        ),
        (n, len(kept)),
    )
    A = sp.csr_matrix(sp.block_diag([body.A for body in bodies], format="csr"))
    motion = np.concatenate([body.motion.sum(axis=1) for body in bodies])
    load = E.T @ -(A @ motion)
    A = sp.csr_matrix(E.T @ A @ E)
    points, node, component, count = [], np.zeros(n, dtype=int), np.zeros(n, dtype=int), 0
    for body, start in zip(bodies, starts):
        for c, unknowns in enumerate(body.unknowns):
            node[start + unknowns], component[start + unknowns] = (
                count + np.arange(len(unknowns)),
                c,
            )
        points.append(body.locations)
        count += body.locations.shape[1]
    system = System(A, node[kept], component[kept], np.concatenate(points, axis=1))
    return lambda: make_solver("superlu", system).solve(load)


def _coupled(scene: Scene) -> None:
    """The work before the bodies are factorised."""
    upper, lower = (assemble(scene, part, scene.elements, scene.zone) for part in scene.parts)
    couple(scene, scene.pairs[0], upper, lower)


def costs() -> list[dict[str, Any]]:
    rows = []
    for sizes in ((SIZES[0], SIZES[0]), SIZES):
        scene = apart(punch(mu=0.5), *sizes)
        linear = tied(reduce_bodies(scene, solver="superlu", coupling="mortar"))
        runs = []
        for _ in range(REPEATS):
            reduction = None  # frees its factors
            _, one, one_cpu = timed(linear)
            _, _, before = timed(partial(_coupled, scene))
            reduction, _, cpu = timed(partial(reduce_bodies, scene, solver="superlu"))
            solution, spent, spent_cpu = timed(partial(solve, reduction.problem, tol=1e-8))
            made = reduction.seconds["assemble"]
            whole = sum(reduction.seconds.values()) - made + spent
            runs.append((one, made, whole, whole / one, (cpu - before + spent_cpu) / one_cpu))
        one, made, whole, ratio, ratio_cpu = (median(column) for column in zip(*runs))
        rows.append(
            {
                "elements": f"{sizes[0]}:{sizes[1]}",
                "coupling": reduction.coupling.kind,
                "unknowns": reduction.dofs,
                "contacts": reduction.problem.contacts,
                "status": solution.status.label,
                "steps": solution.iterations,
                "tied, one linear solve [s]": one,
                "meshes, assembly, coupling [s]": made,
                "friction [s]": whole,
                "ratio": ratio,
                "ratio of CPU times": ratio_cpu,
            }
        )
    return rows
