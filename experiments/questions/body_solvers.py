"""What do the solvers of a body's linear system cost, up to a million unknowns?

It takes some ten minutes and 12 GiB.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import time
from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from contactopt import scenes
from contactopt.bodies.body import build_body
from contactopt.bodies.solvers import make_solver
from contactopt.bodies.solvers.constants import RTOL
from contactopt.bodies.solvers.multigrid import conjugate_gradients, nodal_blocks, rigid_motions
from contactopt.bodies.solvers.system import System
from contactopt.figures.style import COLOURS, label_ends, paper_axes
from experiments.report import Tables, measure, template

PLAIN = "pyamg's defaults"
USUAL = (8, 12, 16, 24, 32)  # elements across the contact half-width
ELEMENTS = {
    "superlu": USUAL,
    "pardiso": (*USUAL, 48),
    "multigrid": (*USUAL, 48, 64, 80),
    PLAIN: USUAL,
}


def system(part: str, elements: int) -> tuple[System, np.ndarray]:
    """What a solver of a body of the 3D punch is made from, and a random load on its contacts."""
    scene = scenes.flat_punch(3)
    body = build_body(scene, getattr(scene, part), elements, None)
    dofs, free = np.asarray(body.basis.nodal_dofs), body.free
    node, component = np.empty(len(body.load), int), np.empty(len(body.load), int)
    node[dofs], component[dofs] = np.arange(dofs.shape[1]), np.arange(len(dofs))[:, None]
    load = np.random.default_rng(0).standard_normal(len(free)) * np.isin(free, body.contact_dofs)
    return System(body.A[free][:, free], node[free], component[free], body.basis.mesh.p), load


class Plain:
    """Smoothed aggregation of the same blocks and rigid motions as pyamg does it by default."""

    def __init__(self, system: System):
        import pyamg

        blocks, self.place, present = nodal_blocks(*system[:3], len(system.points))
        modes = rigid_motions(system.points[:, present])
        modes[np.setdiff1d(np.arange(len(modes)), self.place)] = 0.0
        self.hierarchy = pyamg.smoothed_aggregation_solver(blocks.astype(float), modes)
        self.complexity = self.hierarchy.operator_complexity()

    def solve(self, load: np.ndarray) -> np.ndarray:
        full = np.zeros(self.hierarchy.levels[0].A.shape[0])
        full[self.place] = load
        residuals: list[float] = []
        x = self.hierarchy.solve(full, tol=RTOL, accel="cg", maxiter=300, residuals=residuals)
        self.iterations = len(residuals) - 1
        return np.asarray(x[self.place])


def iterations(solver: Any, load: np.ndarray) -> int:
    """Iterations of the last solve, 0 for factors."""
    if isinstance(solver, Plain):
        return solver.iterations
    return conjugate_gradients(solver.A, solver.cycle, load, RTOL).cycles if solver.iterative else 0


def resident() -> float:
    """Memory of this process [byte], without what it has freed (glibc)."""
    ctypes.CDLL(None).malloc_trim(0)
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def timed(act: Callable[[], Any]) -> tuple[Any, float]:
    """What `act` returns and the processor time it took [s]."""
    start = time.process_time()
    result = act()
    return result, time.process_time() - start


def measured(task: tuple[str, int]) -> dict[str, Any]:
    """One solver on the foundation, in a process of its own."""
    name, elements = task
    arguments, load = system("lower", elements)
    before = resident()
    solver, setup = timed(
        lambda: Plain(arguments) if name == PLAIN else make_solver(name, arguments)
    )
    memory = resident() - before
    solver.solve(load)
    x, seconds = timed(lambda: solver.solve(load))
    cycle = getattr(solver, "cycle", solver)
    return {
        "solver": name,
        "elements": elements,
        "unknowns": len(load),
        "setup [s]": setup,
        "solve [s]": seconds,
        "iterations": iterations(solver, load),
        "memory [MiB]": memory / 2**20,
        "complexity": getattr(cycle, "complexity", ""),
        "residual": float(np.linalg.norm(load - arguments.A @ x) / np.linalg.norm(load)),
    }


def alone(act: Callable[[Any], Any], task: Any) -> Any:
    """act(task) in a new process, so that its memory is its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(act, (task,))


def draw(tables: Tables) -> dict[str, Any]:
    rows = tables["rows"]
    figure, axes = paper_axes(2, rows=2, wide=True)
    keys = ("setup [s]", "solve [s]", "memory [MiB]", "iterations")
    for ax, key in zip(axes, keys):
        ends = []
        for name, colour in zip(dict.fromkeys(row["solver"] for row in rows), COLOURS):
            own = [row for row in rows if row["solver"] == name and row[key]]
            if own:
                x, y = ([row[column] for row in own] for column in ("unknowns", key))
                ax.loglog(x, y, "o-", color=colour)
                ends.append((x[-1], y[-1], name, colour))
        ax.set(xlabel="unknowns of the body [-]", ylabel=key if "[" in key else f"{key} [-]")
        if key == "iterations":
            ax.set(yscale="linear", ylim=(0, None))
        label_ends(ax, ends)
    return {"cost": figure}


def rows() -> list[dict[str, Any]]:
    return [
        alone(measured, (name, elements))
        for name, several in ELEMENTS.items()
        for elements in several
        if name != "pardiso" or find_spec("pypardiso")
    ]


if __name__ == "__main__":
    there = [name for name in ("pyamg", "pypardiso") if find_spec(name)]
    versions = ", ".join(f"{name} {version(name)}" for name in there)
    text = template(__file__).format(versions=versions)
    measure("body_solvers", "Solvers of a body's linear system", text, {"rows": rows}, draw)
