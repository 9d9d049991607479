"""Half-spaces against exact answers: Cattaneo and Mindlin."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from contactopt import HalfSpace, Material, follow, scenes, solve
from contactopt.analytic import contact_modulus, cycle_loss_point, tangential_modulus
from contactopt.coupling.reduction import reduce_bodies
from contactopt.readings.half_space_readings import surface_contact
from experiments.questions.half_spaces.measured import Row, cpu

STEPS = 4  # of the path from zero to the largest shear


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
