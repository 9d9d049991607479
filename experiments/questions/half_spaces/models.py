"""The same Hertz contact by finite elements and by half-spaces: error over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from contactopt import HalfSpace, Material, Rigid, Scene, Solution, scenes, solve
from contactopt.analytic import contact_modulus, hertz_line
from contactopt.coupling.reduction import reduce_bodies
from contactopt.figures.style import COLOURS, draw_lines, label_ends, paper_axes
from experiments.questions.half_spaces.measured import Row, cpu

MATERIAL = Material(5.0, 0.3)
RADIUS = 400.0


def chart_rows() -> list[Row]:
    """Hertz's pressure by finite elements and by half-spaces: error in L2 over CPU seconds."""
    cases = [
        ("finite elements, axisymmetric", scenes.sphere(rigid="sphere", mu=0.0, elements=n))
        for n in (8, 16, 32)
    ]
    cases += [("half-space, 3D", scenes.hertz_half_space(elements=n)) for n in (8, 16, 32, 64, 128)]
    cases += [("half-plane, 2D", _line(n)) for n in (8, 16, 32, 64, 128)]
    cases += [
        ("finite elements, 3D", scenes.cattaneo(3, shear=0.0, mu=0.1, elements=n)) for n in (3, 4)
    ]
    return [_pressure_error(*case) for case in cases]


def _line(elements: int) -> Scene:
    exact = hertz_line(1.0, RADIUS, contact_modulus(MATERIAL))
    half = int(1.25 * elements)
    x = (np.arange(-half, half) + 0.5) * exact.half_width / elements
    rigid = Rigid("cylinder", gap=lambda p: p[0] ** 2 / (2 * RADIUS), force={"y": -1.0})
    return Scene(
        "line",
        rigid,
        HalfSpace("half-plane", MATERIAL, x),
        0.0,
        law="frictionless",
        elements=elements,
        reference=exact,
    )


def _pressure_error(name: str, scene: Scene) -> Row:
    seconds, (problem, solution) = cpu(lambda: _answer(scene))
    distance = np.linalg.norm(problem.coordinates[: scene.dim - 1], axis=0)
    exact = scene.reference.pressure(distance)
    pressure, w = solution.reactions[:, 0] / np.maximum(problem.areas, 1e-300), problem.areas
    error = np.sqrt(np.sum(w * (pressure - exact) ** 2) / np.sum(w * exact**2))
    row: Row = {"model": name, "elements a radius": scene.elements, "contacts": problem.contacts}
    row |= {"pressure in L2": error, "CPU s": seconds}
    print(row, flush=True)  # long runs show how far they are
    return row


def _answer(scene: Scene) -> tuple[Any, Solution]:
    problem = reduce_bodies(scene).problem
    return problem, solve(problem)


def draw_speed(charts: list[Row], growth: list[Row]) -> Any:
    """Error over time of all models, and products over the size of the grid."""
    figure, (left, right) = paper_axes(2, wide=True)
    lines = []
    for name in dict.fromkeys(row["model"] for row in charts):
        own = [row for row in charts if row["model"] == name]
        lines.append((name, *([row[key] for row in own] for key in ("CPU s", "pressure in L2"))))
    draw_lines(left, lines)
    left.set(xlabel="CPU time [s]", ylabel="error of the pressure in L2 [-]")
    ends = []
    for law, colour in zip(("frictionless", "coulomb"), COLOURS):
        own = [row for row in growth if row["law"] == law]
        points = [row["points"] for row in own]
        for key, style in (("products", "o-"), ("iterations a step", "s--")):
            values = [row[key] for row in own]
            right.semilogx(points, values, style, color=colour)
            ends.append((points[-1], values[-1], f"{law}: {key}", colour))
    right.set(xlabel="points [-]", ylabel="number on the finest grid [-]", ylim=(0, None))
    label_ends(right, ends)
    return figure
