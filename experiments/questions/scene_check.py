"""How good are the estimates of `contactopt check`? Time and memory of runs, each in a process of
its own, beside what was estimated before anything was solved.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

from contactopt.figures.scene_check import check_scene
from contactopt.scenes import make_scene
from experiments.report import write

# scene, elements, changes; the way to the solution is the one that is taken
CASES: tuple[tuple[str, int, dict[str, Any]], ...] = (
    ("punch-2d", 32, {}),
    ("punch-2d", 128, {}),
    ("sphere", 64, {}),
    ("cattaneo-2d", 96, {}),
    ("press-fit", 24, {}),
    ("punch-3d", 6, {}),
    ("punch-3d", 10, {}),
    ("punch-3d", 14, {}),
    ("punch-3d", 8, {"degree": 2}),
    ("hertz-half-space", 96, {}),
)
RUN = """
import json, resource, sys, time
import contactopt
from contactopt.coupling.back_to_bodies import recover
from contactopt.scenes import make_scene
from contactopt.solving.solve_scene import solve_scene
name, elements, changes = json.loads(sys.argv[1])
scene = make_scene(name, elements=elements, **changes)
begin = time.process_time()
solved = solve_scene(scene, zone=scene.zone)
spent = time.process_time() - begin
recover(solved.reduction, solved.solution)
peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([spent, peak]))
"""


def main() -> None:
    rows = []
    for name, elements, changes in CASES:
        found = check_scene((make_scene(name, elements=elements, **changes),))
        told = json.dumps([name, elements, changes])
        command = [sys.executable, "-c", RUN, told]
        spent, peak = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
        costs: dict[tuple[str, str], Any] = found.costs or {("products", "FFT"): "-"}
        way = min(costs, key=lambda own: costs[own])
        rows.append(
            {
                "scene": name,
                "elements": elements,
                "unknowns": sum(body.unknowns for body in found.posed.bodies),
                "way": " by ".join(way),
                "estimated s": costs[way],
                "CPU s": spent,
                "estimated GB": found.memory / 1e9,
                "peak GB": peak / 1e9,
            }
        )
        print(rows[-1], flush=True)
    ratios = [row["estimated GB"] / row["peak GB"] for row in rows]
    times = [row["estimated s"] / row["CPU s"] for row in rows if row["estimated s"] != "-"]
    text = f"""`contactopt check` estimates time and memory before anything is solved. How good are
these numbers?

- The memory is estimated at {min(ratios):.2g} to {max(ratios):.2g} times the peak of the process.
- The time is estimated at {min(times):.2g} to {max(times):.2g} times the CPU time of assembly,
  solution and certificate. The costs were fitted to other meshes.

{{estimates}}

Each run is a process of its own; the peak is its largest resident memory, with Python and its
packages.
"""
    write("scene_check", "The predicted cost of a run", text, {"estimates": rows}, {})


if __name__ == "__main__":
    main()
