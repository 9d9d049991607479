"""Products, CPU seconds and memory as the grid of a rough surface grows; Tamaas beside it."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from contactopt import HalfSpace, Material, Rigid, Scene, natural_map_residual
from contactopt.analytic import contact_modulus
from contactopt.scenes.rough_surfaces import self_affine
from experiments.questions.half_spaces.measured import Row, apart, solved

LENGTH, MATERIAL, MU = 10.0, Material(5.0, 0.3), 0.3
TAMAAS = """
import sys, time, numpy as np, tamaas as tm
data = np.load(sys.argv[1])
gap, length, tol = data["gap"], float(data["length"]), float(data["tol"])
model = tm.Model(tm.model_type.basic_2d, [length, length], list(gap.shape))
model.E, model.nu = float(data["modulus"]), 0.0
kind = tm.PolonskyKeerRey.pressure
solver = tm.PolonskyKeerRey(model, gap.max() - gap, tol, kind, kind)
if not data["periodic"]:
    tm.ModelFactory.registerNonPeriodic(model, "dcfft")
    solver.setIntegralOperator("dcfft")
solver.max_iter = 5000
start = time.process_time()
solver.solve(float(data["pressure"]))
np.savez(sys.argv[2], seconds=time.process_time() - start, pressure=np.array(model.traction))
"""


def ticks(n: int) -> np.ndarray:
    return (np.arange(n) + 0.5) * LENGTH / n - LENGTH / 2


def gap_of(kind: str, n: int) -> np.ndarray:
    """Gap (n, n) of a paraboloid of radius 10, or of a surface with up to 64 or 16 waves a side."""
    if kind == "sphere":
        return np.asarray(np.add.outer(ticks(n) ** 2, ticks(n) ** 2) / 20)
    heights = self_affine(
        (n, n),
        (LENGTH, LENGTH),
        longest=LENGTH / 4,
        shortest=LENGTH / (16 if kind == "wavy" else 64),
        slope=0.1,
    )
    return np.asarray(heights.max() - heights)


def pressed(kind: str, n: int, law: str, shear: float = 0.0, periodic: bool = False) -> Scene:
    """A rigid sphere or rough surface pressed on a half-space; sheared by a share of mu P."""
    force = 3.0 if kind == "sphere" else 0.005 * contact_modulus(MATERIAL) * LENGTH**2
    load = {"z": -force} | ({"x": shear * MU * force} if shear else {})
    lower = HalfSpace("half-space", MATERIAL, (ticks(n), ticks(n)), periodic=periodic)
    return Scene(
        kind, Rigid("body", gap=gap_of(kind, n), force=load), lower, MU, kind="solid", law=law
    )


def one(kind: str, n: int, law: str) -> Row:
    return solved(pressed(kind, n, law, 0.0 if law == "frictionless" else 0.5))[0]


def growth(kind: str, sizes: tuple[int, ...], frictional: tuple[int, ...]) -> list[Row]:
    """Every size in a process of its own; those with friction are sheared to half of mu P."""
    rows = [apart(one, kind, n, "frictionless") for n in sizes]
    return rows + [apart(one, kind, n, "coulomb") for n in frictional]


def wavy_rows() -> list[Row]:
    return growth("wavy", (64, 128, 256, 512, 1024), (64, 128, 256, 512, 1024))


def rough_rows() -> list[Row]:
    return growth("rough", (512, 1024, 2048), ())


def friction_rows() -> list[Row]:
    return growth("rough", (), (512, 1024))


def tamaas_rows() -> list[Row]:
    """Normal contact, the same gap, load and tolerance."""
    python = os.environ.get("TAMAAS") or (sys.executable if find_spec("tamaas") else "")
    cases = [
        (kind, periodic, tol, n)
        for kind, periodic, tol in (("rough", True, 1e-8), ("sphere", False, 1e-10))
        for n in (512, 1024)
    ]
    absent = [{"Tamaas": "not installed here: nothing compared"}]
    return [apart(beside, python, *case) for case in cases] if python else absent


def beside(python: str, kind: str, periodic: bool, tol: float, n: int) -> Row:
    """One problem, solved here and by Tamaas in another process, one after the other."""
    scene = pressed(kind, n, "frictionless", periodic=periodic)
    row, reduction, solution = solved(scene, tol)
    problem = reduction.problem
    force = -float(scene.upper.force["z"])  # type: ignore[union-attr,index]
    with tempfile.TemporaryDirectory() as folder:
        given, answer = Path(folder) / "given.npz", Path(folder) / "answer.npz"
        np.savez(given, gap=gap_of(kind, n), length=LENGTH, pressure=force / LENGTH**2, tol=tol,
                 modulus=contact_modulus(MATERIAL), periodic=periodic)  # fmt: skip
        subprocess.run(
            [python, "-c", TAMAAS, str(given), str(answer)], check=True, capture_output=True
        )
        theirs = np.load(answer)
        seconds, pressure = float(theirs["seconds"]), theirs["pressure"]
    r = np.zeros(problem.q.shape)
    r[:, 0] = pressure.ravel() * problem.areas
    own = row["CPU s, problem"] + row["CPU s, solve"]
    return {
        "surface": f"{kind}, {'periodic' if periodic else 'alone'}",
        "points": f"{n} x {n}",
        "contact": row["contact"],
        "tolerance": tol,
        "CPU s, problem": row["CPU s, problem"],
        "CPU s, solve": row["CPU s, solve"],
        "CPU s, Tamaas' solve": seconds,
        "Tamaas' over solve": seconds / row["CPU s, solve"],
        "Tamaas' over both": seconds / own,
        "certificate": solution.residual,
        "certificate of Tamaas": natural_map_residual(problem, r),
        "pressures differ by": float(np.linalg.norm(r - solution.reactions) / np.linalg.norm(r)),
    }
