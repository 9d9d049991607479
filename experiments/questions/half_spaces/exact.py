"""Half-spaces against exact answers: influence coefficients, Hertz, Cattaneo and Mindlin."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from contactopt import HalfSpace, Material, follow, scenes, solve
from contactopt.analytic import contact_modulus, cycle_loss_point, tangential_modulus
from contactopt.coupling.reduction import reduce_bodies
from contactopt.readings.half_space_readings import surface_contact
from experiments.questions.half_spaces.measured import Row, cpu, solved

STEPS = 4  # of the path from zero to the largest shear


def _box(n: int) -> tuple[np.ndarray, np.ndarray]:
    """n x n points of a square that is 2.5 contact radii wide."""
    a = scenes.hertz_half_space().reference.half_width
    x = (np.arange(n) + 0.5) * 2.5 * a / n - 1.25 * a
    return x, x


def hertz_rows() -> list[Row]:
    """The scene hertz-half-space on more and more points."""
    rows: list[Row] = []
    for points in (16, 32, 64, 128, 256):
        scene = scenes.hertz_half_space()
        row, reduction, solution = solved(
            replace(scene, lower=replace(scene.lower, points=_box(points))), 1e-10
        )
        exact, problem = scene.reference, reduction.problem
        pressure = solution.reactions[:, 0] / problem.areas
        distance = np.linalg.norm(problem.chart.places, axis=0)
        inner = distance < 0.5 * exact.half_width
        fit = np.polyfit(distance[inner] ** 2, pressure[inner] ** 2, 2)
        edge = (distance > 0.5 * exact.half_width) & (distance < 0.95 * exact.half_width)
        slope, top = np.polyfit(distance[edge] ** 2, pressure[edge] ** 2, 1)
        approach = -solution.multipliers[0] / exact.approach - 1
        made: Row = {
            "points a side": points,
            "peak, rel. error": np.sqrt(fit[-1]) / exact.peak - 1,
            "width, rel. error": np.sqrt(-top / slope) / exact.half_width - 1,
            "approach, rel. error": approach,
            "order of the approach": np.log2(abs(rows[-1]["approach, rel. error"] / approach))
            if rows
            else np.nan,
            "pressure in L2": np.linalg.norm(pressure - exact.pressure(distance))
            / np.linalg.norm(exact.pressure(distance)),
        }
        rows.append(
            made
            | {"products": row["products"], "CPU s": row["CPU s, problem"] + row["CPU s, solve"]}
        )
    return rows


def cattaneo_rows() -> list[Row]:
    """Sheared to half of mu P at nu = 0, where the formulas are exact, and at nu = .3."""
    rows, tractions = [], {}
    for nu, elements in ((0.0, 32), (0.0, 64), (0.0, 128), (0.3, 32), (0.3, 64), (0.3, 128)):
        material = Material(5.0, nu)
        scene = scenes.cattaneo_half_space(material=material, elements=elements)
        seconds, reduction = cpu(lambda scene=scene: reduce_bodies(scene))
        spent, solution = cpu(lambda problem=reduction.problem: solve(problem))
        exact, problem, r = scene.reference, reduction.problem, solution.reactions
        shear = exact.shear(np.linalg.norm(problem.chart.places, axis=0))
        numbers = surface_contact(problem, solution)
        work = _cycle(scene).history["friction_work"] if elements <= 64 and nu == 0 else None
        limits = contact_modulus(material, material), tangential_modulus(material, material)
        loss = cycle_loss_point(100.0, 400.0, *limits, 0.5, 25.0)
        side = round(np.sqrt(problem.contacts))
        tractions[nu, elements] = (r[:, 1:] / problem.areas[:, None]).reshape(side, side, 2)
        rows.append(
            {
                "nu": nu,
                "points a radius": elements,
                "c / a": np.sqrt(numbers.stick_area / numbers.area),
                "c / a, rel. to exact": np.sqrt(numbers.stick_area / numbers.area) / 0.5 ** (1 / 3)
                - 1,
                "q in L2, rel. to exact": np.linalg.norm(-r[:, 1] / problem.areas - shear)
                / np.linalg.norm(shear),
                "across / along": np.abs(r[:, 2]).sum() / np.abs(r[:, 1]).sum(),
                "shift": float(solution.multipliers[0]),
                "shift, rel. to exact": solution.multipliers[0] / exact.shift - 1,
                "loss, rel. to exact": np.nan
                if work is None
                else (work[-1] - work[STEPS]) / loss - 1,
                "CPU s": seconds + spent,
            }
        )
    for row in rows:
        own, finest = tractions[row["nu"], row["points a radius"]], tractions[row["nu"], 128]
        ratio = len(finest) // len(own)
        means = finest.reshape(len(own), ratio, len(own), ratio, 2).mean(axis=(1, 3))
        row["q in L2, rel. to finest"] = (
            np.linalg.norm(own - means) / np.linalg.norm(means) if ratio > 1 else np.nan
        )
    return rows


def _cycle(scene: Any) -> Any:
    upper = scene.upper
    assert isinstance(upper, HalfSpace)
    rising = np.linspace(0, 1, STEPS + 1)
    shares = [
        *rising,
        *np.linspace(1, -1, 2 * STEPS + 1)[1:],
        *np.linspace(-1, 1, 2 * STEPS + 1)[1:],
    ]
    return follow(
        [replace(scene, upper=replace(upper, force={"x": 25.0 * s, "z": -100.0})) for s in shares]
    )
