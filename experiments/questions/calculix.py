"""Does CalculiX, another code, find the same forces from the decks that contactopt writes?"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from contactopt import scenes, solve
from contactopt.bodies.calculix_deck import FACTOR, deck
from contactopt.coupling.reduction import reduce_bodies
from contactopt.figures.style import add_legend, paper_axes
from experiments.report import measure, template

SCENES: list[tuple[str, dict[str, Any]]] = [
    ("punch-2d", {"elements": 16}),
    ("punch-2d", {"elements": 32}),
    ("cylinder-2d", {"elements": 16}),
    ("press-fit", {}),
    ("punch-3d", {"elements": 6}),
]
DECADES = range(7)
LIMIT = 100.0  # seconds for one run of ccx
ABSENT = (
    "CalculiX is not installed: on Debian or Ubuntu `apt-get install calculix-ccx` provides its"
    " solver, ccx."
)


def compared(name: str, settings: dict[str, Any], factor: float) -> dict[str, Any]:
    """One scene in both codes: differences of nodal contact forces, over the largest force, and of
    displacements, over the largest displacement.
    """
    scene = scenes.make_scene(name, **settings)
    start = time.process_time()
    reduction = reduce_bodies(scene)
    solution = solve(reduction.problem, tol=1e-10)
    moved = reduction.displaced(solution)
    own = time.process_time() - start
    row: dict[str, Any] = {"scene": name, "contacts": reduction.problem.contacts, "factor": factor}
    answer, iterations, seconds = run(deck(scene, factor))
    end = "converged" if len(answer) else "no answer"
    forces, displacements, first = [], [], 0
    for U, body, T in zip(moved, reduction.bodies, reduction.maps) if len(answer) else ():
        assembly, unknowns = body.body, body.body.unknowns  # type: ignore[attr-defined]
        theirs = np.zeros(len(U))
        theirs[unknowns] = answer[first : first + unknowns.shape[1], : scene.dim].T
        ours = T.T @ solution.reactions.ravel()
        pressed = np.intersect1d(np.flatnonzero(ours), assembly.free)
        gap = (assembly.A @ theirs - assembly.load - ours)[pressed]
        forces.append(abs(gap).max() / abs(ours).max())
        displacements.append((abs(theirs - U).max(), abs(U).max()))
        first += unknowns.shape[1]
    if forces:
        errors, sizes = zip(*displacements)
        row |= {"contact forces": float(max(forces))}
        row |= {"displacements": float(max(errors) / max(sizes))}
    else:
        row |= {"contact forces": "", "displacements": ""}
    counts = {"steps": solution.iterations, "iterations of ccx": iterations}
    return row | counts | {"CPU s": own, "CPU s of ccx": seconds, "end": end}


def run(text: str) -> tuple[np.ndarray, int, float]:
    """Displacements of all nodes, (nodes, 3), none if ccx did not carry the whole load; iterations
    of all attempts; CPU seconds.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "job.inp").write_text(text)
        start = os.times()
        try:
            done = subprocess.run(
                ["ccx", "job"], cwd=folder, capture_output=True, text=True, timeout=LIMIT
            )
            good = "Job finished" in done.stdout and "*ERROR" not in done.stdout
        except subprocess.TimeoutExpired:
            good = False
        end = os.times()
        seconds = end.children_user + end.children_system
        seconds -= start.children_user + start.children_system
        iterations = len((folder / "job.cvg").read_text().splitlines()) - 4
        table = (folder / "job.dat").read_text() if good else ""
    # the last table of displacements ends where that of forces begins
    lines = table[table.rfind("displacements") :].split("forces")[0].splitlines()[1:]
    rows = [line.split()[1:] for line in lines if line.strip()]
    return np.array(rows, dtype=float), iterations, seconds


TEXT = template(__file__)


def draw(tables: dict[str, list[dict[str, Any]]]) -> dict[str, Any]:
    figure, (axes,) = paper_axes()
    rows = [row for row in tables["factors"] if row["end"] == "converged"]
    for column, mark in (("contact forces", "o-"), ("displacements", "s--")):
        axes.loglog([r["factor"] for r in rows], [r[column] for r in rows], mark, label=column)
    axes.set(xlabel="penalty factor $K h / E$ [-]", ylabel="difference from contactopt [-]")
    add_legend(axes)
    return {"penalty": figure}


TABLES = {
    "factors": lambda: [compared(*SCENES[0], 10.0**decade) for decade in DECADES],
    "scenes": lambda: [compared(name, settings, FACTOR) for name, settings in SCENES],
}

if __name__ == "__main__":
    if shutil.which("ccx") is None:
        raise SystemExit(ABSENT)
    measure("calculix", "CalculiX on the same mesh", TEXT, TABLES, draw)
