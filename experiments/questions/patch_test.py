"""Is a uniform pressure between two blocks exact?"""

from __future__ import annotations

import numpy as np

from contactopt import Material, Part, Plate, Scene, Support, reduce, solve
from contactopt.meshes.structured import rename, tensor_mesh
from experiments.report import write

COMPONENTS = {"plane-strain": "xy", "axisymmetric": "rz", "solid": "xyz"}
CELLS = (4, 8, 16)


def block(kind: str, low: float, high: float, cells: int):  # type: ignore[no-untyped-def]
    across = [np.linspace(0.0, 1.0, cells + 1) ** 1.3] * (len(COMPONENTS[kind]) - 1)
    up = "xyz"[len(across)]
    names = {f"side{i}": f"{'xy'[i]}-" for i in range(len(across))} | {
        "top": f"{up}+",
        "bottom": f"{up}-",
    }
    return rename(tensor_mesh(*across, np.linspace(low, high, cells)), **names)


def measure(kind: str, cells: int) -> dict[str, object]:
    *sides, up = COMPONENTS[kind]
    held = tuple(Support(f"side{i}", {c: 0.0}) for i, c in enumerate(sides))
    load = (Plate("top", {up: -3.0}, glued=False),)
    rubber = Material(5.0, 0.3)
    upper = Part("upper", block(kind, 0, 1, cells), rubber, held, load, contact="bottom")
    lower = Part(
        "lower",
        block(kind, -2, 0, cells),
        rubber,
        (*held, Support("bottom", {up: 0.0})),
        contact="top",
    )
    problem = reduce(Scene("patch", upper, lower, 0.0, kind=kind))
    solution = solve(problem, tol=1e-12)
    exact = 3.0 / (np.pi if kind == "axisymmetric" else 1.0)
    pressure = solution.reactions[:, 0] / problem.areas
    modulus = 5.0 / (1 - 0.3**2) if kind == "plane-strain" else 5.0
    return {
        "kind": kind,
        "contacts": problem.contacts,
        "pressure, largest relative error": float(np.abs(pressure / exact - 1).max()),
        "approach, relative error": float(
            abs(-solution.multipliers[0] * modulus / (3 * exact) - 1)
        ),
        "status": str(solution.status),
    }


TEXT = """Does a uniform pressure pass through the interface exactly? Two blocks with unevenly
spaced meshes and the heights 1 and 2 are pressed by a frictionless rigid plate, with mu = 0. The
stress is uniform and uniaxial. So the pressure F / A and the approach 3 F / (A E) are exact. (In
plane strain E / (1 - nu^2) takes the place of E.)

{rows}
"""

if __name__ == "__main__":
    rows = [
        measure(kind, cells)
        for kind in COMPONENTS
        for cells in CELLS
        if kind != "solid" or cells < 16
    ]
    write("patch_test", "Patch test: uniform pressure between two blocks", TEXT, {"rows": rows}, {})
