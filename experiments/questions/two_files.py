"""How long is the way from two mesh files to the figures of the contact pressure, by the command
line alone?

The bodies, and the scene file, are those of the page experiments/site/your_own_mesh.md: a shaft
pressed into a hub, meshed by Gmsh in files of their own with triangles of second order. Needs Gmsh
to make the files.
"""

from __future__ import annotations

import json
import os
import re
import resource
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from contactopt import Material, analytic
from experiments.report import REPORTS, write

ROOT = REPORTS.parent
PAGE = ROOT / "experiments" / "site" / "your_own_mesh.md"
# element sizes over those of the page; the last one makes about 20,000 unknowns
SIZES = (2.0, 1.0, 0.56)


def measure(factor: float) -> dict[str, object]:
    """One run of the command in a process of its own, in a folder that holds the two meshes and the
    scene file.
    """
    mesh = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)[0]
    scene = re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.S)[0]
    for size in ("10.0, 20.0, 1.0", "19.98, 40.0, 1.5"):
        *radii, h = size.split(", ")
        mesh = mesh.replace(size, ", ".join([*radii, str(float(h) * factor)]))
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "make.py").write_text(mesh)
        (folder / "press-fit.toml").write_text(scene)
        subprocess.run([sys.executable, "make.py"], cwd=folder, check=True)
        start, used = time.perf_counter(), processor_seconds()
        command = [sys.executable, "-m", "contactopt", "run", "press-fit.toml"]
        subprocess.run(
            command,
            cwd=folder,
            check=True,
            capture_output=True,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )
        seconds, used = time.perf_counter() - start, processor_seconds() - used
        summary = json.loads((folder / "out" / "press-fit" / "summary.json").read_text())
    exact = analytic.press_fit(0.02, 10.0, 20.0, 40.0, Material(210e3, 0.3), Material(70e3, 0.33))
    mean = summary["normal_force"] / (2 * 3.141592653589793 * 20.0 * 30.0)
    return {
        "unknowns": summary["dofs"],
        "contacts": summary["contact_nodes"],
        "status": summary["status"],
        "seconds of the command": seconds,
        "processor seconds": used,
        "of the seconds figures and files": (
            summary["seconds"]["figures"] + summary["seconds"]["files"]
        ),
        "mean pressure over Lame's": mean / exact.peak,
    }


def processor_seconds() -> float:
    """What processes started from here have used of the processor: other programs on the machine do
    not change it much.
    """
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


TEXT = """How long does it take from two mesh files to the figures of the pressure? A shaft is pressed into a hub. The two meshes are files of Gmsh
with triangles of second order, and their nodes do not match. The page *Your own mesh* has them and
the scene file. The seconds are those of the whole command `contactopt run press-fit.toml`: the
start of Python, the solution, the figures and the files.

{runs}
"""

if __name__ == "__main__":
    runs = [measure(factor) for factor in SIZES]
    write(
        "two_files", "From two mesh files to the figures of the pressure", TEXT, {"runs": runs}, {}
    )
