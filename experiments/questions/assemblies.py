"""What a frictional solve of many bodies costs: chains of blocks and walls of bricks that only rest on each other.

`python -m experiments.questions.assemblies [bodies ...]` prints, for each number of bodies, unknowns, contacts, Newton steps and
the wall time of reduction and solve per body. Walls are coupled by mortar, since bricks are staggered.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

from contactopt import BodyForce, Contact, Material, Part, Rigid, Scene, reduce_bodies, solve
from contactopt.scenes.meshes import rename, tensor_mesh

BODIES = (2, 4, 8, 16, 32)
CELLS = 16  # elements along each side of a block
WALL = 4  # bricks in a row of a wall
STONE = Material(1000.0, 0.2)
FLOOR = Rigid("floor", normal=(0, 1))


def brick(name: str, left: float, bottom: float, width: float, force: tuple[float, float]) -> Part:
    """A block of height one."""
    x, y = (np.linspace(a, a + size, CELLS + 1) for a, size in ((left, width), (bottom, 1.0)))
    mesh = rename(tensor_mesh(x, y), bottom="y-", top="y+")
    return Part(name, mesh, STONE, loads=(BodyForce(force),), contact="bottom")


def chain(count: int) -> Scene:
    """Blocks on top of each other, pushed sideways by a fifth of what topples them."""
    force = 0.2 / count, -1.0
    bodies = [brick(f"b{i}", 0.0, i, 1.0, force) for i in range(count)]
    contacts = [Contact(f"b{i}", f"b{i - 1}:top" if i else "floor", 0.3) for i in range(count)]
    return Scene("chain", bodies=(FLOOR, *bodies), contacts=tuple(contacts))


def wall(count: int) -> Scene:
    """Rows of WALL bricks, every second one moved by a quarter of a brick, pushed sideways a little."""
    bodies: list[Part] = []
    contacts: list[Contact] = []
    below: list[tuple[str, float]] = []
    row = 0
    while len(bodies) < count:
        own = []
        for column in range(min(WALL, count - len(bodies))):
            name, left = f"b{len(bodies)}", 2.0 * column + 0.5 * (row % 2)
            bodies.append(brick(name, left, row, 2.0, (0.02, -1.0)))
            own.append((name, left))
            contacts += [Contact(name, "floor", 0.5)] if row == 0 else []
            contacts += [Contact(name, f"{b}:top", 0.5, coupling="mortar") for b, x in below if abs(x - left) < 2]
        below, row = own, row + 1
    return Scene("wall", bodies=(FLOOR, *bodies), contacts=tuple(contacts))


def measure(scene: Scene) -> dict[str, Any]:
    """One row of the table."""
    start = time.perf_counter()
    reduction = reduce_bodies(scene)
    reduced = time.perf_counter()
    solution = solve(reduction.problem)
    done = time.perf_counter()
    count = len(scene.parts) - 1
    return {
        "scene": scene.name,
        "bodies": count,
        "unknowns": reduction.dofs,
        "contacts": reduction.problem.contacts,
        "status": solution.status.label,
        "steps": solution.iterations,
        "reduce [ms/body]": 1e3 * (reduced - start) / count,
        "solve [ms/body]": 1e3 * (done - reduced) / count,
        "solve [s]": done - reduced,
    }


if __name__ == "__main__":
    for make in (chain, wall):
        for bodies in [int(word) for word in sys.argv[1:]] or BODIES:
            row = measure(make(bodies))
            print("  ".join(f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items()), flush=True)
