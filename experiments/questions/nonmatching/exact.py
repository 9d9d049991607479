"""What must hold to rounding: uniform pressure, equilibrium, independence of the units."""

from __future__ import annotations

from typing import Any

import numpy as np

from contactopt import reduce, reduce_bodies, solve
from contactopt.coupling.reduction import Reduction
from experiments.questions.nonmatching.bodies import apart, press_fit, punch, stacked

AREA = {"plane-strain": 1.0, "axisymmetric": np.pi, "solid": 1.0}
CELLS = {"1:1.5": (4, 6), "1:3": (2, 6), "1:7": (1, 7)}


def patch_tests() -> list[dict[str, Any]]:
    """Largest relative error of the pressure at any contact; either side carries."""
    rows = []
    for kind in AREA:
        for degree in (1, 2):
            row: dict[str, Any] = {"kind": kind, "degree": degree}
            for name, cells in CELLS.items():
                off = 0.0
                for carrier in ("upper", "lower"):
                    problem = reduce(stacked(kind, degree, cells, carrier))
                    pressure = solve(problem, tol=1e-13).reactions[:, 0] / problem.areas
                    off = max(off, float(np.abs(pressure * AREA[kind] / 3 - 1).max()))
                row[name] = off
            rows.append(row)
    return rows


def resultants(reduction: Reduction, reactions: np.ndarray) -> tuple[float, float]:
    """Sums of all nodal forces and of their moments, over the forces' sizes (and the extent)."""
    force, moment, extent = np.zeros(2), 0.0, 0.0
    for body, B in zip(reduction.bodies, reduction.maps):
        f, x = (B.T @ reactions.ravel())[body.body.unknowns], body.body.locations
        force, moment = force + f.sum(axis=1), moment + float(np.sum(x[0] * f[1] - x[1] * f[0]))
        extent = max(extent, float(np.abs(x).max()))
    size = float(np.abs(reactions).sum())
    return float(np.abs(force).max()) / size, abs(moment) / (size * extent)


def equilibrium() -> list[dict[str, Any]]:
    """Of solved scenes, and of random contact forces on the same curved surfaces."""
    rows = []
    found = {
        f"press fit, degree {d}, {c} carries": press_fit((8, 12), d, c, 0.3)[0]
        for d in (1, 2)
        for c in ("upper", "lower")
    }
    found["elastic punch"] = apart(punch(), 16, 24)
    for name, scene in found.items():
        reduction = reduce_bodies(scene)
        r = solve(reduction.problem).reactions
        random = np.random.default_rng(0).normal(size=r.shape)
        for plane in reduction.coupling.planes:  # which takes a part of the forces there
            random[np.abs(plane.inward @ reduction.problem.coordinates - plane.offset) < 1e-9] = 0.0
        row: dict[str, Any] = {"scene": name}
        for label, forces in (("solved", r), ("random forces", random)):
            row[f"{label}: force"], row[f"{label}: moment"] = resultants(reduction, forces)
        rows.append(row)
    return rows
