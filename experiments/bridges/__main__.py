"""The same frictional punch from the matrices of other codes: agreement, price, lines of code.

A bridge runs in the first of these Pythons that has its package: this one, those that the variable
BRIDGES_PYTHON names (separated by colons), and /usr/bin/python3.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from shutil import which
from typing import Any, cast

import numpy as np
import scipy.sparse as sp
import skfem
from scipy.sparse.linalg import spsolve

from contactopt import Material, MatrixPart, Part, Rigid, Scene, Support, reduce_bodies, solve
from contactopt.bodies import assemble
from contactopt.bodies.elastic import condense
from contactopt.bodies.matrix_body import MatrixBody
from experiments.bridges.host import NU, E
from experiments.report import template, write

HERE = Path(__file__).parent
COUNT, REPEATS = 16, 5
# bridge -> name of the code, what it needs
BRIDGES = {
    "scikit_fem": ("scikit-fem", "skfem"),
    "calculix_block": ("CalculiX", "skfem"),
    "pymfem": ("MFEM", "mfem"),
    "ngsolve_block": ("NGSolve", "ngsolve"),
    "getfem_block": ("GetFEM", "getfem"),
    "kratos_block": ("Kratos", "KratosMultiphysics.StructuralMechanicsApplication"),
    "dolfinx_block": ("FEniCSx", "dolfinx.fem.petsc"),
}


def python_of(name: str) -> str | None:
    """The Python that has what a bridge needs; None for none."""
    given = os.environ.get("BRIDGES_PYTHON", "").split(":")
    if name == "calculix_block" and not which("ccx"):
        return None
    for python in filter(None, (sys.executable, *given, "/usr/bin/python3")):
        code = f"import {BRIDGES[name][1]}"
        if not subprocess.run([python, "-c", code], capture_output=True, check=False).returncode:
            return python
    return None


def given_by(name: str, python: str, count: int) -> dict[str, np.ndarray]:
    """What a bridge hands over for a block of `count` by `count` by `count` / 2 cells."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "block.npz"
        told = {"BLOCK_FILE": str(file), "BLOCK_COUNT": str(count), "PYTHONPATH": ""}
        run = subprocess.run(
            [python, str(HERE / f"{name}.py")], capture_output=True, env={**os.environ, **told}
        )
        if run.returncode:
            raise RuntimeError(f"{name}: {run.stderr.decode()[-500:]}")
        with np.load(file) as made:
            return dict(made)


def bodies(made: dict[str, np.ndarray]) -> tuple[MatrixPart, Part]:
    """The block by the matrices of the host, and our own on the same mesh."""
    points, count = made["points"], made["points"].size
    K = sp.csr_matrix((made["entries"], made["places"]), (count, count))
    facets = {"contact": made["contact"]}
    part = MatrixPart(
        "block", K, np.zeros(count), points, facets, made["fixed"], order=made["unknowns"]
    )
    mesh = skfem.MeshTet(points.T, np.ascontiguousarray(made["cells"].T)).with_boundaries(
        {"contact": lambda x: np.isclose(x[2], 0), "bottom": lambda x: np.isclose(x[2], -1)}
    )
    return part, Part("block", mesh, Material(E, NU), (Support("bottom"),))


def pressed(block: Any) -> Scene:
    """A punch that is pressed and pushed on a block."""
    force = {"x": 0.5, "z": -3.0}
    punch = Rigid("punch", gap=lambda x: (x[0] ** 2 + x[1] ** 2) / 40, force=force)
    return Scene("punch", punch, block, 0.4, kind="solid", degree=1)


def answer(block: Any) -> tuple[np.ndarray, np.ndarray, float]:
    """Forces (k, 3) in the order of their places, displacements (N, 3), and CPU seconds."""
    start = time.process_time()
    reduction = reduce_bodies(pressed(block), solver="superlu")
    solution = solve(reduction.problem, tol=1e-13)
    U = reduction.displaced(solution)[1]
    seconds = time.process_time() - start
    x = reduction.problem.coordinates
    order = np.lexsort(np.round(x[:2], 9))
    return solution.reactions[order], U[reduction.bodies[1].view.unknowns].T, seconds


def linear(block: MatrixPart) -> tuple[float, float]:
    """CPU seconds of factors and a solve, by the same solver in our order and by spsolve."""
    held = cast(MatrixBody, assemble(pressed(block), block, 16, None)).body
    free, load = held.free, np.ones(len(held.load))
    start = time.process_time()
    condense(held, "superlu", False)  # it solves for the loads
    ours = time.process_time()
    spsolve(sp.csc_matrix(held.A[free][:, free]), load[free])
    return ours - start, time.process_time() - ours


def compared(name: str, python: str, count: int, repeats: int = 1) -> dict[str, Any]:
    """One row of the table."""
    made = given_by(name, python, count)
    part, own = bodies(made)
    runs = [(answer(part), linear(part)) for _ in range(repeats)]
    (r, u, _), (s, v, _) = runs[0][0], answer(own)
    lines = [own for own in (HERE / f"{name}.py").read_text().splitlines() if own.strip()]
    friction, ours, scipys = (min(t) for t in zip(*((run[2], *alone) for run, alone in runs)))
    work = assemble(pressed(part), part, 16, None).work
    return {
        "code": BRIDGES[name][0],
        "lines": len(lines),
        "unknowns": part.K.shape[0],
        "contacts": len(r),
        "forces differ by": float(np.abs(r - s).max() / np.abs(s).max()),
        "displacements differ by": float(np.abs(u - v).max() / np.abs(v).max()),
        "operations with Q / without": work.factors_contact_last[1] / work.factors[1],
        "friction / linear solve": friction / ours,
        "friction / spsolve": friction / scipys,
    }


def main() -> None:
    found = {name: python_of(name) for name in BRIDGES}
    rows = [compared(name, own, COUNT, REPEATS) for name, own in found.items() if own is not None]
    missing = [BRIDGES[name][0] for name, own in found.items() if own is None]
    text = template(__file__).format(missing=", ".join(missing) or "none", repeats=REPEATS)
    write("bridges", "Matrices of other codes", text, {"bridges": rows}, {}, "experiments.bridges")


if __name__ == "__main__":
    main()
