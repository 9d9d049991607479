"""What does a half-space cost, and how exact is it: Hertz, Cattaneo-Mindlin, rough surfaces, against Tamaas?

`TAMAAS=/path/to/python python -m experiments.questions.half_spaces` compares with the package Tamaas in an environment of its own;
without TAMAAS the comparison uses this Python if it has Tamaas, and is left out if not. Set OMP_NUM_THREADS=1.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from contactopt import HalfSpace, Material, Rigid, Scene, Solution, follow, natural_map_residual, scenes, solve
from contactopt.analysis.half_spaces import subsurface_stress, surface_contact
from contactopt.analytic import contact_modulus, cycle_loss_point, hertz_line, tangential_modulus
from contactopt.figures.plots import BLUE, GREEN, GREY, ORANGE
from contactopt.interface.reduction import Reduction, reduce_bodies
from contactopt.scenes.scene import Part
from contactopt.scenes.surfaces import self_affine
from experiments.report import write

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


def cpu(act: Callable[[], Any]) -> tuple[float, Any]:
    start = time.process_time()
    made = act()
    return time.process_time() - start, made


def ticks(n: int) -> np.ndarray:
    return (np.arange(n) + 0.5) * LENGTH / n - LENGTH / 2


def gap_of(kind: str, n: int) -> np.ndarray:
    """Gap (n, n) of a paraboloid of radius 10, or of a rough surface with 64 waves along a side at most, or 16 ('wavy')."""
    if kind == "sphere":
        return np.asarray(np.add.outer(ticks(n) ** 2, ticks(n) ** 2) / 20)
    heights = self_affine(
        (n, n), (LENGTH, LENGTH), longest=LENGTH / 4, shortest=LENGTH / (16 if kind == "wavy" else 64), slope=0.1
    )
    return np.asarray(heights.max() - heights)


def pressed(kind: str, n: int, law: str, shear: float = 0.0, periodic: bool = False) -> Scene:
    """A rigid sphere or rough surface pressed on a half-space; sheared by a share of mu P."""
    force = 3.0 if kind == "sphere" else 0.005 * contact_modulus(MATERIAL) * LENGTH**2
    load = {"z": -force} | ({"x": shear * MU * force} if shear else {})
    lower = HalfSpace("half-space", MATERIAL, (ticks(n), ticks(n)), periodic=periodic)
    return Scene(kind, Rigid("body", gap=gap_of(kind, n), force=load), lower, MU, kind="solid", law=law)


def solved(scene: Scene, tol: float = 1e-8) -> tuple[dict[str, Any], Reduction, Solution]:
    making, reduction = cpu(lambda: reduce_bodies(scene))
    solving, solution = cpu(lambda: solve(reduction.problem, tol=tol))
    row = {
        "points": reduction.problem.contacts,
        "law": scene.law,
        "contact": surface_contact(reduction.problem, solution).fraction,
        "products": solution.products,
        "CPU s, problem": making,
        "CPU s, solve": solving,
        "certificate": solution.residual,
        "solved": solution.solved,
        "peak GB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
    }
    return row, reduction, solution


def hertz_rows() -> list[dict[str, Any]]:
    """The scene hertz-half-space: 2.5 elements are one side of the box, so that 51.2 stand for 128 points."""
    rows = []
    for points in (16, 32, 64, 128, 256):
        scene = replace(scenes.hertz_half_space(), lower=replace(scenes.hertz_half_space().lower, points=_box(points)))
        row, reduction, solution = solved(scene, 1e-10)
        exact, problem = scene.reference, reduction.problem
        pressure = solution.reactions[:, 0] / problem.areas
        distance = np.linalg.norm(problem.chart.places, axis=0)
        inner = distance < 0.5 * exact.half_width
        fit = np.polyfit(distance[inner] ** 2, pressure[inner] ** 2, 2)
        edge = (distance > 0.5 * exact.half_width) & (distance < 0.95 * exact.half_width)
        slope, top = np.polyfit(distance[edge] ** 2, pressure[edge] ** 2, 1)
        depths = exact.half_width * np.linspace(0.44, 0.52, 9)
        made: dict[str, Any] = {
            "points a side": points,
            "peak, rel. error": np.sqrt(fit[-1]) / exact.peak - 1,
            "width, rel. error": np.sqrt(-top / slope) / exact.half_width - 1,
            "approach, rel. error": -solution.multipliers[0] / exact.approach - 1,
            "pressure in L2": np.linalg.norm(pressure - exact.pressure(distance))
            / np.linalg.norm(exact.pressure(distance)),
        }
        if points >= 64:
            mises = subsurface_stress(reduction, solution, depths)[1].reshape(len(depths), -1)
            below = mises[:, np.argmin(distance)]
            made["von Mises / p0"] = below.max() / exact.peak
            made["at depth / a"] = depths[below.argmax()] / exact.half_width
        else:
            made["von Mises / p0"] = made["at depth / a"] = np.nan
        rows.append(made | {"products": row["products"], "CPU s": row["CPU s, problem"] + row["CPU s, solve"]})
    return rows


def _box(n: int) -> tuple[np.ndarray, np.ndarray]:
    a = scenes.hertz_half_space().reference.half_width
    x = (np.arange(n) + 0.5) * 2.5 * a / n - 1.25 * a
    return x, x


def cattaneo_rows() -> list[dict[str, Any]]:
    """Cattaneo and Mindlin: half of mu P at nu = 0 (exact) and nu = .3, and the loss of a cycle."""
    rows = []
    for nu, elements in ((0.0, 32), (0.0, 64), (0.0, 128), (0.3, 32), (0.3, 64), (0.3, 128)):
        material = Material(5.0, nu)
        scene = scenes.cattaneo_half_space(material=material, elements=elements)
        seconds, reduction = cpu(lambda scene=scene: reduce_bodies(scene))
        spent, solution = cpu(lambda problem=reduction.problem: solve(problem))
        exact, problem, r = scene.reference, reduction.problem, solution.reactions
        distance = np.linalg.norm(problem.chart.places, axis=0)
        exact_shear = exact.shear(distance)
        numbers = surface_contact(problem, solution)
        path = _cycle(scene) if elements <= 64 and nu == 0 else None
        work = None if path is None else path.history["friction_work"]
        limits = contact_modulus(material, material), tangential_modulus(material, material)
        loss = cycle_loss_point(100.0, 400.0, *limits, 0.5, 25.0)
        rows.append(
            {
                "nu": nu,
                "points a radius": elements,
                "c / a": np.sqrt(numbers.stick_area / numbers.area),
                "c / a, rel. to exact": np.sqrt(numbers.stick_area / numbers.area) / 0.5 ** (1 / 3) - 1,
                "q in L2, rel. to exact": np.linalg.norm(-r[:, 1] / problem.areas - exact_shear)
                / np.linalg.norm(exact_shear),
                "across / along": np.abs(r[:, 2]).sum() / np.abs(r[:, 1]).sum(),
                "shift, rel. to exact": solution.multipliers[0] / exact.shift - 1,
                "loss, rel. to exact": np.nan if work is None else (work[-1] - work[STEPS]) / loss - 1,
                "CPU s": seconds + spent,
            }
        )
    return rows


STEPS = 4  # of the path from zero to the largest shear


def _cycle(scene: Scene) -> Any:
    upper = scene.upper
    assert isinstance(upper, HalfSpace)
    rising = np.linspace(0, 1, STEPS + 1)
    shares = [*rising, *np.linspace(1, -1, 2 * STEPS + 1)[1:], *np.linspace(-1, 1, 2 * STEPS + 1)[1:]]
    return follow([replace(scene, upper=replace(upper, force={"x": 25.0 * s, "z": -100.0})) for s in shares])


def tamaas_rows() -> list[dict[str, Any]]:
    """Normal contact, the same gap, load and tolerance; empty without Tamaas."""
    python = os.environ.get("TAMAAS") or (sys.executable if find_spec("tamaas") else "")
    rows: list[dict[str, Any]] = []
    for kind, periodic, tol in (("rough", True, 1e-8), ("sphere", False, 1e-10)) if python else ():
        for n in (512, 1024):
            scene = pressed(kind, n, "frictionless", periodic=periodic)
            row, reduction, solution = solved(scene, tol)
            problem = reduction.problem
            force = -float(scene.upper.force["z"])  # type: ignore[union-attr,index]
            with tempfile.TemporaryDirectory() as folder:
                given, answer = Path(folder) / "given.npz", Path(folder) / "answer.npz"
                np.savez(given, gap=gap_of(kind, n), length=LENGTH, pressure=force / LENGTH**2, tol=tol,
                         modulus=contact_modulus(MATERIAL), periodic=periodic)  # fmt: skip
                subprocess.run([python, "-c", TAMAAS, str(given), str(answer)], check=True, capture_output=True)
                theirs = np.load(answer)
                seconds, pressure = float(theirs["seconds"]), theirs["pressure"]
            r = np.zeros(problem.q.shape)
            r[:, 0] = pressure.ravel() * problem.areas
            rows.append(
                {
                    "surface": f"{kind}, {'periodic' if periodic else 'alone'}",
                    "points": f"{n} x {n}",
                    "contact": row["contact"],
                    "tolerance": tol,
                    "CPU s, problem": row["CPU s, problem"],
                    "CPU s, solve": row["CPU s, solve"],
                    "CPU s, Tamaas' solve": seconds,
                    "Tamaas' over both": seconds / (row["CPU s, problem"] + row["CPU s, solve"]),
                    "Tamaas' over solve": seconds / row["CPU s, solve"],
                    "certificate": solution.residual,
                    "certificate of Tamaas": natural_map_residual(problem, r),
                    "pressures differ by": np.linalg.norm(r - solution.reactions) / np.linalg.norm(r),
                }
            )
    return rows


def chart_rows() -> list[dict[str, Any]]:
    """Hertz's pressure by finite elements and by half-spaces: error in L2 over CPU seconds."""
    rows = []
    for elements in (8, 16, 32, 64):
        rows.append(
            _pressure_error("finite elements, axisymmetric", scenes.sphere(rigid="sphere", mu=0.0, elements=elements))
        )
    for elements in (4, 6):
        rows.append(_pressure_error("finite elements, 3D", _without_shear(elements)))
    for elements in (8, 16, 32, 64, 128):
        rows.append(_pressure_error("half-space, 3D", scenes.hertz_half_space(elements=elements)))
        rows.append(_pressure_error("half-plane, 2D", _line(elements)))
    return rows


def _without_shear(elements: int) -> Scene:
    return scenes.cattaneo(3, shear=0.0, mu=0.1, elements=elements)


def _line(elements: int) -> Scene:
    exact = hertz_line(1.0, 400.0, contact_modulus(MATERIAL))
    a = exact.half_width
    x = (np.arange(-int(1.25 * elements), int(1.25 * elements)) + 0.5) * a / elements
    rigid = Rigid("cylinder", gap=lambda p: p[0] ** 2 / 800, force={"y": -1.0})
    return Scene("line", rigid, HalfSpace("half-plane", MATERIAL, x), 0.0, law="frictionless", reference=exact)


def _pressure_error(name: str, scene: Scene) -> dict[str, Any]:
    seconds, (problem, solution) = cpu(lambda: _answer(scene))
    distance = np.linalg.norm(problem.coordinates[: scene.dim - 1], axis=0)
    exact = scene.reference.pressure(distance)
    pressure, w = solution.reactions[:, 0] / np.maximum(problem.areas, 1e-300), problem.areas
    error = np.sqrt(np.sum(w * (pressure - exact) ** 2) / np.sum(w * exact**2))
    meshed = isinstance(scene.lower, Part)
    return {"model": name, "elements a radius": scene.elements if meshed or scene.dim == 3 else problem.contacts / 2.5,
            "contacts": problem.contacts, "pressure in L2": error, "CPU s": seconds}  # fmt: skip


def _answer(scene: Scene) -> tuple[Any, Solution]:
    problem = reduce_bodies(scene).problem
    return problem, solve(problem)


def figure(charts: list[dict[str, Any]], growth: list[dict[str, Any]]) -> Figure:
    made = Figure(figsize=(11, 4.2), layout="constrained")
    left, right = made.subplots(1, 2)
    for name, colour in zip(dict.fromkeys(row["model"] for row in charts), (GREY, ORANGE, BLUE, GREEN)):
        own = [row for row in charts if row["model"] == name]
        left.loglog(
            [row["CPU s"] for row in own], [row["pressure in L2"] for row in own], "o-", color=colour, label=name
        )
    left.set(xlabel="CPU seconds", ylabel="error of the pressure in L2 [-]", title="Hertz contact")
    left.legend(frameon=False)
    for law, colour in (("frictionless", BLUE), ("coulomb", ORANGE)):
        own = [row for row in growth if row["law"] == law]
        right.semilogx([row["points"] for row in own], [row["products"] for row in own], "o-", color=colour, label=law)
    right.set(
        xlabel="points", ylabel="products with Q on the finest grid", title="rough surface, 16 waves", ylim=(0, None)
    )
    right.legend(frameon=False)
    return made


TEXT = """All runs in one process with one thread per transform; CPU seconds of this machine, on which other programs ran as well.
"CPU s, problem" is the time to make the interface problem, "solve" that of contactopt.solve with its certificate.

## Hertz: a rigid sphere on a half-space

The square of points is 2.5 contact radii wide. The peak is that of a parabola in r^2 through p^2 within half a radius, the width
the zero of a line through p^2 beyond. The largest von Mises stress on the axis is .620 p0 at .481 a for nu = .3.

{hertz}

## Cattaneo and Mindlin: two spheres, sheared to half of mu P

Exact for nu = 0. For nu = .3 the same formulas neglect the friction across the shear; what is given is the deviation from them, which
converges to a limit of its own. The loss is that of a cycle of 16 steps.

{cattaneo}

## Rough surfaces

A rigid rough surface (16 waves along a side at most, Hurst exponent .8, rms slope .1) at a mean pressure of .005 E*, not periodic;
with friction sheared to half of mu P, mu = .3, all components coupled. Products are those on the finest grid.

{wavy}

The same with 64 waves along a side at most:

{rough}

## Tamaas

The same gap, load and tolerance, given to Tamaas' solver of Polonsky, Keer and Rey with its own stopping rule. Both answers are judged
by the certificate here. Where Tamaas is not installed this table says so.

{tamaas}

## Speed against accuracy, products against size

{chart}
"""


def growth(kind: str, sizes: tuple[int, ...], frictional: tuple[int, ...]) -> list[dict[str, Any]]:
    rows = [solved(pressed(kind, n, "frictionless"))[0] for n in sizes]
    return rows + [solved(pressed(kind, n, "coulomb", 0.5))[0] for n in frictional]


def main() -> None:
    wavy = growth("wavy", (64, 128, 256, 512, 1024), (64, 128, 256, 512, 1024))
    rough, charts = growth("rough", (512, 1024, 2048), (512, 1024)), chart_rows()
    tables = {"hertz": hertz_rows(), "cattaneo": cattaneo_rows(), "wavy": wavy, "rough": rough, "chart": charts}
    tables["tamaas"] = tamaas_rows() or [{"Tamaas": "not installed here: nothing compared"}]
    write("half_spaces", "Half-spaces: exactness, cost, and Tamaas", TEXT, tables, {"speed": figure(charts, wavy)})


if __name__ == "__main__":
    main()
