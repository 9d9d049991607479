"""The elastic punch on meshes that do not match in CalculiX (ccx): forces, time, and other systems
of units.
"""

from __future__ import annotations

import shutil
import time
from statistics import median
from typing import Any

import numpy as np

from contactopt import reduce_bodies, solve
from experiments.questions.calculix.deck import Contact, model
from experiments.questions.calculix.run import RIGID, STICK, Run, difference, run
from experiments.questions.nonmatching.bodies import apart, punch

SIZES = (48, 32)  # ccx puts its multipliers on the upper body
STIFF = 5e5  # strain of 1e-7: displaced surfaces are as good as undisplaced ones
# stick slope, and penalty stiffness, times E / h
LAWS = {"mortar": RIGID, "surface-to-surface": 1e3}
UNITS = ((1.0, 1.0), (1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6))
REPEATS = 1


def beside() -> list[dict[str, Any]]:
    """No rows if ccx is not installed."""
    program = shutil.which("ccx")
    if program is None:
        return []
    rows, last = [], None
    for length, force in UNITS:
        scene = apart(punch(length=length, force=force, modulus=STIFF), *SIZES)
        own = []
        for _ in range(REPEATS):
            start = time.perf_counter()
            reduction = reduce_bodies(scene)
            solution = solve(reduction.problem, tol=1e-11)
            own.append(time.perf_counter() - start)
        nodal = [(B.T @ solution.reactions.ravel()) / force for B in reduction.maps]
        last = nodal if last is None else last
        units = {"unit of length": 1 / length, "unit of force": 1 / force}
        row = units | {
            "solver": "contactopt",
            "end": solution.status.label,
            "iterations": solution.iterations,
        }
        row |= {"seconds": median(own)}
        rows.append(row | _against(nodal, last, reduction))
        for law, factor in LAWS.items():
            stiffness = factor * STIFF * force / length**2 * SIZES[0] / (20.0 * length)
            stick = stiffness if law == "mortar" else STICK * stiffness
            found = [
                run(program, model(scene), reduction, Contact(law, stiffness, stick, "top"))
                for _ in range(REPEATS)
            ]
            rows.append(units | _row(law, found, last, reduction, force))
    return rows


def _row(
    law: str, found: list[Run], exact: list[np.ndarray], reduction: Any, force: float
) -> dict[str, Any]:
    answer = found[-1]
    row: dict[str, Any] = {"solver": f"ccx, {law}", "end": answer.failure or "converged"}
    row |= {"iterations": answer.iterations, "seconds": median(one.seconds for one in found)}
    if answer.failure:
        return row | dict.fromkeys(
            ("normal, upper", "tangential, upper", "normal, lower", "tangential, lower"), ""
        )
    return row | _against([f / force for f in answer.forces], exact, reduction)


def _against(forces: list[np.ndarray], exact: list[np.ndarray], reduction: Any) -> dict[str, Any]:
    """Relative L2 differences of the nodal forces on the contact nodes of each body."""
    row = {}
    for name, found, known, body in zip(("upper", "lower"), forces, exact, reduction.bodies):
        unknowns = body.body.unknowns
        touched = np.flatnonzero(np.any(np.abs(known[unknowns]) > 0, axis=0))
        for c, component in ((1, "normal"), (0, "tangential")):
            there = unknowns[c, touched]
            there = there[np.isin(there, body.body.free)]
            row[f"{component}, {name}"] = difference(found[there], known[there])[1]
    return row
