"""Do the preconditioners fit several pairs of surfaces, unequal bodies, and one body that is cut
into slices?

`python -m experiments.questions.several_pairs` makes the tables and the report.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import scipy.linalg as la
from scipy.sparse.linalg import LinearOperator, cg
from skfem import MeshHex, MeshQuad

from contactopt import Contact, Material, Part, Scene, Support, reduce, scenes, solve
from contactopt.linear.operators import held
from contactopt.methods.preconditioners import (
    Preconditioner,
    deflated,
    degrees,
    preconditioner,
    smooth_motions,
)
from contactopt.problem import InterfaceProblem, dimensionless
from contactopt.scenes.slices import sliced
from experiments.report import write

RATIOS = (1e-4, 1.0, 1e4)  # stiffness of every other block over that of the ones between
POISSONS = ((0.3, 0.3), (0.0, 0.0), (0.0, 0.49))
ELEMENTS = {2: 24, 3: 6}  # across a block
TOL, MOST = 1e-8, 30
# dimension, elements across the half-width, slices, options
SLICED: tuple[tuple[int, int, int, dict[str, Any]], ...] = (
    *((2, 32, count, {"Q": "implicit", "solver": "superlu"}) for count in (2, 4, 8, 16)),
    *((3, 6, count, {"Q": "implicit", "solver": "superlu"}) for count in (2, 4)),
    *((2, 32, count, {"solver": "multigrid"}) for count in (2, 4, 8)),
)


def tower(dim: int, blocks: int, ratio: float, poissons: tuple[float, float]) -> Scene:
    """Cubes on each other; the lowest and the highest are held at their far ends, those between by
    contact alone.
    """
    kind = MeshQuad if dim == 2 else MeshHex
    across = np.linspace(0.0, 1.0, ELEMENTS[dim] + 1)
    parts = []
    for i in range(blocks):
        mesh = kind.init_tensor(*[across] * (dim - 1), across + i)
        ends = {
            name: lambda x, at=i + up: np.abs(x[-1] - at) < 1e-9
            for up, name in enumerate(("below", "above"))
        }
        material = Material(ratio if i % 2 else 1.0, poissons[i % 2])
        supports = (Support("below"),) if i == 0 else (Support("above"),) if i == blocks - 1 else ()
        contact = "above" if i == 0 else "below"
        parts.append(
            Part(f"block-{i + 1}", mesh.with_boundaries(ends), material, supports, contact=contact)
        )
    pairs = tuple(
        Contact(f"block-{i + 1}:below", f"block-{i}:above", 0.5) for i in range(1, blocks)
    )
    return Scene(
        "tower", bodies=tuple(parts), contacts=pairs, kind="plane-strain" if dim == 2 else "solid"
    )


def judged(problem: InterfaceProblem, P: Preconditioner) -> tuple[float, int]:
    """Condition of P Q on the forces that free motions bear, and iterations of projected conjugate
    gradients to 1e-8.
    """
    Q, moves = problem.Q, ~held(problem.Q)
    V = problem.V * moves[:, None]
    N = la.null_space(V[moves].T) if V.shape[1] else np.eye(int(moves.sum()))
    whole = (P @ np.eye(len(Q)))[np.ix_(moves, moves)]
    G = np.linalg.inv((whole + whole.T) / 2)
    values = la.eigh(N.T @ Q[np.ix_(moves, moves)] @ N, N.T @ (G + G.T) / 2 @ N, eigvals_only=True)
    Y = np.stack([P @ v for v in V.T], axis=1) if V.shape[1] else V
    K = np.linalg.pinv(V.T @ Y)

    def off(x: np.ndarray) -> np.ndarray:
        return x - Y @ (K @ (V.T @ x))

    def off_t(x: np.ndarray) -> np.ndarray:
        return x - V @ (K @ (Y.T @ x))

    steps: list[object] = []
    load = off_t(np.random.default_rng(0).normal(size=len(Q)) * moves)
    system = LinearOperator(Q.shape, matvec=lambda x: off_t(Q @ off(x.ravel())), dtype=float)
    inverse = LinearOperator(Q.shape, matvec=lambda x: off(P @ off_t(x.ravel())), dtype=float)
    cg(system, load, rtol=1e-8, M=inverse, callback=steps.append, maxiter=1000)
    return float(values[-1] / values[0]), len(steps)


def of_blocks(dim: int, blocks: int, ratio: float, poissons: tuple[float, float]) -> dict[str, Any]:
    problem = dimensionless(reduce(tower(dim, blocks, ratio, poissons), Q="explicit").explicit())[0]
    row = {
        "dimension": dim,
        "pairs": blocks - 1,
        "contacts": problem.contacts,
        "ratio": ratio,
        "Poisson's ratios": f"{poissons[0]:g}, {poissons[1]:g}",
    }
    for name in ("neumann", "laplacian"):
        P = deflated(preconditioner(problem, name), problem.Q, smooth_motions(problem))
        row[f"{name}: condition"], row[f"{name}: iterations"] = judged(problem, P)
    return row


def of_slices(dim: int, elements: int, count: int, options: dict[str, Any]) -> dict[str, Any]:
    scene = scenes.flat_punch(dim, elements=elements)
    begin = time.process_time()
    problem = reduce(sliced(scene, "foundation", count), **options)
    solution = solve(problem, "newton", tol=TOL, max_iterations=MOST)
    spent = time.process_time() - begin
    whole = solve(reduce(scene, Q="explicit"), tol=1e-10).reactions
    error = (
        np.abs(solution.reactions[problem.pairs[0].contacts] - whole).max() / np.abs(whole).max()
    )
    coupled = problem.Q.coupled
    return {
        "dimension": dim,
        "slices": count,
        "solver": options["solver"],
        "interface unknowns": problem.q.size,
        "highest degree": max(degrees(problem)),
        "end": solution.status.label,
        "steps": solution.iterations,
        "V-cycles": "" if coupled is None else coupled.cycles,
        "residual": float(solution.residual),
        "differs from the whole body by": float(error),
        "CPU [s]": spent,
    }


TEXT = """Condition numbers and iterations of conjugate gradients to 1e-8 from a random right-hand side, with smooth motions deflated, on
the forces that the free motions of bodies held by contact alone can bear. Every pair has its own
block and its own scale.

## Towers of cubes

Cubes of unequal stiffness on each other; the ratio of stiffness alternates from cube to cube, and
so does Poisson's ratio. The worst condition number is {condition:.1f}, the most iterations are
{iterations}. Above 10 or above 30 iterations are {above} of {rows} rows: {which}, the first of them
that of the stiffer body.

{{blocks}}

## One body cut into slices

The foundation under a punch with friction, cut into slices of equal numbers of elements and graded
heights; all but the lowest are held by tied pairs alone. Newton's method from products with Q
(superlu), or from V-cycles on all bodies at once (multigrid), to a residual of 1e-8. The degree of
the smooth motions grows with the width of a slice over its height. V-cycles do not include those of
the products that deflation needs.

{{slices}}
"""


def main() -> None:
    cases = [
        (dim, blocks, ratio, poissons)
        for dim, most in ((2, 4), (3, 3))
        for blocks in range(2, most + 1)
        for ratio in RATIOS
        for poissons in POISSONS
    ]
    blocks = [of_blocks(*case) for case in cases]
    slices = [of_slices(*case) for case in SLICED]
    names = ("neumann", "laplacian")
    conditions = [max(row[f"{name}: condition"] for name in names) for row in blocks]
    steps = [max(row[f"{name}: iterations"] for name in names) for row in blocks]
    above = [row for row, c, n in zip(blocks, conditions, steps) if c > 10 or n > 30]
    kinds = sorted({(row["ratio"], row["Poisson's ratios"]) for row in above})
    which = [f"ratio {ratio:g} and Poisson's ratios {poissons}" for ratio, poissons in kinds]
    text = TEXT.format(
        condition=max(conditions),
        iterations=max(steps),
        above=len(above),
        which="; ".join(which) or "none",
        rows=len(blocks),
    )
    tables = {"blocks": blocks, "slices": slices}
    write(
        "several_pairs",
        "Several pairs of surfaces, unequal bodies, slices of one body",
        text,
        tables,
        {},
    )


if __name__ == "__main__":
    main()
