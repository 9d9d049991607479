"""Sheared contacts against Cattaneo and Mindlin: stick zone, tractions, energy lost in a cycle."""

from __future__ import annotations

from typing import Any

import numpy as np

from contactopt import scenes
from contactopt.analytic import (
    contact_modulus,
    cycle_loss_line,
    cycle_loss_point,
    tangential_modulus,
)
from contactopt.scenes.scene import Part, Scene
from contactopt.solving.follow import follow

FORCE, MU, DEPTH, RADIUS = 100.0, 0.5, 400.0, 10000.0  # the scenes' defaults; RADIUS in 3D
SHEARS = {2: (10.0, 20.0, 30.0, 40.0, 45.0), 3: (20.0, 30.0, 40.0)}  # of mu force = 50


def sheared(dim: int, shear: float) -> dict[str, Any]:
    """The state at the largest shear after a whole cycle, and the energy that the cycle costs."""
    states = scenes.shear_cycle(dim, steps=4, shear=shear)
    path = follow(states)
    scene, history, problem = states[-1], path.history, path.reduction.problem
    exact, r = scene.reference, path.solution.reactions
    distance = np.linalg.norm(problem.coordinates[: dim - 1], axis=0)
    pressure, traction = r[:, 0] / problem.areas, -r[:, 1] / problem.areas
    lost = history["friction_work"][-1] - history["friction_work"][4]
    ratio = history["stick_half_width"][-1] / history["contact_half_width"][-1]
    return {
        "scene": scene.name,
        "T / (mu P)": shear / (MU * FORCE),
        "unknowns": path.reduction.dofs,
        "c / a, rel. error": float(ratio / (exact.stick_half_width / exact.half_width) - 1),
        "p in L2": error(pressure, exact.pressure(distance), problem.areas),
        "q in L2": error(traction, exact.shear(distance), problem.areas),
        "loss, rel. error": float(lost / exact_loss(dim, scene, shear) - 1),
    }


def error(value: np.ndarray, exact: np.ndarray, areas: np.ndarray) -> float:
    """Relative L2 error at the nodes, with their areas."""
    exact = np.nan_to_num(exact)
    return float(np.sqrt(np.sum(areas * (value - exact) ** 2) / np.sum(areas * exact**2)))


def exact_loss(dim: int, scene: Scene, shear: float) -> float:
    assert isinstance(scene.upper, Part)
    material = scene.upper.material
    modulus = contact_modulus(material, material)
    if dim == 2:
        return DEPTH * cycle_loss_line(FORCE / DEPTH, modulus, MU, shear / DEPTH)
    return cycle_loss_point(
        FORCE, RADIUS, modulus, tangential_modulus(material, material), MU, shear
    )
