"""Are bodies solved that nothing but friction holds, in the plane and in space?

A rigid or an elastic body is pressed on an elastic block along the block's normal, or inside the
friction cone about it. No support holds it across the normal. Where friction is small nearly all
contacts slip away from one that sticks, and where that one lies is a median of the others.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np

from contactopt import (
    InterfaceProblem,
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    reduce_bodies,
    solve,
)
from contactopt.meshes.structured import rename, tensor_mesh
from experiments.report import template, write

COUNT = 250  # problems in the plane, and as many in space
QUICK = 25
LEAST, MOST = 1e-8, 1.0  # friction coefficients, evenly spread in their logarithm
SIZES = {2: (15, 33, 65), 3: (6, 8, 10)}  # elements along the surface
TOL, LIMIT, REPEATS = 1e-8, 30.0, 3


def frame(random: np.random.Generator, dim: int) -> np.ndarray:
    """A random rotation (dim, dim); its last column is the normal of the block's surface."""
    Q, R = np.linalg.qr(random.normal(size=(dim, dim)))
    Q *= np.sign(np.diag(R))
    Q[:, 0] *= np.linalg.det(Q)
    return Q


def box(
    random: np.random.Generator, turned: np.ndarray, elements: int, up: bool, width: float
) -> object:
    """A block whose contact surface lies at height zero, graded at random and turned."""
    dim = len(turned)
    sides = [np.cumsum(np.append(0, random.uniform(0.6, 1.6, elements))) for _ in range(dim - 1)]
    axes = [width * (side / side[-1] - 0.5) for side in sides]
    height = width * random.uniform(0.3, 0.8) * np.linspace(0, 1, max(3, elements // 3))
    names = {"contact": f"{'xyz'[dim - 1]}-", "back": f"{'xyz'[dim - 1]}+"}
    if not up:
        height, names = height - height[-1], {"contact": names["back"], "back": names["contact"]}
    mesh = rename(tensor_mesh(*axes, height), **names)
    return replace(mesh, doflocs=np.ascontiguousarray(turned @ mesh.doflocs))


def held(seed: int, dim: int) -> tuple[InterfaceProblem, float, int]:
    """A random problem, its friction coefficient and its number of elements along the surface."""
    random = np.random.default_rng([seed, dim])
    mu = float(np.exp(random.uniform(np.log(LEAST), np.log(MOST))))
    elements = SIZES[dim][seed % 3]
    turned = frame(random, dim)
    length, stress = 10.0 ** random.uniform(-6, 3), 10.0 ** random.uniform(-3, 9)
    slope = random.normal(size=dim - 1)
    slope *= random.choice([0.0, random.uniform(0, 0.8)]) * mu / np.linalg.norm(slope)
    press = stress * length ** (dim - 1) * 10.0 ** random.uniform(-4, -2)
    force = press * (turned[:, :-1] @ slope - turned[:, -1])
    radius, middle = (
        length * 10.0 ** random.uniform(0, 2),
        random.uniform(-0.2, 0.2, dim - 1) * length,
    )
    soft = Material(stress, random.uniform(0, 0.45))

    def gap(x: np.ndarray) -> np.ndarray:
        across = turned[:, :-1].T @ x - middle[:, None]
        return np.asarray(np.sum(across**2, axis=0) / (2 * radius))

    loads = dict(zip("xyz", force.tolist()))
    lower = Part("block", box(random, turned, elements, False, length), soft, (Support("back"),))
    upper: Part | Rigid = Rigid("body", tuple(turned[:, -1]), gap, loads)
    if random.random() < 0.4:
        mesh = box(random, turned, elements, True, length)
        mesh = replace(mesh, doflocs=mesh.doflocs + turned[:, -1:] * gap(mesh.doflocs))
        stiff = Material(stress * 10.0 ** random.uniform(-1, 2), random.uniform(0, 0.45))
        upper = Part("body", mesh, stiff, (), (Plate("back", loads),))
    kind = "plane-strain" if dim == 2 else "solid"
    return (
        reduce_bodies(Scene("held by friction", upper, lower, mu, kind=kind)).problem,
        mu,
        elements,
    )


def measured(seed: int, dim: int) -> dict[str, object]:
    problem, mu, elements = held(seed, dim)
    seconds = np.inf
    # the least time is that of the method, without what else the machine does
    for _ in range(REPEATS):
        begin = time.process_time()
        solution = solve(problem, tol=TOL, time_limit=LIMIT)
        seconds = min(seconds, time.process_time() - begin)
    return {
        "dim": dim,
        "seed": seed,
        "elements": elements,
        "contacts": problem.contacts,
        "mu": mu,
        "status": solution.status.label,
        "residual": solution.residual,
        "iterations": solution.iterations,
        "seconds": seconds,
    }


def summary(rows: list[dict[str, object]]) -> list[dict[str, object]]:
    """One row per class of size."""
    table = []
    for dim in SIZES:
        for elements in SIZES[dim]:
            own = [row for row in rows if (row["dim"], row["elements"]) == (dim, elements)]
            seconds = np.array([row["seconds"] for row in own], dtype=float)
            solved = sum(row["status"] == "solved" for row in own)
            table.append(
                {
                    "dimension": dim,
                    "elements along the surface": elements,
                    "certified": f"{solved} of {len(own)}",
                    "median seconds": float(np.median(seconds)),
                    "slowest over the median": float(seconds.max() / np.median(seconds)),
                }
            )
    return table


TEXT = template(__file__)

if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else COUNT
    problems = [measured(seed, dim) for dim in SIZES for seed in range(count)]
    text = TEXT.format(least=LEAST, most=MOST, count=count, tol=TOL, repeats=REPEATS, quick=QUICK)
    tables = {"rows": summary(problems), "problems": problems}
    write("held_by_friction", "Bodies that friction alone holds", text, tables, {})
