"""Do the time and the iterations of a frictional solve grow with the number of bodies?

Chains of blocks and walls of bricks that only rest on each other. Under their own weight the lowest
joints bear all blocks above, so that more bodies are also a harder problem. Pressed by plates from
above, without weight, and with stiff and soft stones by turns, all joints are alike: they slip at
their edges and stick inside. Walls are coupled by mortar, since bricks are staggered.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt import (
    BodyForce,
    Contact,
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    reduce_bodies,
    solve,
)
from contactopt.meshes.structured import rename, tensor_mesh
from experiments.report import write

BODIES = (2, 4, 8, 16, 32)
CELLS = 16  # elements along each side of a block
WALL = 2  # bricks in a row of a wall
STONE, SOFT = Material(1000.0, 0.2), Material(200.0, 0.4)
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
    """Rows of WALL bricks, every second one a quarter of a brick aside, pushed sideways."""
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
            contacts += [
                Contact(name, f"{b}:top", 0.5, coupling="mortar")
                for b, x in below
                if abs(x - left) < 2
            ]
        below, row = own, row + 1
    return Scene("wall", bodies=(FLOOR, *bodies), contacts=tuple(contacts))


def pressed(scene: Scene) -> Scene:
    """The scene without weight, pressed by plates from above; rows are stiff and soft by turns."""
    parts = [part for part in scene.parts if isinstance(part, Part)]
    rows = [round(float(part.build_mesh(CELLS, None).p[1].min())) for part in parts]
    made: list[Any] = [FLOOR]
    for part, row in zip(parts, rows):
        loads = (Plate("top", {"y": -1.0}),) if row == max(rows) else ()
        made.append(replace(part, material=(STONE, SOFT)[row % 2], loads=loads))
    return Scene(f"{scene.name}, pressed", bodies=tuple(made), contacts=scene.pairs)


SCENES = {
    "chain": chain,
    "wall": wall,
    "chain, pressed": lambda count: pressed(chain(count)),
    "wall, pressed": lambda count: pressed(wall(count)),
}


def measure(scene: Scene) -> dict[str, Any]:
    """One row of the table: processor seconds."""
    start = time.process_time()
    reduction = reduce_bodies(scene)
    reduced = time.process_time()
    solution = solve(reduction.problem)
    solved = time.process_time()
    count = len(scene.parts) - 1
    loose = reduction.problem.law.bound(solution.reactions[:, 0]) <= np.linalg.norm(
        solution.reactions[:, 1:], axis=1
    )
    return {
        "scene": scene.name,
        "bodies": count,
        "joints": len(scene.pairs),
        "unknowns": reduction.dofs,
        "contacts": reduction.problem.contacts,
        "open or slipping": int(loose.sum()),
        "status": solution.status.label,
        "steps": solution.iterations,
        "reduce [s]": reduced - start,
        "solve [s]": solved - reduced,
        "both, per body [ms]": 1e3 * (solved - start) / count,
    }


TEXT = """How does the time grow with the number of bodies? The scenes are chains of blocks and
walls of bricks. Each body has 16 x 16 linear elements. The bodies rest on each other and on a rigid
floor, held by contact and friction alone. Under their own weight the lowest joints bear everything
above them. In low chains and walls nothing slips. In the rows `pressed` there is no weight. Instead
a plate presses every body of the highest row. Rows of stiff and soft bodies take turns, so that
every joint slips at its edges.

{runs}

The seconds are processor seconds of one run with one thread.
"""


if __name__ == "__main__":
    rows = []
    for make in SCENES.values():
        for bodies in [int(word) for word in sys.argv[1:]] or BODIES:
            rows.append(measure(make(bodies)))
            print(rows[-1], flush=True)
    write("assemblies", "Many bodies", TEXT, {"runs": rows}, {})
