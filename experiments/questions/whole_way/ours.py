"""One scene solved in one way: a row of seconds and errors."""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from contactopt import HalfSpace, Part, Rigid, Scene, Support, reduce_bodies, scenes, solve
from contactopt.accuracy import refine
from contactopt.analytic import contact_modulus, hertz_point
from contactopt.meshes.structured import patch, rename, simplices, tensor_mesh
from contactopt.readings.half_space_readings import surface_contact
from contactopt.readings.quantities import value_of
from contactopt.solving.solve_scene import Options
from contactopt.solving.zone import solve_zone
from experiments.questions.accuracy.half_space import MATERIAL
from experiments.questions.half_spaces.rough import LENGTH, gap_of, pressed
from experiments.questions.half_spaces.rough import MATERIAL as ROUGH

Row = dict[str, Any]
QUANTITIES = ("peak", "width", "stick", "approach", "area")
BOX = 2.5  # side of the square of a half-space's points over the contact radius
SHORT = 0.5  # CPU seconds, below which a run is repeated three times
FINEST = 1024  # points along a side of the rough surface that the others are compared with
# what a Python that has Tamaas runs: the file that is given, and that of the answer
TAMAAS = """
import sys, time, numpy as np, tamaas as tm
data = np.load(sys.argv[1])
gap, length, tol = data["gap"], float(data["length"]), float(data["tol"])
model = tm.Model(tm.model_type.basic_2d, [length, length], list(gap.shape))
model.E, model.nu = float(data["modulus"]), 0.0
kind = tm.PolonskyKeerRey.pressure
solver = tm.PolonskyKeerRey(model, gap.max() - gap, tol, kind, kind)
tm.ModelFactory.registerNonPeriodic(model, "dcfft")
solver.setIntegralOperator("dcfft")
solver.max_iter = 5000
start = time.process_time()
solver.solve(float(data["pressure"]))
np.savez(sys.argv[2], seconds=time.process_time() - start, pressure=np.array(model.traction))
"""


def timed(act: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds, the median of three where it is short, and the answer."""
    seconds: list[float] = []
    while len(seconds) < (3 if sum(seconds) < SHORT else 1):
        start = time.process_time()
        answer = act()
        seconds.append(time.process_time() - start)
    return median(seconds), answer


def relative(values: dict[str, float], scene: Scene) -> dict[str, float]:
    """Errors over the exact values; nan for what the scene does not have."""
    exact, out = scene.reference, dict.fromkeys(QUANTITIES, np.nan)
    truth = {"peak": exact.peak, "width": exact.half_width, "approach": exact.approach}
    if exact.stick_half_width:
        truth["stick"] = exact.stick_half_width / exact.half_width
    return out | {key: value / truth[key] - 1 for key, value in values.items()}


def meshed(scene: Scene, read: tuple[str, ...], form: str = "auto") -> Row:
    """One scene with a mesh, remeshed to its contact zone where it has one."""
    seconds, solved = timed(lambda: solve_zone(scene, options=Options(Q=form, tol=1e-9)))
    return whole(scene, solved, read, seconds)


def whole(scene: Scene, solved: Any, read: tuple[str, ...], seconds: float) -> Row:
    """The row of a solved scene."""
    reduction, solution = solved.reduction, solved.solution
    names = {"peak": "pressure"}
    values = {q: value_of(names.get(q, q), reduction, solution) for q in read}
    return {"unknowns": reduction.dofs, "seconds": seconds} | relative(values, scene)


def adaptive(scene: Scene, target: float) -> Row:
    """The search for a target of the peak pressure, all its meshes included."""
    seconds, (solved, _) = timed(lambda: refine([scene], "pressure", target, adaptive=True))
    return whole(scene, solved, ("peak", "width"), seconds)


def half_space(points: int) -> Row:
    """Hertz's point contact on a half-space without a mesh."""
    scene = box_scene(points)

    def act() -> Any:
        reduction = reduce_bodies(scene)
        return reduction.problem, solve(reduction.problem, tol=1e-9)

    seconds, (problem, solution) = timed(act)
    pressure = solution.reactions[:, 0] / problem.areas
    distance = np.linalg.norm(problem.chart.places, axis=0)
    values = round_contact(distance, pressure, scene.reference.half_width)
    values["approach"] = -float(solution.multipliers[0])
    return {"unknowns": 3 * problem.contacts, "seconds": seconds} | relative(values, scene)


def box_scene(points: int) -> Scene:
    """A rigid sphere on a square of points that is BOX contact radii wide."""
    scene = scenes.hertz_half_space()
    side = BOX * scene.reference.half_width
    ticks = (np.arange(points) + 0.5) * side / points - side / 2
    assert isinstance(scene.lower, HalfSpace)
    return replace(scene, lower=replace(scene.lower, points=(ticks, ticks)))


def round_contact(distance: np.ndarray, pressure: np.ndarray, a: float) -> dict[str, float]:
    """Peak and half-width of p^2 = p0^2 (1 - r^2 / a^2), fitted inside and near the edge of about
    a; nan where too few points say it.
    """
    inner, edge = distance < 0.5 * a, (distance > 0.5 * a) & (distance < 0.95 * a)
    degree, width = min(2, int(inner.sum()) - 1), np.nan
    top = np.polyfit(distance[inner] ** 2, pressure[inner] ** 2, degree)[-1]
    if edge.sum() > 2:
        slope, at = np.polyfit(distance[edge] ** 2, pressure[edge] ** 2, 1)
        width = float(np.sqrt(-at / slope))
    return {"peak": float(np.sqrt(top)), "width": width}


def in_tamaas(python: str, gap: np.ndarray, **given: Any) -> tuple[float, np.ndarray]:
    """CPU seconds of Tamaas' solve by Polonsky and Keer's method, and its pressure."""
    with tempfile.TemporaryDirectory() as folder:
        file, answer = Path(folder) / "given.npz", Path(folder) / "answer.npz"
        np.savez(file, gap=gap, tol=1e-9, **given)
        subprocess.run([python, "-c", TAMAAS, file, answer], check=True, capture_output=True)
        theirs = np.load(answer)
        return float(theirs["seconds"]), theirs["pressure"].ravel()


def tamaas(points: int, python: str) -> Row:
    """The same points, load and tolerance in Tamaas."""
    scene = box_scene(points)
    assert isinstance(scene.lower, HalfSpace)
    places = reduce_bodies(scene).problem.chart.places
    side, force, exact = BOX * scene.reference.half_width, 100.0, scene.reference
    radius = exact.half_width**2 / exact.approach
    modulus = 0.75 * force * radius / exact.half_width**3
    gap = (np.sum(places**2, axis=0) / (2 * radius)).reshape(points, points)
    seconds, pressure = in_tamaas(
        python, gap, length=side, pressure=force / side**2, modulus=modulus
    )
    values = round_contact(np.linalg.norm(places, axis=0), pressure, exact.half_width)
    return {"unknowns": points**2, "seconds": seconds} | relative(values, scene)


def quarter(n: int, degree: int = 1, cut: bool = False) -> Scene:
    """A rigid sphere on a quarter of a half-space of 20 contact radii, without friction.

    n    elements across the contact radius 1, next to it; they grow by 1 + 4 / n away from it
    cut  whether bricks are cut into tetrahedra
    """
    modulus, radius, near = contact_modulus(MATERIAL), 50.0, n + max(2, n // 4)
    force = 4 * modulus / (3 * radius)

    def beyond(start: np.ndarray) -> np.ndarray:
        count = int(np.ceil(np.log1p((20.0 - start[-1]) * 4) / np.log1p(4 / n)))
        far = np.cumsum((1 + 4 / n) ** np.arange(1.0, count + 1))
        return np.concatenate([start, start[-1] + far * (20.0 - start[-1]) / far[-1]])

    across, depth = beyond(np.arange(near + 1) / n), beyond(np.arange(n + 1) / n)
    mesh = rename(tensor_mesh(across, across, -depth[::-1]), bottom="z-", top="z+")
    mesh = patch(mesh, "top", "contact", [across[near]] * 2)
    mesh = simplices(mesh) if cut else mesh
    held = Support("x-", {"x": 0.0}), Support("y-", {"y": 0.0}), Support("bottom")
    tip = Rigid(
        "sphere",
        (0.0, 0.0, 1.0),
        lambda x: (x[0] ** 2 + x[1] ** 2) / (2 * radius),
        {"z": -force},
    )
    body = Part("half-space", mesh, MATERIAL, held)
    exact = hertz_point(force, radius, modulus)
    return Scene(
        "quarter", tip, body, 0.0, "solid", copies=4, degree=degree, zone=1.0, reference=exact
    )


@cache
def finest_area() -> float:
    """Share of the rough surface that touches, on the finest grid."""
    _, solution = rough_solution(FINEST)
    return float(np.mean(solution.reactions[:, 0] > 0))


def rough_solution(points: int) -> tuple[Any, Any]:
    problem = reduce_bodies(pressed("rough", points, "frictionless")).problem
    return problem, solve(problem, tol=1e-9)


def rough(points: int, python: str = "") -> Row:
    """A rough surface of up to 64 waves a side, here or in Tamaas."""
    if python:
        gap = gap_of("rough", points)
        load = 0.005 * contact_modulus(ROUGH)
        seconds, pressure = in_tamaas(
            python, gap, length=LENGTH, pressure=load, modulus=contact_modulus(ROUGH)
        )
    else:
        seconds, (_, solution) = timed(lambda: rough_solution(points))
        pressure = solution.reactions[:, 0]
    found = {"area": float(np.mean(pressure > 0)) / finest_area() - 1}
    unknowns = {"unknowns": (1 if python else 3) * points**2, "seconds": seconds}
    return unknowns | dict.fromkeys(QUANTITIES, np.nan) | found


def cattaneo(points: int) -> Row:
    """Two like spheres without Poisson's effect, pressed and sheared, on half-spaces."""
    material = replace(scenes.hertz_half_space().lower.material, nu=0.0)
    scene = scenes.cattaneo_half_space(material=material, elements=points)

    def act() -> Any:
        problem = reduce_bodies(scene).problem
        return problem, solve(problem, tol=1e-9)

    seconds, (problem, solution) = timed(act)
    numbers = surface_contact(problem, solution)
    values = {"stick": float(np.sqrt(numbers.stick_area / numbers.area))}
    return {"unknowns": 3 * problem.contacts, "seconds": seconds} | relative(values, scene)
