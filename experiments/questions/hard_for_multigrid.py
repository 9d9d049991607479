"""What does the default way cost on meshes and materials on which multigrid is slow?

`python -m experiments.questions.hard_for_multigrid` measures it; CPU seconds of one run each.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from skfem import MeshHex

from contactopt import Material, Part, Scene, Support, Traction
from contactopt.solving.solve_scene import Options, solve_scene
from experiments.report import measure, template

LIMIT = 60.0  # s for each solve
# name -> elements along the sides and in height, width over height, Poisson's ratio, gradation
SCENES = {
    "cubes": ((16, 16), 1.0, 0.3, 1.0),
    "flat bricks, 12 to 1": ((20, 12), 20.0, 0.3, 1.0),
    "thin plate, 60 to 1": ((28, 6), 60.0, 0.3, 1.0),
    "nearly incompressible": ((16, 16), 1.0, 0.4995, 1.0),
    "graded to the contact": ((16, 16), 1.0, 0.3, 3.0),
}

TEXT = template(__file__)


def block(name: str, base: float, shape: Any, **more: Any) -> Part:
    """A block of bricks above or below z = 0, `base` wider on each side."""
    (across, along), width, nu, power = shape
    flat = np.linspace(-base, width + base, across + 1)
    height = np.linspace(0, 1, along + 1) ** power
    mesh = MeshHex.init_tensor(flat, flat, height if base == 0 else -height[::-1])
    ends = {"low": mesh.p[2].min(), "high": mesh.p[2].max()}
    sides = {side: (lambda x, at=at: np.isclose(x[2], at)) for side, at in ends.items()}
    material = Material(5.0 if base == 0 else 50.0, nu)
    return Part(name, mesh.with_boundaries(sides), material, **more)


def scene(name: str) -> Scene:
    shape = SCENES[name]
    pushed = (Traction("high", (0.02, 0.0, -0.1)),)
    upper = block("upper", 0.0, shape, loads=pushed, contact="low")
    lower = block("lower", 0.2, shape, supports=(Support("low"),), contact="high")
    return Scene(name, upper, lower, 0.3, kind="solid")


def timed(name: str, solver: str) -> tuple[float, Any]:
    start = time.process_time()
    solved = solve_scene(
        scene(name), options=Options(solver=solver, settings={"time_limit": LIMIT})
    )
    return time.process_time() - start, solved


def row(name: str) -> dict[str, Any]:
    out: dict[str, Any] = {"scene": name}
    times = {}
    for solver in ("superlu", "multigrid", "auto"):
        times[solver], solved = timed(name, solver)
        out["unknowns"] = solved.reduction.dofs
        ended = "" if solved.solution.solved else f" ({solved.solution.status})"
        out[f"{solver} [s]"] = f"{times[solver]:.1f}{ended}"
    out["auto / best"] = round(times["auto"] / min(times["superlu"], times["multigrid"]), 2)
    out["the way was left"] = bool(solved.turned)
    print(out, flush=True)
    return out


def rows() -> list[dict[str, Any]]:
    timed("cubes", "auto")  # imports and caches are nobody's time
    return [row(name) for name in SCENES]


if __name__ == "__main__":
    title = "Meshes and materials on which multigrid is slow"
    measure("hard_for_multigrid", title, TEXT.format(limit=LIMIT), {"times": rows})
